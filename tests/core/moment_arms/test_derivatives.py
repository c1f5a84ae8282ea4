"""Moment arms: known answers, their sign, and errors that hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.moment_arms.derivatives import moment_arms, quartic_moment_arms
from vtkmuscle.phantoms.cylinder_wrap import RADIUS, THICKNESS, strap_length

#: Of a normal distribution, 90 per cent is within so many standard deviations.
WITHIN_90 = 1.645


def wrapped(q):
    """Length of a muscle whose moment arm goes from -38 to 38 mm, and that arm."""
    return 100.0 + 30.0 * np.sin(1.3 * q + 0.4), -39.0 * np.cos(1.3 * q + 0.4)


def lifting_off(q):
    """A muscle that leaves its bone at 40 degrees, within some 10 degrees."""
    turn = (q - 0.7) * 12.0
    return 100.0 + 20.0 * np.log1p(np.exp(turn)) / 12.0 + 10.0 * q, -20.0 / (1.0 + np.exp(-turn)) - 10.0


def straight_line(q):
    """A muscle from a point to another that turns about a hinge (law of cosines)."""
    length = np.sqrt(90.0**2 + 40.0**2 - 2.0 * 90.0 * 40.0 * np.cos(q + 0.8))
    return length, -90.0 * 40.0 * np.sin(q + 0.8) / length


def noisy(lengths, noise, n_fibres, seed=3):
    rng = np.random.default_rng(seed)
    return lengths[:, None] + noise * rng.standard_normal((len(lengths), n_fibres))


@pytest.mark.parametrize("curve", [wrapped, lifting_off, straight_line])
@pytest.mark.parametrize(("n", "noise"), [(46, 0.01), (46, 0.3), (91, 0.1), (181, 0.5)])
def test_the_standard_error_covers_the_true_error_in_nine_cases_of_ten(curve, n, noise):
    q = np.radians(np.linspace(0.0, 90.0, n))
    lengths, known = curve(q)
    found = moment_arms(noisy(lengths, noise, 80), q)
    errors = np.abs(found.arms[..., 0] - known[:, None])
    covered = np.mean(errors <= WITHIN_90 * found.errors[..., 0])
    assert 0.84 <= covered <= 0.94
    assert np.sqrt(np.mean(errors**2)) < 5.0


def test_the_sign_is_that_of_the_strap_that_is_wound_up():
    """It lengthens with the angle: the moment arm is negative, the radius of its middle line in size."""
    angles = np.arange(-60.0, 81.0, 2.0)
    lengths = [strap_length(angle) for angle in angles]
    found = moment_arms(lengths, np.radians(angles))
    np.testing.assert_allclose(found.arms, -(RADIUS + THICKNESS / 2.0), rtol=1e-9)
    arms, _ = quartic_moment_arms(lengths, np.radians(angles))
    np.testing.assert_allclose(arms, -(RADIUS + THICKNESS / 2.0), rtol=1e-9)


def test_the_window_suits_the_noise():
    q = np.radians(np.linspace(0.0, 90.0, 91))
    lengths, _ = wrapped(q)
    windows = [moment_arms(noisy(lengths, noise, 50), q).window for noise in (0.001, 0.05, 1.0)]
    assert windows == sorted(windows)
    assert windows[0] < 0.25 * len(q)
    assert windows[2] > 0.4 * len(q)


def test_where_a_muscle_lifts_off_a_quartic_is_wrong_and_the_regression_is_not():
    q = np.radians(np.linspace(0.0, 90.0, 91))
    lengths, known = lifting_off(q)
    measured = noisy(lengths, 0.02, 20)
    local = moment_arms(measured, q).arms[..., 0] - known[:, None]
    arms, residuals = quartic_moment_arms(measured, q)
    assert np.sqrt(np.mean(local**2)) < 0.3
    assert np.sqrt(np.mean((arms - known[:, None]) ** 2)) > 1.5
    assert (residuals > 3 * 0.02).all()


def test_a_quartic_is_exact_for_a_quartic():
    q = np.linspace(-1.0, 1.0, 11)
    arms, residuals = quartic_moment_arms(90.0 + q - 3 * q**2 + 2 * q**4, q, at=[0.0, 0.5])
    np.testing.assert_allclose(arms[:, 0], [-1.0, -(1 - 3.0 + 1.0)], atol=1e-9)
    assert residuals.max() < 1e-9


def test_a_sweep_up_and_down_in_irregular_steps_gives_the_same():
    rng = np.random.default_rng(5)
    q = np.concatenate([np.sort(rng.uniform(0, 1.5, 40)), np.sort(rng.uniform(0, 1.5, 40))[::-1]])
    q = np.concatenate([q, q[:30], [q[0]] * 5])  # values that come again, some of them often
    lengths, known = wrapped(q)
    found = moment_arms(noisy(lengths, 0.05, 40), q)
    assert np.sqrt(np.mean((found.arms[..., 0] - known[:, None]) ** 2)) < 0.6
    same = np.flatnonzero(q == q[0])
    np.testing.assert_allclose(found.arms[same], found.arms[[0] * len(same)], rtol=1e-9)


def test_the_order_of_the_poses_does_not_matter():
    q = np.radians(np.linspace(0.0, 60.0, 31))
    measured = noisy(wrapped(q)[0], 0.1, 3)
    order = np.random.default_rng(0).permutation(31)
    np.testing.assert_allclose(
        moment_arms(measured[order], q[order]).arms, moment_arms(measured, q).arms[order], atol=1e-9
    )


@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 10.0), st.floats(-1e3, 1e3), st.floats(-3.0, 3.0))
def test_arms_scale_with_length_and_not_with_where_zero_is(scale, longer, turned):
    q = np.radians(np.linspace(0.0, 60.0, 21))
    measured = noisy(wrapped(q)[0], 0.05, 2)
    one, other = moment_arms(measured, q), moment_arms(scale * measured + longer, q + turned)
    np.testing.assert_allclose(other.arms, scale * one.arms, rtol=1e-5, atol=1e-5 * scale)
    np.testing.assert_allclose(other.errors, scale * one.errors, rtol=1e-5, atol=1e-5 * scale)


def test_arms_are_wanted_between_the_poses_too():
    q = np.radians(np.linspace(0.0, 60.0, 61))
    wanted = np.radians([0.0, 10.5, 33.3, 60.0])
    found = moment_arms(wrapped(q)[0], q, at=wanted)
    assert found.arms.shape == (4, 1, 1)
    np.testing.assert_allclose(found.arms[:, 0, 0], wrapped(wanted)[1], atol=1e-3)
    with pytest.raises(ValueError, match="there is none, for the poses reach from"):
        moment_arms(wrapped(q)[0], q, at=[2.0])


def test_few_values_are_refused_and_those_that_suffice_are_not():
    q = np.array([0.0, 0.2, 0.4, 0.6, 0.4, 0.2, 0.0])
    np.testing.assert_allclose(moment_arms(90.0 - 20.0 * q, q).arms, 20.0, rtol=1e-9)
    few = np.array([0.0, 0.2, 0.4, 0.2, 0.0, 0.4 + 1e-9])
    with pytest.raises(ValueError, match=r"3 different value.s., but 4 are needed for 1 coordinate"):
        moment_arms(90.0 - 20.0 * few, few)
    with pytest.raises(ValueError, match=r"4 different value.s., but a quartic needs 6"):
        quartic_moment_arms(90.0 - 20.0 * q, q)
    with pytest.raises(ValueError, match=r"coordinate 0 is 0.3 in every pose"):
        moment_arms(np.ones(6), np.full(6, 0.3))


@pytest.mark.parametrize(
    ("lengths", "coordinates", "message"),
    [
        (np.ones((5, 2)), np.arange(6.0), "5 lengths of a fibre, but 6 poses"),
        ([1.0, np.nan, 2.0], [0.0, 1.0, 2.0], "the lengths are of shape .* finite"),
        ([1.0, 1.0, 2.0], [0.0, np.inf, 2.0], "the coordinates are of shape .* finite"),
        (np.ones((0, 2)), np.ones((0, 1)), "the lengths are of shape"),
    ],
)
def test_what_cannot_be_is_refused(lengths, coordinates, message):
    with pytest.raises(ValueError, match=message):
        moment_arms(lengths, coordinates)


# ------------------------------------------------------------------------------- several coordinates


def biarticular(q):
    """Length over two joints, and its two moment arms."""
    a, b = q[:, 0], q[:, 1]
    length = 300.0 - 25.0 * np.sin(a) + 18.0 * b + 6.0 * a * b
    return length, np.column_stack([25.0 * np.cos(a) - 6.0 * b, -18.0 - 6.0 * a])


def test_two_coordinates_have_each_their_arm():
    q = np.array([(a, b) for a in np.linspace(0, 1.2, 12) for b in np.linspace(-0.5, 0.8, 12)])
    lengths, known = biarticular(q)
    found = moment_arms(noisy(lengths, 0.05, 30), q)
    assert found.determined.all()
    errors = np.abs(found.arms - known[:, None, :])
    assert np.sqrt(np.mean(errors**2)) < 0.8
    assert 0.84 <= np.mean(errors <= WITHIN_90 * found.errors) <= 0.95


def test_only_the_coordinate_that_changes_by_itself_is_determined():
    """From rest to the sweep's start three coordinates go together; then one of them sweeps."""
    rest, sweep = np.radians([1.6, -4.7, -5.3]), np.radians(np.arange(-10.0, 61.0, 2.0))
    lead = np.linspace(1.0, 0.0, 6)[:-1, None] * rest
    back = np.radians(np.arange(0.0, -10.0, -2.0))
    q = np.vstack([lead, *([[a, 0.0, 0.0]] for a in [*back, *sweep])])
    length = wrapped(q[:, 0])[0] + 50.0 * q[:, 1] - 20.0 * q[:, 2]
    found = moment_arms(length, q)
    assert found.determined[len(lead) :, 0].all()
    assert not found.determined[:, 1:].any()
    np.testing.assert_allclose(found.arms[len(lead) :, 0, 0], wrapped(q[len(lead) :, 0])[1], atol=0.3)
    assert np.isfinite(found.arms).all()
    assert (found.arms[~found.determined[:, None, :]] == 0).all()


def test_coordinates_that_only_change_together_are_refused():
    along = np.linspace(0.0, 1.0, 30)
    with pytest.raises(ValueError, match="change only together"):
        moment_arms(90.0 + along, np.column_stack([along, 2.0 * along]))


def test_a_quartic_is_found_for_each_fibre_alone(rng):
    q = np.linspace(-0.4, 1.1, 25)
    lengths = np.polynomial.Polynomial(rng.normal(size=(5,)))(q)[:, None] + rng.normal(size=(25, 3))
    together, left = quartic_moment_arms(lengths, q, at=[-0.4, 0.3])
    for k, curve in enumerate(lengths.T):
        fit = np.polynomial.Polynomial.fit(q, curve, 4)
        np.testing.assert_allclose(together[:, k], -fit.deriv()(np.array([-0.4, 0.3])), rtol=1e-9)
        assert left[k] == pytest.approx(np.sqrt(((fit(q) - curve) ** 2).mean()))
