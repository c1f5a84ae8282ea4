"""Surfaces are read exactly, and what cannot be read gives one error that names file and mend."""

import numpy as np
import pytest
from vtkmodules.util.vtkConstants import VTK_DOUBLE
from vtkmodules.vtkCommonCore import vtkIdList
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkStripper
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkIOGeometry import vtkOBJWriter, vtkSTLWriter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter

from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of, vtk_points, with_points
from vtkmuscle.io import SURFACE_SUFFIXES, read_polydata, read_surface, write_polydata

WRITERS = {".vtk": vtkPolyDataWriter, ".stl": vtkSTLWriter, ".obj": vtkOBJWriter, ".ply": vtkPLYWriter}


@pytest.fixture
def ball():
    source = vtkSphereSource(radius=10.0, center=(1.0, 2.0, 3.0))
    source.Update()
    surface = source.GetOutput()
    surface.GetPointData().Initialize()
    # What float32 files can hold, so that all formats must give it back alike.
    return with_points(surface, points_of(surface).astype(np.float32).astype(float))


def written(ball, path):
    if path.suffix == ".vtp":
        write_polydata(path, ball)
    else:
        writer = WRITERS[path.suffix]()
        writer.SetInputData(ball)
        writer.SetFileName(str(path))
        writer.Write()
    return path


@pytest.mark.parametrize("suffix", SURFACE_SUFFIXES)
def test_every_format_gives_the_closed_surface_back(suffix, ball, tmp_path):
    surface = read_surface(written(ball, tmp_path / f"ball{suffix}"))
    points, triangles = points_of(surface), triangles_of(surface, suffix)
    report = survey(points, triangles)
    assert report.closed
    assert report.n_triangles == ball.GetNumberOfCells()
    assert report.volume == pytest.approx(
        survey(points_of(ball), triangles_of(ball, "ball")).volume, rel=1e-5
    )
    assert surface.GetPoints().GetDataType() == VTK_DOUBLE


def test_a_suffix_in_capitals_is_read(ball, tmp_path):
    assert read_surface(written(ball, tmp_path / "ball.stl").rename(tmp_path / "BALL.STL")).GetNumberOfPolys()


def test_triangle_strips_become_triangles(ball, tmp_path):
    stripper = vtkStripper()
    stripper.SetInputData(ball)
    stripper.Update()
    assert stripper.GetOutput().GetNumberOfStrips()
    surface = read_surface(written(stripper.GetOutput(), tmp_path / "strips.vtk"))
    assert len(triangles_of(surface, "strips")) == ball.GetNumberOfCells()


def test_lines_beside_the_triangles_are_left_out(ball, tmp_path):
    mixed = vtkPolyData()
    mixed.DeepCopy(ball)
    line = vtkIdList()
    line.InsertNextId(0)
    line.InsertNextId(1)
    lines = vtkPolyData()
    lines.Allocate(1)
    mixed.SetLines(lines.GetLines())
    mixed.InsertNextCell(3, line)
    surface = read_surface(written(mixed, tmp_path / "mixed.vtp"))
    assert surface.GetNumberOfCells() == ball.GetNumberOfCells()


@pytest.mark.parametrize("suffix", SURFACE_SUFFIXES)
@pytest.mark.parametrize(
    "content", [b"", b"hello\n" * 20, bytes(range(256)) * 9], ids=["empty", "text", "bytes"]
)
def test_a_file_that_is_not_what_its_suffix_says_gives_one_error(suffix, content, tmp_path, capfd):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"bad\.\w+: .*export it again"):
        read_surface(path)
    assert capfd.readouterr() == ("", "")


def test_a_truncated_file_gives_an_error(ball, tmp_path, capfd):
    path = written(ball, tmp_path / "cut.vtp")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match=r"cut\.vtp: .*export it again"):
        read_surface(path)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_is_named_with_its_neighbours(ball, tmp_path):
    written(ball, tmp_path / "ball.stl")
    with pytest.raises(FileNotFoundError, match=r"bal\.stl: there is no such file; files there: ball\.stl"):
        read_surface(tmp_path / "bal.stl")


def test_a_folder_is_not_a_file(tmp_path):
    (tmp_path / "x.vtp").mkdir()
    with pytest.raises(FileNotFoundError, match="a folder, not a file"):
        read_surface(tmp_path / "x.vtp")


def test_an_unknown_suffix_is_answered_with_the_known_ones(tmp_path):
    with pytest.raises(ValueError, match=r"'\.3mf' is not one of \.vtp, \.vtk"):
        read_surface(tmp_path / "x.3mf")


def test_a_volume_mesh_is_refused_with_the_mend(tmp_path):
    grid = vtkUnstructuredGrid()
    grid.SetPoints(vtk_points(np.eye(3)))
    writer = vtkUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(str(tmp_path / "grid.vtk"))
    writer.Write()
    with pytest.raises(ValueError, match=r"vtkUnstructuredGrid, not a surface; save its surface"):
        read_polydata(tmp_path / "grid.vtk")


def test_a_cell_that_names_a_missing_point_is_refused(tmp_path):
    path = tmp_path / "ids.vtp"
    write_polydata(path, surface_from(np.eye(3), np.array([[0, 1, 7]])))
    with pytest.raises(ValueError, match="names point 7, but there are 3 points"):
        read_polydata(path)


def test_points_without_triangles_are_no_surface(tmp_path):
    cloud = vtkPolyData()
    cloud.SetPoints(vtk_points(np.eye(3)))
    write_polydata(tmp_path / "cloud.vtp", cloud)
    with pytest.raises(ValueError, match="holds no triangles"):
        read_surface(tmp_path / "cloud.vtp")


def test_doubles_come_back_bit_for_bit(rng_points, tmp_path):
    surface = surface_from(rng_points, np.array([[0, 1, 2]]))
    write_polydata(tmp_path / "exact.vtp", surface)
    np.testing.assert_array_equal(points_of(read_surface(tmp_path / "exact.vtp")), rng_points)


@pytest.fixture
def rng_points():
    return np.random.default_rng(1).normal(size=(50, 3)) * 10.0 ** np.arange(-25, 25)[:, None]
