"""Shortest paths along the edges of a surface, from landmark to landmark."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How much longer an edge counts that is one chord aside of the chord. On a sphere of like triangles paths
#: stray 6 % of the chord from the great circle with 10, 16 % (at most 38 %) with 0, and are as long.
_STRAIGHTNESS = 10.0
#: Nearly all paths stay this many chords from the chord's middle: they are sought there first.
_REACH = 2.0


def geodesic_curve(points: Floats, triangles: Ints, vertices: Ints, *, closed: bool) -> Ints:
    """Return point ids along the shortest paths from each vertex to the next, (k,), joints once.

    On a mesh of like triangles many paths are nearly as short as the shortest, and that one may bulge
    by a third of its chord. Edges count as longer the farther they are from the chord, so that the path
    keeps near to the straight line between the landmarks.

    Parameters
    ----------
    points : (n, 3) array
        Positions.
    triangles : (m, 3) int array
        Point ids.
    vertices : (j,) int array
        Ids of the points to join, in order.
    closed : bool
        True where the last vertex is joined to the first.

    Raises
    ------
    ValueError
        If no edges connect two neighbours.
    """
    ends = np.append(vertices[1:], vertices[:1]) if closed else vertices[1:]
    offsets, neighbours = _neighbours(triangles, len(points))
    curve = [vertices[:1]]
    for start, end in zip(vertices[: len(ends)], ends, strict=True):
        path = _shortest_path(points, offsets, neighbours, start, end, _REACH)
        if not len(path):
            path = _shortest_path(points, offsets, neighbours, start, end, np.inf)
        if not len(path):
            raise ValueError(
                f"two neighbouring landmarks are nearest to the muscle points {start} and {end}, which no "
                "edges connect: the muscle is in several pieces; split the attachment, or join the pieces"
            )
        curve.append(path[1:])
    return np.concatenate(curve)


@kernel
def _neighbours(triangles: Ints, n_points: int) -> tuple[Ints, Ints]:
    """Return the ends of the edges of each point, one after the other; twice where it is in two triangles."""
    offsets = np.zeros(n_points + 1, dtype=np.int64)
    for t in range(len(triangles)):
        for corner in range(3):
            offsets[triangles[t, corner] + 1] += 2
    offsets = np.cumsum(offsets)
    filled = offsets[:-1].copy()
    neighbours = np.empty(offsets[-1], dtype=np.int64)
    for t in range(len(triangles)):
        for corner in range(3):
            point = triangles[t, corner]
            neighbours[filled[point]] = triangles[t, (corner + 1) % 3]
            neighbours[filled[point] + 1] = triangles[t, (corner + 2) % 3]
            filled[point] += 2
    return offsets, neighbours


@kernel
def _shortest_path(
    points: Floats, offsets: Ints, neighbours: Ints, start: int, end: int, reach: float
) -> Ints:
    """Return the points of the shortest path, both ends included; none where there is no path.

    Dijkstra 1959, doi:10.1007/BF01386390. Edges whose middle is farther from the chord's middle than `reach`
    chords are left out.
    """
    cx, cy, cz = points[end] - points[start]
    square = cx * cx + cy * cy + cz * cz
    distances, before = np.full(len(points), np.inf), np.full(len(points), -1, dtype=np.int64)
    distances[start] = 0.0
    heap = [(0.0, start)]
    while len(heap) > 0:
        distance, point = heapq.heappop(heap)
        if point == end:
            break
        if distance > distances[point]:
            continue
        for i in range(offsets[point], offsets[point + 1]):
            other = neighbours[i]
            # From the path's start to the edge's middle, and along the edge.
            mx = 0.5 * (points[point, 0] + points[other, 0]) - points[start, 0]
            my = 0.5 * (points[point, 1] + points[other, 1]) - points[start, 1]
            mz = 0.5 * (points[point, 2] + points[other, 2]) - points[start, 2]
            away = (mx - 0.5 * cx) ** 2 + (my - 0.5 * cy) ** 2 + (mz - 0.5 * cz) ** 2
            if away > reach * reach * square:
                continue
            crossed = (my * cz - mz * cy) ** 2 + (mz * cx - mx * cz) ** 2 + (mx * cy - my * cx) ** 2
            aside = crossed / max(square * square, 1e-300)  # squared, in chords
            dx, dy, dz = points[other] - points[point]
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            reached = distance + length * (1.0 + _STRAIGHTNESS * aside)
            if reached < distances[other]:
                distances[other] = reached
                before[other] = point
                heapq.heappush(heap, (reached, other))
    if not np.isfinite(distances[end]):
        return np.empty(0, dtype=np.int64)
    count, point = 1, end
    while point != start:
        point = before[point]
        count += 1
    path = np.empty(count, dtype=np.int64)
    point = end
    for i in range(count - 1, -1, -1):
        path[i] = point
        point = before[point]
    return path
