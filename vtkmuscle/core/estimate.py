"""Numbers with the parts of their error, and how these combine.

Each part is an expanded uncertainty with the coverage factor 2: the half width of an interval that holds the
true value with about 95 % confidence, as far as that cause goes (JCGM 100:2008, *Guide to the expression of
uncertainty in measurement*, 6.2 and 6.3.3). Causes are taken as independent, so the total is the root of the
sum of squares (5.1.2, eq. 10). The error of a resolution follows from two of them (Richardson).
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
    """Return the root of the sum of squares of independent parts, which broadcast together; 0 of none."""
    return np.sqrt(sum((np.square(np.asarray(part, dtype=np.float64)) for part in parts), np.zeros(())))


def expanded_of_bounds(half_width: ArrayLike) -> Floats:
    """Return the expanded uncertainty of a value that may be anywhere within bounds of a half width.

    The variance of a rectangular distribution is a third of its half width squared (JCGM 100:2008, 4.3.7):
    the result is 2 / sqrt(3) of the half width.
    """
    expanded: Floats = COVERAGE_FACTOR / np.sqrt(3.0) * np.abs(np.asarray(half_width, dtype=np.float64))
    return expanded


def expanded_of_samples(values: ArrayLike, *, of_mean: bool = False) -> Floats:
    """Return the expanded uncertainty of one more value, or of the mean, of samples along the first axis.

    Student's t for n - 1 degrees of freedom at 95 %, n >= 2, times the standard deviation, for the mean
    divided by the root of n (JCGM 100:2008, 4.2 and G.3).
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
        Expanded uncertainty by cause, of the shape of the value; a cause that is missing is not known.

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
        """Return the mean value, and the root mean square of each part and of the total, for JSON."""
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
    """Return the expanded uncertainty of the coarser of two solutions, with spacings h and h / 2.

    Where the error falls as h^p, the coarse solution is off by 2^p / (2^p - 1) of the difference of the two
    (Richardson). The grid convergence index of the coarse grid is three times that (Roache 1994,
    *Perspective: a method for uniform reporting of grid refinement studies*, doi:10.1115/1.2910291), meant as
    a band of about 95 % confidence (ASME V&V 20-2009, 2-4). The smaller the order p > 0, the larger the
    error.
    """
    power = 2.0**order
    difference = np.abs(np.asarray(coarse, dtype=np.float64) - np.asarray(fine, dtype=np.float64))
    error: Floats = SAFETY * power / (power - 1.0) * difference
    return error


#: Chords are shorter than arcs by the square of the segments' length.
CHORD_ORDER = 2.0


def segment_errors(points: Floats, offsets: Ints) -> Floats:
    """Return by how much polylines are shorter than the curves that they stand for, (k,) [mm].

    An expanded uncertainty, from the lengths by all points (n, 3), and by every second point and the last.
    """
    counts = np.diff(offsets)
    place = np.arange(len(points)) - np.repeat(offsets[:-1], counts)
    kept = (place % 2 == 0) | (place == np.repeat(counts, counts) - 1)
    firsts = np.concatenate([[0], np.cumsum(kept)])[offsets]
    coarse, fine = polyline_lengths(points[kept], firsts), polyline_lengths(points, offsets)
    # The error of the finer of two solutions is 1 / 2^p of that of the coarser one.
    return np.asarray(convergence_error(coarse, fine, order=CHORD_ORDER) / 2.0**CHORD_ORDER)
