"""Strings round bones: known lengths and moment arms, virtual work, and that nothing else matters.

Lengths are of polylines: round a brim of 15 mm, of points 5 mm apart, they jump by up to 0.15 mm as a point
comes to it. So moment arms are taken over 10 degrees.
"""

import numpy as np
import pytest
from phantom_paths import known_paths, levers, paths_of, strung_phantom, swept

from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.core.paths import paths as taut_paths
from vtkmuscle.core.paths.sheet import MusclePaths
from vtkmuscle.phantoms import spindle_over_ball, strap_over_two_joints
from vtkmuscle.phantoms.planar import flexed
from vtkmuscle.phantoms.two_joint_strap import LOWER, WRAPS

AXIS = np.array([-1.0, 0.0, 0.0])
#: Moment arms are means over so many steps of so many degrees.
WINDOW, STEP = 5, 2.0

#: Of hinges about the x axis: the phantom, its settings, the bone that moves, from where to where [degrees].
HINGES = [
    ("wrapping_cylinder", {}, "pulley", -60.0, 80.0),
    ("lifting_strap", {}, "distal", 0.0, 70.0),
    ("flexor_over_brim", {"groove": 8.0}, "distal", 0.0, 80.0),
    ("flexor_over_brim", {"groove": -5.0}, "distal", 0.0, 80.0),
    ("tendon_through_ring", {}, "distal", 0.0, 60.0),
    ("spindle_over_ball", {}, "distal", -10.0, 60.0),
]
EVERY_HINGE = pytest.mark.parametrize(
    ("make", "settings", "bone", "low", "high"),
    HINGES,
    ids=[f"{h[0]}{''.join(map(str, h[1].values()))}" for h in HINGES],
)


def angles(low, high, step=STEP):
    return np.arange(low, high + 0.5 * step, step)


def turned(make, settings, bone, at):
    """Return the poses of a phantom's bones with one turned by angles about the x axis."""
    motion = hinge(bone, centre=(0, 0, 0), axis=AXIS, angles=at)
    return strung_phantom(make, **settings).poses(motion)


def lengths(states):
    return np.array([state.lengths for state in states])


def mean_slopes(of_states, window=WINDOW, step=STEP):
    """Return -dl/dq over windows [mm]."""
    return -(of_states[window:] - of_states[:-window]) / np.radians(window * step)


def mean_levers(arms, window=WINDOW):
    """Return the means (trapezoids) of levers over windows."""
    so_far = np.concatenate([np.zeros_like(arms[:1]), np.cumsum((arms[1:] + arms[:-1]) / 2.0, axis=0)])
    return (so_far[window:] - so_far[:-window]) / window


def check_work(paths, poses, moving, centre, axis, each=1.0):
    """Assert that -dl/dq is the lever of the pull, on the mean and of each fibre, and return -dl/dq."""
    states = swept(paths, poses)
    slopes = mean_slopes(lengths(states))
    arms = mean_levers(np.array([levers(state, moving, centre, axis) for state in states]))
    assert np.abs((slopes - arms).mean(axis=1)).max() < 1.0
    assert np.abs(slopes - arms).max() < each
    assert sum(state.unsettled for state in states) <= 0.03 * lengths(states).size
    return slopes


# -------------------------------------------------------------------- known answers


def test_a_string_in_free_space_is_straight():
    poses = turned("spindle_over_ball", {}, "distal", angles(-10.0, 60.0, 7.0))
    for state in swept(known_paths("spindle_over_ball"), poses):
        part = np.linspace(0.0, 1.0, state.points.shape[1])[None, :, None]
        straight = (1.0 - part) * state.points[:, :1] + part * state.points[:, -1:]
        np.testing.assert_allclose(state.points, straight, atol=0.01)


def test_a_string_wound_round_a_cylinder_has_its_length_and_lies_on_it():
    paths = known_paths("wrapping_cylinder")
    at = angles(-60.0, 80.0, 20.0)
    for angle, state in zip(at, swept(paths, turned("wrapping_cylinder", {}, "pulley", at)), strict=True):
        # The three in the middle are 27, 30 and 33 mm from the axis, and end at 95 degrees of the strap.
        for depth, fibre in zip((27.0, 30.0, 33.0), state.points[3:6], strict=True):
            length = np.linalg.norm(np.diff(fibre, axis=0), axis=1).sum()
            # A polyline's chords round the cylinder are shorter by 0.1 %; it is one of 48 sides.
            assert length == pytest.approx(80.0 + depth * np.radians(95.0 + angle), rel=0.006)
            wound = fibre[fibre[:, 1] > 3.0]
            np.testing.assert_allclose(np.hypot(wound[:, 1], wound[:, 2]), depth, atol=0.5)


