"""What two resolutions tell of the error that is left: Richardson's extrapolation, with some safety."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.types import Floats

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
    >>> from vtkmuscle.core.accuracy.convergence import convergence_error
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
