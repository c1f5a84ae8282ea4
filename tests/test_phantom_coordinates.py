"""Phantoms with two coordinates: lengths against what is measured at poses, moment arms against lengths."""

import numpy as np
import pytest
from phantom_oracles import moved_centres, slope, taut_length
from phantoms import spindle_over_ball, strap_over_two_joints
from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import blocks_of, points_of, surface_from, triangles_of
from vtkmuscle.data.attachments import attachments_of

# -------------------------------------------------------------------- over two joints


POSES = [(0.0, 0.0), (60.0, -20.0), (50.0, 60.0), (-40.0, 30.0), (20.0, 90.0), (-10.0, -20.0)]


@pytest.mark.parametrize("pose", POSES)
def test_strap_over_two_joints_is_as_long_as_a_string_over_its_rollers(pose):
    phantom = strap_over_two_joints(coordinates=[pose])
    lower_at_rest = np.array([-8.0, -100.0]) @ turn(-60.0).T
    lower = (phantom.motion.at(0.0)["middle"] @ [0.0, *lower_at_rest, 1.0])[1:3]
    start, end = moved_centres(phantom, 0.0)
    taut = taut_length(start, end, [((0.0, 0.0), 26.0), (lower, 18.0)], outward=(-1.0, -1.0))
    assert phantom.known["length"](*pose) == pytest.approx(taut, rel=1e-6)


def turn(degrees):
    """Return the rotation (2, 2) of (y, z) by flexion to the front."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, s], [-s, c]])


def test_moment_arms_over_two_joints_are_the_derivatives_of_the_length():
    known = strap_over_two_joints().known
    for upper, lower in POSES:
        about_upper = slope(lambda q, at=lower: known["length"](q, at), upper)
        about_lower = slope(lambda q, at=upper: known["length"](at, q), lower)
        assert known["moment_arm_upper"] == pytest.approx(-about_upper, abs=1e-5)
        assert known["moment_arm_lower"] == pytest.approx(-about_lower, abs=1e-5)


def test_coordinates_go_round_a_loop_and_belong_to_the_frames():
    phantom = strap_over_two_joints()
    upper, lower = phantom.known["coordinates"].values()
    assert len(upper) == len(lower) == len(phantom.motion.times)
    assert [upper.max(), lower.max()] == [50.0, 60.0]
    assert [upper[0], lower[0], upper[-1], lower[-1]] == [0.0] * 4
    assert np.abs(np.diff(upper)).max() == np.abs(np.diff(lower)).max() == 5.0
    # Frames of the same angles, on the way there and back, are the same pose.
    other = strap_over_two_joints(coordinates=[(50.0, 60.0), (0.0, 30.0)])
    for frame, place in ((0.0, 22), (1.0, 38)):
        for bone, transform in other.motion.at(frame).items():
            np.testing.assert_allclose(transform, phantom.motion.transforms[bone][place], atol=1e-12)


def test_two_joints_stay_together():
    phantom = strap_over_two_joints()
    lower_at_rest = np.array([0.0, *(turn(-60.0) @ [-8.0, -100.0]), 1.0])
    for time in phantom.motion.times:
        transforms = phantom.motion.at(time)
        np.testing.assert_allclose(transforms["middle"][:3, 3], 0.0, atol=1e-12)
        ends = [transforms[bone] @ lower_at_rest for bone in ("middle", "distal")]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ([(61.0, 0.0)], "upper is 61 degrees.*-40 to 60"),
        ([(0.0, -21.0)], "lower is -21 degrees.*-20 to 90"),
        ([(0.0, np.nan)], "lower is nan"),
        ([0.0, 1.0], r"of shape \(2,\).*upper and lower"),
    ],
)
def test_angles_without_known_answers_are_refused(poses, message):
    with pytest.raises(ValueError, match=message):
        strap_over_two_joints(coordinates=poses)


# -------------------------------------------------------------------- over a ball joint


def test_spindle_over_a_ball_is_as_long_as_the_way_between_its_moved_ends():
    phantom = spindle_over_ball()
    origin, insertion = (
        area.landmarks.mean(axis=0) for area in attachments_of(phantom.attachments["spindle"], "test")
    )
    poses = np.column_stack(list(phantom.known["coordinates"].values()))
    assert len(poses) == len(phantom.motion.times)
    assert len(np.unique(poses, axis=0)) == 25
    for time, pose in zip(phantom.motion.times, poses, strict=True):
        moved = apply_transform(phantom.motion.at(time)["distal"], insertion[None])[0]
        assert phantom.known["length"](*pose) == pytest.approx(np.linalg.norm(moved - origin), rel=1e-12)


def test_moment_arms_over_a_ball_are_the_derivatives_of_the_length():
    known = spindle_over_ball().known
    for flexion, abduction in [(0.0, 0.0), (35.0, -20.0), (60.0, 20.0), (-10.0, 7.0)]:
        about_flexion = slope(lambda q, at=abduction: known["length"](q, at), flexion)
        about_abduction = slope(lambda q, at=flexion: known["length"](at, q), abduction)
        arms = known["moment_arm_flexion"], known["moment_arm_abduction"]
        assert arms[0](flexion, abduction) == pytest.approx(-about_flexion, abs=1e-5)
        assert arms[1](flexion, abduction) == pytest.approx(-about_abduction, abs=1e-5)


def test_no_bone_is_in_the_straight_way_over_a_ball():
    corners = [(f, a) for f in (-10.0, 60.0) for a in (-20.0, 20.0)]
    phantom = spindle_over_ball(coordinates=corners)
    origin, insertion = (area.landmarks for area in attachments_of(phantom.attachments["spindle"], "test"))
    for time in phantom.motion.times:
        transform = phantom.motion.at(time)["distal"]
        ends = apply_transform(transform, insertion)
        # From 1 mm after each face on: the ends lie on the bones.
        parts = np.linspace(0.01, 0.99, 60)[:, None, None]
        ways = (origin + parts * (ends - origin)).reshape(-1, 3)
        for name, bone in blocks_of(phantom.bones):
            moved = transform if name in phantom.motion.transforms else np.eye(4)
            surface = surface_from(apply_transform(moved, points_of(bone)), triangles_of(bone, "test"))
            distance = vtkImplicitPolyDataDistance()
            distance.SetInput(surface)
            assert min(distance.EvaluateFunction(point) for point in ways) > 0.0, (name, time)
