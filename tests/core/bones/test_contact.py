"""Where contact with a bone, known by its signed distances, leaves points."""

import numpy as np
import pytest
from shapes import box, distance_to_box, rigid, sphere

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneContact, PoseContact
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about

STILL = np.eye(4)[None]
FAR = np.array([300.0, 300.0, 300.0])


@pytest.fixture(scope="module")
def globe():
    return Bone(*sphere(10.0), cell=0.5)


def keep_out(bones, p, *, rest=None, transforms=STILL, free=None, clearance=0.0, centre=None):
    """Return where points end, and which were moved; at rest they are far from the bones."""
    p = np.array(p, dtype=float)
    rest = np.tile(FAR, (len(p), 1)) if rest is None else np.asarray(rest, dtype=float)
    free = np.ones(len(p), dtype=bool) if free is None else free
    bones = dict(enumerate(bones)) if isinstance(bones, list) else {0: bones}
    contact = BoneContact(bones, rest, free, clearance)
    return p, PoseContact(contact, transforms, [], np.zeros(3) if centre is None else centre).keep_out(p)


def on_unit_sphere(rng, count):
    directions = rng.normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_points_in_a_ball_go_out_along_the_radius(globe, rng):
    directions = on_unit_sphere(rng, 500)
    p, moved = keep_out(globe, rng.uniform(7.0, 9.8, (500, 1)) * directions)
    assert moved.all()
    assert np.abs(np.linalg.norm(p, axis=1) - 10.0).max() < 0.05
    assert np.linalg.norm(p - 10.0 * directions, axis=1).max() < 0.3
    np.testing.assert_allclose(globe.field(p)[0], 0.0, atol=1e-6)
    again, moved = keep_out(globe, p)
    assert not moved.any()
    np.testing.assert_array_equal(again, p)


def test_the_exact_depth_in_a_box_is_small_after_one_call(rng):
    low, high = (0.0, 0.0, 0.0), (20.0, 15.0, 12.0)
    p = rng.uniform(np.array(low) - 1, np.array(high) + 1, (4000, 3))
    out, _ = keep_out(Bone(*box(low, high), cell=1.0), p[distance_to_box(p, low, high) < 0])
    # Only edges and corners lose something: however a corner lies in its cell, at most 0.43 of that.
    depth = -distance_to_box(out, low, high)
    assert np.percentile(depth, 95) < 0.05
    assert depth.max() < 0.43


@pytest.mark.parametrize("clearance", [0.0, 1.5, 4.0])
def test_points_keep_their_clearance(globe, clearance):
    p, moved = keep_out(globe, [[0.0, 0.0, 9.0], [0.0, 0.0, 15.0]], clearance=clearance)
    assert moved.tolist() == [True, False]
    np.testing.assert_allclose(p[:, 2], [10.0 + clearance, 15.0], atol=0.05)


@pytest.mark.parametrize("clearance", [0.0, 0.4])
def test_the_rest_pose_is_an_equilibrium(globe, rng, clearance):
    now, rest = rigid(rng), rng.normal(size=(2000, 3)) * 6.0
    world = apply_transform(now, rest)
    p, moved = keep_out(globe, world, rest=rest, transforms=now[None], clearance=clearance)
    np.testing.assert_array_equal(p, world)
    assert not moved.any()


def test_a_point_goes_no_deeper_than_at_rest(globe):
    rest = np.array([[0.0, 0.0, 8.0], [0.0, 0.0, 11.0]])
    p, _ = keep_out(globe, [[0.0, 0.0, 7.0], [0.0, 0.0, 7.0]], rest=rest)
    np.testing.assert_allclose(p[:, 2], [8.0, 10.0], atol=0.05)
    _, moved = keep_out(globe, [[0.0, 0.0, 8.5], [0.0, 0.0, 10.5]], rest=rest)
    assert not moved.any()


def test_fixed_points_stay_and_bring_no_bone_near(globe):
    bone = Bone(*sphere(10.0), cell=0.5)
    p = [[0.0, 0.0, 12.0], [0.0, 0.0, 9.0]]
    out, moved = keep_out(bone, p, free=np.array([True, False]))
    assert not moved.any()
    np.testing.assert_array_equal(out, p)
    _, moved = keep_out(bone, np.add(p, [0.0, 0.0, 50.0]))
    assert not moved.any()
    out, moved = keep_out(bone, p, free=np.zeros(2, dtype=bool))
    assert not moved.any()
    assert len(keep_out([], p)[0]) == 2
    assert len(keep_out(bone, np.zeros((0, 3)))[1]) == 0


def test_points_in_two_bones_leave_both():
    bones = [Bone(*box((-5, -5, -5), (5, 5, 5))), Bone(*box((4.0, -5, -5), (20, 5, 5)))]
    p, _ = keep_out(bones, [[4.5, 0.0, 4.8], [4.6, 0.0, -4.9]], transforms=np.tile(np.eye(4), (2, 1, 1)))
    for bone in bones:
        assert bone.solids.depth(p).max() < 0.1


def test_odd_points_are_finite_or_left_alone(globe):
    p = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 9], [0, 0, -1e12], [0, 0, 1e300]])
    out, moved = keep_out(globe, p)
    assert moved.tolist() == [False, False, True, False, False]
    assert np.isfinite(out[2:]).all()


@pytest.mark.parametrize("pace", [0.05, 0.2, 0.6])
def test_points_passed_over_are_those_that_would_not_be_moved(globe, rng, pace):
    """However points and bones move, the contact that saw the points before gives the same as a new one."""
    x = on_unit_sphere(rng, 500) * rng.uniform(10.1, 16.0, (500, 1))
    muscle, touched = ({0: globe}, np.tile(FAR, (500, 1)), np.ones(500, dtype=bool)), 0
    contact = BoneContact(*muscle)
    for step in range(24):
        if step % 4 == 0:
            now = rotation_about([3.0, -2.0, 30.0], [1.0, 2.0, 0.5], 0.5 * step)[None]
            pose = PoseContact(contact, now, [], np.zeros(3))
        p = x + rng.normal(scale=pace, size=x.shape)
        expected = p.copy()
        expected_moved = PoseContact(BoneContact(*muscle), now, [], np.zeros(3)).keep_out(expected)
        moved = pose.keep_out(p)
        assert np.array_equal(moved, expected_moved)
        assert np.array_equal(p, expected)
        touched += int(moved.sum())
        x = p
    assert touched > 10
