import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from oracles import igl

from vtkmuscle.core.mesh.triangle_tree import triangle_tree


def soup(n, seed):
    """Return n triangles anywhere, of very different sizes."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(scale=10.0, size=(n, 1, 3))
    corners = centres + rng.normal(size=(n, 3, 3)) * 10 ** rng.uniform(-3, 1, (n, 1, 1))
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


@settings(deadline=None, max_examples=30)
@given(n=st.integers(1, 60), seed=st.integers(0, 2**32 - 1))
def test_the_nearest_of_all_triangles_is_found(n, seed):
    points, triangles = soup(n, seed)
    queries = np.random.default_rng(seed + 1).normal(scale=15.0, size=(50, 3))
    found, closest, distances = triangle_tree(points, triangles).nearest(queries)
    squared = igl.point_mesh_squared_distance(queries, points, triangles)[0]
    assert_allclose(distances, np.sqrt(squared), atol=1e-9)
    assert_allclose(np.linalg.norm(closest - queries, axis=1), distances, atol=1e-9)
    a = points[triangles[found]]
    assert (closest <= a.max(axis=1) + 1e-9).all()
    assert (closest >= a.min(axis=1) - 1e-9).all()


def test_triangles_without_area_are_no_obstacle():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5.0]])
    triangles = np.array([[3, 3, 3], [0, 0, 1], [0, 1, 2], [1, 1, 1]])
    _, closest, distances = triangle_tree(points, triangles).nearest(np.array([[0.2, 0.2, 3.0], [5, 5, 5]]))
    assert_allclose(distances, [3, 0], atol=1e-12)
    assert_allclose(closest, [[0.2, 0.2, 0], [5, 5, 5]], atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_points_inside_have_negative_distances(offset):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) + offset
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)])
    queries = np.random.default_rng(0).uniform(-2, 2, (500, 3))
    distances, _ = triangle_tree(corners, triangles).signed(queries + offset)
    inside = np.abs(queries).max(axis=1) < 1
    assert_array_equal(distances < 0, inside)
    assert_allclose(distances[inside], np.abs(queries[inside]).max(axis=1) - 1, atol=1e-10 * (1 + offset))