def test_the_wound_strap_has_its_moment_arm_at_every_angle():
    """30 mm; 3 % wound, 5 % unwound: fibres of the default template come down to the attached face before it.

    For the unwound part 3 % is wanted, too.
    """
    at = angles(-60.0, 80.0)
    states = swept(paths_of("wrapping_cylinder"), turned("wrapping_cylinder", {}, "pulley", at))
    arms = mean_slopes(lengths(states)).mean(axis=1)
    wound = at[:-WINDOW] >= 0.0
    np.testing.assert_allclose(arms[wound], -30.0, rtol=0.03)
    np.testing.assert_allclose(arms[~wound], -30.0, rtol=0.05)


def test_the_strap_leaves_its_roller_and_has_the_moment_arm_of_the_straight_way():
    known = strung_phantom("lifting_strap").phantom.known
    at = angles(0.0, 70.0)
    paths = known_paths("lifting_strap")
    states = swept(paths, turned("lifting_strap", {}, "distal", at))
    depths = (-3.0, 0.0, 3.0)
    expected = [np.mean([known["length"](q, depth) for depth in depths]) for q in at]
    np.testing.assert_allclose(lengths(states).mean(axis=1), expected, rtol=0.005)
    np.testing.assert_allclose(
        mean_slopes(lengths(states)).mean(axis=1), mean_slopes(np.array(expected)), rtol=0.02
    )
    # All have left the roller 5 degrees after the lift-off, and none 5 degrees before.
    on_roller = np.array([state.pushed[0].any(axis=1) for state in states])
    assert on_roller[at <= known["lift_off"] - 5.0].all()
    assert not on_roller[at >= known["lift_off"] + 5.0].any()


@pytest.mark.parametrize("groove", [8.0, -5.0])
def test_the_flexor_flexes_over_its_brim(groove):
    """Where the straight way extends. On the ridge the guide holds it, in the groove its walls do, too."""
    at = angles(0.0, 80.0)
    known = strung_phantom("flexor_over_brim", groove=groove).phantom.known
    states = swept(
        known_paths("flexor_over_brim", groove=groove),
        turned("flexor_over_brim", {"groove": groove}, "distal", at),
    )
    expected = mean_slopes(np.array([known["length"](q) for q in at]))
    np.testing.assert_allclose(mean_slopes(lengths(states)).mean(axis=1), expected, rtol=0.03)
    # As far from the middle of the brim as at rest, where fibres are 2 mm beside it at most.
    assert max(np.abs(state.points[:, :, 0]).max() for state in states) < 4.0


def test_without_a_guide_only_the_tissue_around_keeps_a_string_on_a_ridge():
    groove = {"groove": -5.0}
    free, held = (known_paths("flexor_over_brim", hold=hold, **groove) for hold in (0.0, None))
    aside = [np.abs(paths.rest.points[:, :, 0]).max() for paths in (free, held)]
    assert max(aside) < 4.0
    np.testing.assert_allclose(free.rest.lengths, held.rest.lengths, rtol=0.005)


def test_a_ring_holds_the_tendon_and_without_it_the_tendon_bowstrings():
    known = strung_phantom("tendon_through_ring").phantom.known
    at = angles(0.0, 60.0)
    poses = turned("tendon_through_ring", {}, "distal", at)
    held = lengths(swept(known_paths("tendon_through_ring"), poses))
    # Fibres at 2 mm to all sides of the middle: those in front come to the ring sooner, those behind later.
    np.testing.assert_allclose(held.mean(axis=1), [known["length"](q) for q in at], atol=0.1)
    free = lengths(swept(known_paths("tendon_through_ring", rings=False), poses))
    straight = mean_slopes(free).mean(axis=1)
    middle = at[:-WINDOW] + 0.5 * WINDOW * STEP
    expected = [known["straight_moment_arm"](q) for q in middle]
    np.testing.assert_allclose(straight, expected, rtol=0.005)


