import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vtkmuscle.core.motion import blending
from vtkmuscle.core.motion.rigid import apply_transform, are_rigid, inverse, rotation_about


def motion(seed, angle=None):
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, 120) if angle is None else angle
    result = rotation_about(rng.normal(size=3) * 50, rng.normal(size=3), turn)
    result[:3, 3] += rng.normal(size=3) * 10
    return result


def test_motions_that_agree_move_everything_rigidly():
    points, move = np.random.default_rng(0).normal(size=(50, 3)) * 100, motion(1)
    weights = np.random.default_rng(2).dirichlet([1, 1, 1], size=50)
    assert np.allclose(
        blending.blend_motions(np.array([move] * 3), weights, points), apply_transform(move, points)
    )


def test_a_point_that_no_motion_has_weight_for_stays():
    points = np.random.default_rng(0).normal(size=(3, 3)) * 100
    weights = np.array([[0.0, 0.0], [0.5, 0.5], [0.0, 0.0]])
    blended = blending.blend_motions(np.array([motion(1), motion(2)]), weights, points)
    assert np.array_equal(blended[[0, 2]], points[[0, 2]])


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_blend_does_not_depend_on_the_frame_of_reference(seed):
    rng = np.random.default_rng(seed)
    points, moves, frame = rng.normal(size=(9, 3)) * 50, np.array([motion(seed), motion(seed + 1)]), motion(7)
    weights = rng.dirichlet([1, 1], size=9)
    here = apply_transform(frame, blending.blend_motions(moves, weights, points))
    there = blending.blend_motions(frame @ moves @ inverse(frame), weights, apply_transform(frame, points))
    assert np.allclose(here, there, atol=1e-9)


@pytest.mark.parametrize("angle", [1.0, 90.0, 170.0])
def test_half_way_to_a_turn_is_half_the_turn_and_does_not_collapse(angle):
    points = np.random.default_rng(0).normal(size=(20, 3)) * 30
    hinge = rotation_about([5, 0, 0], [0, 0, 1], angle)
    blended = blending.blend_motions(np.array([np.eye(4), hinge]), np.full((20, 2), 0.5), points)
    assert np.allclose(blended, apply_transform(rotation_about([5, 0, 0], [0, 0, 1], angle / 2), points))


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-5, 0.3, 90.0, 179.0])
def test_parts_of_a_screw_add_up_to_the_whole(angle):
    start, move = motion(3), motion(4, angle)
    end = move @ start
    (part,) = blending.screws_between(start[None], end[None], 0.25)
    assert are_rigid(part)
    assert np.allclose(np.linalg.matrix_power((part @ inverse(start)), 4), move, atol=1e-9)
    assert np.allclose(blending.screws_between(start[None], end[None], 0.0), start)
    assert np.array_equal(blending.screws_between(start[None], end[None], 1.0), end[None])


def rotation_of(matrix):
    return blending.nearest_rotations(np.array([matrix], dtype=np.float64))[0]


def by_decomposition(matrix):
    u, _, vt = np.linalg.svd(matrix)
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    return u @ vt


def test_random_matrices_and_mirrored_ones():
    for matrix in np.random.default_rng(0).normal(size=(200, 3, 3)):
        for sign in (1.0, -1.0):
            assert_allclose(rotation_of(sign * matrix), by_decomposition(sign * matrix), atol=1e-9)


@pytest.mark.parametrize("stretch", [[1.0, 1, 1], [1e-6, 1e3, 2.0], [3.0, 2.0, 0.0], [1e150, 1e149, 1e148]])
def test_a_stretched_rotation_is_found_again(stretch):
    turn, axes = (Rotation.from_rotvec(v).as_matrix() for v in ([0.4, -1.9, 0.8], [1.0, 0.2, -0.5]))
    assert_allclose(rotation_of(turn @ axes @ np.diag(stretch) @ axes.T), turn, atol=1e-9)


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.outer([1, 2, 3], [3, 1, 2]), np.ones((3, 3))])
def test_what_has_no_definite_rotation_gives_one_that_is_best(matrix):
    rotation = rotation_of(matrix)
    assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert np.trace(rotation.T @ matrix) == pytest.approx(np.linalg.svd(matrix)[1].sum())
    assert_allclose(rotation_of(np.zeros((3, 3))), np.eye(3))


OFFSETS = np.array([0, 5, 6, 14])
POINTS = np.random.default_rng(0).normal(scale=30.0, size=(14, 3))
TURN = rotation_about([1.0, 2, 3], [0, 1, 1], 40.0)


@pytest.mark.parametrize("a", [-1.0, -0.042, 0.0, 0.5, 1.0])
def test_weights_go_from_one_to_zero_by_the_formula(a):
    weights, t = blending.origin_weights(OFFSETS, a), np.linspace(0, 1, 8)
    assert_allclose(weights[6:], a * t**2 - (a + 1) * t + 1, atol=1e-15)
    assert weights[0] == weights[5] == weights[6] == 1.0
    assert_allclose(weights[[4, 13]], 0, atol=1e-15)
    assert (np.diff(weights[6:]) < 1e-15).all()
    assert weights.min() >= -1e-15


def test_ends_follow_their_bones_and_both_bones_alike_carry_all():
    moved = blending.blend_fibres(POINTS, OFFSETS, np.eye(4), TURN, -0.042)
    assert_array_equal(moved[[0, 5, 6]], POINTS[[0, 5, 6]])
    assert_allclose(moved[[4, 13]], apply_transform(TURN, POINTS[[4, 13]]), atol=1e-12)
    together = blending.blend_fibres(POINTS, OFFSETS, TURN, TURN, 0.3)
    assert_allclose(together, apply_transform(TURN, POINTS), atol=1e-12)
