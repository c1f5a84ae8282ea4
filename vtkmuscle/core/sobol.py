"""Numbers of low discrepancy, as SciPy's, without what importing ``scipy.stats`` takes: half a second."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats

#: Binary digits of each number.
_DIGITS = 30
#: Per coordinate, of the primitive polynomial: inner coefficients, and the first direction numbers (Joe and
#: Kuo 2008, doi:10.1137/070709359). The first coordinate is van der Corput's sequence.
_DIRECTIONS = (((), (1,)), ((1,), (1, 3)))


def sobol(count: int, dimension: int, *, first: int = 0) -> Floats:
    """Return points of Sobol's sequence, in the order of Gray's code (Antonov and Saleev 1979).

    Each one differs from the one before it in one direction number per coordinate; the i-th is the sum,
    without carries, of the direction numbers of the digits of i in Gray's code.

    Parameters
    ----------
    count : int
        Number of points.
    dimension : int
        1 to 3.
    first : int, optional
        Points that are left out.

    Returns
    -------
    (count, dimension) array
        In [0, 1).

    Examples
    --------
    >>> from vtkmuscle.core.sobol import sobol
    >>> sobol(4, 2).tolist()
    [[0.0, 0.0], [0.5, 0.5], [0.75, 0.25], [0.25, 0.75]]
    """
    index = np.arange(first, first + count)
    code = index ^ (index >> 1)
    points = np.zeros((count, dimension), dtype=np.int64)
    for digit in range(int(code.max(initial=0)).bit_length()):
        chosen = (code >> digit) & 1
        for axis in range(dimension):
            points[:, axis] ^= chosen * (_direction(axis, digit) << (_DIGITS - 1 - digit))
    return points / 2.0**_DIGITS


def _direction(axis: int, digit: int) -> int:
    """Return a direction number: odd, and less than 2^(digit + 1)."""
    if axis == 0:
        return 1
    coefficients, numbers = _DIRECTIONS[axis - 1]
    found = list(numbers)
    degree = len(numbers)
    while len(found) <= digit:
        value = found[-degree] ^ (found[-degree] << degree)
        for k, coefficient in enumerate(coefficients, 1):
            value ^= coefficient * (found[-k] << k)
        found.append(value)
    return found[digit]
