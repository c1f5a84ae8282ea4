"""Numbers with the parts of their error, and how these combine.

Every part is the half width of an interval that holds the true value with about 95 % confidence, as far as
that cause goes: an expanded uncertainty with the coverage factor 2 (JCGM 100:2008, *Guide to the expression
of uncertainty in measurement*, 6.2 and 6.3.3). Causes are taken as independent, so that variances add, and
the total is the root of the sum of squares (5.1.2, eq. 10); with one factor for all that holds for the
expanded parts as well. What is left at a resolution is told by two of them (Richardson).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats, Ints

#: From a standard to an expanded uncertainty of about 95 % (JCGM 100:2008, 6.3.3).
COVERAGE_FACTOR = 2.0
#: Confidence of an expanded uncertainty.
CONFIDENCE = 0.95


def root_of_squares(*parts: ArrayLike) -> Floats:
    """Return the root of the sum of squares of independent parts, which broadcast together; 0 of none.

    Source: JCGM 100:2008, 5.1.2, eq. 10, with sensitivities of 1.

    Examples
    --------
    >>> from vtkmuscle.core.estimate import root_of_squares
    >>> float(root_of_squares(3.0, 4.0))
    5.0
    """
    return np.sqrt(sum((np.square(np.asarray(part, dtype=np.float64)) for part in parts), np.zeros(())))


def expanded_of_bounds(half_width: ArrayLike) -> Floats:
    """Return the expanded uncertainty where only bounds are known: all values within them alike likely.

    The variance of a rectangular distribution is a third of the square of its half width (JCGM 100:2008,
    4.3.7), so that this is 2 / sqrt(3) of the half width.

    Parameters
    ----------
    half_width : array_like
        Of the bounds, of either sign.
    """
    expanded: Floats = COVERAGE_FACTOR / np.sqrt(3.0) * np.abs(np.asarray(half_width, dtype=np.float64))
    return expanded


def expanded_of_samples(values: ArrayLike, *, of_mean: bool = False) -> Floats:
    """Return the expanded uncertainty that repeated values tell of, along the first axis.

    Student's t for n - 1 degrees of freedom at 95 %, times the standard deviation: of one more value, or of
    their mean, by the root of n smaller (JCGM 100:2008, 4.2 and G.3).

    Parameters
    ----------
    values : (n, ...) array_like
        n >= 2 samples.
    of_mean : bool, optional
        Whether the mean of the samples is what is uncertain, not one of them.

    Returns
    -------
    (...) array
        Not negative.

    Examples
    --------
    >>> from vtkmuscle.core.estimate import expanded_of_samples
    >>> float(expanded_of_samples([1.0, 3.0]).round(3))
    17.969
    """
    samples = np.asarray(values, dtype=np.float64)
    count = len(samples)
    factor = float(stdtrit(count - 1, (1.0 + CONFIDENCE) / 2.0)) / (np.sqrt(count) if of_mean else 1.0)
    return np.asarray(factor * samples.std(axis=0, ddof=1))


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """A quantity and the known parts of its error.

    Attributes
    ----------
    value : array
        Of any shape, for instance a value per frame.
    unit : str
        Of the value and of all errors.
    parts : mapping of str to array
        Per cause an expanded uncertainty, of the shape of the value; causes that are not there are not known.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.estimate import Estimate
    >>> parts = {"solve": np.array([0.3, 0.3]), "model": np.array([0.4, 0.4])}
    >>> length = Estimate(np.array([100.0, 90.0]), "mm", parts)
    >>> length.total
    array([0.5, 0.5])
    >>> length.report()["total"]
    0.5
    """

    value: Floats
    unit: str
    parts: Mapping[str, Floats] = field(default_factory=dict)

    def __repr__(self) -> str:
        short = self.report()
        causes = ", ".join(self.parts) or "no cause known"
        number = f"{short['value']:.4g} \u00b1 {short['total']:.2g} {self.unit}"
        return f"Estimate({np.shape(self.value)}: {number}; {causes})"

    @property
    def total(self) -> Floats:
        """All parts together, of the shape of the value."""
        return np.broadcast_to(root_of_squares(*self.parts.values()), np.shape(self.value))

    def report(self) -> dict[str, Any]:
        """Return the mean value, the root mean square of each part, and of the total: JSON-able."""
        return {
            "value": float(np.mean(self.value)),
            "unit": self.unit,
            "parts": {cause: _root_mean_square(part) for cause, part in self.parts.items()},
            "total": _root_mean_square(self.total),
        }


def _root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else 0.0


#: Factor of safety for two resolutions, whose order of convergence is assumed and not measured (Roache 1994).
SAFETY = 3.0


def convergence_error(coarse: ArrayLike, fine: ArrayLike, *, order: float) -> Floats:
    """Return the error of a solution, by one of half its spacing and the grid convergence index.

    Where the error falls with the spacing h as h^p, the coarse solution is off by 2^p / (2^p - 1) of the
    difference of the two (Richardson); the index is three times that (Roache 1994, the index of the coarse
    grid), and is meant as a band of about 95 % confidence (ASME V&V 20-2009, 2-4).

    Parameters
    ----------
    coarse, fine : array_like
        Solutions with spacings of h and h / 2, of shapes that broadcast together.
    order : float
        The order p > 0; the smaller it is assumed, the larger the error.

    Returns
    -------
    array
        Expanded uncertainty of the coarse solution, in its unit, not negative.

    References
    ----------
    Roache 1994, *Perspective: a method for uniform reporting of grid refinement studies*,
    doi:10.1115/1.2910291.

    Examples
    --------
    >>> from vtkmuscle.core.estimate import convergence_error
    >>> float(convergence_error(1.04, 1.01, order=2.0).round(6))  # 0.04 too large, and three times that
    0.12
    """
    power = 2.0**order
    difference = np.abs(np.asarray(coarse, dtype=np.float64) - np.asarray(fine, dtype=np.float64))
    error: Floats = SAFETY * power / (power - 1.0) * difference
    return error


def convergence_error_of_fine(coarse: ArrayLike, fine: ArrayLike, *, order: float) -> Floats:
    """Return the error of the finer of two solutions, likewise: 1 / 2^p of that of the coarser one."""
    return np.asarray(convergence_error(coarse, fine, order=order) / 2.0**order)


#: Chords are shorter than arcs by the square of the segments' length.
CHORD_ORDER = 2.0


def segment_errors(points: Floats, offsets: Ints) -> Floats:
    """Return by how much polylines are shorter than the curves that they stand for.

    The length by every second point is compared with that by all of them, see
    :func:`~vtkmuscle.core.estimate.convergence_error_of_fine`.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Positions [mm]; first point of each line, and n.

    Returns
    -------
    (k,) array
        Expanded uncertainty of the lengths [mm].

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.estimate import segment_errors
    >>> turn = np.linspace(0.0, np.pi / 2.0, 9)
    >>> arc = 100.0 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    >>> float(50.0 * np.pi - 8 * 200.0 * np.sin(np.pi / 32.0))  # arc less chords
    0.252...
    >>> segment_errors(arc, np.array([0, 9])).round(2)
    array([0.76])
    """
    fine = polyline_lengths(points, offsets)
    return convergence_error_of_fine(_every_second(points, offsets), fine, order=CHORD_ORDER)


def _every_second(points: Floats, offsets: Ints) -> Floats:
    """Return the lengths (k,) by every second point and the last one."""
    counts = np.diff(offsets)
    place = np.arange(len(points)) - np.repeat(offsets[:-1], counts)
    kept = (place % 2 == 0) | (place == np.repeat(counts, counts) - 1)
    firsts = np.concatenate([[0], np.cumsum(kept)])[offsets]
    return polyline_lengths(points[kept], firsts)
