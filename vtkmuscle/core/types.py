"""Types of the arrays that functions take and give: their shapes are in the docstrings."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
#: Where the blocks of a grid are, in C order.
Table = NDArray[np.int32]
