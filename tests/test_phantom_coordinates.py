"""Phantoms with two coordinates: lengths against what is measured at poses, moment arms against lengths."""

import numpy as np
import pytest
from phantom_oracles import moved_centres, slope, taut_length
from phantoms import spindle_over_ball, strap_over_two_joints

from vtkmuscle.core.motion.rigid import apply_transform
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
