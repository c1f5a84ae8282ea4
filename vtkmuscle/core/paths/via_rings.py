"""Via rings, such as a retinaculum or pulley.

A via ring holds a muscle in a region without bone, as a retinaculum, a pulley or a trochlea does. A ring is a
polygon in a plane; the muscle passes through and slides along, but does not leave the ring. The polygon is
convex, or at least seen whole from the centre (star-shaped): the polygon has an inside whatever the
landmarks' small errors.
"""

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.rest_shape import SLIVER
from vtkmuscle.core.mesh.surface import unique_edges
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.types import Bools, Floats, Ints


class ViaRing(NamedTuple):
    """A ring in space.

    centre : (3,), centroid of the area [mm];
    normal : (3,), unit normal of the plane; seen from its tip the landmarks run counterclockwise;
    axes : (2, 3), unit vectors of the plane, right-handed with the normal;
    corners : (k, 2), the polygon along the axes, about the centre, counterclockwise [mm].
    """

    centre: Floats
    normal: Floats
    axes: Floats
    corners: Floats


def via_ring(landmarks: Floats) -> ViaRing:
    """Return the ring of landmarks, plane and polygon.

    Landmarks (k, 3) are in order, once round. The normal is the normal of the polygon's vector area (Newell's
    method), so that crowded landmarks count no more than sparse landmarks. Landmarks off the plane are moved
    onto the plane along the normal.

    Raises
    ------
    ValueError
        If there are fewer than three landmarks, or the landmarks lie on a line or far from a plane, or do not
        run once round their centre.
    """
    once = landmarks[(landmarks != np.roll(landmarks, 1, axis=0)).any(axis=1)]
    if len(once) < 3:
        raise InputError("", f"a via ring needs 3 landmarks or more, each once, but there are {len(once)}")
    middle = once.mean(axis=0)
    away = once - middle
    following = np.roll(away, -1, axis=0)
    area = np.cross(away, following).sum(axis=0) / 2.0
    size = float(np.linalg.norm(area))
    # 0.08 of the square for a circle, 0.008 for a strip of 30 : 1.
    if size < SLIVER * float(np.linalg.norm(following - away, axis=1).sum()) ** 2:
        problem = "the landmarks of a via ring lie on a line, or the ring crosses itself"
        raise InputError("", problem, "give the landmarks in order, once round the muscle")
    normal = area / size
    first = away[int(np.linalg.norm(np.cross(away, normal), axis=1).argmax())]  # the farthest across
    first = first - (first @ normal) * normal
    first = first / np.linalg.norm(first)
    axes = np.array([first, np.cross(normal, first)])
    flat, flat_following = away @ axes.T, following @ axes.T
    areas = _cross(flat, flat_following)
    centroid = areas @ (flat + flat_following) / (3.0 * areas.sum())
    corners = flat - centroid
    heights = np.abs(away @ normal)
    radius = float(np.linalg.norm(corners, axis=1).mean())
    worst = int(heights.argmax())
    if heights[worst] > radius:  # nearer to the axis than to the plane
        problem = f"landmark {worst} of a via ring is {heights[worst]:.4g} off the plane of a ring"
        raise InputError("", f"{problem} with mean radius {radius:.4g}", "give landmarks near a common plane")
    turns = _cross(corners, np.roll(corners, -1, axis=0))
    if not (turns > 0.0).all():
        side = int(np.flatnonzero(turns <= 0.0)[0])
        remedy = "give the landmarks in order, once round, with all sides visible from the centre"
        raise InputError("", f"a via ring turns back after landmark {side}", remedy)
    return ViaRing(middle + centroid @ axes, normal, axes, np.ascontiguousarray(corners))


def moved_ring(ring: ViaRing, transform: Floats) -> ViaRing:
    """Return a ring moved by its bone. The transform (4, 4) leads from rest to the pose."""
    turn, shift = transform[:3, :3], transform[:3, 3]
    return ViaRing(turn @ ring.centre + shift, turn @ ring.normal, ring.axes @ turn.T, ring.corners)


def within_ring(ring: ViaRing, points: Floats) -> Bools:
    """Return whether points are within the ring. Points (n, 3) are seen along the ring's normal."""
    places = (points - ring.centre) @ ring.axes.T
    return np.array([is_in_polygon(ring.corners, x, y) for x, y in places], dtype=np.bool_)


def passes_through(ring: ViaRing, points: Floats, triangles: Ints) -> bool:
    """Return whether a closed surface passes through a ring.

    The ring's plane cuts the surface within the ring: a part of the cut's outline is within the ring, or the
    ring's centre is inside the surface.
    """
    edges = unique_edges(triangles)
    heights = ((points - ring.centre) @ ring.normal)[edges]
    cut = (heights[:, 0] < 0.0) != (heights[:, 1] < 0.0)
    if not cut.any():
        return False
    part = (heights[cut, 0] / (heights[cut, 0] - heights[cut, 1]))[:, None]
    ends = points[edges[cut]]
    if within_ring(ring, ends[:, 0] + part * (ends[:, 1] - ends[:, 0])).any():
        return True
    return bool(triangle_tree(points, triangles.astype(np.int64)).inside(ring.centre[None])[0])


@kernel
def is_in_polygon(corners: Floats, x: float, y: float) -> bool:
    """Return whether a place is inside. A ray along x crosses an odd number of the polygon's sides."""
    inside = False
    k = len(corners)
    for i in range(k):
        ax, ay = corners[i, 0], corners[i, 1]
        bx, by = corners[(i + 1) % k, 0], corners[(i + 1) % k, 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


@kernel
def nearest_on_polygon(corners: Floats, x: float, y: float) -> tuple[float, float, bool]:
    """Return a polygon's nearest point. And whether the nearest point is a corner."""
    best, best_x, best_y, is_corner = np.inf, x, y, False
    k = len(corners)
    for i in range(k):
        ax, ay = corners[i, 0], corners[i, 1]
        dx, dy = corners[(i + 1) % k, 0] - ax, corners[(i + 1) % k, 1] - ay
        part = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
        part = min(max(part, 0.0), 1.0)
        px, py = ax + part * dx, ay + part * dy
        squared = (px - x) ** 2 + (py - y) ** 2
        if squared < best:
            best, best_x, best_y, is_corner = squared, px, py, part in (0.0, 1.0)
    return best_x, best_y, is_corner


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
