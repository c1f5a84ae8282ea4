"""Between VTK data sets and numpy arrays, and attachment areas as data."""

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersSources import vtkPlaneSource

from vtkmuscle.data import arrays, attachments
from vtkmuscle.data.paths import path_lines_of

POINTS = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
TRIANGLES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def lines_with_shared_points(**more):
    """Return two polylines of three points each that share one, listed out of order."""
    points = np.array([(0.0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 2, 0)])
    return pv.PolyData(points, lines=[3, 2, 1, 0, 3, 1, 3, 4], **more)


# -------------------------------------------------------------------- points and surfaces


def test_surface_of_faces_with_more_corners_is_refused():
    plane = vtkPlaneSource()
    plane.Update()
    with pytest.raises(ValueError, match=r"here: .*not triangles.*vtkTriangleFilter"):
        arrays.triangles_of(plane.GetOutput(), "here")


def test_surface_without_triangles_is_refused():
    with pytest.raises(ValueError, match="here: the surface has no triangles"):
        arrays.triangles_of(lines_with_shared_points(), "here")


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_surface_with_a_point_that_is_not_finite_is_refused_by_its_number(bad):
    points = POINTS.copy()
    points[2, 1] = bad
    with pytest.raises(ValueError, match=r"here: 1 point\(s\) are not finite, the first is point 2"):
        arrays.checked_surface(arrays.surface_from(points, TRIANGLES), "here")


def test_with_points_keeps_the_rest_but_normals_and_leaves_the_input():
    surface = pv.wrap(arrays.surface_from(POINTS, TRIANGLES)).compute_normals(split_vertices=False)
    arrays.add_arrays(surface, points={"FixedTo": np.arange(4)}, cells={"part": np.arange(4.0)})
    moved = arrays.with_points(surface, POINTS + 1)
    np.testing.assert_array_equal(arrays.points_of(surface), POINTS)
    np.testing.assert_array_equal(arrays.points_of(moved), POINTS + 1)
    assert moved.GetPointData().GetNormals() is moved.GetCellData().GetNormals() is None
    assert surface.GetPointData().GetNormals() is not None
    np.testing.assert_array_equal(arrays.point_array(moved, "FixedTo", "here"), np.arange(4))
    np.testing.assert_array_equal(arrays.cell_array(moved, "part", "here"), np.arange(4.0))


# -------------------------------------------------------------------- polylines


def test_polylines_that_share_points_get_their_own():
    lines = arrays.polylines_of(lines_with_shared_points(), "here")
    np.testing.assert_array_equal(lines.offsets, [0, 3, 6])
    np.testing.assert_array_equal(lines.line(0)[:, 0], [2, 1, 0])
    np.testing.assert_array_equal(lines.line(1)[:, 1], [0, 1, 2])


def test_a_copy_of_lines_puts_point_arrays_in_the_order_of_the_lines():
    data = lines_with_shared_points()
    cells, fields = {"FibreId": np.array([10, 11])}, {"Transform": np.arange(16.0)}
    arrays.add_arrays(data, points={"id": np.arange(5)}, cells=cells, fields=fields)
    data.GetPointData().AddArray(arrays.string_array("letter", "abcde"))
    data.GetPointData().SetActiveScalars("id")
    lines = arrays.polylines_of(data, "here")
    result = lines.moved(lines.points)
    assert result.GetPointData().GetScalars().GetName() == "id"
    letters = result.GetPointData().GetAbstractArray("letter")
    assert "".join(map(letters.GetValue, range(6))) == "cbabde"
    np.testing.assert_array_equal(arrays.point_array(result, "id", "here"), [2, 1, 0, 1, 3, 4])
    np.testing.assert_array_equal(arrays.cell_array(result, "FibreId", "here"), [10, 11])
    np.testing.assert_array_equal(arrays.field_array(result, "Transform"), np.arange(16.0))
    paths = path_lines_of(arrays.add_arrays(data, points={"RestPosition": 2.0 * arrays.points_of(data)}), "")
    np.testing.assert_array_equal(paths.rest, 2.0 * paths.points)


@pytest.mark.parametrize("offsets", [(0, 2, 5), (0, 3, 6)])
def test_lines_of_other_points_drop_point_arrays_only(offsets):
    data = lines_with_shared_points()
    arrays.add_arrays(data, points={"id": np.arange(5)}, cells={"FibreId": np.array([10, 11])})
    result = arrays.polylines_of(data, "here").moved(np.zeros((offsets[-1], 3)), np.array(offsets))
    assert not result.GetPointData().HasArray("id")
    np.testing.assert_array_equal(arrays.cell_array(result, "FibreId", "here"), [10, 11])


def test_polylines_among_other_cells_are_refused():
    with pytest.raises(ValueError, match=r"here: 1 cell\(s\) are not polylines"):
        arrays.polylines_of(lines_with_shared_points(verts=[1, 0]), "here")
    lines = lines_with_shared_points()
    lines.GetLines().InsertNextCell(0)
    with pytest.raises(ValueError, match="here: a polyline has no points; remove the cell"):
        arrays.polylines_of(lines, "here")


