"""The levers of paths: slopes of lengths, by every part of a bone's twist."""

import numpy as np
import pytest
from phantom_paths import AXIS, HINGES, angles, known_paths, levers, strung_phantom, swept, turned
from phantoms.two_joint_strap import ARMS

from vtkmuscle.core.motion.coordinates import twist_about
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.core.paths import pose as sheet_pose

#: Small twists of a bone: so far [mm], and so far at this distance from the middle of the muscle [mm].
SMALL, REACH = 0.02, 50.0
#: One that is part of the cell over which a bone's normals are compared [mm].
PART_OF_A_CELL = 0.3


def twisted(pose, bone, number, size, middle):
    """Return a pose with a bone moved along an axis, or turned about one through a point."""
    twist, axis = np.eye(4), np.eye(3)[number % 3]
    if number < 3:
        twist[:3, 3] = size * axis
    else:
        twist = rotation_about(middle, axis, np.degrees(size / REACH))
    moved = np.array(pose)
    moved[bone] = twist @ moved[bone]
    return moved


@pytest.mark.gap(
    "difference of lever and slope of a path's length, over edges of a bone", "0.55 mm", "0.2 mm"
)
@pytest.mark.parametrize(
    ("number", "angle", "small", "mean", "each"),
    [
        (0, 20.0, SMALL, 0.3, 0.4),
        (1, 15.0, PART_OF_A_CELL, 0.05, 0.2),
        (1, 15.0, SMALL, 0.05, 0.6),
        (2, 30.0, SMALL, 0.3, 1.0),
        (3, 40.0, SMALL, 0.3, 1.0),
        (4, 10.0, SMALL, 0.1, 0.2),
        (4, 30.0, SMALL, 0.3, 1.0),
        (5, 30.0, SMALL, 0.3, 0.5),
    ],
)
def test_levers_are_slopes_of_lengths(number, angle, small, mean, each, monkeypatch):
    """In mm of lever, of all six parts: on the mean of the fibres, and of each.

    Differences are so small that a ring keeps its hold, and sheets settle to rounding, which they need.
    """
    make, settings, name, *_ = HINGES[number]
    paths, (pose,) = known_paths(make, **settings), turned(make, settings, name, [angle])
    monkeypatch.setattr(sheet_pose, "TOLERANCE", 1e-9)
    bone = strung_phantom(make, **settings).names.index(name)
    state = paths.follow(paths.rest, pose)
    middle = state.points.reshape(-1, 3).mean(axis=0)
    twists = np.zeros((6, len(state.transforms), 6))
    twists[:, bone] = np.eye(6)
    twists[3:, bone, :3] = np.cross(middle, np.eye(3))
    known = list(state.levers(dict(enumerate(twists))).values())
    for part in range(6):
        there, back = (
            paths.follow(state, twisted(pose, bone, part, size, middle)).lengths for size in (small, -small)
        )
        slopes = -(there - back) / (2.0 * small) * REACH
        lever = known[part] * (REACH if part < 3 else 1.0)
        assert np.abs(slopes - lever).max() < each
        assert abs((slopes - lever).mean()) < mean


@pytest.mark.parametrize("make", ["flexor_over_brim", "strap_over_two_joints"])
def test_levers_by_all_bones_one_after_the_other_are_none_in_all(make):
    """As they are where all move together, but for what solutions leave."""
    rest = known_paths(make).rest
    bones = len(rest.transforms)
    twists = np.zeros((bones, bones, 6))
    twists[range(bones), range(bones)] = twist_about((0, 0, 0), AXIS)
    by_each = np.array(list(rest.levers(dict(enumerate(twists))).values()))
    assert np.abs(by_each).max() > 1.0
    np.testing.assert_allclose(by_each.sum(axis=0), 0.0, atol=0.2)


def test_a_strap_on_a_cylinder_has_its_radius_as_lever_in_every_pose():
    """The levers of chords are shorter than the radius, those of a bone of flat triangles 1 %."""
    pulley = strung_phantom("wrapping_cylinder").names.index("pulley")
    poses = turned("wrapping_cylinder", {}, "pulley", angles(-60.0, 80.0, 4.0))
    for state in swept(known_paths("wrapping_cylinder"), poses):
        assert levers(state, [pulley], (0, 0, 0), AXIS).mean() == pytest.approx(-30.0, abs=0.4)


def test_a_strap_over_two_joints_has_both_rollers_as_levers_in_every_pose():
    """But for what chords and flat triangles take: 0.6 mm of 26, 0.6 of 18."""
    made = strung_phantom("strap_over_two_joints")
    numbers = [made.names.index(name) for name in ("middle", "distal")]
    for state in swept(known_paths("strap_over_two_joints"), made.poses()):
        lower = apply_transform(state.transforms[numbers[0]], [made.phantom.known["centres"]["lower"]])[0]
        assert levers(state, numbers, (0, 0, 0), AXIS).mean() == pytest.approx(ARMS[0], abs=0.6)
        assert levers(state, numbers[1:], lower, -AXIS).mean() == pytest.approx(-ARMS[1], abs=0.6)


def test_a_bone_that_no_path_ends_on_pushes_paths_and_has_its_levers():
    """A cylinder that moves by itself, as a patella does, under a strap whose ends stay."""
    made, paths = strung_phantom("wrapping_cylinder"), known_paths("wrapping_cylinder")
    pulley = made.names.index("pulley")
    free = made.pulled(
        fibres=paths.fibres,
        start_bones=paths.start_bones,
        end_bones=paths.end_bones,
        bones={2: made.bones[pulley]},
    )
    middle = np.zeros(3)
    rest = np.tile(np.eye(4), (3, 1, 1))
    state = free.follow(free.rest, rest)
    for part in (1, 2):
        by_pulley = np.outer([0.0, 0.0, 1.0], np.eye(6)[part])
        there, back = (
            free.follow(state, twisted(rest, 2, part, size, middle)).lengths for size in (SMALL, -SMALL)
        )
        slopes = -(there - back) / (2.0 * SMALL)
        np.testing.assert_allclose(state.levers({"q": by_pulley})["q"], slopes, atol=0.03)
        assert np.abs(slopes).mean() > 0.3
