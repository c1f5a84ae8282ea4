"""Lengths and levers of a pose do not depend on the way to it, where it has one equilibrium.

Each pose is reached through all frames, straight from rest, and back from the far end. Where a sheet has
several equilibria (hysteresis), bounds are what these differ by: fibres roll over in a ring, slide off a
ridge or snap; an edge or a roller has a point of a path more or less on it.
"""

from dataclasses import replace

import numpy as np
import pytest
from phantom_paths import AXIS, HINGES, angles, known_paths, strung_muscle, strung_phantom, turned
from slow import slow

from vtkmuscle import Scene
from vtkmuscle.core.motion.blending import screws
from vtkmuscle.core.motion.coordinates import twist_about
from vtkmuscle.core.motion.rigid import inverse
from vtkmuscle.core.paths.poses import KeptPoses

#: Lengths, and the rms of levers of paths, differ by no more than this [mm].
LENGTHS, LEVERS = 0.02, 0.05


def differences(paths, poses, twists, at):
    """Return the largest difference of lengths, and of rms levers, of straight ways and of those back."""
    known = {}

    def measured(number, state):
        assert state.settled
        return state.lengths, state.levers({"q": twists[number]})["q"]

    state = paths.rest
    for number, pose in enumerate(poses):
        state = paths.follow(state, pose)
        known[number] = measured(number, state) if number in at else None
    straight = {number: measured(number, paths.follow(paths.rest, poses[number])) for number in at}
    back = {}
    for number in reversed(range(len(poses))):
        state = paths.follow(state, poses[number])
        if number in at:
            back[number] = measured(number, state)
    return [
        (
            max(np.abs(found[number][0] - known[number][0]).max() for number in at),
            max(np.sqrt(((found[number][1] - known[number][1]) ** 2).mean()) for number in at),
        )
        for found in (straight, back)
    ]


@pytest.mark.parametrize(
    ("number", "straight", "back"),
    [
        *((number, (LENGTHS, LEVERS), (LENGTHS, LEVERS)) for number in (0, 5)),
        *slow(*((number, (LENGTHS, LEVERS), (LENGTHS, LEVERS)) for number in (1, 2))),
        (3, (0.05, 0.5), (0.05, 0.5)),
        (4, (0.7, 0.8), (1.2, 1.3)),
    ],
)
def test_a_hinge_may_go_straight_or_back(number, straight, back):
    make, settings, name, low, high = HINGES[number]
    poses = turned(make, settings, name, angles(low, high))
    twists = np.zeros((*poses.shape[:2], 6))
    twists[:, strung_phantom(make, **settings).names.index(name)] = twist_about((0, 0, 0), AXIS)
    found = differences(known_paths(make, **settings), poses, twists, range(0, len(poses), 6))
    assert np.less(found, [straight, back]).all(), found


def test_the_last_pose_is_kept_and_without_memory_no_other():
    make, settings, name, low, high = HINGES[0]
    kept, (first, second) = (
        KeptPoses(known_paths(make, **settings)),
        turned(make, settings, name, [low, high]),
    )
    state = kept.at(first, memory=0.0)
    assert kept.at(first, memory=0.0) is state
    kept.at(second, memory=0.0)
    assert kept.at(first, memory=0.0) is not state


def test_a_pose_that_does_not_settle_is_tried_from_rest(monkeypatch):
    make, settings, name, low, high = HINGES[0]
    paths, poses = (
        known_paths(make, **settings),
        turned(make, settings, name, [low, 0.5 * (low + high), high]),
    )
    kept, follow = KeptPoses(paths), type(paths).follow

    def shaky(self, before, transforms):
        return replace(follow(self, before, transforms), settled=before is self.rest)

    monkeypatch.setattr(type(paths), "follow", shaky)
    assert all(kept.at(pose, memory=1e9).settled for pose in poses)


def test_two_joints_may_go_straight_or_back():
    made = strung_phantom("strap_over_two_joints")
    poses = made.poses()
    twists = np.zeros((*poses.shape[:2], 6))
    twists[:, [made.names.index(name) for name in ("middle", "distal")]] = twist_about((0, 0, 0), AXIS)
    found = differences(known_paths("strap_over_two_joints"), poses, twists, range(0, len(poses), 6))
    assert np.less(found, [(0.03, 0.15), (0.03, 0.5)]).all(), found


def twists_along(poses, bone, values):
    """Return the twists of a bone (k, b, 6) by a coordinate with some values at poses (k, b, 4, 4)."""
    twists = np.zeros((*poses.shape[:2], 6))
    before, after = np.roll(np.arange(len(poses)), 1), np.roll(np.arange(len(poses)), -1)
    before[0], after[-1] = 0, len(poses) - 1
    moves = [b @ inverse(a) for a, b in zip(poses[before, bone], poses[after, bone], strict=True)]
    twists[:, bone] = screws(np.array(moves)) / (values[after] - values[before])[:, None]
    return twists


@pytest.fixture(scope="module")
def hip_scene(lhdl_hip):
    return Scene.load(lhdl_hip / "scene.toml")


def flexed_hip(scene, name):
    """Return the paths of a muscle, its bones' poses (k, b, 4, 4), and their twists by flexion."""
    made = strung_muscle(
        scene.muscles[name].surface,
        scene.bones_data(),
        scene.attachments_data(name),
        fibres=scene.muscles[name].fibres or {},
        **scene.fixing_of(name),
    )
    poses = made.poses(scene.motion)
    values = np.radians(np.array(scene.motion.times))
    return made.pulled(), poses, twists_along(poses, made.names.index("femur_r"), values)


@pytest.mark.realdata
@pytest.mark.gap(
    "difference of a path's lever, flexed straight and on the way, gluteus maximus", "1.1 mm", "0.05 mm"
)
@pytest.mark.parametrize(
    ("name", "straight", "back"),
    [
        ("gluteus_medius", (LENGTHS, LEVERS), (LENGTHS, 0.1)),
        ("gluteus_maximus", (0.3, 1.2), (0.06, 0.4)),
        pytest.param("iliacus", (LENGTHS, LEVERS), (LENGTHS, LEVERS), marks=pytest.mark.long),
        ("adductor_brevis", (LENGTHS, LEVERS), (LENGTHS, LEVERS)),
    ],
)
@pytest.mark.slow
def test_a_real_hip_may_be_flexed_straight_and_go_back(hip_scene, name, straight, back):
    paths, poses, twists = flexed_hip(hip_scene, name)
    found = differences(paths, poses, twists, (10, 20, 30, 45))
    assert np.less(found, [straight, back]).all(), found
