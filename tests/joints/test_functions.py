"""Functions of coordinates: splines that reproduce what they must, and go on straight."""

import numpy as np
import pytest

from vtkmuscle.joints.functions import CubicSpline, PiecewiseLinear, Polynomial


@pytest.mark.parametrize("knots", [4, 5, 9])
def test_spline_reproduces_a_cubic(rng, knots):
    x = np.sort(rng.uniform(-2, 2, knots)) + 0.1 * np.arange(knots)
    cubic, inside = Polynomial(rng.normal(size=4)), np.linspace(x[0], x[-1], 101)
    np.testing.assert_allclose(CubicSpline(x, cubic(x))(inside), cubic(inside), rtol=0, atol=1e-10)


def test_spline_of_three_knots_has_one_third_derivative():
    spline, values = CubicSpline([0.0, 1.0, 3.0], [0.0, 1.0, 9.0]), np.linspace(0, 3, 7)
    np.testing.assert_allclose(spline(values), values**2, atol=1e-12)


def test_spline_goes_on_straight_beyond_its_knots(rng):
    x, y = np.arange(6.0), rng.normal(size=6)
    spline = CubicSpline(x, y)
    for end, sign in ((0.0, -1.0), (5.0, 1.0)):
        slope = (spline(np.array([end])) - spline(np.array([end - sign * 1e-6])))[0] / (sign * 1e-6)
        beyond = spline(end + sign * np.array([1.0, 2.0]))
        np.testing.assert_allclose(np.diff(beyond) * sign, slope, rtol=1e-4)


def test_knots_that_do_not_ascend_are_refused():
    with pytest.raises(ValueError, match="ascend"):
        CubicSpline([0.0, 0.0, 1.0], [0.0, 1.0, 2.0])
    with pytest.raises(ValueError, match="as many of each"):
        PiecewiseLinear([0.0, 1.0], [0.0])
