"""Numbers sorted into bins by counting: the cells of a grid, or the edges of each point."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import array_kernel
from vtkmuscle.core.types import Ints


@array_kernel
def sorted_into_bins(bins: Ints, n_bins: int) -> tuple[Ints, Ints]:
    """Return the numbers 0 to n - 1 bin by bin, and where each bin starts: a stable counting sort.

    Parameters
    ----------
    bins : (n,) int array
        Bin of each number, 0 to n_bins - 1.
    n_bins : int
        Number of bins.

    Returns
    -------
    order : (n,) int array
        Those in bin b are ``order[starts[b] : starts[b + 1]]``, ascending.
    starts : (n_bins + 1,) int array

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.bins import sorted_into_bins
    >>> order, starts = sorted_into_bins(np.array([1, 0, 1]), 2)
    >>> order.tolist(), starts.tolist()
    ([1, 0, 2], [0, 1, 3])
    """
    starts = np.zeros(n_bins + 1, dtype=np.int64)
    for i in range(len(bins)):
        starts[bins[i] + 1] += 1
    starts = np.cumsum(starts)
    free = starts.copy()
    order = np.empty(len(bins), dtype=np.int64)
    for i in range(len(bins)):
        order[free[bins[i]]] = i
        free[bins[i]] += 1
    return order, starts
