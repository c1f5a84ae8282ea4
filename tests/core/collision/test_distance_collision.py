"""The response to a bone given as signed distances."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import box, distance_to_box, sphere, union

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.collision.distance_collision import Clearance, resolve_distance_collisions
from vtkmuscle.core.motion.rigid import apply_transform, inverse, rotation_about

STILL = np.eye(4)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture(scope="module")
def globe():
    return Bone(*sphere(10.0), cell=0.5)


def resolve(bone, x, p, *, now=STILL, step=STILL, free=None, **settings):
    """Return where points end, and which were moved; positions and motions are those of the bone at rest."""
    x, p = np.array(x, dtype=float), np.array(p, dtype=float)
    free = np.ones(len(p), dtype=bool) if free is None else free
    from_axes = now @ inverse(bone.axes)
    moved = resolve_distance_collisions(bone, from_axes, step, x, p, free, **settings)
    return p, moved


def rest_allowance(bone, points, *, skin=0.0):
    return np.maximum(0.0, skin - bone.field(points)[0])


def rigid(rng):
    transform = np.eye(4)
    transform[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    transform[:3, 3] = rng.uniform(-100, 100, 3)
    return transform


def test_points_in_a_ball_go_out_along_the_radius(globe, rng):
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    p, moved = resolve(globe, 12.0 * directions, rng.uniform(7.0, 9.8, (500, 1)) * directions)
    assert moved.all()
    assert np.abs(np.linalg.norm(p, axis=1) - 10.0).max() < 0.05
    assert np.linalg.norm(p - 10.0 * directions, axis=1).max() < 0.3
    np.testing.assert_allclose(globe.field(p)[0], 0.0, atol=1e-6)


def test_points_outside_stay_where_they_are(globe, rng):
    x = rng.uniform(-20, 20, (2000, 3))
    x = x[np.linalg.norm(x, axis=1) > 10.5]
    _, moved = resolve(globe, x, x * rng.uniform(1.0, 2.0, (len(x), 1)))
    assert not moved.any()
    _, moved = resolve(globe, x + 1e6, x + 1e6)
    assert not moved.any()


def test_one_call_is_enough(globe, rng):
    x = 10.5 * np.array([[1.0, 0.0, 0.0]]) + rng.normal(scale=0.1, size=(300, 3))
    p, _ = resolve(globe, x, x - rng.uniform(0.0, 4.0, (300, 1)) * [1.0, 0.3, 0.0])
    again, moved = resolve(globe, x, p)
    assert not moved.any()
    np.testing.assert_array_equal(again, p)


def test_the_exact_depth_in_a_box_is_small_after_one_call(rng):
    low, high = (0.0, 0.0, 0.0), (20.0, 15.0, 12.0)
    bone = Bone(*box(low, high), cell=1.0)
    p = rng.uniform(np.array(low) - 1, np.array(high) + 1, (4000, 3))
    depth = -distance_to_box(p, low, high)
    p, x = p[depth > 0], p[depth > 0]  # were inside before, too
    out, _ = resolve(bone, x, p)
    # Only edges and corners lose something: however a corner lies in its cell, at most 0.43 of that.
    depth = -distance_to_box(out, low, high)
    assert np.percentile(depth, 95) < 0.05
    assert depth.max() < 0.43
    assert np.isfinite(out).all()


@pytest.mark.parametrize("cell", [0.5, 1.0])
def test_nothing_tunnels_through_a_plate_of_1_mm_in_a_step_of_200_mm(cell, rng):
    for offset in (0.0, 0.25, 0.5):
        low, high = (-150.0, -150.0, offset), (150.0, 150.0, offset + 1.0)
        bone = Bone(*box(low, high), cell=cell)
        x = np.column_stack([rng.uniform(-20, 20, (400, 2)), rng.uniform(1.6 + offset, 100.0, 400)])
        p = x + np.column_stack([rng.uniform(-20, 20, (400, 2)), np.full(400, -200.0)])
        out, moved = resolve(bone, x, p)
        assert moved.all()
        assert (out[:, 2] > high[2] - 0.05).all()
        assert (out[:, 2] < high[2] + 0.6 * cell).all()
        # They go on along the plate; its own axes are not quite those of its sides.
        assert np.abs(out[:, :2] - p[:, :2]).max() < 1e-3
        back, moved = resolve(bone, [[0.0, 0.0, -80.0]], [[1.0, 2.0, 90.0]])
        assert moved.all()
        assert back[0, 2] < low[2] + 0.05


def test_a_bone_that_jumps_over_a_muscle_takes_it_along(globe, rng):
    # The ball passes from -100 to 100 through points that do not move.
    x = rng.uniform(-5, 5, (300, 3))
    before, now = np.eye(4), np.eye(4)
    before[0, 3], now[0, 3] = -100.0, 100.0
    p, moved = resolve(globe, x, x, now=now, step=now @ inverse(before))
    assert moved.all()
    local = apply_transform(inverse(now), p)
    assert np.linalg.norm(local, axis=1).min() > 9.95
    # Those met head on are pushed before the ball; the others slip off along its tangent planes.
    assert (local[np.linalg.norm(x[:, 1:], axis=1) < 2.0, 0] > 0.0).all()


def test_a_point_that_slides_round_a_bone_is_not_held_back(globe):
    # A chord that cuts 0.6 mm deep into the ball.
    angle = np.radians(20.0)
    x = 10.01 * np.array([[np.sin(-angle), 0.0, np.cos(angle)]])
    p = x * [[-1.0, 1.0, 1.0]]
    out, moved = resolve(globe, x, p)
    assert not moved.any()
    np.testing.assert_array_equal(out, p)


def test_points_that_rest_on_a_bone_can_slide_and_leave(globe):
    x = np.array([[0.0, 0.0, 10.0], [0.0, 0.0, 10.0]])
    p = np.array([[2.0, 0.0, 9.9], [0.0, 0.0, 14.0]])
    out, _ = resolve(globe, x, p)
    assert np.abs(out[0] - p[0]).max() < 0.15
    np.testing.assert_array_equal(out[1], p[1])


def test_a_gap_can_be_crossed():
    bone = Bone(*union(box((0, 0, 0), (10, 10, 5)), box((0, 0, 5.8), (10, 10, 11))), cell=0.5)
    out, moved = resolve(bone, [[5.0, 5.0, 5.05]], [[5.0, 5.0, 5.75]])
    assert not moved.any()
    out, moved = resolve(bone, [[5.0, 5.0, 5.1]], [[5.2, 5.0, 6.3]])
    np.testing.assert_allclose(out, [[5.2, 5.0, 5.8]], atol=0.03)


def test_a_rigid_motion_of_bone_and_points_changes_nothing(globe, rng):
    x = rng.normal(size=(1000, 3)) * 8.0
    p = x + rng.normal(size=(1000, 3)) * 6.0
    before, now, everything = rigid(rng), rigid(rng), rigid(rng)
    step = now @ inverse(before)
    start, end = apply_transform(before, x), apply_transform(now, p)
    out, moved = resolve(globe, start, end, now=now, step=step)
    expected, expected_moved = resolve(globe, x, p)
    np.testing.assert_array_equal(moved, expected_moved)
    np.testing.assert_allclose(apply_transform(inverse(now), out), expected, atol=1e-6)
    again, _ = resolve(
        globe,
        apply_transform(everything, start),
        apply_transform(everything, end),
        now=everything @ now,
        step=everything @ step @ inverse(everything),
    )
    np.testing.assert_allclose(again, apply_transform(everything, out), atol=1e-6)


def test_with_allowance_the_rest_pose_is_an_equilibrium(globe, rng):
    now = rigid(rng)
    rest = rng.normal(size=(2000, 3)) * 6.0
    for skin in (0.0, 0.4):
        allowance = rest_allowance(globe, rest, skin=skin)
        assert (allowance > 0).any()
        world = apply_transform(now, rest)
        p, moved = resolve(globe, world, world, now=now, skin=skin, allowance=allowance)
        np.testing.assert_array_equal(p, world)
        assert not moved.any()


def test_a_point_with_allowance_goes_no_deeper_than_at_rest(globe):
    rest = np.array([[0.0, 0.0, 8.0], [0.0, 0.0, 11.0]])
    allowance = rest_allowance(globe, rest)
    p, moved = resolve(globe, rest, [[0.0, 0.0, 7.0], [0.0, 0.0, 7.0]], allowance=allowance)
    np.testing.assert_allclose(p[:, 2], [8.0, 10.0], atol=0.05)
    p, moved = resolve(globe, rest, [[0.0, 0.0, 8.5], [0.0, 0.0, 10.5]], allowance=allowance)
    assert not moved.any()


def test_the_skin_keeps_points_off(globe, rng):
    x = rng.normal(size=(300, 3))
    x *= 12.0 / np.linalg.norm(x, axis=1, keepdims=True)
    p, moved = resolve(globe, x, x * 0.85, skin=0.4)
    assert moved.all()
    assert np.abs(np.linalg.norm(p, axis=1) - 10.4).max() < 0.05


def test_nothing_tunnels_through_a_plate_that_is_thinner_than_its_skin():
    bone = Bone(*box((-20, -20, -0.2), (20, 20, 0.2)), cell=0.5)
    x, p = [[0.0, 0.0, 9.0], [3.0, 1.0, -9.0]], [[1.0, 0.0, -9.0], [3.0, 1.0, 9.0]]
    out, moved = resolve(bone, x, p, skin=1.5)
    assert moved.all()
    np.testing.assert_allclose(out[:, 2], [1.7, -1.7], atol=0.1)


def test_fixed_points_stay(globe):
    x = np.array([[0.0, 0.0, 12.0]] * 2)
    p = np.array([[0.0, 0.0, 9.0]] * 2)
    out, moved = resolve(globe, x, p, free=np.array([True, False]))
    np.testing.assert_array_equal(moved, [True, False])
    np.testing.assert_array_equal(out[1:], p[1:])


def test_a_muscle_wholly_swallowed_comes_out(globe, rng):
    x = rng.normal(size=(1000, 3))
    x *= rng.uniform(0.0, 9.0, (1000, 1)) / np.linalg.norm(x, axis=1, keepdims=True)
    x[0] = 0.0
    p, moved = resolve(globe, x, x)
    assert moved.all()
    assert np.linalg.norm(p, axis=1).min() > 9.95


def test_points_halfway_through_a_symmetric_plate_come_out():
    bone = Bone(*box((-8, -8, -1), (8, 8, 1)), cell=0.5)
    x = np.array([[0.0, 0.0, 0.0], [1.0, -2.0, 0.0]])
    p, _ = resolve(bone, x, x)
    assert (np.abs(p[:, 2]) > 0.99).all()


def test_odd_points_are_finite_or_left_alone(globe):
    x = np.array([[0.0, 0, 12], [0, 0, 12], [np.nan, 0, 0], [0, 0, 1e12], [0, 0, -1e300]])
    p = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 9], [0, 0, -1e12], [0, 0, 1e300]])
    out, moved = resolve(globe, x, p)
    np.testing.assert_array_equal(moved[:3], False)
    assert np.isfinite(out[3:]).all()


def test_no_points_are_fine(globe):
    _, moved = resolve(globe, np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(moved) == 0


def test_the_way_out_has_no_jumps_between_cells(globe):
    """Points next to each other in a bone come out next to each other, wherever the grid has its cells."""
    angle = np.linspace(0.0, np.pi, 20_001)
    inside = 9.3 * np.column_stack([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
    out, moved = resolve(globe, inside * (12.0 / 9.3), inside)
    assert moved.all()
    apart = np.linalg.norm(np.diff(out, axis=0), axis=1)
    assert apart.max() < 3.0 * np.median(apart)


@pytest.mark.parametrize("pace", [0.05, 0.2, 0.6])
def test_points_passed_over_as_they_are_clear_are_those_that_are_not_moved(globe, rng, pace):
    """Whatever way points take around a bone, knowing their clearance changes nothing but the time."""
    known = Clearance(500)
    x = rng.normal(size=(500, 3))
    x *= rng.uniform(10.1, 12.0, (500, 1)) / np.linalg.norm(x, axis=1, keepdims=True)
    passed_over = touched = 0
    for _ in range(12):
        p = x + rng.normal(scale=pace, size=x.shape)
        way = p - known.seen_at
        passed_over += int(((way**2).sum(axis=1) < known.squares).sum())
        expected, expected_moved = resolve(globe, x, p)
        p, moved = resolve(globe, x, p, clearance=known)
        assert np.array_equal(moved, expected_moved)
        assert np.array_equal(p, expected)
        touched += int(moved.sum())
        x = p
    assert touched > 10
    assert passed_over > 100


@pytest.mark.parametrize("pace", [0.1, 0.6])
def test_what_is_known_of_points_moves_with_the_bone(globe, rng, pace):
    """From step to step, on a bone that turns and shifts, also when the points are those of another time."""
    known, free = Clearance(500), np.ones(500, dtype=bool)
    outside = rng.normal(size=(500, 3))
    outside *= rng.uniform(10.1, 20.0, (500, 1)) / np.linalg.norm(outside, axis=1, keepdims=True)
    x, before = outside, np.eye(4)
    passed_over = touched = 0
    for number in range(12):
        now = rotation_about([3.0, -2.0, 30.0], [1.0, 2.0, 0.5], 1.5 * number)
        towards = x
        if number == 7:  # from anywhere back to where they were seen, through the bone as often as not
            x, before = apply_transform(now, outside[::-1]), now
        step = now @ inverse(before)
        from_axes = now @ inverse(globe.axes)
        known.begin(from_axes, step, x)
        start = x
        for _ in range(3):
            p = towards + rng.normal(scale=pace, size=x.shape)
            passed_over += int((((p - known.seen_at) ** 2).sum(axis=1) < known.squares).sum())
            expected, q = p.copy(), p.copy()
            looked_at = resolve_distance_collisions(globe, from_axes, step, start, expected, free)
            moved = resolve_distance_collisions(globe, from_axes, step, start, q, free, clearance=known)
            assert np.array_equal(moved, looked_at)
            assert np.array_equal(q, expected)
            touched += int(moved.sum())
            x, towards, start, step = q, q, q, np.eye(4)
        before = now
    assert touched > 10
    assert passed_over > 3000


@pytest.mark.parametrize("far", [1e17, 1e150, 1e300])
def test_paths_so_long_that_steps_are_lost_in_rounding_come_to_an_end(globe, far):
    x = np.array([[0.0, 0, far], [0, 0, 12], [far, far, far]])
    p, _ = resolve(globe, x, [[0.0, 0, -far], [0, far, 0], [0, 0, 1.0]])
    assert np.isfinite(p).all()
