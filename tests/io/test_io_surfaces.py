"""Surfaces are read exactly, and what cannot be read gives one error that names file and mend."""

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkFiltersCore import vtkStripper
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkIOGeometry import vtkGLTFWriter

from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.data.arrays import multiblock_from, point_array, points_of, surface_from, triangles_of
from vtkmuscle.io import SURFACE_SUFFIXES, read_polydata, read_surface, write_polydata


@pytest.fixture
def ball():
    return vtkSphereSource(radius=10.0, center=(1.0, 2.0, 3.0)).update().output


def test_triangle_strips_become_triangles(ball, tmp_path):
    strips = vtkStripper(input_data=ball).update().output
    assert strips.GetNumberOfStrips()
    write_polydata(tmp_path / "strips.vtp", strips)
    with pytest.warns(UserWarning, match="polygons were split into 96 triangles"):
        surface = read_surface(tmp_path / "strips.vtp")
    assert len(triangles_of(surface, "strips")) == ball.GetNumberOfCells()


def test_lines_beside_the_triangles_are_left_out(ball, tmp_path):
    mixed = pv.PolyData(points_of(ball), faces=pv.wrap(ball).faces, lines=[2, 0, 1])
    write_polydata(tmp_path / "mixed.vtp", mixed)
    assert read_surface(tmp_path / "mixed.vtp").GetNumberOfCells() == ball.GetNumberOfCells()


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
    (tmp_path / "bal.stl").symlink_to("gone.stl")
    with pytest.raises(FileNotFoundError, match=r"bal\.stl: the link leads to gone\.stl, which is missing"):
        read_surface(tmp_path / "bal.stl")


def test_an_unknown_suffix_is_answered_with_the_known_ones(tmp_path):
    with pytest.raises(ValueError, match=r"'\.3mf' is not one of \.vtp, \.vtk"):
        read_surface(tmp_path / "x.3mf")
    with pytest.raises(ValueError, match="a label map goes to vtkmuscle from-labels"):
        read_surface(tmp_path / "hip.nii.gz")


def volume(ball):
    """Return tetrahedra from the centre of a ball."""
    points = np.vstack([points_of(ball), [[1.0, 2.0, 3.0]]])
    corners = np.insert(triangles_of(ball, "ball"), 3, len(points) - 1, axis=1)
    return pv.UnstructuredGrid({pv.CellType.TETRA: corners}, points)


def test_a_volume_mesh_is_read_as_its_outer_surface(ball, tmp_path):
    for name in ("ball.vtu", "ball.vtk"):
        volume(ball).save(tmp_path / name)
        assert survey_of(read_surface(tmp_path / name)).closed
    pv.ImageData(dimensions=(2, 2, 2)).save(tmp_path / "image.vtk")
    with pytest.raises(ValueError, match="vtkStructuredPoints, not a surface; save a surface mesh"):
        read_polydata(tmp_path / "image.vtk")


def survey_of(surface):
    return survey(points_of(surface), triangles_of(surface, "surface"))


@pytest.mark.parametrize("suffix", [".off", ".glb", ".gltf"])
def test_meshes_of_modellers_are_read(ball, tmp_path, suffix):
    path, points, triangles = tmp_path / f"ball{suffix}", points_of(ball), triangles_of(ball, "ball")
    if suffix == ".off":
        rows = ["OFF", f"{len(points)} {len(triangles)} 0", *(" ".join(map(str, row)) for row in points)]
        path.write_text("\n".join([*rows, *(f"3 {a} {b} {c}" for a, b, c in triangles), ""]))
    else:
        writer = vtkGLTFWriter(file_name=str(path), inline_data=True)
        writer.SetInputData(multiblock_from({"scene": multiblock_from({"ball": ball})}))
        writer.Write()
    surface = read_surface(path)
    assert survey_of(surface).closed
    np.testing.assert_allclose(points_of(surface).mean(axis=0), points.mean(axis=0), atol=1e-5)


def test_corners_of_flat_normals_are_joined_and_polygons_split(tmp_path):
    """As a modeller writes a box: quads, and each corner a point of its own."""
    box = pv.Box((0.0, 1.0, 0.0, 2.0, 0.0, 3.0))
    box.point_data["Number"] = np.arange(box.n_points)
    corners = box.points[box.regular_faces].reshape(-1, 3)
    split = pv.PolyData.from_regular_faces(corners, np.arange(24).reshape(6, 4))
    split.point_data["Number"] = np.arange(24)
    write_polydata(tmp_path / "box.vtp", split)
    with pytest.warns(UserWarning, match=r"6 polygons were split into 12 triangles; 24 points .* to 8"):
        surface = read_surface(tmp_path / "box.vtp")
    report = survey_of(surface)
    assert (report.closed, report.n_components, report.volume) == (True, 1, pytest.approx(6.0))
    numbers = point_array(surface, "Number", "box")
    np.testing.assert_array_equal(points_of(surface), corners[numbers])


def test_closed_pieces_that_touch_stay_apart(ball, tmp_path):
    """Joined, both balls would be one surface that is not manifold at a point."""
    points, triangles = points_of(ball), triangles_of(ball, "ball")
    first, second = points.argmax(axis=0)[2], points.argmin(axis=0)[2]
    moved = points + points[first] - points[second]
    both = surface_from(np.vstack([points, moved]), np.vstack([triangles, triangles + len(points)]))
    write_polydata(tmp_path / "both.vtp", both)
    assert read_surface(tmp_path / "both.vtp").GetNumberOfPoints() == 2 * len(points)


def test_points_without_triangles_are_no_surface(tmp_path):
    write_polydata(tmp_path / "cloud.vtp", pv.PolyData(np.eye(3)))
    with pytest.raises(ValueError, match="holds no triangles"):
        read_surface(tmp_path / "cloud.vtp")


def test_doubles_come_back_bit_for_bit(rng, tmp_path):
    points = rng.normal(size=(50, 3)) * 10.0 ** np.arange(-25, 25)[:, None]
    write_polydata(tmp_path / "exact.vtp", surface_from(points, np.array([[0, 1, 2]])))
    np.testing.assert_array_equal(points_of(read_surface(tmp_path / "exact.vtp")), points)
