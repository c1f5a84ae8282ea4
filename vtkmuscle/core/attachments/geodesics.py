"""Shortest paths along the edges of a surface, from landmark to landmark."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import edge_lengths, unique_edges
from vtkmuscle.core.types import Floats, Ints

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
    points, triangles : (n, 3) array, (m, 3) int array
        Positions; point ids.
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
    edges = unique_edges(triangles)
    middles = np.ascontiguousarray(0.5 * (points[edges[:, 0]] + points[edges[:, 1]]).T)
    curve = [vertices[:1]]
    for start, end in zip(vertices[: len(ends)], ends, strict=True):
        path = _shortest_path(points, edges, middles, int(start), int(end), _REACH)
        if not len(path):
            path = _shortest_path(points, edges, middles, int(start), int(end), np.inf)
        if not len(path):
            raise InputError(
                "",
                f"two neighbouring landmarks are nearest to the muscle points {start} and {end}, which no "
                "edges connect: the muscle is in several pieces",
                "split the attachment, or join the pieces",
            )
        curve.append(path[1:])
    return np.concatenate(curve)


def _shortest_path(points: Floats, edges: Ints, middles: Floats, start: int, end: int, reach: float) -> Ints:
    """Return the points of the shortest path, both ends included; none where there is no path.

    Dijkstra 1959, doi:10.1007/BF01386390. Edges whose middle (3, k) is farther from the chord's middle than
    `reach` chords, along any axis, are left out.
    """
    chord = points[end] - points[start]
    square = max(float(chord @ chord), 1e-300)
    near = np.ones(len(edges), dtype=np.bool_)
    if np.isfinite(reach):
        for along, middle in zip(middles, points[start] + 0.5 * chord, strict=True):
            near &= np.abs(along - middle) <= reach * np.sqrt(square)
    edges, away = edges[near], middles.T[near] - points[start]
    aside = (np.cross(away, chord) ** 2).sum(axis=1) / square**2  # squared, in chords
    weights = edge_lengths(points, edges) * (1.0 + _STRAIGHTNESS * aside)
    graph = coo_array((weights, (edges[:, 0], edges[:, 1])), shape=(len(points), len(points))).tocsr()
    before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
    path = [end]
    while path[-1] != start:
        if before[path[-1]] < 0:
            return np.empty(0, dtype=np.int64)
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)
