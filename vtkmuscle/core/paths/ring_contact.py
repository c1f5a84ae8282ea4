"""Paths kept within via rings."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.paths.bone_contact import PUSH, Load, pressure_at
from vtkmuscle.core.paths.equilibrium import add_direction
from vtkmuscle.core.paths.via_rings import ViaRing, is_in_polygon, moved_ring, nearest_on_polygon
from vtkmuscle.core.types import Floats, Ints


class Rings(NamedTuple):
    """Via rings in a pose.

    frames : (r, 4, 3), centre [mm], unit normal, and the two axes of the plane of each ring;
    corners : (c, 2), of all rings' polygons, along the axes about the centre [mm];
    offsets : (r + 1,) int, first corner of each ring, and c;
    outside : (r, f), allowed distance of each path outside of each ring: the distance at rest [mm].
    """

    frames: Floats
    corners: Floats
    offsets: Ints
    outside: Floats


def rings_at(
    rings: Sequence[tuple[int, ViaRing]], transforms: Floats, middle: Floats, outside: Floats
) -> Rings:
    """Return rings in a pose. Each comes with its bone's number; positions are about the middle."""
    moved = [moved_ring(ring, transforms[bone]) for bone, ring in rings]
    frames = np.array([[ring.centre - middle, ring.normal, *ring.axes] for ring in moved]).reshape(-1, 4, 3)
    corners = np.concatenate([np.empty((0, 2)), *(ring.corners for ring in moved)])
    return Rings(frames, corners, np.cumsum([0, *(len(ring.corners) for ring in moved)]), outside)


@kernel
def hold_in_rings(x: Floats, rings: Rings, points: Ints) -> None:
    """Write the point of each path that rings hold.

    Numbers are (r, f), 0 for no point. A path that crosses a ring's plane outside of the ring is held at the
    crossing by the nearest point: only a point in the plane bends the path at the ring. A held path stays
    held in a pose; inside the ring, nothing presses the path. The crossings of all paths are rounded to
    points together, on the mean: neighbours are held by neighbours.
    """
    for ring in range(len(rings.frames)):
        corners = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]]
        mean, count = 0.0, 0
        for a in range(len(x)):
            segment, part, _, _ = crossing(rings.frames[ring], x[a])
            if segment >= 0:
                mean, count = mean + segment + part, count + 1
        mean /= max(count, 1)
        rounded = np.floor(mean + 0.5) - mean
        for a in range(len(x)):
            if points[ring, a] > 0:
                continue
            segment, part, s, t = crossing(rings.frames[ring], x[a])
            if segment >= 0 and way_to_edge(corners, s, t)[2] > rings.outside[ring, a]:
                i = int(np.floor(segment + part + rounded + 0.5))
                points[ring, a] = min(max(i, 1), x.shape[1] - 2)


@kernel
def add_rings(
    x: Floats, rings: Rings, points: Ints, push: float, rounding: float, gradient: Floats, blocks: Floats,
    held: Floats,
) -> None:  # fmt: skip
    """Add the forces of rings on the held points.

    The function also writes the pressures, (r, f, n) [mm]. A ring's edge pushes as a bone does
    (:func:`~vtkmuscle.core.paths.bone_contact.pressure_at`), at right angles to the ring's normal, but from
    the edge on: inside, the direction to the nearest side jumps where two sides are equally near. At a corner
    the direction turns as the point goes round the corner. The ring keeps the point in the ring's plane.
    """
    held[:] = 0.0
    for ring in range(len(rings.frames)):
        frame = rings.frames[ring]
        corners = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]]
        for a in range(len(x)):
            i = points[ring, a]
            if i == 0:
                continue
            height, s, t = 0.0, 0.0, 0.0
            for c in range(3):
                away = x[a, i, c] - frame[0, c]
                height, s, t = height + away * frame[1, c], s + away * frame[2, c], t + away * frame[3, c]
            u, v, distance, at_corner = way_to_edge(corners, s, t)
            force, stiff = pressure_at(rings.outside[ring, a] - distance + rounding, push, rounding)
            for c in range(3):
                gradient[a, i, c] += push * height * frame[1, c]
            add_direction(blocks[a, i], push, frame[1, 0], frame[1, 1], frame[1, 2])
            if force > 0.0:
                held[ring, a, i] = force
                p, q = u / distance, v / distance
                add_direction(blocks[a, i], stiff, *_in_space(frame, p, q))
                if at_corner:
                    add_direction(blocks[a, i], force / distance, *_in_space(frame, -q, p))
                for c in range(3):
                    gradient[a, i, c] -= force * (p * frame[2, c] + q * frame[3, c])


