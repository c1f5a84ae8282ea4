"""Rings of landmarks, their surfaces, and outlines of patches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.mesh.surface import half_edges
from vtkmuscle.core.types import Floats, Ints


def discs_over(rings: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Return points and triangles that span rings (k, 3).

    Triangles go from each ring's mean to its sides. On a coarse mesh the triangles between attached points
    leave out up to an edge's length along the rim of an area, and an aponeurosis within a muscle has only its
    ring. Rings of fewer than three points span nothing.
    """
    points, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
    for ring in rings:
        count = len(ring)
        if count < 3:
            continue
        number = first + np.arange(count)
        triangles.append(np.column_stack([number, np.roll(number, -1), np.full(count, first + count)]))
        points += [ring, ring.mean(axis=0)[None]]
        first += count + 1
    return np.vstack(points), np.vstack(triangles).astype(np.int64)


#: Most landmarks of an outline: patches inside outlines have 0.9 to 1.0 of the original area.
MOST_LANDMARKS = 40


def outline(points: Floats, triangles: Ints, patch: Ints) -> tuple[Floats, bool]:
    """Return a patch's boundary points, and True for a ring. Points (j, 3), connected patch (k,).

    Holes are left out. A patch without a triangle is no ring: its points are returned in order.
    """
    edges = half_edges(triangles)
    within = np.isin(edges, patch).all(axis=1)
    inside = {(b, a) for a, b in edges[np.repeat(within.reshape(-1, 3).all(axis=1), 3)].tolist()}
    following: dict[int, list[int]] = {}
    for a, b in sorted({(a, b) for a, b in edges[within].tolist()} - inside):  # both ways between islands
        following.setdefault(a, []).append(b)
    if not inside:
        spread = points[patch] - points[patch].mean(axis=0)
        along = spread @ np.linalg.svd(spread, full_matrices=False)[2][0]
        return points[patch[np.argsort(along, kind="stable")]], False
    rings = []
    for start in following:  # Hierholzer 1873, doi:10.1007/BF01442866: once along each edge
        path, ring = [start], []
        while path:
            if following.get(path[-1]):
                path.append(following[path[-1]].pop())
            else:
                ring.append(path.pop())
        rings.append(ring)
    longest = max(rings, key=len)
    return points[longest[: -1 : -(-(len(longest) - 1) // MOST_LANDMARKS)]], True


#: Most passes over all pairs of edges; a ring of a hundred points takes about ten.
_MOST_PASSES = 200


def ring_length(points: Floats) -> float:
    """Return the length of the ring through points (n, 3)."""
    return float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())


def ring_area(points: Floats) -> float:
    """Return the area of the ring through points (n, 3).

    Seen from the direction of the largest area.
    """
    arms = points - points.mean(axis=0)
    return 0.5 * float(np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)))


def short_ring(points: Floats) -> Ints:
    """Return an order (n,) of points with a short ring.

    The ring goes from each point to the nearest, then exchanges pairs of edges as long as its length falls
    (2-opt, Croes 1958, doi:10.1287/opre.6.6.791). It is rarely more than a few percent longer than the
    shortest.
    """
    count = len(points)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    order, left = [0], np.ones(count, dtype=np.bool_)
    left[0] = False
    for _ in range(count - 1):
        nearest = int(np.argmin(np.where(left, distance[order[-1]], np.inf)))
        order.append(nearest)
        left[nearest] = False
    ring = np.array(order, dtype=np.int64)
    for _ in range(_MOST_PASSES):
        onward = np.roll(ring, -1)
        edges = distance[ring, onward]
        gain = edges[:, None] + edges[None] - distance[np.ix_(ring, ring)] - distance[np.ix_(onward, onward)]
        i, j = sorted(np.unravel_index(int(np.argmax(np.triu(gain, 2))), gain.shape))
        if not gain[i, j] > 1e-12 * edges.sum():
            break
        ring[i + 1 : j + 1] = ring[i + 1 : j + 1][::-1]
    return ring
