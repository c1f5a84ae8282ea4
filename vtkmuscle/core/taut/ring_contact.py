"""Kernels that hold strings in via rings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.taut.springs import PUSH, add_spring
from vtkmuscle.core.taut.via_rings import is_inside, nearest_on_polygon
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


@array_kernel
def hold_in_ring(
    rings: Rings, ring: int, f: int, p: Floats, held: Floats, matrices: Floats, right: Floats
) -> None:
    """Add what holds a string's point on a ring's edge, where the string would pass outside of it.

    ``held`` (5,) is of this string and ring, from one iteration to the next: the point that is held, 0 for
    none, the direction into the ring, and how far in that the point is to be.
    """
    centre, normal, first, second = rings.frames[ring]
    corners = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]]
    outside = rings.outside[ring, f]
    i = int(held[0])
    if i == 0:
        i = _leaves_ring(centre, normal, first, second, corners, outside, p)
        if i == 0:
            return
        held[0] = i
    away = p[i] - centre
    s = away[0] * first[0] + away[1] * first[1] + away[2] * first[2]
    t = away[0] * second[0] + away[1] * second[1] + away[2] * second[2]
    u, v = nearest_on_polygon(corners, s, t)
    way = np.sqrt((u - s) ** 2 + (v - t) ** 2)
    inside = is_inside(corners, s, t)
    into = held[1:4]
    # A point on the edge does not tell which way is into the ring: that is known from the iteration before.
    if way > 0.0:
        into[:] = ((u - s) * first + (v - t) * second) / (-way if inside else way)
    at = into[0] * p[i, 0] + into[1] * p[i, 1] + into[2] * p[i, 2]
    held[4] = at + (-way if inside else way) - outside
    add_spring(into, PUSH, held[4], matrices[i], right[i])
    at = normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2]
    add_spring(normal, PUSH, at, matrices[i], right[i])


@array_kernel
def _leaves_ring(
    centre: Floats, normal: Floats, first: Floats, second: Floats, corners: Floats, outside: float, p: Floats
) -> int:
    """Return the point next to where a string crosses a ring's plane outside of it; 0 where it does not.

    Of several crossings the one nearest to the centre counts.
    """
    nearest, point, s, t = np.inf, 0, 0.0, 0.0
    for i in range(len(p) - 1):
        a, b = p[i] - centre, p[i + 1] - centre
        low = a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
        high = b[0] * normal[0] + b[1] * normal[1] + b[2] * normal[2]
        if (low < 0.0) == (high < 0.0):
            continue
        part = low / (low - high)
        cross = a + part * (b - a)
        u = cross[0] * first[0] + cross[1] * first[1] + cross[2] * first[2]
        v = cross[0] * second[0] + cross[1] * second[1] + cross[2] * second[2]
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
