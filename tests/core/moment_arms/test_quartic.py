"""Quartics of lengths: known answers, their sign, and what they refuse."""

import numpy as np
import pytest

from vtkmuscle.core.moment_arms.of_joints import ErrorSources, joint_arms, quartic_moment_arms
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.phantoms.one_hinge import RADIUS, THICKNESS, strap_length


def test_the_sign_is_that_of_the_strap_that_is_wound_up():
    """It lengthens with the angle: the moment arm is negative, the radius of its middle line in size."""
    angles = np.arange(-60.0, 81.0, 2.0)
    arms, _ = quartic_moment_arms(np.array([[strap_length(angle)] for angle in angles]), np.radians(angles))
    np.testing.assert_allclose(arms, -(RADIUS + THICKNESS / 2.0), rtol=1e-9)


def test_a_quartic_is_exact_for_a_quartic():
    q = np.linspace(-1.0, 1.0, 11)
    lengths = (90.0 + q - 3 * q**2 + 2 * q**4)[:, None]
    arms, residuals = quartic_moment_arms(lengths, q, at=np.array([0.0, 0.5]))
    np.testing.assert_allclose(arms[:, 0], [-1.0, -(1 - 3.0 + 1.0)], atol=1e-9)
    assert residuals.max() < 1e-9


@pytest.mark.parametrize(("unit", "sag"), [("deg", 0.8), ("mm", 0.0)])
def test_the_sag_of_segments_is_a_part_of_the_error_of_an_angle(unit, sag):
    q = np.arange(0.0, 60.0, 10.0)
    coordinate = Coordinate(q, unit)
    motion = RigidMotion(q, {"bone": np.tile(np.eye(4), (6, 1, 1))}, None, {"q": coordinate})
    lengths = 90.0 - 20.0 * coordinate.natural[:, None] + [-1.0, 0.0, 1.0]
    (arms, _), (without, _) = (
        joint_arms(lengths, {"q": np.full((6, 3), 20.0)}, motion, sources=ErrorSources(np.ones(6), {}, sags))
        for sags in (np.full(6, 0.8), np.zeros(6))
    )
    np.testing.assert_allclose(arms["q"].errors["numerical"] - without["q"].errors["numerical"], sag)


def test_few_values_are_refused():
    q = np.array([0.0, 0.2, 0.4, 0.6, 0.4, 0.2, 0.0, 0.6 + 1e-9])
    with pytest.raises(ValueError, match=r"4 different value.s., but a quartic needs 6"):
        quartic_moment_arms(90.0 - 20.0 * q[:, None], q)
    with pytest.raises(ValueError, match=r"1 different value.s., but a quartic needs 6"):
        quartic_moment_arms(np.ones((7, 1)), np.full(7, 0.3))


def test_a_quartic_is_found_for_each_fibre_alone(rng):
    q = np.linspace(-0.4, 1.1, 25)
    lengths = np.polynomial.Polynomial(rng.normal(size=(5,)))(q)[:, None] + rng.normal(size=(25, 3))
    wanted = np.array([-0.4, 0.3])
    together, left = quartic_moment_arms(lengths, q, at=wanted)
    for k, curve in enumerate(lengths.T):
        fit = np.polynomial.Polynomial.fit(q, curve, 4)
        np.testing.assert_allclose(together[:, k], -fit.deriv()(wanted), rtol=1e-9)
        assert left[k] == pytest.approx(np.sqrt(((fit(q) - curve) ** 2).mean()))
