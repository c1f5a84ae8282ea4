"""Errors of lengths and moment arms from landmarks that are moved about."""

from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle import Scene, landmark_errors
from vtkmuscle.phantoms import hip


@pytest.fixture(scope="module")
def scene():
    whole = Scene.from_phantom(hip(), n_fibres=6, resolution=8)
    muscles = {"gluteus_medius": whole.muscles["gluteus_medius"]}
    every = range(0, len(whole.motion.times), 6)
    return replace(whole, muscles=muscles, motion=whole.motion.part(every))


@pytest.fixture(scope="module")
def moved_by_5_mm(scene):
    return landmark_errors(scene, samples=3)["gluteus_medius"]


def test_errors_are_of_each_frame_and_value_and_the_same_again(scene, moved_by_5_mm):
    assert moved_by_5_mm.lengths.shape == scene.motion.times.shape
    ((name, arms),) = moved_by_5_mm.moment_arms.items()
    assert arms.shape == moved_by_5_mm.values[name].shape
    again = landmark_errors(scene, samples=3)["gluteus_medius"]
    np.testing.assert_array_equal(arms, again.moment_arms[name])


def test_errors_grow_with_the_distance(scene, moved_by_5_mm):
    near = landmark_errors(scene, distance=0.5, samples=3)["gluteus_medius"]
    assert 0.0 <= near.lengths.mean() < moved_by_5_mm.lengths.mean() < 5.0


@pytest.mark.parametrize(
    ("changes", "words"), [({"distance": 0.0}, "positive"), ({"samples": 2}, "3 or more")]
)
def test_what_says_nothing_is_refused(scene, changes, words):
    with pytest.raises(ValueError, match=words):
        landmark_errors(scene, **changes)
