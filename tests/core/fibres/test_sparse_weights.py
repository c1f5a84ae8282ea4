import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
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


def test_a_turned_muscle_has_the_same_weights(mesh):
    points, triangles, queries = mesh
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7])
    still, turned = (
        sparse_mean_value_coordinates(p, triangles, q, prune=0.5).matrix
        for p, q in ((points, queries), (turn.apply(points), turn.apply(queries)))
    )
    assert_array_equal(still.indices, turned.indices)
    assert_allclose(still.data, turned.data, atol=1e-9)


def test_groups_are_worth_more_than_the_larger_weights_alone(mesh):
    points, triangles, queries = mesh
    weights = mean_value_coordinates(points, triangles, queries)
    sparse = sparse_mean_value_coordinates(points, triangles, queries, prune=0.3)
    exact = transport(weights, bent(points))
    count = len(sparse.matrix.data) // len(queries)
    assert count < 0.4 * len(points)
    alone = np.where(weights >= np.sort(weights, axis=1)[:, -2 * count, None], weights, 0.0)
    alone /= alone.sum(axis=1, keepdims=True)
    error = [
        np.linalg.norm(m - exact, axis=1).max()
        for m in (sparse_transport(sparse, bent(points)), alone @ bent(points))
    ]
    assert error[0] < 0.2 * error[1]


def test_what_is_done_is_reported_and_stops_where_that_fails(mesh):
    points, triangles, queries = mesh
    told = []

    def report(part):
        told.append(part)
        if len(told) == 2:
            raise KeyboardInterrupt

    sparse_mean_value_coordinates(points, triangles, queries, prune=0.5, report=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    told.clear()
    with pytest.raises(KeyboardInterrupt):
        sparse_mean_value_coordinates(points, triangles, queries, prune=0.5, report=report, threads=1)
    assert len(told) == 2


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


def test_groups_are_compact_and_their_means_those_of_their_vertices(mesh):
    points = mesh[0]
    groups = vertex_groups(points)
    values = np.random.default_rng(0).normal(size=points.shape)
    means = groups.means @ values
    scattered = np.linalg.norm(np.ptp(points, axis=0)) / 2
    starts, sizes, radii, following = groups.groups
    for number, (start, size) in enumerate(zip(starts, sizes, strict=True)):
        ids = groups.order[start : start + size]
        assert_allclose(means[number], values[ids].mean(axis=0), atol=1e-12)
        apart = np.linalg.norm(points[ids] - points[ids].mean(axis=0), axis=1).max()
        assert radii[number] == pytest.approx(apart, abs=1e-9)
        parts = slice(number + 1, following[number])
        assert (starts[parts] + sizes[parts] <= start + size).all()
        assert sizes[parts][starts[parts] == start].max(initial=0) < size
    assert np.median(radii[(sizes > 16) & (sizes <= 64)]) < 0.35 * scattered
    assert sorted(groups.order) == list(range(len(points)))
    assert_array_equal(starts[sizes == 1], np.arange(len(points)))


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.zeros((5, 3)), np.eye(3)[:2]])
def test_few_or_equal_points_have_groups(points):
    groups = vertex_groups(points)
    assert sorted(groups.order) == list(range(len(points)))
    assert (groups.groups.sizes == 1).sum() == len(points)