def test_the_strap_has_its_moment_arms_about_both_joints():
    made, paths = strung_phantom("strap_over_two_joints"), known_paths("strap_over_two_joints")
    known = made.phantom.known
    for moves, arm in (((1.0, 0.0), known["moment_arm_upper"]), ((0.0, 1.0), known["moment_arm_lower"])):
        poses = [np.multiply(q, moves) + (0.0, 20.0) * np.array(moves[::-1]) for q in angles(-20.0, 60.0)]
        states = swept(paths, made.poses(strap_over_two_joints(coordinates=poses).motion))
        # 5 %: near their ends fibres of 18 mm radius lie on rollers with few points.
        np.testing.assert_allclose(mean_slopes(lengths(states)).mean(axis=1), arm, rtol=0.05)


def test_the_slivered_tendon_gets_as_much_longer_as_it_is_pulled():
    made = strung_phantom("slivered_tendon")
    pulls = np.array(made.phantom.motion.times)
    found = lengths(swept(known_paths("slivered_tendon"), made.poses())).mean(axis=1)
    expected = [made.phantom.known["length"](pull) for pull in pulls]
    # At the end 10 of 33 points are round the edge: chords are 0.3 % short.
    np.testing.assert_allclose(found, expected, rtol=0.004)


# -------------------------------------------------------------------- virtual work


@EVERY_HINGE
def test_slopes_of_lengths_are_levers_of_the_pull(make, settings, bone, low, high):
    paths, poses = known_paths(make, **settings), turned(make, settings, bone, angles(low, high))
    moving = [strung_phantom(make, **settings).names.index(bone)]
    check_work(paths, poses, moving, np.zeros(3), AXIS)


def test_slopes_are_levers_in_abduction_of_a_flexed_ball():
    made = strung_phantom("spindle_over_ball")
    motion = spindle_over_ball(coordinates=[(30.0, q) for q in angles(-20.0, 20.0)]).motion
    axis = rotation_about((0, 0, 0), AXIS, 30.0)[:3, 1]
    arms = check_work(known_paths("spindle_over_ball"), made.poses(motion), [1], np.zeros(3), axis)
    known = np.array([made.phantom.known["length"](30.0, q) for q in angles(-20.0, 20.0)])
    np.testing.assert_allclose(arms.mean(axis=1), mean_slopes(known), atol=0.05)


def test_slopes_are_levers_about_both_joints():
    made, paths = strung_phantom("strap_over_two_joints"), known_paths("strap_over_two_joints")
    upper = strap_over_two_joints(coordinates=[(q, 30.0) for q in angles(-40.0, 60.0)]).motion
    # 2 mm: a fibre on two rollers of few points each jumps by 0.3 mm where one comes to them.
    check_work(paths, made.poses(upper), [1, 2], np.zeros(3), AXIS, each=2.0)
    lower = strap_over_two_joints(coordinates=[(20.0, q) for q in angles(-20.0, 90.0)]).motion
    joint = rotation_about((0, 0, 0), AXIS, 20.0)[:3, :3] @ [0.0, *flexed(LOWER, -WRAPS[0])]
    check_work(paths, made.poses(lower), [2], joint, -AXIS)


# -------------------------------------------------------------------- what does not matter


@EVERY_HINGE
def test_neither_the_way_up_or_down_nor_the_steps_matter(make, settings, bone, low, high):
    paths, poses = known_paths(make, **settings), turned(make, settings, bone, angles(low, high))
    up = swept(paths, poses)
    down = swept(paths, poses[::-1], start=up[-1])[::-1]
    wide = swept(paths, poses[::5])
    for there, here in ((lengths(down), lengths(up)), (lengths(wide), lengths(up[::5]))):
        assert np.sqrt(((there - here) ** 2).mean(axis=1)).max() < 0.3


def test_a_bone_that_comes_over_a_string_in_one_step_does_not_catch_it():
    """It is carried along with the bones, so that it is on its side of them before it is pulled."""
    paths = known_paths("spindle_over_ball")
    (rest, flexed_far) = turned("spindle_over_ball", {}, "distal", [0.0, 60.0])
    assert paths._carried(rest, flexed_far) > 2.0 * taut_paths.LARGEST_STEP * paths._segment
    state = paths.follow(paths.rest, flexed_far)
    straight = np.linalg.norm(state.points[:, -1] - state.points[:, 0], axis=1)
    np.testing.assert_allclose(state.lengths, straight, atol=1e-4)


