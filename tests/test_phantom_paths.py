"""Phantoms with known paths: lengths against an independent taut string, moment arms against lengths."""

import numpy as np
import pytest
from taut_oracle import taut_length

from vtkmuscle.core.rigid import apply_transform
from vtkmuscle.filters.arrays import points_of
from vtkmuscle.filters.attachments import attachments_of
from vtkmuscle.phantoms import lifting_strap
from vtkmuscle.phantoms.planar import String, evenly


def moved_centres(phantom, time):
    """Return (y, z) of the centres of the origin and the insertion landmarks at a time, origin first."""
    (areas,) = phantom.attachments.values()
    transforms = phantom.motion.at(time)
    return [
        apply_transform(transforms.get(area.bone, np.eye(4)), area.landmarks).mean(axis=0)[1:]
        for area in attachments_of(areas, "test")
        if area.role != "via"
    ]


def slope(length, angle, step=1e-4):
    return (length(angle + step) - length(angle - step)) / (2.0 * np.radians(step))


# -------------------------------------------------------------------- a string past a circle


def test_a_string_is_as_long_as_the_hull_of_its_circle_says(rng):
    wraps = []
    for _ in range(60):
        ends = np.array([[0.0, 6.0], [0.0, -6.0]]) + rng.uniform(-4.0, 4.0, (2, 2))
        string = String(*ends, np.zeros(2), 1.5, 1)
        taut = taut_length(*ends, [((0.0, 0.0), 1.5)], outward=(-1.0, 0.0))
        assert string.length == pytest.approx(taut, rel=1e-6)
        wraps.append(string.wrap)
    assert 10 < np.count_nonzero(wraps) < 50


def test_a_string_pulls_along_itself(rng):
    for _ in range(20):
        ends = np.array([[0.0, 6.0], [0.0, -6.0]]) + rng.uniform(-4.0, 4.0, (2, 2))
        string = String(*ends, np.zeros(2), 1.5, 1)
        for axis in np.eye(2):
            longer, shorter = (
                String(ends[0], ends[1] + s * axis, np.zeros(2), 1.5, 1) for s in (1e-5, -1e-5)
            )
            assert -string.pull @ axis == pytest.approx((longer.length - shorter.length) / 2e-5, abs=1e-4)


def test_points_of_a_string_are_as_long_as_it_is_and_stay_out_of_the_circle():
    string = String(np.array([-3.0, 5.0]), np.array([4.0, -5.0]), np.zeros(2), 2.0, 1)
    points = string.points(0.01)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(string.length, rel=1e-5)
    assert np.linalg.norm(points, axis=1).min() == pytest.approx(2.0, abs=1e-4)
    np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), 0.01, rtol=0.01)


def test_evenly_keeps_the_ends():
    chain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 5.0]])
    np.testing.assert_array_equal(evenly(chain, 0.7)[[0, -1]], chain[[0, -1]])


# -------------------------------------------------------------------- a strap that lifts off


@pytest.mark.parametrize("angle", [0.0, 12.0, 29.0, 30.0, 33.0, 50.0, 70.0])
def test_lifting_strap_is_as_long_as_a_string_past_its_roller(angle):
    phantom = lifting_strap()
    start, end = moved_centres(phantom, angle)
    taut = taut_length(start, end, [((0.0, 0.0), 25.0)], outward=(-1.0, 0.0))
    assert phantom.known["length"](angle) == pytest.approx(taut, rel=1e-6)
    if angle > phantom.known["lift_off"]:
        assert taut == pytest.approx(np.linalg.norm(end - start), rel=1e-12)
    elif angle < phantom.known["lift_off"]:
        assert taut > np.linalg.norm(end - start) + 1e-4


@pytest.mark.parametrize("depth", [-5.0, 0.0, 3.0])
def test_lifting_straps_moment_arm_is_the_derivative_of_its_length(depth):
    known = lifting_strap().known
    for angle in (0.0, 15.0, 29.0, 31.0, 45.0, 70.0):
        arm = known["moment_arm"](angle, depth)
        assert arm == pytest.approx(-slope(lambda q: known["length"](q, depth), angle), abs=1e-5)
        if angle <= known["lift_off"]:
            assert arm == pytest.approx(25.0 + depth, rel=1e-12)
        else:
            assert arm > 25.0 + depth + 0.5


def test_lifting_strap_lies_on_its_roller_and_nowhere_else():
    points = points_of(lifting_strap().muscles["strap"])
    touching = points[np.hypot(points[:, 1], points[:, 2]) < 20.05]
    turn = np.degrees(np.arctan2(-touching[:, 2], -touching[:, 1]))
    assert len(touching) > 30
    assert turn.min() > -5.0
    assert turn.max() < 35.0
    assert np.hypot(points[:, 1], points[:, 2]).min() > 19.95
