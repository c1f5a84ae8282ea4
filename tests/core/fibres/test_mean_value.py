import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from shapes import sphere
from spindle import spindle

from vtkmuscle.core.fibres import embedding, mean_value
from vtkmuscle.core.fibres.embedding import sparse_mean_value_coordinates, sparse_transport, vertex_groups
from vtkmuscle.core.fibres.mean_value import mean_value_coordinates, transport

# An L-shaped block (concave), 12 points, outward oriented: an L in x and y, extruded along z.
OUTLINE = np.array([[0, 0], [20, 0], [20, 8], [8, 8], [8, 20], [0, 20]], dtype=float)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])


def block():
    points = np.vstack([np.column_stack([OUTLINE, np.full(6, z)]) for z in (0.0, 10.0)])
    sides = [[[i, (i + 1) % 6, (i + 1) % 6 + 6], [i, (i + 1) % 6 + 6, i + 6]] for i in range(6)]
    return points, np.vstack([FACES[:, ::-1], FACES + 6, np.reshape(sides, (-1, 3))]).astype(np.int64)


def reference(points, triangles, query):
    """Ju et al. 2005, section 3, word for word in extended precision."""
    e = points.astype(np.longdouble) - query
    w = np.zeros(len(points), dtype=np.longdouble)
    for t in triangles:
        corners, m = e[t], np.zeros(3, dtype=np.longdouble)
        for k in range(3):
            a, b = corners[(k + 1) % 3], corners[(k + 2) % 3]
            c = np.cross(a, b)
            m += 0.5 * np.arctan2(np.sqrt(c @ c), a @ b) * c / np.sqrt(c @ c)
        volume = corners[0] @ np.cross(corners[1], corners[2])
        for k in range(3):
            w[t[k]] += m @ np.cross(corners[(k + 1) % 3], corners[(k + 2) % 3]) / volume
    return (w / w.sum()).astype(float)


coordinates = st.floats(-30, 40).map(lambda x: round(x, 6))
anywhere = st.tuples(coordinates, coordinates, coordinates).map(np.array)
corners = st.integers(0, 19)
shares = st.floats(0, 1)


@settings(max_examples=50)
@given(query=anywhere)
def test_weights_sum_to_one_and_reproduce_their_point_inside_and_outside(query):
    points, triangles = block()
    w = mean_value_coordinates(points, triangles, query[None])[0]
    assert abs(w.sum() - 1) < 1e-12
    assert_allclose(w @ points, query, atol=1e-10)


@settings(max_examples=30)
@given(triangle=corners, a=shares, b=shares)
def test_on_triangles_edges_and_vertices_the_weights_are_barycentric(triangle, a, b):
    points, triangles = block()
    bary = np.array([1 - a, a * (1 - b), a * b])
    w = mean_value_coordinates(points, triangles, (bary @ points[triangles[triangle]])[None])[0]
    expected = np.zeros(len(points))
    expected[triangles[triangle]] = bary
    assert_allclose(w, expected, atol=1e-10)


@pytest.mark.parametrize("height", [3.0, 1e-1, 1e-3, 1e-5, 1e-6])
def test_near_the_plane_of_a_triangle_no_digits_are_lost(height):
    points, triangles = block()
    queries = np.random.default_rng(1).uniform(-15, 35, (40, 3))
    queries[:, 0] = 8.0 + height  # the plane of the concave side: inside of the muscle, or outside of it
    ours = mean_value_coordinates(points, triangles, queries)
    assert_allclose(ours, [reference(points, triangles, q) for q in queries], atol=3e-11)


def test_triangles_without_area_and_unused_points_change_nothing():
    points, triangles = block()
    queries = np.random.default_rng(6).uniform(1, 7, (10, 3))
    before = mean_value_coordinates(points, triangles, queries)
    more_points = np.vstack([points, [[100.0, 0, 0]]])
    after = mean_value_coordinates(more_points, np.vstack([triangles, [[0, 0, 1], [3, 3, 3]]]), queries)
    assert_allclose(after[:, :-1], before, atol=1e-12)
    assert_allclose(after[:, -1], 0, atol=1e-12)


def test_the_number_of_threads_does_not_change_a_bit(ball, monkeypatch):
    points, triangles = ball
    queries = np.random.default_rng(7).uniform(-12, 12, (100, 3))
    found = []
    for count in (1, 7):
        monkeypatch.setattr(mean_value, "processors", lambda count=count: count)
        found.append(mean_value_coordinates(points, triangles, queries))
    assert_array_equal(*found)
    assert_array_equal(found[0][5:6], mean_value_coordinates(points, triangles, queries[5:6]))


def test_meshes_and_points_without_coordinates_are_refused(ball):
    points, triangles = ball
    for mesh, query, words in (
        ((points, triangles[3:]), np.zeros((1, 3)), "close the surface"),
        ((np.zeros((3, 3)), np.array([[0, 1, 2]])), np.ones((1, 3)), "no triangle with an area"),
        (ball, np.full((1, 3), 1e12), "a few times its size"),
    ):
        with pytest.raises(ValueError, match=words):
            mean_value_coordinates(*mesh, query)


def test_transport_follows_an_affine_map_exactly(ball):
    points, triangles = ball
    queries = np.random.default_rng(8).uniform(-12, 12, (30, 3))
    weights = mean_value_coordinates(points, triangles, queries)
    matrix, shift = np.array([[1.0, 0.3, 0], [0, 0.7, 0.2], [0.1, 0, 1.4]]), np.array([3.0, 4.0, -5.0])
    assert_allclose(transport(weights, points @ matrix.T + shift), queries @ matrix.T + shift, atol=1e-11)


def test_far_from_the_origin_transport_loses_no_digits(ball):
    points, triangles = ball
    offset = np.array([1e6, -1e6, 1e6])
    queries = np.random.default_rng(9).uniform(-12, 12, (30, 3))
    weights = mean_value_coordinates(points + offset, triangles, queries + offset)
    # The coordinates themselves have their last digit at 1e-10.
    assert_allclose(transport(weights, points + offset), queries + offset, atol=5e-10, rtol=0)


@pytest.fixture
def ball():
    """Return a sphere of radius 10, 162 evenly spread points, outward oriented."""
    return sphere(10.0, 162)


@pytest.fixture(scope="module")
def mesh():
    points, triangles, _ = spindle()
    centre, rng = points.mean(axis=0), np.random.default_rng(3)
    inside = centre + (points[rng.integers(0, len(points), 120)] - centre) * rng.uniform(0, 0.95, (120, 1))
    on = points[triangles[:20]].mean(axis=1)
    return points, triangles, np.vstack([inside, on, points[:5], (centre + (points[:20] - centre) * 1.3)])


def bent(points):
    return points + 0.003 * (points - points.mean(axis=0))[:, 2:] ** 2 * [1.0, 0.5, 0.0]


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


def test_no_points_have_no_weights(mesh):
    points, triangles, _ = mesh
    sparse = sparse_mean_value_coordinates(points, triangles, np.zeros((0, 3)), prune=1.0)
    assert sparse_transport(sparse, points).shape == (0, 3)


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.zeros((5, 3)), np.eye(3)[:2]])
def test_few_or_equal_points_have_groups(points):
    order, groups, _ = vertex_groups(points)
    assert sorted(order) == list(range(len(points)))
    assert (groups.sizes == 1).sum() == len(points)


def test_progress_grows_to_the_whole(rng):
    told: list[float] = []
    embedding.EmbeddedPoints(rng.uniform(1.0, 7.0, (300, 3)), *block(), 0.0).moved(block()[0], told.append)
    assert told[0] < max(told) == told[-1] == 1.0
