"""Array types of functions; docstrings give the shapes."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
#: Function of arrays, such as a map of positions.
FloatMap = Callable[[Floats], Floats]
