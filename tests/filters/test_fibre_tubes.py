import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from shapes import lines_of
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkMassProperties, vtkTriangleFilter

from vtkmuscle.data.arrays import add_arrays, cell_array, point_array, points_of
from vtkmuscle.filters.fibre_tubes import FibreTubes


def straight(length, points=5):
    return np.linspace([0, 0, 0], [length, 0, 0], points)


def test_a_tube_is_closed_and_has_the_volume_of_its_prism():
    tubes = FibreTubes(radius=2.0, sides=24)(lines_of([straight(30)]))
    mass = vtkMassProperties()
    mass.SetInputData((tubes >> vtkTriangleFilter()).update().output)
    mass.Update()
    polygon = 0.5 * 24 * 2.0**2 * np.sin(2 * np.pi / 24)
    assert_allclose(mass.GetVolume(), 30 * polygon, rtol=1e-9)


def test_scalars_of_points_and_cells_are_passed_on():
    fibres = lines_of([straight(30), straight(10, 3) + np.array([0, 9, 0])])
    arrays = {"t": points_of(fibres)[:, 0], "Normals": np.tile([1.0, 0.0, 0.0], (8, 1))}  # along the lines
    add_arrays(fibres, points=arrays, cells={"FibreId": np.array([4, 9])})
    fibres.GetPointData().SetActiveNormals("Normals")
    tubes = FibreTubes(radius=1.0)(fibres)
    assert_allclose(point_array(tubes, "t", ""), points_of(tubes)[:, 0], atol=1e-12)
    ids = cell_array(tubes, "FibreId", "")
    for cell in range(tubes.GetNumberOfCells()):
        assert ids[cell] == (9 if tubes.GetCell(cell).GetBounds()[2] > 5 else 4)


def test_a_fibre_without_length_gets_no_tube_and_the_others_keep_their_scalars():
    fibres = lines_of([[[3, 3, 3]] * 4, straight(30), [[0, 5, 0]]])
    add_arrays(fibres, cells={"FibreId": np.array([1, 2, 3])})
    tubes = FibreTubes()(fibres)
    assert set(cell_array(tubes, "FibreId", "")) == {2}
    assert_allclose(tubes.GetBounds()[:2], [0, 30])


steps = st.sampled_from([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, -1), (1e-13, 0, 0), (2, 3, 1)])


@settings(max_examples=60)
@given(walk=st.lists(steps, min_size=2, max_size=12))
def test_repeated_points_and_turns_back_make_no_nan(walk):
    lines = (np.cumsum(np.array(walk, dtype=float), axis=0), straight(5))
    tubes = FibreTubes(radius=0.3, sides=5)(lines_of(lines))
    assert np.isfinite(points_of(tubes)).all()
    assert_allclose(np.linalg.norm(vtk_to_numpy(tubes.GetPointData().GetNormals()), axis=1), 1.0, atol=1e-5)
