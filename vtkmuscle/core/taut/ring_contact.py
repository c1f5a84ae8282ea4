"""Kernels that hold strings in via rings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.taut.springs import PUSH, add_spring
from vtkmuscle.core.paths.via_rings import is_inside, nearest_on_polygon
from vtkmuscle.core.types import Floats, Ints


class Rings(NamedTuple):
    """Via rings now, and how far strings are outside of them at rest.

    Attributes
    ----------
    frames : (r, 4, 3) array
        Centre [mm], unit normal, and the two axes of the plane of each ring.
    corners : (c, 2) array
        Of all rings' polygons, along the axes about the centre [mm].
    offsets : (r + 1,) int array
        First corner of each ring, and c.
    outside : (r, f) array
        How far outside a string may be, as it is at rest [mm].
    """

    frames: Floats
    corners: Floats
    offsets: Ints
    outside: Floats


@kernel
def hold_in_ring(
    rings: Rings, ring: int, f: int, p: Floats, held: Floats, matrices: Floats, right: Floats
) -> None:
    """Add what holds a string's point on a ring's edge, where the string would pass outside of it.

    ``held`` (5,) is of this string and ring, from one iteration to the next: the point that is held, 0 for
    none, the direction into the ring, and how far in that the point is to be.
    """
    centre, normal = rings.frames[ring, 0], rings.frames[ring, 1]
    first, second = rings.frames[ring, 2], rings.frames[ring, 3]
    corners = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]]
    outside = rings.outside[ring, f]
    i = int(held[0])
    if i == 0:
        i = _leaves_ring(centre, normal, first, second, corners, outside, p)
        if i == 0:
            return
        held[0] = i
    x, y, z = p[i, 0] - centre[0], p[i, 1] - centre[1], p[i, 2] - centre[2]
    s = x * first[0] + y * first[1] + z * first[2]
    t = x * second[0] + y * second[1] + z * second[2]
    u, v = nearest_on_polygon(corners, s, t)
    way = np.sqrt((u - s) ** 2 + (v - t) ** 2)
    inside = is_inside(corners, s, t)
    into = held[1:4]
    # A point on the edge does not tell which way is into the ring: that is known from the iteration before.
    if way > 0.0:
        for axis in range(3):
            into[axis] = ((u - s) * first[axis] + (v - t) * second[axis]) / (-way if inside else way)
    at = into[0] * p[i, 0] + into[1] * p[i, 1] + into[2] * p[i, 2]
    held[4] = at + (-way if inside else way) - outside
    add_spring(into, PUSH, held[4], matrices[i], right[i])
    at = normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2]
    add_spring(normal, PUSH, at, matrices[i], right[i])


@kernel
def _leaves_ring(
    centre: Floats, normal: Floats, first: Floats, second: Floats, corners: Floats, outside: float, p: Floats
) -> int:
    """Return the point next to where a string crosses a ring's plane outside of it; 0 where it does not.

    Of several crossings the one nearest to the centre counts.
    """
    nearest, point, s, t = np.inf, 0, 0.0, 0.0
    for i in range(len(p) - 1):
        ax, ay, az = p[i, 0] - centre[0], p[i, 1] - centre[1], p[i, 2] - centre[2]
        bx, by, bz = p[i + 1, 0] - centre[0], p[i + 1, 1] - centre[1], p[i + 1, 2] - centre[2]
        low = ax * normal[0] + ay * normal[1] + az * normal[2]
        high = bx * normal[0] + by * normal[1] + bz * normal[2]
        if (low < 0.0) == (high < 0.0):
            continue
        part = low / (low - high)
        x, y, z = ax + part * (bx - ax), ay + part * (by - ay), az + part * (bz - az)
        u = x * first[0] + y * first[1] + z * first[2]
        v = x * second[0] + y * second[1] + z * second[2]
        if u * u + v * v < nearest:
            nearest, s, t = u * u + v * v, u, v
            point = min(max(i if part < 0.5 else i + 1, 1), len(p) - 2)
    if point == 0 or is_inside(corners, s, t):
        return 0
    u, v = nearest_on_polygon(corners, s, t)
    return point if np.sqrt((u - s) ** 2 + (v - t) ** 2) > outside else 0


@kernel
def let_go(held: Floats, y: Floats) -> None:
    """Let a point go that, solved, is farther in the ring than it has to be: the ring does not pull it."""
    i = int(held[0])
    if i > 0 and held[1] * y[i, 0] + held[2] * y[i, 1] + held[3] * y[i, 2] >= held[4]:
        held[0] = 0.0
