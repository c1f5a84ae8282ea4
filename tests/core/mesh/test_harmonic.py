import subprocess
import sys

import numpy as np
import pytest
from oracles import igl
from shapes import grid
from spindle import spindle

from vtkmuscle.core.mesh import harmonic


def test_laplacian_is_symmetric_and_an_m_matrix_on_bad_triangles():
    points, triangles, _ = spindle(seed=0)
    points[triangles[7, 0]] = points[triangles[7, 1]]  # degenerate
    repeated = np.vstack([triangles, triangles[:1, [0, 0, 1]]])
    matrix = harmonic.intrinsic_laplacian(points, repeated).toarray()
    assert np.allclose(matrix, matrix.T)
    assert np.allclose(matrix.sum(axis=1), 0.0, atol=1e-9 * np.abs(matrix).max())
    assert np.isfinite(matrix).all()
    assert (matrix - np.diag(np.diag(matrix)) <= 1e-12).all()


def test_laplacian_agrees_with_igl_where_triangles_are_delaunay():
    points, triangles, _ = spindle(rings=20, around=12)
    ours, theirs = (
        harmonic.intrinsic_laplacian(points, triangles).toarray(),
        -igl.cotmatrix(points, triangles).toarray(),
    )
    kept = (theirs < -2e-3) & (ours < 0)
    assert kept.sum() > len(points)
    assert np.allclose(ours[kept], theirs[kept], rtol=1e-9)


@pytest.mark.parametrize("part", [1.0 / 3.0, 0.01, 0.001])
def test_a_harmonic_function_does_not_depend_on_the_triangles_of_a_shape(part):
    """Triangles are cut at a point in their plane, a part of their height off an edge."""
    points, triangles, fixed_to = spindle(rings=20, around=12)
    fixed = np.flatnonzero(fixed_to >= 0)
    values = fixed_to[fixed, None].astype(float)
    expected = harmonic.harmonic_extension(points, triangles, fixed, values)
    a, b, c = triangles[::3].T
    new = 0.5 * (1.0 - part) * (points[a] + points[b]) + part * points[c]
    d = len(points) + np.arange(len(new))
    cut = np.vstack(
        [np.delete(triangles, np.s_[::3], axis=0)]
        + [np.column_stack(corners) for corners in ((a, b, d), (b, c, d), (c, a, d))]
    )
    found = harmonic.harmonic_extension(np.vstack([points, new]), cut, fixed, values)
    assert np.abs(found[: len(points)] - expected).max() < 0.01 * np.ptp(values)


def test_linear_functions_in_the_plane_are_harmonic():
    points, triangles = grid(8, 8)
    border = np.flatnonzero((points[:, :2] == 0).any(axis=1) | (points[:, :2] == 8).any(axis=1))
    wanted = points[:, :1] * 2.0 - points[:, 1:2] + 3.0
    found = harmonic.harmonic_extension(points, triangles, border, wanted[border])
    assert np.allclose(found, wanted, atol=1e-9)


def test_a_finely_divided_surface_is_no_dead_end():
    """Each triangle of a strap cut in four three times: minimum degree took minutes."""
    program = """if True:
        import numpy as np, pyvista
        from vtkmuscle import phantoms
        from vtkmuscle.core.mesh.harmonic import harmonic_extension
        fine = pyvista.wrap(phantoms.wrapping_cylinder().muscles["strap"]).triangulate().subdivide(3)
        points = np.array(fine.points, dtype=float)
        ends = np.flatnonzero((points[:, 1] < -79.0) | (points[:, 1] > 20.0))
        harmonic_extension(points, fine.regular_faces, ends, points[ends, 1:2])"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120.0)


def test_weights_are_a_partition_of_unity():
    points, triangles, fixed_to = spindle(seed=1)
    fixed_to[60:64] = 5
    bones, weights, places = harmonic.harmonic_weights(points, triangles, fixed_to)
    assert bones.tolist() == [0, 1, 5]
    assert weights.min() >= 0.0
    assert weights.max() <= 1.0
    assert np.allclose(weights.sum(axis=1), 1.0, atol=1e-14)
    for column, bone in enumerate(bones):
        assert np.array_equal(weights[fixed_to == bone, column], np.ones((fixed_to == bone).sum()))
    assert ((fixed_to < 0) & (weights > 1e-6).all(axis=1)).any()
    held = places.reshape(-1, 3, 4).sum(axis=1)[fixed_to >= 0]
    assert np.allclose(held, np.insert(points[fixed_to >= 0], 3, 1.0, axis=1), atol=1e-12)


def test_part_without_fixed_points_takes_the_mean():
    points, triangles, fixed_to = spindle()
    n = len(points)
    both = np.vstack([points, points + 100.0, [[0.0, 50, 0]]])  # the last is in no triangle
    fixed = np.concatenate([fixed_to, np.full(n + 1, -1)])
    _, weights, _ = harmonic.harmonic_weights(both, np.vstack([triangles, triangles + n]), fixed)
    assert np.allclose(weights[n:], np.mean(fixed_to[fixed_to >= 0] == np.array([[0], [1]]), axis=1))
    assert np.allclose(weights[:n], harmonic.harmonic_weights(points, triangles, fixed_to)[1])


def test_field_runs_between_the_ends_that_are_farthest_apart():
    points, triangles, fixed_to = spindle()
    fixed_to[20:30] = 2  # a third bone just beside the lower end
    field = harmonic.harmonic_field(points, triangles, fixed_to)
    assert set(np.unique(field[fixed_to == 1])) == {1.0 - field[fixed_to == 0][0]}
    assert (field[fixed_to == 2] == field[fixed_to == 0][0]).all()
    assert harmonic.harmonic_field(points, triangles, np.where(fixed_to == 0, 0, -1)) is None
    assert harmonic.harmonic_field(points, triangles, np.full(len(points), -1)) is None


def test_gradient_of_a_linear_function_is_its_tangential_part():
    points, triangles, _ = spindle(seed=3)
    direction = np.array([0.3, -0.5, 2.0])
    gradients = harmonic.triangle_gradients(points, triangles, points @ direction + 7.0)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.allclose(gradients, direction - (normals @ direction)[:, None] * normals, atol=1e-9)
    assert (harmonic.triangle_gradients(points, triangles, np.full(len(points), 0.1)) == 0).all()
