"""A deformer that keeps its muscle out of its neighbours, and a scene that does."""

from dataclasses import replace

import numpy as np
import pytest

from examples import ball_beside
from vtkmuscle import Muscle, Scene, SceneError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data import arrays
from vtkmuscle.data.muscle_geometry import outward_tree
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.pipelines import deform


def depth(points, other):
    return outward_tree(*arrays.checked_surface(other, "test")).depth(points)


def pressing(shift=0.0):
    """Return a ball that has moved into the spindle by 9 mm, from beside it or from a little in it."""
    moved = np.array([0.0, -10.0, 0.0])
    ball = arrays.with_points(ball_beside(), arrays.points_of(ball_beside()) + moved + [0.0, shift, 0.0])
    arrays.add_arrays(ball, points={"Displacement": np.tile(moved, (ball.GetNumberOfPoints(), 1))})
    return ball


def chain(spindle, neighbours=None, **solver):
    motion = RigidMotion(np.array([0.0, 1.0]), {"distal": np.array([np.eye(4)] * 2)})
    deformer = deform(
        spindle.muscles["spindle"], spindle.bones, motion, spindle.attachments["spindle"], **solver
    )
    if neighbours is not None:
        deformer.neighbours = neighbours
    return deformer


def test_a_muscle_gives_way_to_its_neighbour_and_keeps_its_volume(spindle):
    ball = pressing()
    rest = arrays.points_of(spindle.muscles["spindle"])
    assert depth(rest, ball).max() > 2.0
    output = chain(spindle, arrays.multiblock_from({"ball": ball}), iterations=30).update(time=1.0).output
    assert depth(arrays.points_of(output), ball).max() < 0.05
    volumes = [
        signed_volume(points, arrays.triangles_of(output, "")) for points in (arrays.points_of(output), rest)
    ]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-9)
    assert np.linalg.norm(arrays.points_of(output) - rest, axis=1).max() > 2.0


def test_points_stay_as_deep_as_they_are_at_rest(spindle):
    rest = arrays.points_of(spindle.muscles["spindle"])
    ball = pressing()
    arrays.add_arrays(ball, points={"Displacement": np.zeros((ball.GetNumberOfPoints(), 3))})
    output = chain(spindle, arrays.multiblock_from({"ball": ball})).update(time=1.0).output
    np.testing.assert_allclose(arrays.points_of(output), rest, atol=1e-6)


def test_a_neighbour_that_is_far_away_changes_nothing(spindle):
    alone = arrays.points_of(chain(spindle).update(time=1.0).output)
    beside = chain(spindle, arrays.multiblock_from({"ball": pressing(500.0)})).update(time=1.0).output
    np.testing.assert_array_equal(arrays.points_of(beside), alone)


def test_another_neighbour_counts_by_its_own_depth_at_rest(spindle):
    still, moved = pressing(), arrays.multiblock_from({"ball": pressing()})
    arrays.add_arrays(still, points={"Displacement": np.zeros((still.GetNumberOfPoints(), 3))})
    deformer = chain(spindle, arrays.multiblock_from({"ball": still}))
    deformer.update(time=1.0)
    deformer.neighbours = moved
    fresh = arrays.points_of(chain(spindle, moved).update(time=1.0).output)
    np.testing.assert_array_equal(arrays.points_of(deformer.update(time=1.0).output), fresh)


#: The second muscle is beside the bones that it is said to be on.
BESIDE_ITS_BONES = pytest.mark.filterwarnings("ignore:scene. muscles.front.* the landmarks are")


def two_spindles(contact, *, apart=33.0):
    """Return a spindle over a hinge and before it a second one, so far off (they are 32 mm thick)."""
    phantom = Scene.from_phantom(spindle_over_hinge())
    back = replace(phantom.muscles["spindle"], fibres=None)
    shift = np.array([0.0, -apart, 0.0])
    front = Muscle(
        arrays.with_points(back.surface, arrays.points_of(back.surface) + shift),
        tuple(replace(area, landmarks=area.landmarks + shift) for area in back.attachments),
    )
    motion = RigidMotion(
        phantom.motion.times[::6], {bone: table[::6] for bone, table in phantom.motion.transforms.items()}
    )
    return Scene("two", phantom.bones, {"front": front, "back": back}, motion, muscle_contact=contact)


@BESIDE_ITS_BONES
@pytest.mark.parametrize(("apart", "at_rest"), [(33.0, 0.0), (31.0, 0.99)])
def test_a_scene_reports_overlap_and_contact_takes_away_what_is_more_than_at_rest(apart, at_rest):
    frames = {}
    for contact in ("measure", "on"):
        report = two_spindles(contact, apart=apart).run().report["muscles"]
        assert all(row["overlapping_points"] == 0 for row in report["front"]["frames"])
        frames[contact] = report["back"]["frames"]
    before, after = frames["measure"][-1], frames["on"][-1]
    assert before["overlap_max_mm"] > at_rest + 1.5
    assert before["overlapping_points"] > 15
    assert after["overlap_max_mm"] < at_rest + 0.05
    assert after["overlap_p95_mm"] <= after["overlap_max_mm"]
    assert after["volume_ratio"] == pytest.approx(1.0, abs=1e-3)


@BESIDE_ITS_BONES
def test_without_contact_no_overlap_is_measured():
    report = replace(two_spindles("off")).run(frames="0:1").report["muscles"]
    assert "overlap_max_mm" not in report["back"]["frames"][0]


def test_the_key_of_a_scene_is_checked_and_written(tmp_path):
    assert Scene.load(two_spindles("on").save(tmp_path)).muscle_contact == "on"
    with pytest.raises(SceneError, match=r"muscle_contact: must be 'off', 'on' or 'measure', not 'yes'"):
        two_spindles("yes")
