"""Array types of functions, and tolerances; docstrings give the shapes."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
#: Numbers of points, never negative: kernels look them up without asking.
Indices = NDArray[np.uint32]
#: Function of arrays, such as a map of positions.
FloatMap = Callable[[Floats], Floats]
#: Takes the finished part of a computation, from 0 to 1; may raise, to stop.
Progress = Callable[[float], None]
#: Part of a size or range within which positions or values are the same: files have seven digits.
SAME = 1e-6
#: Part of a size below which a difference is rounding: of 16 digits a computation loses up to seven.
ROUNDING = 1e-9
#: Part of a size between the rounding of a number and :data:`ROUNDING`: a grid of positions that rounding
#: does not tell apart, and what keeps equations of flat sets of points from being singular.
GRAIN = 1e-12
#: Least positive number with all digits: added to a divisor it keeps a division by nothing finite.
TINY = float(np.finfo(np.float64).tiny)
#: Rounds of a loop that ends by itself, at most: 5 to 10 are common.
MOST_ROUNDS = 30


def quiet(part: float) -> None:
    """Take the finished part of a computation, without a report."""