@kernel
def _in_space(frame: Floats, p: float, q: float) -> tuple[float, float, float]:
    """Return a ring plane's direction (p, q) in space."""
    first, second = frame[2], frame[3]
    return p * first[0] + q * second[0], p * first[1] + q * second[1], p * first[2] + q * second[2]


@kernel
def way_to_edge(corners: Floats, s: float, t: float) -> tuple[float, float, float, bool]:
    """Return the way from a point to a ring's edge.

    The point is in the ring's plane. The length of the way, and whether a corner is nearest, follow [mm]; the
    length is negative for a point inside.
    """
    u, v, at_corner = nearest_on_polygon(corners, s, t)
    distance = np.sqrt((u - s) ** 2 + (v - t) ** 2)
    return u - s, v - t, -distance if is_in_polygon(corners, s, t) else distance, at_corner


@kernel
def crossing(frame: Floats, p: Floats) -> tuple[int, float, float, float]:
    """Return a path's crossing of a ring's plane.

    The crossing nearest to the ring's centre counts: segment, part, and place (s, t). The part is the
    segment's part before the plane, the place is along the plane's axes [mm]. Segment -1: no crossing.
    """
    nearest, segment, part, s, t = np.inf, -1, 0.0, 0.0, 0.0
    for i in range(len(p) - 1):
        low, high, u, v, du, dv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for c in range(3):
            away, along = p[i, c] - frame[0, c], p[i + 1, c] - p[i, c]
            low += away * frame[1, c]
            high += (away + along) * frame[1, c]
            u, v = u + away * frame[2, c], v + away * frame[3, c]
            du, dv = du + along * frame[2, c], dv + along * frame[3, c]
        if (low < 0.0) == (high < 0.0):
            continue
        at = low / (low - high)
        u, v = u + at * du, v + at * dv
        if u * u + v * v < nearest:
            nearest, segment, part, s, t = u * u + v * v, i, at, u, v
    return segment, part, s, t


@kernel
def outside_of(rings: Rings, x: Floats, outside: Floats) -> None:
    """Write the distances of paths outside of rings. Of crossing paths (f, n, 3), (r, f) [mm]."""
    for ring in range(len(rings.frames)):
        corners = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]]
        for a in range(len(x)):
            segment, _, s, t = crossing(rings.frames[ring], x[a])
            outside[ring, a] = max(way_to_edge(corners, s, t)[2], 0.0) if segment >= 0 else 0.0


def ring_load(x: Floats, rings: Rings, ring: int, points: Ints, rounding: float) -> Load:
    """Return the load of a ring. On held points of paths x (f, n, 3): numbers (f,), 0 for no point."""
    first, last = rings.offsets[ring : ring + 2]
    frames, outside = rings.frames[ring : ring + 1], rings.outside[ring : ring + 1]
    alone = Rings(frames, rings.corners[first:last], np.array([0, last - first]), outside)
    gradient, blocks = np.zeros(x.shape), np.zeros((*x.shape[:2], 6))
    add_rings(x, alone, points[None], PUSH, rounding, gradient, blocks, np.zeros((1, *x.shape[:2])))
    return Load(-gradient, blocks[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
