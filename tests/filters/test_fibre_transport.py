import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from shapes import lines_of
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtkmuscle.core.fibres import embedding
from vtkmuscle.data.arrays import add_arrays, cell_array, field_array, points_of, with_points
from vtkmuscle.filters.fibre_transport import FibreTransport


@pytest.fixture
def fibres():
    t = np.linspace(-1, 1, 9)
    return lines_of([np.column_stack([25 * t, 6 * np.sin(t + i), np.full(9, float(i))]) for i in range(3)])


@pytest.fixture
def weights(noted):
    """Count the computations of weights."""
    return noted(embedding, "mean_value_coordinates", "weights")


def test_without_a_deformation_fibres_come_back_also_those_outside(fibres, muscle):
    assert_allclose(points_of(FibreTransport()(fibres, muscle, muscle)), points_of(fibres), atol=1e-9)


def test_rest_lengths_are_added_and_other_arrays_kept(fibres, muscle):
    add_arrays(fibres, cells={"FibreId": np.array([4, 5, 6])})
    moved = FibreTransport()(fibres, muscle, with_points(muscle, 0.5 * points_of(muscle)))
    expected = np.linalg.norm(np.diff(points_of(fibres).reshape(3, 9, 3), axis=1), axis=2).sum(axis=1)
    assert_allclose(cell_array(moved, "RestLength", ""), expected, rtol=1e-12)
    assert_array_equal(cell_array(moved, "FibreId", ""), [4, 5, 6])


def test_filters_keep_weights_up_to_a_common_size(weights, fibres, muscle, monkeypatch):
    embedding._kept.clear()
    size = 8 * fibres.GetNumberOfPoints() * muscle.GetNumberOfPoints()
    monkeypatch.setattr(embedding, "_LARGEST_CACHE", size)
    transports = [FibreTransport(), FibreTransport()]
    for number, scale in ((0, 1.0), (1, 0.9), (0, 0.8), (1, 0.7)):
        transports[number](fibres, muscle, with_points(muscle, scale * points_of(muscle)))
    assert len(weights) == 3
    del transports[0]
    for _ in range(2):
        transports[0](fibres, muscle, muscle)
    assert len(weights) == 4


@pytest.mark.parametrize("which", ["fibres", "muscle"])
def test_a_change_of_the_rest_state_is_noticed_even_behind_vtks_back(weights, fibres, muscle, which):
    transport = FibreTransport()
    deformed = with_points(muscle, points_of(muscle))
    transport(fibres, muscle, deformed)
    # A numpy view writes into VTK's memory without marking anything modified.
    vtk_to_numpy({"fibres": fibres, "muscle": muscle}[which].GetPoints().GetData())[:] *= 0.5
    moved = transport(fibres, muscle, deformed)
    assert len(weights) == 2
    assert_allclose(points_of(moved), {"fibres": 1.0, "muscle": 2.0}[which] * points_of(fibres), atol=1e-9)


def test_points_outside_of_the_muscle_are_counted(fibres, muscle):
    moved = FibreTransport()(fibres, muscle, muscle)
    radii = np.linalg.norm(points_of(fibres), axis=1)
    assert 0 < (radii > 20).sum() <= field_array(moved, "PointsOutside")[0] <= (radii > 19).sum()
    inner = with_points(fibres, 0.5 * points_of(fibres))
    assert_array_equal(field_array(FibreTransport()(inner, muscle, muscle), "PointsOutside"), [0])


def test_pruned_weights_are_near_all_of_them_and_say_how_near(fibres, muscle):
    bent = points_of(muscle)
    bent[:, 1] += 0.01 * bent[:, 0] ** 2
    deformed = with_points(muscle, bent)
    exact = FibreTransport()(fibres, muscle, deformed)
    assert_array_equal(field_array(exact, "WeightError"), [0.0])
    transport = FibreTransport(weight_tolerance=0.5)
    pruned = transport(fibres, muscle, deformed)
    assert 0 < np.linalg.norm(points_of(pruned) - points_of(exact), axis=1).max() < 0.5
    assert 0 < field_array(pruned, "WeightError")[0] < 1.0
    transport.weight_tolerance = 0.0
    assert_array_equal(points_of(transport(fibres, muscle, deformed)), points_of(exact))