@pytest.mark.parametrize(
    "make", ["wrapping_cylinder", "lifting_strap", "strap_over_two_joints", "tendon_through_ring"]
)
def test_bones_that_move_together_change_nothing(make):
    paths = paths_of(make)
    turn = rotation_about((10.0, -20.0, 30.0), np.array([1.0, 2.0, 2.0]) / 3.0, 65.0)
    turn[:3, 3] += [200.0, -50.0, 10.0]
    together = np.array([turn] * len(paths.rest.transforms))
    same = paths.follow(paths.rest, paths.rest.transforms)
    np.testing.assert_allclose(same.points, paths.rest.points, atol=1e-12)
    moved = paths.follow(paths.rest, together)
    np.testing.assert_allclose(moved.lengths, paths.rest.lengths, rtol=1e-12)
    np.testing.assert_allclose(
        moved.points.reshape(-1, 3), apply_transform(turn, paths.rest.points.reshape(-1, 3)), atol=1e-9
    )


def moved_paths(make, turn, scale=1.0):
    """Return the strings of a phantom that is turned as a whole, and scaled."""
    made = strung_phantom(make)
    size = np.diag([scale, scale, scale, 1.0])

    def moved(points):
        return scale * apply_transform(turn, points.reshape(-1, 3)).reshape(points.shape)

    bones = {
        number: (moved(points), triangles, size @ axes @ np.linalg.inv(size @ turn))
        for number, (points, triangles, axes) in made.bones.items()
    }
    fibres = known_paths(make).fibres
    paths = MusclePaths(
        moved(fibres),
        known_paths(make).start_bones,
        known_paths(make).end_bones,
        moved(made.points),
        made.triangles,
        bones,
    )
    return paths, size @ turn


def test_where_the_scene_is_does_not_matter_nor_its_unit():
    """A scene that is turned and far away, or in metres, has the same ratios of lengths."""
    at = angles(-60.0, 80.0, 20.0)
    poses = turned("wrapping_cylinder", {}, "pulley", at)
    expected = lengths(swept(known_paths("wrapping_cylinder"), poses))
    turn = rotation_about((30.0, 20.0, -10.0), np.array([2.0, -1.0, 2.0]) / 3.0, 130.0)
    turn[:3, 3] += [500.0, -900.0, 300.0]
    for scale in (1.0, 1e-3):
        paths, whole = moved_paths("wrapping_cylinder", turn, scale)
        found = lengths(swept(paths, [whole @ pose @ np.linalg.inv(whole) for pose in poses]))
        np.testing.assert_allclose(found / scale, expected, rtol=2e-4)


def test_neither_the_order_of_fibres_nor_that_of_bones_matters(rng):
    made = strung_phantom("lifting_strap")
    poses = turned("lifting_strap", {}, "distal", angles(0.0, 70.0, 10.0))
    expected = lengths(swept(paths_of("lifting_strap"), poses))
    order = rng.permutation(len(made.fibres))
    shuffled = made.pulled(
        fibres=made.fibres[order],
        start_bones=made.start_bones[order],
        end_bones=made.end_bones[order],
        bones=dict(reversed(made.bones.items())),
    )
    np.testing.assert_allclose(lengths(swept(shuffled, poses)), expected[:, order], atol=1e-9)


def test_the_same_again_gives_the_same_bits():
    """Whatever was asked for before: blocks that were filled for other poses change nothing."""
    made = strung_phantom("flexor_over_brim", groove=8.0)
    poses = turned("flexor_over_brim", {"groove": 8.0}, "distal", angles(0.0, 80.0, 10.0))
    used, fresh = made.pulled(), made.pulled()
    swept(used, poses[::-1])
    for a, b in zip(swept(used, poses), swept(fresh, poses), strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.pushed, b.pushed)


def test_following_changes_no_state_that_is_given():
    paths = known_paths("wrapping_cylinder")
    before = paths.rest.points.copy(), paths.rest.place.copy(), paths.rest.pushed.copy()
    paths.follow(paths.rest, turned("wrapping_cylinder", {}, "pulley", [40.0])[0])
    for kept, now in zip(before, (paths.rest.points, paths.rest.place, paths.rest.pushed), strict=True):
        np.testing.assert_array_equal(kept, now)


def test_a_fibre_of_no_length_is_refused():
    made = strung_phantom("lifting_strap")
    fibres = made.fibres.copy()
    fibres[3] = fibres[3, 0]
    with pytest.raises(ValueError, match="fibre 3 has no length"):
        made.pulled(fibres=fibres)
