from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from vtkmuscle.core.attachments.patches import geodesic_curve
from vtkmuscle.core.mesh.surface import unique_edges
from vtkmuscle.phantoms.meshing import box


def cost(points, path, start, end):
    """Return what a path costs: its edges count more the farther they are from the chord."""
    chord = points[end] - points[start]
    a, b = points[path[:-1]], points[path[1:]]
    crossed = np.cross(0.5 * (a + b) - points[start], chord)
    aside = (crossed**2).sum(axis=1) / (chord @ chord) ** 2
    return (np.linalg.norm(b - a, axis=1) * (1.0 + 10.0 * aside)).sum()


@pytest.mark.parametrize("seed", range(2))
def test_paths_are_as_short_as_the_shortest_that_scipy_finds(seed):
    points, triangles = box((0.0, 0.0, 0.0), (10.0, 12.0, 30.0), 1.5)
    rng = np.random.default_rng(seed)
    points = points + rng.normal(scale=0.1, size=points.shape)
    start, end = rng.choice(len(points), 2, replace=False)
    edges = unique_edges(triangles)
    costs = [cost(points, edge, start, end) for edge in edges]
    graph = coo_array((costs, tuple(edges.T)), shape=(len(points), len(points))).tocsr()
    path = geodesic_curve(points, edges, np.array([start, end]), closed=False)
    assert path[0] == start
    assert path[-1] == end
    joined = {tuple(edge) for edge in edges}
    assert all((min(a, b), max(a, b)) in joined for a, b in pairwise(path))
    assert cost(points, path, start, end) == pytest.approx(
        dijkstra(graph, directed=False, indices=start)[end]
    )


def test_a_ring_comes_back_to_its_start_and_has_its_landmarks():
    points, triangles = box((0.0, 0.0, 0.0), (10.0, 10.0, 10.0), 2.0)
    landmarks = np.array([0, len(points) // 3, len(points) // 2])
    curve = geodesic_curve(points, unique_edges(triangles), landmarks, closed=True)
    assert curve[0] == curve[-1] == 0
    assert set(landmarks) <= set(curve)
    assert (curve[1:] != curve[:-1]).all()
