import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vtkmuscle.core.motion.blending import blend_fibres, origin_weights
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about

OFFSETS = np.array([0, 5, 6, 14])
POINTS = np.random.default_rng(0).normal(scale=30.0, size=(14, 3))
TURN = rotation_about([1.0, 2, 3], [0, 1, 1], 40.0)


@pytest.mark.parametrize("a", [-1.0, -0.042, 0.0, 0.5, 1.0])
def test_weights_go_from_one_to_zero_by_the_formula(a):
    weights = origin_weights(OFFSETS, a)
    t = np.linspace(0, 1, 8)
    assert_allclose(weights[6:], a * t**2 - (a + 1) * t + 1, atol=1e-15)
    assert weights[0] == weights[5] == weights[6] == 1.0
    assert_allclose(weights[[4, 13]], 0, atol=1e-15)
    assert (np.diff(weights[6:]) < 1e-15).all()
    assert weights.min() >= -1e-15


def test_ends_follow_their_bones_and_both_bones_alike_carry_all():
    moved = blend_fibres(POINTS, OFFSETS, np.eye(4), TURN, -0.042)
    assert_array_equal(moved[[0, 5, 6]], POINTS[[0, 5, 6]])
    assert_allclose(moved[[4, 13]], apply_transform(TURN, POINTS[[4, 13]]), atol=1e-12)
    together = blend_fibres(POINTS, OFFSETS, TURN, TURN, 0.3)
    assert_allclose(together, apply_transform(TURN, POINTS), atol=1e-12)


def test_a_motion_of_everything_moves_the_blend():
    outer = rotation_about([4.0, 5, 6], [1, 0, 1], 70.0)
    inner = blend_fibres(POINTS, OFFSETS, np.eye(4), TURN, 0.2)
    assert_allclose(
        blend_fibres(POINTS, OFFSETS, outer, outer @ TURN, 0.2), apply_transform(outer, inner), atol=1e-9
    )
