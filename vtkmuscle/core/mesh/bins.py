"""Numbers in order: sorted into bins by counting, by merging, and looked up.

Numba would compile those of numpy for seconds.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.types import Floats, Ints


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
    for b in range(n_bins):
        starts[b + 1] += starts[b]
    free = starts.copy()
    order = np.empty(len(bins), dtype=np.int64)
    for i in range(len(bins)):
        order[free[bins[i]]] = i
        free[bins[i]] += 1
    return order, starts


@array_kernel
def stable_order(values: Floats) -> Ints:
    """Return the order (n,) in which values (n,) ascend, equal ones as they come: runs merged by twos.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.bins import stable_order
    >>> stable_order(np.array([2.0, 1.0, 2.0, 0.0])).tolist()
    [3, 1, 0, 2]
    """
    n = len(values)
    order, merged = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for i in range(n):
        order[i] = i
    run = 1
    while run < n:
        first = 0
        while first < n:
            middle, end = min(first + run, n), min(first + 2 * run, n)
            one, two = first, middle
            for k in range(first, end):
                if one < middle and (two >= end or values[order[one]] <= values[order[two]]):
                    merged[k] = order[one]
                    one += 1
                else:
                    merged[k] = order[two]
                    two += 1
            first = end
        order, merged = merged, order
        run *= 2
    return order


@kernel
def count_up_to(ascending: Floats, value: float) -> int:
    """Return how many of ascending values (n,) are no greater than one, by halving."""
    low, high = 0, len(ascending)
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] <= value:
            low = middle + 1
        else:
            high = middle
    return low
