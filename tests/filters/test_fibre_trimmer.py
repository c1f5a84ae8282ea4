import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from shapes import lines_of, turns_of
from vtkmodules.vtkFiltersCore import vtkCleanPolyData, vtkTriangleFilter
from vtkmodules.vtkFiltersModeling import vtkLinearSubdivisionFilter
from vtkmodules.vtkFiltersSources import vtkCubeSource

from vtkmuscle import Scene
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import add_arrays, checked_surface, field_array, points_of
from vtkmuscle.data.attachments import AttachmentArea, attachments_from
from vtkmuscle.data.muscle_geometry import surface_of
from vtkmuscle.filters import FibreSmoother, FibreTemplateSource, FibreTrimmer, SliceMorpher, TemplateFitter

LENGTH = 80.0


@pytest.fixture(scope="module")
def muscle():
    """Return a bar along z, 20 x 20 x 80 mm, of small triangles."""
    cube = vtkCubeSource(x_length=20.0, y_length=20.0, z_length=LENGTH, center=(0, 0, LENGTH / 2))
    subdivide = vtkLinearSubdivisionFilter(number_of_subdivisions=4)
    return (cube >> vtkTriangleFilter() >> vtkCleanPolyData() >> subdivide).update().output


def ring(z, half=10.0):
    return np.column_stack([(np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * half), np.full(4, z)])


def areas(origin_z=10.0, insertion_z=70.0):
    return [
        AttachmentArea("origin", "pelvis", ring(origin_z), True),
        AttachmentArea("insertion", "femur", ring(insertion_z), True),
    ]


def fibres(n=30, count=16):
    """Return fibres that meet in the middle of both end faces, with arrays."""
    i, t = np.arange(n) + 0.5, np.linspace(0, 1, count)
    radius, angle = 9 * np.sqrt(i / n), np.pi * (1 + 5**0.5) * i
    feet = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * i])
    data = lines_of(feet[:, None] * np.sin(np.pi * t)[:, None] + LENGTH * t[:, None] * [0, 0, 1])
    add_arrays(data, points={"t": np.tile(t, n)}, cells={"FibreId": np.arange(n)}, fields={"FitError": 0.5})
    return data


def ends_of(data, n=30):
    points = points_of(data).reshape(n, -1, 3)
    return points[:, 0], points[:, -1]


def test_it_says_how_many_fibres_end_on_the_areas_as_they_are(muscle):
    led = FibreTrimmer()(fibres(), muscle, attachments_from(areas()))
    assert_array_equal(field_array(led, "EndsKept"), [0.0, 0.0])
    assert field_array(FibreTrimmer()(led, muscle, attachments_from(areas())), "EndsKept").min() > 0.9


def test_fibres_at_the_rim_of_an_area_keep_their_ends_or_share_all_of_it(muscle):
    feet = 9 * np.exp(2j * np.pi * np.arange(30) / 30)
    levels = LENGTH * np.linspace(0, 1, 16)
    rim = [np.column_stack([np.tile([foot.real, foot.imag], (16, 1)), levels]) for foot in feet]
    flat = attachments_from(areas(0.0, LENGTH))
    assert_array_equal(field_array(FibreTrimmer()(lines_of(rim), muscle, flat), "EndsKept"), [1.0, 1.0])
    for ends in ends_of(FibreTrimmer(end_rule="shared")(lines_of(rim), muscle, flat)):
        assert (np.linalg.norm(ends[:, :2], axis=1) < 6).sum() > 5


def test_several_areas_of_a_role_are_used_together(muscle):
    # Two areas side by side on the bottom face.
    quarter = np.array([[1, 9], [1, -9], [9, -9], [9, 9.0]])
    left, right = (np.column_stack([quarter * [side, 1], np.zeros(4)]) for side in (-1, 1))
    both = [
        AttachmentArea("origin", "pelvis", left, True),
        AttachmentArea("origin", "sacrum", right, True),
        areas()[1],
    ]
    starts, _ = ends_of(FibreTrimmer()(fibres(), muscle, attachments_from(both)))
    assert (starts[:, 0] < 0).any()
    assert (starts[:, 0] > 0).any()
    assert (np.abs(starts[:, 0]) > 0.5).all()


@pytest.mark.parametrize(("rule", "spread"), [("shared", 5.0), ("closest", 0.0)])
def test_an_open_curve_is_an_area_too(muscle, rule, spread):
    # A line attachment, as that of the gluteus maximus on the femur, along one side near the top.
    line = np.column_stack([np.full(5, 10.0), np.linspace(-5, 5, 5), np.full(5, 75.0)])
    data = attachments_from([areas()[0], AttachmentArea("insertion", "femur", line, False)])
    _, ends = ends_of(FibreTrimmer(end_rule=rule)(fibres(), muscle, data))
    assert_allclose(ends[:, 0], 10, atol=1e-6)
    assert np.ptp(ends[:, 1]) > spread
    assert np.abs(ends[:, 2] - 75.0).max() <= surface_of(muscle, "").geometry.mean_edge


def test_the_axis_of_the_template_is_used_where_there_is_one(muscle):
    # The centroids of these areas would give a slanted axis; with the template's, both planes are level.
    level = np.column_stack([np.full(4, -10.0), [-5, 5, 5, -5], [2, 2, 10, 10.0]])
    data = attachments_from([AttachmentArea("origin", "pelvis", level, True), areas()[1]])
    fibre = lines_of([np.linspace([0.0, 0, 0], [0, 0, LENGTH], 41)])
    transform = np.eye(4)
    transform[:3, 2] = [0, 0, LENGTH]
    add_arrays(fibre, fields={"Transform": transform.reshape(-1)})
    points = points_of(FibreTrimmer()(fibre, muscle, data))
    leaves = points[np.hypot(points[:, 0], points[:, 1]) > 1e-9]
    # The area is beside the fibre, so that twice the cut at the plane z = 10 turns least; with the slanted
    # axis twice the cut would be 16.9 mm.
    assert 17 < leaves[leaves[:, 2] < 40, 2].max() <= 20
    assert points[points[:, 2] > 20][:20, :2] == pytest.approx(0, abs=1e-9)


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["gluteus_medius", "iliacus"])
def test_fibres_of_a_real_muscle_stay_in_it_and_end_apart_without_sharp_turns(lhdl_hip, name):
    scene = Scene.load(lhdl_hip / "scene.toml")
    real, attachments = scene.muscles[name].surface, scene.attachments_data(name)
    fitted = TemplateFitter()(FibreTemplateSource(n_fibres=64)(), real, attachments)
    trimmed = FibreTrimmer()(SliceMorpher()(fitted, real, attachments), real, attachments)
    surface, points = solids_of(*checked_surface(real, "test")), points_of(trimmed)
    # The output's coordinates may round to either side of the surface.
    assert np.abs(surface.distances(points[surface.depth(points) == 0])).max() < 1e-5
    lines = points.reshape(64, -1, 3)
    for places in (lines[:, 0], lines[:, -1]):
        assert np.abs(surface.distances(places)).max() < 1e-5
        gaps = np.linalg.norm(places[:, None] - places[None], axis=2) + 1e9 * np.eye(len(places))
        assert gaps.min() > 0.3
    assert turns_of(points_of(FibreSmoother()(trimmed)).reshape(64, -1, 3)).max() < 60
