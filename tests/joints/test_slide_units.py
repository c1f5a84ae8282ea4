"""A tree with its slides in metres moves as it did."""

import numpy as np
import pytest

from vtkmuscle.joints.functions import IDENTITY, CubicSpline, PiecewiseLinear, Polynomial, Wave
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree

X = np.array([0.0, 4.0, 9.0, 15.0])
FUNCTIONS = [
    Polynomial([2.0]),
    Polynomial([0.01, -0.3, 1.0]),
    PiecewiseLinear(X, X**2),
    CubicSpline(X, np.sin(X)),
    Wave(2.0, 0.4, 0.1, 0.3),
]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda one: type(one).__name__)
def test_a_function_in_other_units_has_the_same_values(function):
    values = np.linspace(-3.0, 20.0, 12)
    np.testing.assert_allclose(
        function.rescaled(0.001, 3.0)(0.001 * values), 3.0 * function(values), rtol=1e-9, atol=1e-12
    )


def test_poses_are_the_same():
    draw = Joint(
        "draw",
        "box",
        "drawer",
        [JointAxis((0, 0, 1), CubicSpline(X, 0.1 * X), "out")],
        [JointAxis((1, 0, 0), IDENTITY, "out"), JointAxis((0, 1, 0), Polynomial([0.02, 0.0, 0.0]), "aside")],
    )
    coordinates = [JointCoordinate("out", "mm", 2.0), JointCoordinate("aside", "cm")]
    tree = KinematicTree("box", [draw], coordinates, [Coupling("aside", "out", Polynomial([0.5, 1.0]))])
    metres, factors = tree.in_metres(0.001)
    assert factors == {"out": 0.001, "aside": 0.01}
    assert metres.coordinate("out").rest == pytest.approx(0.002)
    values = np.linspace(0.0, 14.0, 8)
    then, now = tree.poses({"out": values}), metres.poses({"out": 0.001 * values})
    np.testing.assert_allclose(now["drawer"][:, :3, :3], then["drawer"][:, :3, :3], atol=1e-12)
    np.testing.assert_allclose(now["drawer"][:, :3, 3], 0.001 * then["drawer"][:, :3, 3], atol=1e-15)
