"""Errors of moment arms where other lengths have arms in other frames."""

from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle.accuracy.causes import Cause
from vtkmuscle.accuracy.estimates import arm_estimates
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about

ANGLES = np.linspace(0.0, 60.0, 25)
ARM, OFF = 30.0, 2.0


def lengths(arm):
    smooth = 200.0 - arm * np.radians(ANGLES)
    return np.column_stack([smooth, smooth + 5.0])


def arms(values):
    """Return moment arms; of the longer lever those of some frames are missing, as by several coordinates."""
    turns = np.array([rotation_about((0, 0, 0), (1, 0, 0), angle) for angle in ANGLES])
    coordinates = {"knee": Coordinate(ANGLES, "deg", "flexion")}
    found = joint_arms(values, RigidMotion(ANGLES, {"shank": turns}, coordinates=coordinates))[0]["knee"]
    if np.ptp(values[:, 0]) > ARM * np.radians(60.0) + 1e-6:
        kept = np.r_[1:10, 14:24]
        fields = ("frames", "values", "arms", "errors", "mean", "mean_error")
        found = replace(found, **{name: getattr(found, name)[kept] for name in fields})
    return {"knee": found}


@pytest.mark.parametrize(("own", "other"), [(ARM, ARM + OFF), (ARM + OFF, ARM)])
def test_arms_in_other_frames_leave_an_error_in_all_of_ours(own, other):
    found = arm_estimates(lengths(own), [Cause("segments", [lengths(other)])], arms)
    known = arms(lengths(own))["knee"]
    np.testing.assert_allclose(found["moment_arm_knee"].parts["segments"], np.full(len(known.mean), OFF))
    np.testing.assert_allclose(
        found["fibre_moment_arm_knee"].parts["segments"], np.full(known.arms.shape, OFF)
    )
