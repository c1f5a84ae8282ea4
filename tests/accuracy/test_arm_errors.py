"""Errors of moment arms: what others of them say, and what other lengths say by their slopes."""

from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle.accuracy.estimates import Cause, arm_estimates
from vtkmuscle.core.moment_arms.by_coordinate import JointArms

ANGLES = np.radians(np.linspace(0.0, 60.0, 25))
ARM, OFF = 30.0, 2.0


def arms(arm, slope=None):
    """Return moment arms of two paths, and slopes that may differ from them."""
    both = np.full((len(ANGLES), 2), arm)
    slopes = both if slope is None else np.full_like(both, slope)
    frames = np.arange(len(ANGLES))
    return {"knee": JointArms("knee", "deg", "flexion", frames, ANGLES, both, slopes, None, None)}


def lengths(arm):
    smooth = 200.0 - arm * ANGLES
    return np.column_stack([smooth, smooth + 5.0])


def slopes(name, of):
    assert name == "knee"
    return -np.gradient(of, ANGLES, axis=0)


@pytest.mark.parametrize(
    "cause",
    [
        Cause("segments", [lengths(ARM + OFF)]),
        Cause("segments", [lengths(ARM + OFF)], arms=[arms(ARM + OFF)]),
    ],
    ids=["lengths", "arms"],
)
def test_other_lengths_or_arms_leave_an_error_in_every_frame(cause):
    found = arm_estimates(arms(ARM), [cause], slopes)
    np.testing.assert_allclose(found["moment_arm_knee"].parts["segments"], np.full(len(ANGLES), OFF))
    np.testing.assert_allclose(
        found["each_moment_arm_knee"].parts["segments"], np.full((len(ANGLES), 2), OFF)
    )


def test_what_lever_and_slope_differ_by_bounds_the_error():
    found = arm_estimates(arms(ARM, ARM - OFF), [], slopes)
    np.testing.assert_allclose(found["moment_arm_knee"].parts["slopes"], 2.0 / np.sqrt(3.0) * OFF)


def test_a_slope_that_is_not_known_adds_nothing():
    (known,) = arms(ARM).values()
    known = {"knee": replace(known, slopes=np.full_like(known.arms, np.nan))}
    found = arm_estimates(known, [Cause("segments", [lengths(ARM + OFF)])], slopes)
    assert all(not part.any() for part in found["moment_arm_knee"].parts.values())