# -------------------------------------------------------------------- arrays


def test_arrays_are_copied_in_and_read_only_out():
    surface, values = arrays.surface_from(POINTS, TRIANGLES), np.arange(4.0)
    arrays.add_arrays(surface, points={"a": values})
    values[:] = 7.0
    view = arrays.point_array(surface, "a", "here")
    np.testing.assert_array_equal(view, np.arange(4.0))
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0


@pytest.mark.parametrize(("get", "kind"), [(arrays.point_array, "point"), (arrays.cell_array, "cell")])
def test_missing_array_is_named(get, kind):
    with pytest.raises(ValueError, match=f"here: the {kind} array 'FixedTo' is missing"):
        get(arrays.surface_from(POINTS, TRIANGLES), "FixedTo", "here")


def test_field_arrays_hold_numbers_and_strings():
    data = vtkPolyData()
    arrays.add_arrays(data, fields={"FitError": 1.5, "Bone": "fémur droit"})
    np.testing.assert_array_equal(arrays.field_array(data, "FitError"), [1.5])
    assert arrays.field_string(data, "Bone") == "fémur droit"
    assert arrays.field_array(data, "nothing") is None
    assert arrays.field_string(data, "nothing") is None
    assert arrays.field_string(data, "FitError") is None


# -------------------------------------------------------------------- blocks


def test_blocks_without_names_are_called_by_number():
    data = vtkMultiBlockDataSet()
    data.SetBlock(1, vtkPolyData())
    assert [name for name, _ in arrays.blocks_of(data)] == ["0", "1"]
    assert arrays.blocks_of(data)[0][1] is None


# -------------------------------------------------------------------- attachment areas

TRIANGLE = np.array([(0.0, 0.0, 1.0), (4.0, 0.0, 1.0), (0.0, 4.0, 1.0)])


def test_attachment_areas_round_trip():
    areas = [
        attachments.AttachmentArea("origin", "pelvis", POINTS, closed=True),
        attachments.AttachmentArea("insertion", "femur", POINTS + 1, closed=False),
        attachments.AttachmentArea("origin", "sacrum", POINTS + 2, closed=True),
        attachments.AttachmentArea("via", "femur", TRIANGLE, closed=True),
    ]
    back = attachments.attachments_of(attachments.attachments_from(areas), "here")
    assert [(a.role, a.bone, a.closed) for a in back] == [(a.role, a.bone, a.closed) for a in areas]
    for one, other in zip(areas, back, strict=True):
        np.testing.assert_array_equal(one.landmarks, other.landmarks)


def test_ends_and_via_rings_are_told_apart():
    areas = [
        attachments.AttachmentArea("via", "femur", TRIANGLE, closed=True),
        attachments.AttachmentArea("origin", "pelvis", POINTS, closed=True),
        attachments.AttachmentArea("insertion", "femur", POINTS + 1, closed=False),
    ]
    data = attachments.attachments_from(areas)
    assert [area.role for area in attachments.attachments_of(data, "here")] == ["via", "origin", "insertion"]
    assert [area.role for area in attachments.end_areas(data, "here")] == ["origin", "insertion"]
    (ring,) = attachments.via_rings_of(data, "here")
    assert ring.role == "via"


@pytest.mark.parametrize(
    ("ring", "message"),
    [
        (
            attachments.AttachmentArea("via", "femur", TRIANGLE, closed=False),
            "must be closed; end the polyline",
        ),
        (attachments.AttachmentArea("via", "femur", TRIANGLE[[0, 1, 1]], closed=True), "3 landmarks or more"),
        (attachments.AttachmentArea("via", "femur", TRIANGLE * [1, 0.001, 1], closed=True), "on a line"),
    ],
)
def test_a_via_ring_that_is_none_is_refused_with_its_block(ring, message):
    with pytest.raises(ValueError, match=f"here, block 'via_0': .*{message}"):
        attachments.attachments_of(attachments.attachments_from([ring]), "here")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda block: block.SetPoints(vtkPoints()), "no landmarks"),
        (lambda block: arrays.add_arrays(block, fields={"Role": "middle"}), "'Role' is 'middle'.*'origin'"),
        (lambda block: block.GetFieldData().RemoveArray("Role"), "'Role' is None"),
        (lambda block: block.GetFieldData().RemoveArray("Bone"), "'Bone'"),
        (lambda block: block.GetPoints().SetPoint(1, np.nan, 0, 0), "not finite"),
    ],
)
def test_bad_attachment_is_refused_with_its_block(change, message):
    data = attachments.attachments_from(
        [
            attachments.AttachmentArea("origin", "a", POINTS, closed=True),
            attachments.AttachmentArea("insertion", "b", POINTS, closed=True),
        ]
    )
    change(data.GetBlock(1))
    with pytest.raises(ValueError, match=f"here, block 'insertion_1'.*{message}"):
        attachments.attachments_of(data, "here")
