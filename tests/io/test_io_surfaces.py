"""Surfaces are read exactly, and what cannot be read gives one error that names file and mend."""

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkFiltersCore import vtkStripper
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.data.arrays import points_of, surface_from, triangles_of
from vtkmuscle.io import SURFACE_SUFFIXES, read_polydata, read_surface, write_polydata


@pytest.fixture
def ball():
    return vtkSphereSource(radius=10.0, center=(1.0, 2.0, 3.0)).update().output


def test_triangle_strips_become_triangles(ball, tmp_path):
    strips = vtkStripper(input_data=ball).update().output
    assert strips.GetNumberOfStrips()
    write_polydata(tmp_path / "strips.vtp", strips)
    surface = read_surface(tmp_path / "strips.vtp")
    assert len(triangles_of(surface, "strips")) == ball.GetNumberOfCells()


def test_lines_beside_the_triangles_are_left_out(ball, tmp_path):
    mixed = pv.PolyData(points_of(ball), faces=pv.wrap(ball).faces, lines=[2, 0, 1])
    write_polydata(tmp_path / "mixed.vtp", mixed)
    surface = read_surface(tmp_path / "mixed.vtp")
    assert surface.GetNumberOfCells() == ball.GetNumberOfCells()


@pytest.mark.parametrize("suffix", SURFACE_SUFFIXES)
@pytest.mark.parametrize("content", [b"", bytes(range(256)) * 9], ids=["empty", "bytes"])
def test_a_file_that_is_not_what_its_suffix_says_gives_one_error(suffix, content, tmp_path, capfd):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"bad\.\w+: .*export it again"):
        read_surface(path)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_is_named_with_its_neighbours(tmp_path):
    (tmp_path / "ball.stl").touch()
    with pytest.raises(FileNotFoundError, match=r"bal\.stl: there is no such file; .*ball\.stl"):
        read_surface(tmp_path / "bal.stl")


def test_an_unknown_suffix_is_answered_with_the_known_ones(tmp_path):
    with pytest.raises(ValueError, match=r"'\.3mf' is not one of \.vtp, \.vtk"):
        read_surface(tmp_path / "x.3mf")


def test_a_volume_mesh_is_refused_with_the_mend(tmp_path):
    pv.Sphere().delaunay_3d().save(tmp_path / "grid.vtk")
    with pytest.raises(ValueError, match=r"vtkUnstructuredGrid, not a surface; save its surface"):
        read_polydata(tmp_path / "grid.vtk")


def test_points_without_triangles_are_no_surface(tmp_path):
    write_polydata(tmp_path / "cloud.vtp", pv.PolyData(np.eye(3)))
    with pytest.raises(ValueError, match="holds no triangles"):
        read_surface(tmp_path / "cloud.vtp")


def test_doubles_come_back_bit_for_bit(rng, tmp_path):
    points = rng.normal(size=(50, 3)) * 10.0 ** np.arange(-25, 25)[:, None]
    write_polydata(tmp_path / "exact.vtp", surface_from(points, np.array([[0, 1, 2]])))
    np.testing.assert_array_equal(points_of(read_surface(tmp_path / "exact.vtp")), points)
