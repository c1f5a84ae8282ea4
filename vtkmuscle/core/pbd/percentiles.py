"""Percentiles of many numbers, without sorting all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Bins that values are put into: a few values each, where there are tens of thousands.
_BINS = 4096

#: So many values are sorted.
_FEW = 64


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
    # Each beside the next: they mostly share a bin.
    found = _in_order(values, np.column_stack([low, np.minimum(low + 1, len(values) - 1)]).reshape(-1))
    if of is not None:
        found = of(found)
    below, above = found[::2], found[1::2]
    part = places - low
    with np.errstate(over="ignore", invalid="ignore"):
        result: list[float] = np.where(part > 0.0, below + part * (above - below), below).tolist()
    return result


@kernel
def _in_order(values: Floats, ranks: Ints) -> Floats:
    """Return the values (r,) that would be at ranks (r,) if all values (n,) were sorted.

    Only the bins that hold them are looked at again, and divided into bins of their own until few are left:
    where one value is far from all others, they share a bin.
    """
    found = np.empty(len(ranks))
    least, scale, starts = _binned(values)
    last, part = -1, values
    for r in range(len(ranks)):
        b = np.searchsorted(starts, ranks[r], side="right") - 1
        if b != last:
            last, part = b, _of_bin(values, least, scale, b, starts[b + 1] - starts[b])
        rest, rank = part, ranks[r] - starts[b]
        while len(rest) > _FEW:
            low, width, within = _binned(rest)
            inner = np.searchsorted(within, rank, side="right") - 1
            count = within[inner + 1] - within[inner]
            if count == len(rest):
                break
            rest, rank = _of_bin(rest, low, width, inner, count), rank - within[inner]
        found[r] = np.sort(rest)[rank]
    return found


@kernel
def _binned(values: Floats) -> tuple[float, float, Ints]:
    """Return the least value, bins per unit, and how many values are in the bins before each, (bins + 1,).

    All values are in the first bin where they cannot be divided: not finite, or all equal.
    """
    least, greatest, finite = np.inf, -np.inf, True
    for v in values:
        least = v if v < least else least
        greatest = v if v > greatest else greatest
        finite = finite and np.isfinite(v)
    scale = (_BINS - 1) / (greatest - least)
    starts = np.zeros(_BINS + 1, dtype=np.int64)
    if not (finite and np.isfinite(scale)):
        starts[1:] = len(values)
        return 0.0, 0.0, starts
    for v in values:
        # Rounded alike for all of them, so that a greater value is never in a lower bin.
        starts[np.int64((v - least) * scale) + 1] += 1
    return least, scale, np.cumsum(starts)


@kernel
def _of_bin(values: Floats, least: float, scale: float, number: int, count: int) -> Floats:
    """Return the values of a bin, as many as it has."""
    if count == len(values):
        return values
    part = np.empty(count)
    k = 0
    for v in values:
        if np.int64((v - least) * scale) == number:
            part[k] = v
            k += 1
    return part
