import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.motion.blending import blend_motions, screws_between
from vtkmuscle.core.motion.rigid import apply_transform, inverse, is_rigid, rotation_about


def motion(seed, angle=None):
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, 120) if angle is None else angle
    result = rotation_about(rng.normal(size=3) * 50, rng.normal(size=3), turn)
    result[:3, 3] += rng.normal(size=3) * 10
    return result


def test_motions_that_agree_move_everything_rigidly():
    points, move = np.random.default_rng(0).normal(size=(50, 3)) * 100, motion(1)
    weights = np.random.default_rng(2).dirichlet([1, 1, 1], size=50)
    assert np.allclose(blend_motions(np.array([move] * 3), weights, points), apply_transform(move, points))


def test_full_weight_is_the_bones_own_motion():
    points, moves = np.random.default_rng(0).normal(size=(2, 3)) * 100, np.array([motion(1), motion(2)])
    blended = blend_motions(moves, np.eye(2), points)
    assert np.allclose(blended, [apply_transform(m, p[None])[0] for m, p in zip(moves, points, strict=True)])


def test_a_point_that_no_motion_has_weight_for_stays():
    points = np.random.default_rng(0).normal(size=(3, 3)) * 100
    weights = np.array([[0.0, 0.0], [0.5, 0.5], [0.0, 0.0]])
    blended = blend_motions(np.array([motion(1), motion(2)]), weights, points)
    assert np.array_equal(blended[[0, 2]], points[[0, 2]])


def test_no_motion_leaves_points_where_they_are_to_the_last_bit():
    points = np.random.default_rng(0).normal(size=(50, 3)) * 100
    weights = np.random.default_rng(2).dirichlet([1, 1], size=50)
    weights /= weights.sum(axis=1, keepdims=True)
    still = blend_motions(np.array([np.eye(4)] * 2), weights, points)
    assert np.abs(still - points).max() <= 1e-13


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_blend_does_not_depend_on_the_frame_of_reference(seed):
    rng = np.random.default_rng(seed)
    points, moves, frame = rng.normal(size=(9, 3)) * 50, np.array([motion(seed), motion(seed + 1)]), motion(7)
    weights = rng.dirichlet([1, 1], size=9)
    here = apply_transform(frame, blend_motions(moves, weights, points))
    there = blend_motions(frame @ moves @ inverse(frame), weights, apply_transform(frame, points))
    assert np.allclose(here, there, atol=1e-9)


@pytest.mark.parametrize("angle", [1.0, 90.0, 170.0])
def test_half_way_to_a_turn_is_half_the_turn_and_does_not_collapse(angle):
    points = np.random.default_rng(0).normal(size=(20, 3)) * 30
    hinge = rotation_about([5, 0, 0], [0, 0, 1], angle)
    blended = blend_motions(np.array([np.eye(4), hinge]), np.full((20, 2), 0.5), points)
    assert np.allclose(blended, apply_transform(rotation_about([5, 0, 0], [0, 0, 1], angle / 2), points))


def test_blend_of_small_motions_is_the_mean_of_the_moved_positions():
    points = np.random.default_rng(0).normal(size=(20, 3)) * 30
    moves = np.array([rotation_about([1, 2, 3], [0, 1, 1], 0.01), rotation_about([0, 9, 3], [1, 1, 0], 0.02)])
    weights = np.random.default_rng(2).dirichlet([1, 1], size=20)
    mean = np.einsum("nb,bnk->nk", weights, [apply_transform(move, points) for move in moves])
    assert np.abs(blend_motions(moves, weights, points) - mean).max() < 1e-5


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-5, 0.3, 90.0, 179.0])
def test_parts_of_a_screw_add_up_to_the_whole(angle):
    start, move = motion(3), motion(4, angle)
    end = move @ start
    (part,) = screws_between(start[None], end[None], 0.25)
    assert is_rigid(part)
    quarter = part @ inverse(start)
    assert np.allclose(np.linalg.matrix_power(quarter, 4), move, atol=1e-9)
    assert np.allclose(screws_between(start[None], end[None], 0.0), start)
    assert np.array_equal(screws_between(start[None], end[None], 1.0), end[None])


def test_a_hinge_stays_on_its_hinge():
    centre = np.array([[10.0, 20, 30]])
    (half,) = screws_between(np.eye(4)[None], rotation_about(centre[0], [0, 1, 0], 80)[None], 0.5)
    assert np.allclose(half, rotation_about(centre[0], [0, 1, 0], 40))
