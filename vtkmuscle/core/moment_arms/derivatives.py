"""Moment arms: how much a fibre's length changes as a joint turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyfit, polyval
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.local_regression import distinct_places, fewest_places, local_regression
from vtkmuscle.core.types import Bools, Floats

#: Degree of the polynomial that the field fits to lengths (Modenese, Kohout 2020), and how many different
#: values it needs: one more than coefficients, or it goes through every sample, noise and all.
QUARTIC = 4
FEWEST_FOR_QUARTIC = QUARTIC + 2


@dataclass(frozen=True, eq=False)
class MomentArmCurves:
    """Moment arms of fibres at some values of one coordinate or several.

    Attributes
    ----------
    arms : (m, k, d) array
        Moment arm of each fibre by each coordinate, at each of the values; 0 where it is not determined.
    errors : (m, k, d) array
        Their standard errors, for noise of the lengths that is independent from sample to sample.
    determined : (m, d) bool array
        False where the samples near the value do not separate the coordinate from the others.
    window : int
        Places of samples that a window of the regression holds; one more than there are: all count alike.
    """

    arms: Floats
    errors: Floats
    determined: Bools
    window: int


def moment_arms(
    lengths: ArrayLike, coordinates: ArrayLike, *, at: ArrayLike | None = None
) -> MomentArmCurves:
    """Return moment arms, -dl/dq, from lengths of fibres at values of joint coordinates.

    A fibre that shortens as a coordinate grows has a positive moment arm: its pull drives the coordinate up
    (principle of virtual work; An et al. 1984, for any coordinate Sherman et al. 2013). The slope is that of
    a cubic fitted about each place, in a window that is chosen against the noise of the lengths; see
    :func:`~vtkmuscle.core.moment_arms.local_regression.local_regression`.

    Parameters
    ----------
    lengths : (f, k) or (f,) array_like
        Of k fibres in f poses [mm, or any unit of length].
    coordinates : (f,) or (f, d) array_like
        Of the poses, in any order, values may come again; in radians for an angle, for moment arms in the
        unit of the lengths; in the unit of the lengths for a translation, for moment arms without a unit.
    at : (m,) or (m, d) array_like, optional
        Where they are wanted, in the range of the coordinates; default: at each pose.

    Returns
    -------
    MomentArmCurves
        Of finite numbers.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, a coordinate does not change, there are too few
        different values (4 for one coordinate), ``at`` is outside of them, or no moment arm is determined by
        the poses.

    References
    ----------
    An, Takahashi, Harrigan, Chao 1984, *Determination of muscle orientations and moment arms*,
    doi:10.1115/1.3138494.
    Sherman, Seth, Delp 2013, *What is a moment arm? Calculating muscle effectiveness in biomechanical models
    using generalized coordinates*, doi:10.1115/DETC2013-13633.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.derivatives import moment_arms
    >>> angles = np.radians(np.arange(0.0, 61.0, 5.0))
    >>> found = moment_arms(80.0 + 30.0 * angles, angles)  # wound up on a pulley of 30 mm
    >>> found.arms[:2, 0, 0].round(6)
    array([-30., -30.])
    """
    curves, samples = _checked_samples(lengths, coordinates)
    if len(curves) != len(samples):
        raise InputError(
            "",
            f"there are {len(curves)} lengths of a fibre, but {len(samples)} poses",
            "give a row per pose",
        )
    for number, spread in enumerate(np.ptp(samples, axis=0)):
        if not spread > 0:
            raise InputError(
                "",
                f"coordinate {number} is {samples[0, number]:g} in every pose, so no slope by it is known",
                "leave it out",
            )
    dimension = samples.shape[1]
    n_places, needed = len(distinct_places(samples)), fewest_places(dimension)
    if n_places < needed:
        raise InputError(
            "",
            f"the coordinates have {n_places} different value(s), but {needed} are needed for {dimension} "
            "coordinate(s)",
            "use more frames of the motion",
        )
    fit = local_regression(samples, curves, samples if at is None else _checked_places(at, samples))
    if not fit.determined.any():
        raise InputError(
            "",
            f"the {dimension} coordinates change only together, so that no slope by one of them is known",
            "name one of them, or use a motion that changes them one after the other",
        )
    return MomentArmCurves(0.0 - fit.slopes, fit.slope_errors, fit.determined, fit.window)


def quartic_moment_arms(
    lengths: ArrayLike, coordinate: ArrayLike, *, at: ArrayLike | None = None
) -> tuple[Floats, Floats]:
    """Return moment arms, -dl/dq, of a polynomial of degree 4 fitted to all lengths of each fibre.

    It is the habit of the field (Modenese, Kohout 2020), and smooth; where a muscle lifts off a bone, or a
    curve has more than three bends, it is not what was measured, and the residual says so.

    Parameters
    ----------
    lengths : (f, k) or (f,) array_like
        Of k fibres in f poses.
    coordinate : (f,) array_like
        Of the poses, in any order; in radians for an angle.
    at : (m,) array_like, optional
        Where they are wanted; default: at each pose.

    Returns
    -------
    arms : (m, k) array
        Moment arms.
    residuals : (k,) array
        Root mean square of what the fit leaves of each fibre's lengths.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, or there are fewer than 6 different values.

    References
    ----------
    Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4: quartics of lengths.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.derivatives import quartic_moment_arms
    >>> q = np.linspace(0.0, 1.0, 7)
    >>> arms, residuals = quartic_moment_arms(50.0 + q**2, q, at=[0.5])
    >>> arms.round(6), residuals.round(6)
    (array([[-1.]]), array([0.]))
    """
    curves, samples = _checked_samples(lengths, coordinate)
    if samples.shape[1] != 1 or len(curves) != len(samples):
        raise InputError(
            "",
            f"a quartic takes one coordinate with a value per pose, but the lengths are of {len(curves)} "
            f"poses and the coordinates of shape {samples.shape}",
        )
    n_places = len(distinct_places(samples))
    if n_places < FEWEST_FOR_QUARTIC:
        raise InputError(
            "",
            f"the coordinate has {n_places} different value(s), but a quartic needs {FEWEST_FOR_QUARTIC}",
            "use more frames of the motion",
        )
    places = samples if at is None else _checked_places(at, samples)
    low, high = samples.min(), samples.max()
    q, wanted = (2.0 * (x[:, 0] - low) / (high - low) - 1.0 for x in (samples, places))
    fits = polyfit(q, curves, QUARTIC)
    arms = -2.0 / (high - low) * polyval(wanted, polyder(fits)).T
    left = polyval(q, fits).T - curves
    return arms, np.sqrt((left**2).mean(axis=0))


def _checked_table(table: ArrayLike, what: str, column: str) -> Floats:
    """Return finite numbers with a row per pose, having checked them; a list is one column."""
    rows = np.asarray(table, dtype=np.float64)
    rows = rows[:, None] if rows.ndim == 1 else rows
    if rows.ndim != 2 or not rows.size or not np.isfinite(rows).all():
        raise InputError(
            "",
            f"the {what} are of shape {rows.shape}, but must be finite numbers, a row per pose and a column "
            f"per {column}",
        )
    return rows


def _checked_samples(lengths: ArrayLike, coordinates: ArrayLike) -> tuple[Floats, Floats]:
    """Return lengths (f, k) and coordinates (f, d), as arrays of finite numbers."""
    return _checked_table(lengths, "lengths", "fibre"), _checked_table(
        coordinates, "coordinates", "coordinate"
    )


def _checked_places(at: ArrayLike, samples: Floats) -> Floats:
    places = np.asarray(at, dtype=np.float64)
    places = places[:, None] if places.ndim == 1 and samples.shape[1] == 1 else np.atleast_2d(places)
    if places.shape[1] != samples.shape[1] or not np.isfinite(places).all():
        raise InputError(
            "",
            f"at is of shape {places.shape}, but must be finite numbers, {samples.shape[1]} for each place",
        )
    low, high = samples.min(axis=0), samples.max(axis=0)
    slack = 1e-9 * (high - low)
    outside = np.flatnonzero(((places < low - slack) | (places > high + slack)).any(axis=1))
    if len(outside):
        raise InputError(
            "",
            f"at {places[outside[0]].tolist()} there is none, for the poses reach from {low.tolist()} to "
            f"{high.tolist()} only",
        )
    return places
