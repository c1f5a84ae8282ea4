import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from shapes import sphere
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkMeanValueCoordinatesInterpolator

from vtkmuscle.core.fibres.mean_value import mean_value_coordinates, transport
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about

# An L-shaped block (concave), 12 points, outward oriented: an L in x and y, extruded along z.
OUTLINE = np.array([[0, 0], [20, 0], [20, 8], [8, 8], [8, 20], [0, 20]], dtype=float)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])


def block():
    points = np.vstack([np.column_stack([OUTLINE, np.full(6, z)]) for z in (0.0, 10.0)])
    sides = [[[i, (i + 1) % 6, (i + 1) % 6 + 6], [i, (i + 1) % 6 + 6, i + 6]] for i in range(6)]
    triangles = np.vstack([FACES[:, ::-1], FACES + 6, np.reshape(sides, (-1, 3))])
    return points, triangles.astype(np.int64)


def reference(points, triangles, query):
    """Ju et al. 2005, section 3, word for word in extended precision."""
    e = points.astype(np.longdouble) - query
    w = np.zeros(len(points), dtype=np.longdouble)
    for t in triangles:
        corners = e[t]
        m = np.zeros(3, dtype=np.longdouble)
        for k in range(3):
            a, b = corners[(k + 1) % 3], corners[(k + 2) % 3]
            c = np.cross(a, b)
            m += 0.5 * np.arctan2(np.sqrt(c @ c), a @ b) * c / np.sqrt(c @ c)
        volume = corners[0] @ np.cross(corners[1], corners[2])
        for k in range(3):
            w[t[k]] += m @ np.cross(corners[(k + 1) % 3], corners[(k + 2) % 3]) / volume
    return (w / w.sum()).astype(float)


def vtk_weights(points, triangles, query):
    vtk_points, cells = vtkPoints(), vtkCellArray()
    for p in points:
        vtk_points.InsertNextPoint(p)
    for t in triangles:
        cells.InsertNextCell(3, [int(i) for i in t])
    weights = [0.0] * len(points)
    vtkMeanValueCoordinatesInterpolator.ComputeInterpolationWeights(query, vtk_points, cells, weights)
    return np.array(weights)


coordinates = st.floats(-30, 40).map(lambda x: round(x, 6))
anywhere = st.tuples(coordinates, coordinates, coordinates).map(np.array)
corners = st.integers(0, 19)
shares = st.floats(0, 1)


@settings(deadline=None, max_examples=50)
@given(query=anywhere)
def test_weights_sum_to_one_and_reproduce_their_point_inside_and_outside(query):
    points, triangles = block()
    w = mean_value_coordinates(points, triangles, query[None])[0]
    assert abs(w.sum() - 1) < 1e-12
    assert_allclose(w @ points, query, atol=1e-10)


@settings(deadline=None, max_examples=30)
@given(triangle=corners, a=shares, b=shares)
def test_on_triangles_edges_and_vertices_the_weights_are_barycentric(triangle, a, b):
    points, triangles = block()
    bary = np.array([1 - a, a * (1 - b), a * b])
    query = bary @ points[triangles[triangle]]
    w = mean_value_coordinates(points, triangles, query[None])[0]
    expected = np.zeros(len(points))
    expected[triangles[triangle]] = bary
    assert_allclose(w, expected, atol=1e-10)


def test_vtk_finds_the_same_weights():
    points, triangles = block()
    rng = np.random.default_rng(0)
    queries = rng.uniform(-5, 25, (100, 3))
    ours = mean_value_coordinates(points, triangles, queries)
    # VTK leaves out triangles in whose plane the point nearly lies: a few digits less.
    for query, w in zip(queries, ours, strict=True):
        assert_allclose(w, vtk_weights(points, triangles, query), atol=1e-9)


@pytest.mark.parametrize("height", [3.0, 1e-1, 1e-3, 1e-5, 1e-6])
def test_near_the_plane_of_a_triangle_no_digits_are_lost(height):
    points, triangles = block()
    rng = np.random.default_rng(1)
    queries = rng.uniform(-15, 35, (40, 3))
    queries[:, 0] = 8.0 + height  # the plane of the concave side: inside of the muscle, or outside of it
    ours = mean_value_coordinates(points, triangles, queries)
    expected = [reference(points, triangles, q) for q in queries]
    assert_allclose(ours, expected, atol=3e-11)


def test_the_plane_of_a_triangle_is_no_jump():
    points, triangles = block()
    rng = np.random.default_rng(2)
    queries = rng.uniform(-15, 35, (100, 3))
    queries[:, 0] = 8.0
    beside = queries + np.array([1e-9, 0, 0])
    at, near = (mean_value_coordinates(points, triangles, q) for q in (queries, beside))
    assert_allclose(at, near, atol=1e-8)


def test_a_rigid_motion_of_everything_changes_no_weight():
    points, triangles = block()
    queries = np.random.default_rng(5).uniform(-5, 25, (20, 3))
    motion = rotation_about([3, 4, 5], [1, 2, -1], 77.0)
    motion[:3, 3] += [30, -20, 10]
    before = mean_value_coordinates(points, triangles, queries)
    moved = (apply_transform(motion, points), triangles, apply_transform(motion, queries))
    assert_allclose(mean_value_coordinates(*moved), before, atol=1e-11)


def test_triangles_without_area_and_unused_points_change_nothing():
    points, triangles = block()
    queries = np.random.default_rng(6).uniform(1, 7, (10, 3))
    before = mean_value_coordinates(points, triangles, queries)
    more_points = np.vstack([points, [[100.0, 0, 0]]])
    more = np.vstack([triangles, [[0, 0, 1], [3, 3, 3]]])
    after = mean_value_coordinates(more_points, more, queries)
    assert_allclose(after[:, :-1], before, atol=1e-12)
    assert_allclose(after[:, -1], 0, atol=1e-12)


def test_the_number_of_threads_does_not_change_a_bit(ball):
    points, triangles = ball
    queries = np.random.default_rng(7).uniform(-12, 12, (100, 3))
    one = mean_value_coordinates(points, triangles, queries, threads=1)
    assert_array_equal(one, mean_value_coordinates(points, triangles, queries, threads=7))
    assert_array_equal(one[5:6], mean_value_coordinates(points, triangles, queries[5:6]))


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
    moved = transport(weights, points @ matrix.T + shift)
    assert_allclose(moved, queries @ matrix.T + shift, atol=1e-11)


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
