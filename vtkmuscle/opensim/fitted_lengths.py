"""Lengths of a muscle as a polynomial of joint coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.muscle_paths import FunctionPath, powers, terms

#: Poses are held back in so many parts, one after the other, and the order chosen by how well lengths in each
#: are foretold by the others.
PARTS = 5
#: A higher order must foretell held-back lengths better by this part, or it is not worth its terms.
WORTH = 0.05
#: The highest sum of powers that is tried.
HIGHEST_ORDER = 6


@dataclass(frozen=True, eq=False)
class LengthFit:
    """A polynomial of coordinates for a length, and what it leaves.

    Attributes
    ----------
    path : FunctionPath
        With the length, in its unit.
    held_back_error : float
        Root mean square at poses that were held back, each once, by which the order was chosen.
    error, largest_error : float
        Root mean square and largest, at all poses, of the fit to all.
    """

    path: FunctionPath
    held_back_error: float
    error: float
    largest_error: float


def fit_length(lengths: Floats, values: Mapping[str, Floats]) -> LengthFit:
    """Return the polynomial of coordinates that gives a length best where it was not fitted.

    Parameters
    ----------
    lengths : (f,) array
        In each pose.
    values : mapping of str to (f,) array
        Of the coordinates that it depends on [radians, or their unit of length]; those that do not change are
        left out.

    Returns
    -------
    LengthFit
        Of the least order that is within 5 % of the best at the poses that were held back.

    Raises
    ------
    ValueError
        If no coordinate changes, or there are fewer poses than a straight line needs.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.opensim.fitted_lengths import fit_length
    >>> knee = np.linspace(0.0, 2.0, 30)
    >>> fit_length(0.3 - 0.04 * knee + 0.01 * knee**2, {"knee": knee}).path.order
    2
    """
    moving = {name: column for name, column in values.items() if np.ptp(column) > 1e-9}
    if not moving:
        raise InputError("", "no coordinate changes over the poses, so a length is no function of one")
    samples = np.column_stack(list(moving.values()))
    part = np.random.default_rng(0).permutation(len(lengths)) % PARTS
    # Powers are taken about the middle, in half ranges: high ones of plain radians are nearly the same.
    middle, half = samples.mean(axis=0), np.ptp(samples, axis=0) / 2.0
    scaled = (samples - middle) / half
    levels = min(len(np.unique(column.round(9))) for column in samples.T)
    errors: dict[int, float] = {}
    for order in range(1, HIGHEST_ORDER + 1):
        count = len(powers(samples.shape[1], order))
        if count > 0.7 * (part != 0).sum() or order >= levels:
            break
        off = np.zeros(len(lengths))
        for held in (part == number for number in range(PARTS)):
            fitted = _solved(scaled[~held], lengths[~held], order)
            off[held] = terms(scaled[held], order) @ fitted - lengths[held]
        errors[order] = _rms(off)
    if not errors:
        raise InputError(
            "", f"{len(lengths)} poses are too few for a polynomial of {samples.shape[1]} coordinates"
        )
    least = min(errors.values())
    tiny = 1e-12 * float(np.abs(lengths).max())
    order = next(one for one, error in errors.items() if error <= (1.0 + WORTH) * least + tiny)
    coefficients = _unscaled(_solved(scaled, lengths, order), middle, half, order)
    path = FunctionPath(tuple(moving), order, coefficients)
    off = terms(samples, order) @ coefficients - lengths
    return LengthFit(path, errors[order], _rms(off), float(np.abs(off).max()))


def _solved(samples: Floats, lengths: Floats, order: int) -> Floats:
    solution = np.linalg.lstsq(terms(samples, order), lengths, rcond=None)[0]
    return np.asarray(solution, dtype=np.float64)


def _unscaled(coefficients: Floats, middle: Sequence[float] | Floats, half: Floats, order: int) -> Floats:
    """Return the coefficients for plain coordinates of a polynomial of scaled ones."""
    table = powers(len(half), order)
    place = {tuple(row): number for number, row in enumerate(table)}
    result = np.zeros(len(table))
    for coefficient, row in zip(coefficients, table, strict=True):
        # (q - m)^p / h^p, multiplied out one coordinate after the other.
        parts: dict[tuple[int, ...], float] = {(): float(coefficient)}
        for power, centre, width in zip(row, middle, half, strict=True):
            parts = {
                (*done, low): value * comb(int(power), low) * (-centre) ** (int(power) - low) / width**power
                for done, value in parts.items()
                for low in range(int(power) + 1)
            }
        for powers_of, value in parts.items():
            result[place[powers_of]] += value
    return result


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))
