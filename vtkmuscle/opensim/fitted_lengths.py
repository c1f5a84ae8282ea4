"""The length of a muscle as a polynomial of joint coordinates, by its lengths and moment arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats
from vtkmuscle.opensim.muscle_paths import FunctionPath, powers, terms

#: Parts of the values of each coordinate, at most. Poses of each but the outer two are held back, and the
#: order chosen by how well they are foretold by the others: between the levels of a grid as well.
PARTS = 5
#: A higher order must foretell held-back lengths better by this part, or it is not worth its terms.
WORTH = 0.05
#: Terms of a polynomial, at most, for each number that is fitted.
FILLED = 0.7
#: The highest sum of powers that is tried.
HIGHEST_ORDER = 6


def fit_length(
    lengths: Floats, values: Mapping[str, Floats], arms: Mapping[str, Floats] | None = None
) -> FunctionPath:
    """Return the polynomial of coordinates that gives a length best where it was not fitted.

    Where moment arms are known, its derivatives are fitted to them as its values are to the lengths, each
    coordinate counted in half its range: few poses of a grid do then for several coordinates.

    Parameters
    ----------
    lengths : (f,) array
        In each pose.
    values : mapping of str to (f,) array
        Of the coordinates that it depends on [radians, or their unit of length]; those that do not change are
        left out.
    arms : mapping of str to (f,) array, optional
        Moment arms -dl/dq by them.

    Returns
    -------
    FunctionPath
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
    >>> fit_length(0.3 - 0.04 * knee + 0.01 * knee**2, {"knee": knee}).order
    2
    """
    moving = {name: column for name, column in values.items() if np.ptp(column) > 1e-9}
    if not moving:
        raise InputError("", "no coordinate changes over the poses, so a length is no function of one")
    samples = np.column_stack(list(moving.values()))
    # Powers are taken about the middle, in half ranges: high ones of plain radians are nearly the same.
    middle, half = samples.mean(axis=0), np.ptp(samples, axis=0) / 2.0
    scaled = (samples - middle) / half
    slopes = {i: -half[i] * arms[name] for i, name in enumerate(moving) if arms and name in arms}
    known = np.concatenate([lengths, *slopes.values()])
    held_back = [np.tile(held, 1 + len(slopes)) for held in _held_back(samples)]
    # A coordinate of k values has a polynomial of order k - 1 through them, 2 k - 1 with its slopes there.
    levels = min(
        (2 if i in slopes else 1) * len(np.unique(column.round(9))) for i, column in enumerate(samples.T)
    )
    errors: dict[int, float] = {}
    for order in range(1, HIGHEST_ORDER + 1):
        count = len(powers(samples.shape[1], order))
        if count > FILLED * min((~held).sum() for held in held_back) or order >= levels:
            break
        rows = np.vstack([terms(scaled, order), *(_slopes(scaled, order, i) for i in slopes)])
        off = [rows[held] @ _solved(rows[~held], known[~held]) - known[held] for held in held_back]
        errors[order] = float(np.sqrt((np.concatenate(off) ** 2).mean()))
    if not errors:
        raise InputError(
            "", f"{len(lengths)} poses are too few for a polynomial of {samples.shape[1]} coordinates"
        )
    least = min(errors.values())
    tiny = 1e-12 * float(np.abs(lengths).max())
    order = next(one for one, error in errors.items() if error <= (1.0 + WORTH) * least + tiny)
    rows = np.vstack([terms(scaled, order), *(_slopes(scaled, order, i) for i in slopes)])
    return FunctionPath(tuple(moving), order, _unscaled(_solved(rows, known), middle, half, order))


def _held_back(samples: Floats) -> list[Bools]:
    """Return the poses (f,) that are held back together, of samples (f, d)."""
    found = []
    for column in samples.T.round(9):
        levels = np.unique(column)
        parts = np.array_split(levels, min(PARTS, len(levels)))
        found += [np.isin(column, part) for part in parts[1:-1]]
    if found:
        return found
    numbers = np.random.default_rng(0).permutation(len(samples)) % PARTS
    return [numbers == number for number in range(PARTS) if number in numbers]


def _slopes(samples: Floats, order: int, variable: int) -> Floats:
    """Return the derivatives (f, m) of a polynomial's terms by one of its variables."""
    table = powers(samples.shape[1], order)
    factors = table[:, variable].astype(np.float64)
    table[:, variable] = np.maximum(table[:, variable] - 1, 0)
    result: Floats = factors * np.prod(samples[:, None, :] ** table, axis=2)
    return result


def _solved(rows: Floats, known: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(rows, known, rcond=None)[0], dtype=np.float64)


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
