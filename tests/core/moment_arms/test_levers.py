"""Levers of pulls: known in every pose, whatever the motion is, and the slopes of the lengths."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vtkmuscle.core.moment_arms.levers import MotionTwists, differences_by, twists_by
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.core.motion.coordinates import Coordinate, carried_twists
from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, hinge, rotation_about
from vtkmuscle.core.paths.levers import path_levers, pull_of
from vtkmuscle.joints import grid_of
from vtkmuscle.joints.functions import IDENTITY
from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.scene.joints import SceneJoints

CENTRE, AXIS = np.array([5.0, -20.0, 300.0]), np.array([1.0, 0.0, 0.0])
#: Where straight paths leave the bone that stays, and the one that moves, at rest [mm].
STARTS = CENTRE + np.array([[0.0, -80.0, 30.0], [5.0, -80.0, 40.0]])
ENDS = CENTRE + np.array([[0.0, 40.0, 20.0], [5.0, 50.0, 10.0]])
STEP = 5.0
ANGLES = np.arange(0.0, 91.0, STEP)


def straight(motion, bone="shank"):
    """Return lengths (f, k) of straight paths to a bone that moves, their levers by coordinate, and ends."""
    ends = np.array([apply_transform(one, ENDS) for one in motion.transforms[bone]])
    points = np.stack([np.broadcast_to(STARTS, ends.shape), ends], axis=2)
    twists = MotionTwists(motion)
    levers = {name: np.full(ends.shape[:2], np.nan) for name in motion.coordinates}
    for frame, time in enumerate(motion.times):
        for name, by_bone in twists.at(time).items():
            levers[name][frame] = of_straight(points[frame], by_bone[bone])
    return np.linalg.norm(ends - STARTS, axis=2), levers, ends


def of_straight(points, twist):
    """Return the levers of straight paths as the bone of their ends moves."""
    # There is nothing between their ends that bones could press on, or that could give way.
    stays = np.zeros(len(points), dtype=np.int64)
    return straight_levers(points, stays, np.array([[np.zeros(6), twist]]))[0]


def straight_levers(points, stays, twists):
    """Return the levers of straight paths from a bone that stays to the next one, which nothing holds."""
    return path_levers(points, (stays, stays + 1), {}, twists, np.zeros_like(points), (np.zeros_like,) * 3)


@pytest.mark.parametrize(("softness", "responds"), [(0.3, 1 / 0.3), (0.05, 5.0), (1e-5, 1e-3), (-0.2, 0.0)])
def test_a_path_about_to_buckle_has_the_lever_of_a_path_that_is_not(softness, responds):
    points = CENTRE + np.array([[[0.0, 0.0, -40.0], [0.0, 9.0, -15.0], [0.0, 9.0, 15.0], [0.0, 0.0, 40.0]]])
    twist, stays = np.array([[np.zeros(6), [0.0, 3.0, 2.0, 0.0, 0.0, 0.0]]]), np.zeros(1, dtype=np.int64)
    stiffness, shares = np.ones((2, 2, 3))
    stiffness[0, 1] = softness  # of Newton's matrix, by which each point goes with the end

    def change(velocity):
        return np.pad(stiffness * velocity[:, 1:-1] - velocity[:, -1:], ((0, 0), (1, 1), (0, 0)))

    solver = change, np.negative, np.copy
    found = path_levers(points, (stays, stays + 1), {}, twist, np.zeros_like(points), solver)
    shares[0, 1] = 1 / 3 + (1 - softness / 3) * responds  # beyond the point's third of the way to the end
    moved = np.concatenate([shares, np.ones((1, 3))]) * twist[0, 1, :3]
    assert found[0, 0] == pytest.approx(np.sum(pull_of(points)[0, 1:] * moved), abs=2e-3)


def lever_about(ends, centre, axis):
    """Return the lever of the pull of straight paths, in closed form."""
    pull = (STARTS - ends) / np.linalg.norm(STARTS - ends, axis=-1, keepdims=True)
    return np.cross(ends - centre, pull) @ axis


def as_table(motion):
    """Return the same motion, as of a table: it is not known what its coordinates are."""
    return replace(
        motion, coordinates={n: replace(one, twists=None) for n, one in motion.coordinates.items()}
    )


# ----------------------------------------------------------------------------- one joint


@pytest.mark.parametrize("known", [True, False])
def test_a_hinge_has_the_lever_of_a_straight_pull_in_every_pose(known):
    motion = hinge("shank", CENTRE, AXIS, ANGLES, coordinate="knee")
    motion = motion if known else as_table(motion)
    lengths, levers, ends = straight(motion)
    arms, refused = joint_arms(lengths, levers, motion)
    assert not refused
    np.testing.assert_array_equal(arms["knee"].frames, np.arange(len(ANGLES)))
    np.testing.assert_allclose(arms["knee"].arms, lever_about(ends, CENTRE, AXIS), atol=1e-9)
    np.testing.assert_allclose(arms["knee"].mean, lever_about(ends, CENTRE, AXIS).mean(axis=1), atol=1e-9)


def test_slopes_of_lengths_are_the_levers():
    """Central differences err by h^2 / 6 of the third derivative, at either end by h^2 / 3."""
    motion = hinge("shank", CENTRE, AXIS, ANGLES)
    lengths, levers, _ = straight(motion)
    (found,) = joint_arms(lengths, levers, motion)[0].values()
    step = np.radians(STEP)
    third = np.abs(np.diff(lengths, 3, axis=0)).max() / step**3
    off = np.abs(found.arms - found.slopes)
    assert off[1:-1].max() < 1.1 * third * step**2 / 6.0
    assert off.max() < 1.5 * third * step**2 / 3.0
    assert off[1:-1].max() > 1e-3  # they are two ways, not one


@pytest.mark.parametrize("angles", [[0.0, 40.0], [30.0]])
def test_one_or_two_poses_have_levers_where_the_joint_is_known(angles):
    motion = hinge("shank", CENTRE, AXIS, angles, coordinate="knee")
    lengths, levers, ends = straight(motion)
    found = joint_arms(lengths, levers, motion)[0]["knee"]
    np.testing.assert_allclose(found.arms, lever_about(ends, CENTRE, AXIS), atol=1e-12)
    assert np.isnan(found.slopes).all()  # a line's slope is between its ends
    with pytest.raises(ValueError, match=r"no coordinate of the motion changes|together"):
        joint_arms(lengths, levers | {"knee": np.full_like(lengths, np.nan)}, as_table(motion))


def test_a_motion_of_all_bones_changes_no_lever():
    own = as_table(hinge("shank", CENTRE, AXIS, ANGLES, coordinate="knee"))
    common = np.array([rotation_about(STARTS[0], [0.2, 1.0, 0.3], 3.0 * angle) for angle in ANGLES])
    both = replace(own, transforms={"thigh": common, "shank": common @ own.transforms["shank"]})
    (_, alone), (_, found) = (twists_by(each, "knee") for each in (own, both))
    expected = [carried_twists(*each) for each in zip(alone["shank"], common, strict=True)]
    np.testing.assert_allclose(found["shank"] - found["thigh"], expected, atol=1e-9)


def test_a_slide_has_the_part_of_the_pull_along_it():
    shifts, table = np.linspace(0.0, 20.0, 6), np.tile(np.eye(4), (6, 1, 1))
    table[:, 2, 3] = -shifts
    motion = RigidMotion(shifts, {"shank": table}, None, {"pull": Coordinate(shifts / 10.0, "cm")})
    lengths, levers, ends = straight(motion)
    pull = (STARTS - ends) / np.linalg.norm(STARTS - ends, axis=2, keepdims=True)
    np.testing.assert_allclose(joint_arms(lengths, levers, motion)[0]["pull"].arms, -pull[..., 2])


def test_the_way_from_rest_to_a_sweep_has_no_levers():
    lead = np.array([rotation_about(CENTRE, [0.0, 0.0, 1.0], angle) for angle in (30.0, 20.0, 10.0)])
    table = np.concatenate([lead, hinge("shank", CENTRE, AXIS, ANGLES).transforms["shank"]])
    values = np.concatenate([[10.0, 6.0, 3.0], ANGLES])
    motion = RigidMotion(np.arange(len(table)), {"shank": table}, CENTRE, {"knee": Coordinate(values)})
    lengths, levers, ends = straight(motion)
    found = joint_arms(lengths, levers, motion)[0]["knee"]
    np.testing.assert_array_equal(found.frames, np.arange(3, len(table)))
    np.testing.assert_allclose(found.arms, lever_about(ends[3:], CENTRE, AXIS), atol=1e-9)


# --------------------------------------------------------------------- several coordinates

#: Flexion about x, then abduction about the y axis that goes with it.
BALL = [JointAxis(AXIS, IDENTITY, "flexion"), JointAxis(np.eye(3)[1], IDENTITY, "abduction")]
COORDINATES = [JointCoordinate("flexion"), JointCoordinate("abduction")]
TREE = KinematicTree("ground", [Joint("hip", "ground", "shank", BALL)], COORDINATES)


def of_ball(flexion, abduction):
    values = {"flexion": np.radians(flexion), "abduction": np.radians(abduction)}
    joints = SceneJoints(TREE, {"shank": "shank"}, TREE.root, TREE.root)
    return joints.motion_of(np.arange(float(len(flexion))), values)


def known_of_ball(motion, ends):
    turned = [rotation_about((0, 0, 0), AXIS, angle) for angle in motion.coordinates["flexion"].values]
    axes = {"flexion": np.tile(AXIS, (len(ends), 1)), "abduction": np.array(turned)[:, :3, 1]}
    return {
        name: np.array([lever_about(one, np.zeros(3), axis) for one, axis in zip(ends, of, strict=True)])
        for name, of in axes.items()
    }


@pytest.mark.parametrize("known", [True, False])
def test_a_grid_of_7_by_19_poses_has_levers_by_both_coordinates_in_all_of_them(known):
    """From the poses alone screws between neighbours err as central differences of a turning axis do."""
    grid = grid_of({"flexion": np.linspace(0.0, 60.0, 7), "abduction": np.linspace(-30.0, 60.0, 19)})
    motion = of_ball(**grid)
    motion = motion if known else as_table(motion)
    lengths, levers, ends = straight(motion)
    arms, refused = joint_arms(lengths, levers, motion)
    assert not refused
    for name, right in known_of_ball(motion, ends).items():
        np.testing.assert_array_equal(arms[name].frames, np.arange(7 * 19))
        # Both axes stay where they are while their own coordinate changes: so screws are exact as well.
        np.testing.assert_allclose(arms[name].arms, right, atol=1e-5)
        assert np.isfinite(arms[name].slopes).all()
        # A curve for each value of the other coordinate, with a gap between two.
        values, sweeps, steps = arms[name].drawn(arms[name].values), *{"flexion": (19, 7)}.get(name, (7, 19))
        assert np.isnan(values).sum() == sweeps - 1
        rows = np.append(values, np.nan).reshape(sweeps, steps + 1)
        np.testing.assert_allclose(rows[:, :-1], np.tile(np.unique(grid[name]), (sweeps, 1)), atol=1e-9)


def test_coordinates_that_change_together_have_levers_only_where_the_joint_is_known():
    q = np.linspace(0.0, 40.0, 9)
    motion = of_ball(q, 0.5 * q)
    lengths, levers, ends = straight(motion)
    arms, _ = joint_arms(lengths, levers, motion)
    closed = of_ball(np.append(q, q[0]), np.append(0.5 * q, 0.0))  # a walk ends as it begins
    for each in (*arms.values(), *joint_arms(*straight(closed)[:2], closed)[0].values()):
        np.testing.assert_array_equal(each.drawn(each.values), each.values)
    for name, right in known_of_ball(motion, ends).items():
        np.testing.assert_allclose(arms[name].arms, right, atol=1e-5)
        assert np.isnan(arms[name].slopes).all()
    table = as_table(motion)
    with pytest.raises(ValueError, match="change only together"):
        joint_arms(lengths, straight(table)[1], table)


def test_a_coordinate_that_never_changes_alone_is_refused_and_the_other_is_not():
    # Flexion alone, then both together.
    flexion = np.concatenate([np.arange(0.0, 31.0, 5.0), np.arange(35.0, 56.0, 5.0)])
    motion = as_table(of_ball(flexion, np.concatenate([np.zeros(7), np.arange(5.0, 26.0, 5.0)])))
    lengths, levers, ends = straight(motion)
    arms, refused = joint_arms(lengths, levers, motion)
    assert "changes only together with flexion" in refused["abduction"]
    np.testing.assert_array_equal(arms["flexion"].frames, np.arange(7))
    np.testing.assert_allclose(arms["flexion"].arms, known_of_ball(motion, ends)["flexion"][:7], atol=1e-9)


# ------------------------------------------------------------------------------ invariance


@given(
    st.tuples(*[st.floats(-200.0, 200.0)] * 3),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(-170.0, 170.0),
    st.booleans(),
)
def test_levers_do_not_depend_on_where_the_scene_is_nor_on_its_side(shift, axis, angle, mirrored):
    motion = hinge("shank", CENTRE, AXIS, [20.0], coordinate="knee")
    lengths, levers, ends = straight(motion)
    known = joint_arms(lengths, levers, motion)[0]["knee"].arms
    carried = rotation_about(shift, axis, angle)
    carried[:3, :3] *= [-1.0, 1.0, 1.0] if mirrored else 1.0
    points = np.stack([apply_transform(carried, one) for one in (STARTS, ends[0])], axis=1)
    twist = motion.coordinates["knee"].carried(carried).twists["shank"][0]
    np.testing.assert_allclose(of_straight(points, twist), known[0], atol=1e-8)


# ------------------------------------------------------------------------------ differences


@given(st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=12, unique=True), st.floats(-3.0, 3.0))
def test_differences_of_a_parabola_are_its_slopes(values, bend):
    values = np.sort(values)
    if np.diff(values).min() < 1e-2:
        return
    motion = RigidMotion(np.arange(len(values)), {}, None, {"q": Coordinate(values, "rad")})
    near = differences_by(motion, "q")
    assert len(near.frames) == len(values)
    slopes = near.slopes(bend * values**2 + 3.0 * values)
    np.testing.assert_allclose(slopes, 2.0 * bend * values + 3.0, atol=1e-6 * (1.0 + np.abs(values).max()))


def test_a_sweep_that_comes_back_is_taken_from_the_poses_next_to_each():
    values = np.concatenate([np.arange(0.0, 5.0), np.arange(3.0, -1.0, -1.0)])
    near = differences_by(RigidMotion(np.arange(9.0), {}, None, {"q": Coordinate(values, "rad")}), "q")
    assert near.neighbours[2].tolist() == [1, 3]
    assert near.neighbours[6].tolist() == [7, 5]


def test_between_two_poses_twists_are_interpolated_and_beside_one_without_there_are_none():
    """The first pose has the value of the second, but not its rotation. Then the bone goes as q^2."""
    shifts = np.tile(np.eye(4), (4, 1, 1))
    shifts[0] = rotation_about(CENTRE, AXIS, 30.0)
    shifts[:, 2, 3] += [0.0, 0.0, 100.0, 400.0]
    values = Coordinate(np.array([0.0, 0.0, 10.0, 20.0]), "mm")
    twists = MotionTwists(RigidMotion([0.0, 1.0, 2.0, 4.0], {"shank": shifts}, None, {"pull": values}))
    assert twists.at(0.0) == twists.at(0.5) == {}
    for time, speed in ((1.0, 0.0), (1.25, 5.0), (2.0, 20.0), (2.5, 25.0), (4.0, 40.0), (9.0, 40.0)):
        np.testing.assert_allclose(twists.at(time)["pull"]["shank"], [0, 0, speed, 0, 0, 0], atol=1e-9)
