"""Rings of landmarks: how long they are, what they enclose, and the order in which they would be shortest."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Passes over all pairs of edges, at most; a ring of a hundred points takes some ten.
_MOST_PASSES = 200


def ring_length(points: Floats) -> float:
    """Return the length of the ring through points (n, 3) in their order."""
    return float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum())


def ring_area(points: Floats) -> float:
    """Return the area that the ring through points (n, 3) encloses, seen from where it is largest."""
    arms = points - points.mean(axis=0)
    return 0.5 * float(np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)))


def short_ring(points: Floats) -> Ints:
    """Return an order of points in which the ring through them is short.

    From each point to the nearest, then pairs of edges are exchanged while that makes the ring shorter
    (2-opt, Croes 1958, doi:10.1287/opre.6.6.791).

    Parameters
    ----------
    points : (n, 3) array
        At least one.

    Returns
    -------
    (n,) int array
        Point ids. The ring is rarely more than a few percent longer than the shortest.
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
