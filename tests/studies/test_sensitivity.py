"""Spreads of lengths and moment arms from landmarks, axes and surfaces that are moved about."""

from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle import Scene, sensitivities
from vtkmuscle.data.arrays import points_of
from vtkmuscle.phantoms import hip
from vtkmuscle.studies.variation import CAUSES, Variation


@pytest.fixture(scope="module")
def scene():
    whole = Scene.from_phantom(hip(), n_fibres=6, resolution=8)
    muscles = {"gluteus_medius": whole.muscles["gluteus_medius"]}
    every = range(0, len(whole.motion.times), 6)
    return replace(whole, muscles=muscles, motion=whole.motion.part(every), model="paths")


@pytest.fixture(scope="module")
def spread_by_5_mm(scene):
    return sensitivities(scene, samples=3, landmarks=5.0)["gluteus_medius"]["landmarks"]


def test_spreads_are_of_each_frame_and_value_and_the_same_again(scene, spread_by_5_mm):
    assert spread_by_5_mm.lengths.shape == scene.motion.times.shape
    ((name, arms),) = spread_by_5_mm.moment_arms.items()
    assert arms.shape == spread_by_5_mm.values[name].shape
    again = sensitivities(scene, samples=3, landmarks=5.0)["gluteus_medius"]["landmarks"]
    np.testing.assert_array_equal(arms, again.moment_arms[name])


def test_spreads_grow_with_the_distance_and_the_largest_cause_stands_first(scene, spread_by_5_mm):
    found = sensitivities(scene, samples=3, centre=0.01, landmarks=0.5)["gluteus_medius"]
    assert list(found) == ["landmarks", "centre"]
    # Both ends move by 5 mm: a length changes by 10 at most.
    assert 0.0 <= found["landmarks"].lengths.mean() < spread_by_5_mm.lengths.mean() < 10.0


def test_each_cause_moves_its_own_input_by_its_amount(scene):
    def moved(cause, amount):
        return Variation("1", cause=cause, amount=amount).of(scene)

    name = "gluteus_medius"
    areas = moved("landmarks", 5.0).muscles[name].attachments
    for area, before in zip(areas, scene.muscles[name].attachments, strict=True):
        shift = np.asarray(area.landmarks) - np.asarray(before.landmarks)
        np.testing.assert_allclose(np.linalg.norm(shift, axis=1), 5.0)
        assert np.ptp(shift, axis=0).max() < 1e-9
    (turned,) = moved("axis", 3.0).motion.transforms.values()
    (pose,) = scene.motion.transforms.values()
    axes = [np.linalg.eig(one[-1, :3, :3]) for one in (turned, pose)]
    first, second = (np.real(vectors[:, np.argmin(abs(values - 1.0))]) for values, vectors in axes)
    assert 0.1 < np.degrees(np.arccos(min(1.0, abs(first @ second)))) <= 3.0 + 1e-6
    np.testing.assert_allclose(turned[:, :3, 3], 0.0, atol=1e-9)  # about the centre of the head
    (shifted,) = moved("centre", 3.0).motion.transforms.values()
    np.testing.assert_allclose(shifted[:, :3, :3], pose[:, :3, :3], atol=1e-12)
    assert np.linalg.norm(shifted[-1, :3, 3]) > 0.1
    waved = moved("segmentation", 1.0)
    for before, after in (
        (scene.bones["femur"], waved.bones["femur"]),
        (scene.muscles[name].surface, waved.muscles[name].surface),
    ):
        moves = np.linalg.norm(points_of(after) - points_of(before), axis=1)
        assert 0.6 < np.sqrt((moves**2).mean()) < 1.4


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"landmarks": 0.0}, "positive"),
        ({"landmarks": 1.0, "samples": 2}, "3 or more"),
        ({}, "nothing is varied"),
        ({"landmark": 1.0}, "did you mean 'landmarks'"),
    ],
)
def test_what_says_nothing_is_refused(scene, changes, words):
    with pytest.raises(ValueError, match=words):
        sensitivities(scene, **changes)
    assert set(CAUSES) == {"landmarks", "axis", "centre", "segmentation"}


def test_a_motion_that_is_moved_too_far_to_be_followed_is_refused(scene):
    with pytest.raises(ValueError, match=r"'femur' moves \S+ mm from frame"):
        sensitivities(scene, samples=3, centre=1e8)
