import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.filters.arrays import (
    Polylines,
    points_of,
    polylines_from,
    set_cell_array,
    set_field_array,
    set_point_array,
)
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.surface_distance import SurfaceDistance


def noisy_fibres():
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 12)
    lines = [np.column_stack([100 * t, 5 * np.sin(3 * t) + i, 0 * t]) for i in range(4)]
    points = np.vstack(lines) + rng.normal(scale=0.5, size=(48, 3))
    return Polylines(points, np.arange(0, 49, 12))


def test_inner_points_follow_the_formula_and_end_points_stay():
    lines = noisy_fibres()
    smoothed = points_of(FibreSmoother(iterations=1, k=4.0)(polylines_from(lines))).reshape(4, 12, 3)
    p = lines.points.reshape(4, 12, 3)
    assert_allclose(smoothed[:, 1:-1], (p[:, :-2] + 4 * p[:, 1:-1] + p[:, 2:]) / 6, atol=1e-12)
    assert_array_equal(smoothed[:, [0, -1]], p[:, [0, -1]])


def test_no_iteration_changes_nothing():
    lines = noisy_fibres()
    assert_array_equal(points_of(FibreSmoother(iterations=0)(polylines_from(lines))), lines.points)


def test_many_iterations_straighten_the_fibres():
    smoothed = points_of(FibreSmoother(iterations=5000, k=0.0)(polylines_from(noisy_fibres()))).reshape(
        4, 12, 3
    )
    assert_allclose(smoothed, np.linspace(smoothed[:, 0], smoothed[:, -1], 12, axis=1), atol=1e-6)


def test_arrays_of_the_fibres_pass_through():
    fibres = polylines_from(noisy_fibres())
    set_point_array(fibres, "t", np.tile(np.linspace(0, 1, 12), 4))
    set_cell_array(fibres, "FibreId", np.arange(4))
    set_field_array(fibres, "FitError", 0.25)
    smoothed = FibreSmoother()(fibres)
    assert smoothed.GetPointData().GetArray("t").GetValue(11) == 1.0
    assert smoothed.GetCellData().GetArray("FibreId").GetValue(3) == 3
    assert smoothed.GetFieldData().GetArray("FitError").GetValue(0) == 0.25


def test_points_stay_in_the_muscle_where_it_is_connected():
    ball = vtkSphereSource(radius=10.0, theta_resolution=40, phi_resolution=40).update().output
    t = np.linspace(0, np.pi, 16)
    # From side to side just inside, with one point far out.
    arch = np.column_stack([9.9 * np.cos(t), 0 * t, 9.9 * np.sin(t)])
    arch[8] *= 1.5
    fibres = polylines_from(Polylines(arch, np.array([0, 16])))
    surface = SurfaceDistance(ball)
    alone = points_of(FibreSmoother(iterations=1)(fibres))
    kept = points_of(FibreSmoother(iterations=1)(fibres, ball))
    outside = surface.depth(alone) == 0
    assert outside[8]
    assert_allclose(kept[~outside], alone[~outside], atol=0)
    assert_allclose(surface.unsigned(kept[outside]), 0.0, atol=1e-9)
    assert_array_equal(kept[[0, -1]], arch[[0, -1]])
