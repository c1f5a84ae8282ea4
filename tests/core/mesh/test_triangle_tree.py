import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from oracles import igl
from shapes import box

from vtkmuscle.core.mesh.triangle_tree import tree_of_deformed, triangle_tree
from vtkmuscle.phantoms.meshing import solid_of_revolution


def soup(n, seed):
    """Return n triangles anywhere, of very different sizes."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(scale=10.0, size=(n, 1, 3))
    corners = centres + rng.normal(size=(n, 3, 3)) * 10 ** rng.uniform(-3, 1, (n, 1, 1))
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


@settings(max_examples=30)
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
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [5, 5, 5], [5, 5, 9.0]])
    triangles = np.array([[3, 3, 3], [0, 0, 1], [0, 1, 2], [1, 1, 1], [3, 4, 5]])
    queries = np.array([[0.2, 0.2, 3.0], [5, 5, 5], [5, 6, 7]])
    _, closest, distances = triangle_tree(points, triangles).nearest(queries)
    assert_allclose(distances, [3, 0, 1], atol=1e-12)
    assert_allclose(closest, [[0.2, 0.2, 0], [5, 5, 5], [5, 5, 7]], atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_points_inside_have_negative_distances(offset):
    corners, triangles = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    queries = np.random.default_rng(0).uniform(-2, 2, (500, 3))
    distances = np.full(500, np.inf)
    triangle_tree(corners + offset, triangles).lower(distances, queries + offset)
    inside = np.abs(queries).max(axis=1) < 1
    assert_array_equal(distances < 0, inside)
    assert_allclose(distances[inside], np.abs(queries[inside]).max(axis=1) - 1, atol=1e-10 * (1 + offset))


def test_the_tree_of_a_bent_surface_answers_as_a_new_tree():
    points, triangles = solid_of_revolution([0.0, 20.0, 40.0, 90.0], [5.0, 20.0, 4.0, 9.0], 30)
    bent = points + points[:, 2:] ** 2 / 100.0 * [1.0, 0.5, 0.0]
    tree, new = (
        tree_of_deformed(triangle_tree(points, triangles), bent, triangles),
        triangle_tree(bent, triangles),
    )
    queries = np.random.default_rng(0).uniform(-30.0, 100.0, (500, 3))
    assert_allclose(tree.nearest(queries)[2], new.nearest(queries)[2], atol=1e-12)
    assert_array_equal(tree.inside(queries), new.inside(queries))


def test_normals_on_the_surface_lead_outward():
    points, triangles = box(high=(1.0, 1.0, 1.0))
    corners, tree = points[triangles], triangle_tree(points, triangles)
    places = np.concatenate([points, 0.5 * (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3)])
    places = np.concatenate([places, corners.mean(axis=1)])
    distances, closest, normals = tree.tangent_planes(places)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(closest - distances[:, None] * normals, places, atol=1e-12)
    assert not tree.inside(places + 1e-3 * normals).any()
