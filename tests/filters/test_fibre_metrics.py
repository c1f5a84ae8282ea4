import csv

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from shapes import lines_of
from vtkmodules.vtkFiltersCore import vtkCleanPolyData, vtkTriangleFilter
from vtkmodules.vtkFiltersSources import vtkCubeSource

from vtkmuscle.data.arrays import add_arrays, cell_array, field_array, surface_from
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.io import write_fibre_table
from vtkmuscle.phantoms.meshing import box as meshed_box


@pytest.fixture
def box():
    cube = vtkCubeSource(x_length=100.0, y_length=60.0, z_length=20.0, output_points_precision=1)
    return (cube >> vtkTriangleFilter()).update().output


def slanted(angle, *, height=20.0, points=9):
    """Return a fibre from the bottom to the top of the box at an angle [degrees] to both."""
    run = height / np.tan(np.radians(angle))
    return np.linspace([-run / 2, 0, -height / 2], [run / 2, 0, height / 2], points)


def names(data):
    cells = data.GetCellData()
    return {cells.GetArrayName(i) for i in range(cells.GetNumberOfArrays())}


def test_lengths_tortuosity_and_summary():
    half_circle = np.array([[np.cos(a), np.sin(a), 0] for a in np.linspace(0, np.pi, 2001)]) * 10
    measured = FibreMetrics()(lines_of([[[0, 0, 0], [3, 0, 0], [3, 4, 0]], half_circle]))
    assert_allclose(cell_array(measured, "Length", ""), [7, 10 * np.pi], rtol=1e-6)
    assert_allclose(cell_array(measured, "Tortuosity", ""), [7 / 5, np.pi / 2], rtol=1e-6)
    assert_allclose(field_array(measured, "LengthMean"), (7 + 10 * np.pi) / 2, rtol=1e-6)
    assert_allclose(field_array(measured, "LengthSD"), (10 * np.pi - 7) / 2, rtol=1e-6)


def test_only_what_the_inputs_allow_is_measured(box):
    fibre = lines_of([slanted(30)])
    assert names(FibreMetrics()(fibre)) == {"Length", "Tortuosity"}
    found = names(FibreMetrics()(fibre, box))
    assert found == {"Length", "Tortuosity", "PennationOrigin", "PennationInsertion"}
    add_arrays(fibre, cells={"RestLength": np.array([10.0])})
    assert names(FibreMetrics()(fibre)) == {"Length", "Tortuosity", "RestLength", "Strain"}


def test_strain_is_relative_to_the_rest_length_and_0_for_a_fibre_that_had_none():
    fibres = lines_of([[[0, 0, 0], [12, 0, 0]], [[0, 0, 0], [0, 5, 0]], [[0, 0, 0], [0, 5, 0]]])
    add_arrays(fibres, cells={"RestLength": np.array([10.0, 10.0, 0.0])})
    assert_allclose(cell_array(FibreMetrics()(fibres), "Strain", ""), [0.2, -0.5, 0.0], atol=1e-12)


@pytest.mark.parametrize("angle", [15.0, 25.0, 45.0, 80.0, 90.0])
def test_pennation_is_the_angle_to_the_surface_at_both_ends(box, angle):
    measured = FibreMetrics()(lines_of([slanted(angle)]), box)
    assert_allclose(cell_array(measured, "PennationOrigin", ""), angle, atol=1e-6)
    assert_allclose(cell_array(measured, "PennationInsertion", ""), angle, atol=1e-6)


def test_on_a_crease_it_is_the_mean_of_the_angles_to_the_faces_whatever_rounding_says(rng):
    points, triangles = meshed_box((0.0, 0.0, 0.0), (40.0, 20.0, 10.0), 5.0)
    # From the middle of the top's longer edge, down at 20 degrees to the top and 70 to the side.
    down = np.array([0.0, np.cos(np.radians(20.0)), -np.sin(np.radians(20.0))])
    ends = np.array([[12.5, 0.0, 10.0], [15.0, 0.0, 10.0], [17.5, 0.0, 10.0]])
    lines = [[end, end + 8.0 * down] for end in ends]
    for turn in Rotation.random(20, random_state=rng):
        box = surface_from(turn.apply(points), triangles[rng.permutation(len(triangles))])
        measured = FibreMetrics()(lines_of([*(turn.apply(line) for line in lines)]), box)
        assert_allclose(cell_array(measured, "PennationOrigin", ""), 45.0, atol=1e-6)


