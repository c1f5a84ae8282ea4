"""Rings of landmarks: their length and order, the surfaces that they span, and those round a patch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.mesh.surface import half_edges
from vtkmuscle.core.types import Floats, Ints


def discs_over(rings: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Return points and triangles that span rings (k, 3), from each ring's mean to its sides.

    On a coarse mesh the triangles between attached points leave out up to an edge's length along the rim of
    an area, and an aponeurosis within a muscle is not on its surface at all: only the ring is known. Rings of
    fewer than three points span nothing.
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


#: Most landmarks of an outline: the patches inside of them are 0.9 to 1.0 of the patches outlined.
MOST_LANDMARKS = 40


def outline(points: Floats, triangles: Ints, patch: Ints) -> tuple[Floats, bool]:
    """Return points (j, 3) of the muscle along the boundary of a connected patch (k,), and True for a ring.

    Holes in it are left out. A patch without a triangle is no ring: its own points are returned in order.
    """
    edges = half_edges(triangles)
    held = np.isin(edges, patch).all(axis=1)
    inside = {(b, a) for a, b in edges[np.repeat(held.reshape(-1, 3).all(axis=1), 3)].tolist()}
    following: dict[int, list[int]] = {}
    for a, b in sorted({(a, b) for a, b in edges[held].tolist()} - inside):  # both ways between islands
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


#: Most passes over all pairs of edges; a ring of a hundred points takes some ten.
_MOST_PASSES = 200


def ring_length(points: Floats) -> float:
    """Return the length of the ring through points (n, 3) in their order."""
    return float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())


def ring_area(points: Floats) -> float:
    """Return the area that the ring through points (n, 3) encloses, seen from where it is largest."""
    arms = points - points.mean(axis=0)
    return 0.5 * float(np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)))


def short_ring(points: Floats) -> Ints:
    """Return an order (n,) of one or more points in which the ring through them is short.

    It goes from each point to the nearest, then pairs of edges are exchanged while that makes the ring
    shorter (2-opt, Croes 1958, doi:10.1287/opre.6.6.791). The ring is rarely more than a few percent longer
    than the shortest.
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
