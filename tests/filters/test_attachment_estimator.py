import numpy as np
import pytest
from phantoms import leg

from vtkmuscle import Scene
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.data import arrays
from vtkmuscle.data.attachments import attachments_from, attachments_of
from vtkmuscle.filters.attachment_estimator import AttachmentEstimator
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.io import read_surface


def estimate(muscle, bones, **parameters):
    return AttachmentEstimator(**parameters)(muscle, bones)


def fixed(*inputs):
    return arrays.point_array(FixedPointDetector()(*inputs), "FixedTo", "test")


def compared(muscle, bones, known):
    """Return for each bone: covered part of the true area, estimated area / true area, and centroids' gap."""
    points, triangles = arrays.checked_surface(muscle, "test")
    thirds = np.repeat(np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6, 3)
    weights = np.bincount(triangles.ravel(), thirds, len(points))
    estimated, true = (fixed(muscle, bones, areas) for areas in (estimate(muscle, bones), known))
    found = {}
    for index, (name, _) in enumerate(arrays.blocks_of(bones)):
        mine, theirs = estimated == index, true == index
        centres = [np.average(points[mask], axis=0, weights=weights[mask]) for mask in (mine, theirs)]
        found[name] = (
            weights[mine & theirs].sum() / weights[theirs].sum(),
            weights[mine].sum() / weights[theirs].sum(),
            np.linalg.norm(centres[0] - centres[1]),
        )
    return found


def test_the_ends_of_the_spindle_are_found(spindle):
    """Its flat ends lie on the bones; the estimate goes up its sides as far as they are near."""
    found = compared(spindle.muscles["spindle"], spindle.bones, spindle.attachments["spindle"])
    for covered, area, gap in found.values():
        assert covered > 0.9
        assert area < 2.0
        assert gap < 1.0


def test_a_muscle_that_overlaps_its_bones_is_attached_there(spindle):
    """By 4 mm: points that are inside of a bone do not face it."""
    bones = dict(arrays.blocks_of(spindle.bones))
    sunken = {}
    for name, bone in bones.items():
        points = arrays.points_of(bone)
        way = arrays.points_of(spindle.muscles["spindle"]).mean(axis=0) - points.mean(axis=0)
        sunken[name] = arrays.with_points(bone, points + 4.0 * way / np.linalg.norm(way))
    areas = attachments_of(estimate(spindle.muscles["spindle"], arrays.multiblock_from(sunken)), "test")
    assert {area.bone for area in areas} == set(bones)
    marked = fixed(spindle.muscles["spindle"], arrays.multiblock_from(sunken), attachments_from(areas))
    known = fixed(spindle.muscles["spindle"], spindle.bones, spindle.attachments["spindle"])
    for number in range(len(bones)):
        assert (marked[known == number] == number).mean() > 0.9


@pytest.mark.parametrize("muscle", ["gluteus_medius", "gluteus_maximus", "iliacus"])
def test_the_attachments_of_the_phantom_hip_are_covered(hip, muscle):
    """Muscles of the phantom lie on the bones beside their attachments too: the estimate is wider."""
    for covered, area, gap in compared(hip.muscles[muscle], hip.bones, hip.attachments[muscle]).values():
        assert covered > 0.7
        assert area < 3.0
        assert gap < 16.0


def test_both_bones_of_each_muscle_of_the_phantom_leg_are_found():
    """Four of them pass a joint, and lie on the bone between."""
    phantom = leg()
    for name, muscle in phantom.muscles.items():
        mine, true = (
            {area.bone for area in attachments_of(data, name)}
            for data in (estimate(muscle, phantom.bones), phantom.attachments[name])
        )
        assert mine == true, name


def test_areas_are_marked_as_estimated_and_have_roles(spindle):
    data = estimate(spindle.muscles["spindle"], spindle.bones)
    assert [arrays.field_array(block, "Estimated")[0] for _, block in arrays.blocks_of(data)] == [1, 1]
    areas = attachments_of(data, "test")
    assert [area.role for area in areas] == ["origin", "insertion"]
    assert all(area.estimated for area in areas)
    assert not any(area.estimated for area in attachments_of(spindle.attachments["spindle"], "test"))


def test_the_bone_of_the_origin_may_be_given(spindle):
    for bone in ("proximal", "distal"):
        areas = attachments_of(estimate(spindle.muscles["spindle"], spindle.bones, origin=bone), "test")
        assert {area.role: area.bone for area in areas}["origin"] == bone


@pytest.mark.realdata
@pytest.mark.parametrize(
    "name",
    [
        "adductor_brevis",
        *(pytest.param(name, marks=pytest.mark.long) for name in ("gluteus_medius", "iliacus")),
        pytest.param("gluteus_maximus", marks=pytest.mark.long),
    ],
)
@pytest.mark.slow
def test_estimates_of_a_real_muscle_cover_the_digitised_areas(lhdl_hip, name):
    scene = Scene.load(lhdl_hip / "scene.toml")
    found = compared(scene.muscles[name].surface, scene.bones_data(), scene.attachments_data(name))
    for bone, most in (("pelvis", 1.6), ("femur_r", 2.5)):
        covered, area, apart = found[bone]
        assert covered > 0.6, bone
        assert area < most, bone
        assert apart < 10.0, bone


@pytest.mark.realdata
def test_two_joint_muscles_are_attached_beyond_the_bone_they_slide_over(bp3d_knee):
    scene = Scene.load(bp3d_knee / "scene.toml")
    bones = scene.bones_data()
    for name, muscle in scene.muscles.items():
        true = {area.role: area.bone for area in muscle.attachments}
        areas = attachments_of(estimate(muscle.surface, bones), name)
        assert {area.bone for area in areas} == set(true.values()), name
        assert all(0.06 < area.confidence <= 0.64 for area in areas)
        named = attachments_of(estimate(muscle.surface, bones, **true), name)
        assert {area.role: area.bone for area in named} == true


@pytest.mark.realdata
def test_a_belly_whose_tendon_is_another_surface_is_refused(bp3d_knee):
    bones = Scene.load(bp3d_knee / "scene.toml").bones_data()
    muscle = read_surface(bp3d_knee / "muscles/gastrocnemius_medial.vtp")
    with pytest.raises(ValueError, match=r"extends 129 beyond .* 'shank', and ends at .*, 37.7 from"):
        estimate(muscle, bones)