def test_the_two_ends_are_told_apart_and_turning_a_fibre_around_swaps_them(box):
    bent = np.vstack([slanted(30)[:5], [[0, 0, 10.0]]])
    forth = FibreMetrics()(lines_of([bent]), box)
    back = FibreMetrics()(lines_of([bent[::-1]]), box)
    assert_allclose(cell_array(forth, "PennationOrigin", ""), 30, atol=1e-6)
    assert_allclose(cell_array(forth, "PennationInsertion", ""), 90, atol=1e-6)
    assert_allclose(cell_array(back, "PennationOrigin", ""), 90, atol=1e-6)
    assert_allclose(cell_array(back, "PennationInsertion", ""), 30, atol=1e-6)


def test_degenerate_fibres_get_finite_measures(box):
    loop = [[0, 0, 0], [5, 0, 0], [0, 0, 0]]
    measured = FibreMetrics()(lines_of([[[1, 1, 1]] * 4, loop, [[2, 2, 2]]]), box)
    for name in names(measured):
        assert np.isfinite(cell_array(measured, name, "")).all()
    assert_array_equal(cell_array(measured, "Length", ""), [0, 10, 0])
    tortuosity = cell_array(measured, "Tortuosity", "")
    assert tortuosity[0] == tortuosity[2] == 1.0
    assert tortuosity[1] > 1e12


def straight_bundle(n=30, points=9):
    """Return fibres from the left to the right face of the box."""
    rng = np.random.default_rng(0)
    feet = np.column_stack([np.full(n, -50.0), rng.uniform(-28, 28, n), rng.uniform(-9, 9, n)])
    return lines_of([*(np.linspace(foot, np.add(foot, [100, 0, 0]), points) for foot in feet)])


@pytest.fixture
def closed_box(box):
    return (box >> vtkCleanPolyData()).update().output


def test_the_architecture_of_a_box_of_parallel_fibres(closed_box):
    measured = FibreMetrics(architecture=True)(straight_bundle(), closed_box)
    assert_allclose(field_array(measured, "MuscleVolume"), 120000, rtol=1e-9)
    assert_allclose(field_array(measured, "PCSA"), 1200, rtol=1e-9)
    assert_allclose(field_array(measured, "PCSALine"), 1200, rtol=1e-9)
    assert_allclose(field_array(measured, "LineOfAction"), [1, 0, 0], atol=1e-12)
    assert field_array(measured, "CentroidPath").shape == (21, 3)
    assert_allclose(field_array(measured, "CentroidPath")[:, 0], np.linspace(-50, 50, 21), atol=1e-9)
    assert_allclose(cell_array(measured, "LineAngle", ""), 0, atol=1e-6)


def test_the_table_has_a_row_per_fibre_and_a_column_per_measure(tmp_path):
    fibres = lines_of(np.array([[[0, 0, 0], [3, 0, 0], [3, 4, 0]], [[0, 0, 0], [0, 6, 0], [0, 11, 0.0]]]))
    with pytest.raises(ValueError, match="run FibreMetrics"):
        write_fibre_table(fibres, tmp_path / "fibres.csv")
    measured = FibreMetrics()(fibres)
    rows = list(csv.DictReader(write_fibre_table(measured, tmp_path / "fibres.csv").read_text().splitlines()))
    assert set(rows[0]) == {"Length", "Tortuosity"}
    for name in rows[0]:
        assert_allclose([float(row[name]) for row in rows], cell_array(measured, name, ""), rtol=1e-9)
