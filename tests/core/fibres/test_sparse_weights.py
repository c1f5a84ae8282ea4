import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from spindle import spindle

from vtkmuscle.core.fibres.embedding import (
    sparse_mean_value_coordinates,
    sparse_transport,
    vertex_groups,
)
from vtkmuscle.core.fibres.mean_value import mean_value_coordinates, transport


@pytest.fixture(scope="module")
def mesh():
    points, triangles, _ = spindle()
    centre = points.mean(axis=0)
    rng = np.random.default_rng(3)
    inside = centre + (points[rng.integers(0, len(points), 120)] - centre) * rng.uniform(0, 0.95, (120, 1))
    on = points[triangles[:20]].mean(axis=1)
    outside = centre + (points[:20] - centre) * 1.3
    return points, triangles, np.vstack([inside, on, points[:5], outside])


def bent(points):
    centred = points - points.mean(axis=0)
    return points + 0.003 * centred[:, 2:] ** 2 * [1.0, 0.5, 0.0]


def test_without_a_threshold_all_weights_are_kept(mesh):
    points, triangles, queries = mesh
    sparse = sparse_mean_value_coordinates(points, triangles, queries, prune=0.0)
    exact = transport(mean_value_coordinates(points, triangles, queries), bent(points))
    assert_allclose(sparse_transport(sparse, bent(points)), exact, atol=1e-10)
    assert sparse.error < 1e-12


@pytest.mark.parametrize("prune", [0.1, 1.0, 3.0, 100.0])
def test_affine_motions_are_exact_whatever_is_dropped(mesh, prune):
    points, triangles, queries = mesh
    sparse = sparse_mean_value_coordinates(points, triangles, queries, prune=prune)
    matrix = np.array([[1.0, 0.2, 0.0], [0.0, 1.1, -0.3], [0.3, 0.0, 0.9]])
    moved = sparse_transport(sparse, points @ matrix.T + [5, 6, 7])
    assert_allclose(moved, queries @ matrix.T + [5, 6, 7], atol=1e-7)


def test_fewer_weights_cost_accuracy_and_the_error_says_how_much(mesh):
    points, triangles, queries = mesh
    exact = transport(mean_value_coordinates(points, triangles, queries), bent(points))
    kept, errors, said = [], [], []
    for prune in (0.03, 0.3, 2.0):
        sparse = sparse_mean_value_coordinates(points, triangles, queries, prune=prune)
        kept.append(len(sparse.matrix.data))
        errors.append(np.linalg.norm(sparse_transport(sparse, bent(points)) - exact, axis=1).max())
        said.append(sparse.error)
    assert kept[0] > 2 * kept[2]
    assert errors[0] < 0.2 * errors[2]
    # The bend of the probe along the muscle's axis is z^2 / (2 d).
    bend = 0.003 * np.hypot(1.0, 0.5) * 2 * np.linalg.norm(np.ptp(points, axis=0))
    assert (np.array(errors) <= bend * np.array(said) * 1.01).all()
    assert (np.array(errors) >= 0.2 * bend * np.array(said)).all()


def test_the_result_does_not_depend_on_threads(mesh):
    points, triangles, queries = mesh
    one, three = (
        sparse_mean_value_coordinates(points, triangles, queries, prune=0.5, threads=n) for n in (1, 3)
    )
    assert_array_equal(one.matrix.indices, three.matrix.indices)
    assert_array_equal(one.matrix.data, three.matrix.data)
    assert one.error == three.error


def test_no_points_have_no_weights(mesh):
    points, triangles, _ = mesh
    sparse = sparse_mean_value_coordinates(points, triangles, np.zeros((0, 3)), prune=1.0)
    assert sparse_transport(sparse, points).shape == (0, 3)


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.zeros((5, 3)), np.eye(3)[:2]])
def test_few_or_equal_points_have_groups(points):
    order, groups, _ = vertex_groups(points)
    assert sorted(order) == list(range(len(points)))
    assert (groups.sizes == 1).sum() == len(points)
