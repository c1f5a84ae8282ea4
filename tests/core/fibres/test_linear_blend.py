import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vtkmuscle.core.fibres.linear_blend import blend_fibres, fitted_a, origin_weights
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


def test_a_is_found_where_the_fibres_stay_out_of_a_bone():
    # Fibres along x; the insertion's bone lifts by 10 mm, and a bone below y = 10 (1 - w) - 1 is not entered
    # by the blend with a = 0.4 but by all with a larger one.
    t = np.linspace(0, 1, 31)
    points = np.column_stack([100 * t, 0 * t, 0 * t])
    offsets = np.array([0, 31])
    lift = np.eye(4)
    lift[1, 3] = 10.0
    floor = blend_fibres(points, offsets, np.eye(4), lift, 0.4)[:, 1]

    def depth(pose, moved):
        assert pose == 0
        return np.maximum(floor - moved[:, 1], 0.0)

    a, left = fitted_a(points, offsets, [(np.eye(4), lift)], depth)
    assert a == pytest.approx(0.4, abs=0.01)
    assert left == pytest.approx(0.0, abs=1e-3)
    assert fitted_a(points, offsets, [(np.eye(4), lift)], lambda _, moved: np.zeros(31)) == (0.0, 0.0)


@pytest.mark.parametrize("largest", [1.0, 0.3])
def test_where_no_a_is_best_the_fit_ends_at_its_bound(largest):
    # The insertion's bone lifts all into a ceiling: the less of it a fibre follows, the better.
    points = np.column_stack([np.linspace(0, 100, 31), np.zeros((31, 2))])
    lift = np.eye(4)
    lift[1, 3] = 10.0
    for sign, pose in ((-1.0, (np.eye(4), lift)), (1.0, (lift, np.eye(4)))):
        a, left = fitted_a(points, np.array([0, 31]), [pose], lambda _, moved: moved[:, 1], largest=largest)
        assert a == sign * largest
        others = [
            blend_fibres(points, np.array([0, 31]), *pose, sign * smaller)[:, 1].mean()
            for smaller in np.linspace(0, largest, 5)
        ]
        assert others[-1] == pytest.approx(left)
        assert (np.diff(others) < 0).all()
