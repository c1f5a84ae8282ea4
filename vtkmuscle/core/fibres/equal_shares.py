"""Equal shares of areas, and the optimal transport that pairs those of one area with those of another.

Fibres between two areas begin at places of which each stands for as much of one area, and end at such places
of the other. Matched by the least sum of squared distances they do not cross: (x_i - x_j) . (y_i - y_j) >= 0
for any two of them, or exchanging their ends would make that sum less (cyclic monotonicity: Villani 2009,
*Optimal Transport*, doi:10.1007/978-3-540-71050-9, chapter 5).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from vtkmuscle.core.types import Floats, Ints

#: Largest extra weight of a position, drawn at random, in the axes that divide them.
UNEVEN = 0.1
#: Positions that sample each share of an area.
CANDIDATES = 16
#: Passes of Lloyd's relaxation. Of 333 places on plates of 30 x 10 and 5 x 60 mm the cells' sizes have a
#: standard deviation of 0.33 of their mean with none, 0.18 with 2, 0.14 with 16; between equal plates that
#: are sampled otherwise, fibres deviate by 0.19 spacings with none (median), 0.21 with 2, 0.25 with 16.
RELAXATIONS = 2
#: Places that are matched at once: the time grows with the cube of their number, 0.1 s for a thousand.
AT_ONCE = 512
#: Neighbours of each fibre with which it may exchange its end, where places are matched in parts.
NEIGHBOURS = 8
#: Thickness assumed for a flat area, as a part of its extent: with much less the map from one flat area to
#: another would be rounding across them.
FLAT = 0.01


def even_places(areas: Sequence[Floats], count: int) -> list[Floats]:
    """Return places (count, 3) on each of one or two areas, each of which stands for an equal share.

    The areas are positions (m, 3) of even density, count or more, and the places some of them. Two areas are
    halved across the axis along which they are longest together, each half again, until there are as many
    parts as wanted, and a few passes of Lloyd's relaxation make these round. The axis is turned to each of
    the areas by half of the optimal map between their normal distributions. So areas alike have places alike,
    and it does not matter which is the first.
    """
    return [_relaxed(area, part, count) for area, part in zip(areas, halved(areas, count), strict=True)]


def _relaxed(positions: Floats, part: Ints, count: int) -> Floats:
    """Return the positions nearest to the middles of parts, after a few passes of relaxation."""
    places = _means(positions, part, count)
    for _ in range(RELAXATIONS):
        places = _means(positions, cKDTree(places).query(positions)[1], count, places)
    on_area: Floats = positions[cKDTree(positions).query(places)[1]]
    return on_area


def halved(areas: Sequence[Floats], count: int) -> list[Ints]:
    """Return for each area the part (m,) of each position, `count` parts that are halves of halves."""
    parts = [np.zeros(len(area), dtype=np.int64) for area in areas]
    shares = np.array([count])  # number of final parts in each part
    # Rounding would choose between two axes of equal length, and between the two ways along one. Small random
    # weights of the positions, always the same, decide instead.
    weights = [np.random.default_rng(0).random(len(area)) for area in areas]
    while shares.max() > 1:
        centred, spreads = [], []
        for area, part, weight in zip(areas, parts, weights, strict=True):
            centred.append(area - _means(area, part, len(shares))[part])
            x = np.ascontiguousarray(centred[-1].T)
            products = ((1.0 + UNEVEN * weight) * x)[:, None] * x
            spreads.append(_means(products.reshape(9, -1).T, part, len(shares)).reshape(-1, 3, 3))
        axes = np.linalg.eigh(spreads[0] + spreads[-1])[1][..., -1]
        along = (centred[0] * axes[parts[0]]).sum(axis=1)
        axes *= np.where(np.bincount(parts[0], weights[0] * along, len(shares)) < 0.0, -1.0, 1.0)[:, None]
        ways = [axes]
        if len(areas) > 1:
            forth = _normal_map(*spreads)
            ways = [(_power(forth, half) @ axes[..., None])[..., 0] for half in (0.5, -0.5)]
        lower, pieces = shares // 2, 1 + (shares > 1)
        for number, (part, axis) in enumerate(zip(parts, ways, strict=True)):
            along = np.einsum("ij,ij->i", centred[number], axis[part])
            sizes = np.bincount(part, minlength=len(shares))
            order = np.argsort(along + 2.0 * np.ptp(along) * part, kind="stable")
            rank = np.empty(len(part), dtype=np.int64)
            rank[order] = np.arange(len(part)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
            above = (rank >= (sizes * lower // shares)[part]) & (shares > 1)[part]
            parts[number] = (np.cumsum(pieces) - pieces)[part] + above
        halves = np.column_stack([lower, shares - lower]).reshape(-1)
        shares = halves[halves > 0]
    return parts


def _means(values: Floats, part: Ints, count: int, otherwise: Floats | None = None) -> Floats:
    """Return the mean of the values (m, k) of each part, (count, k); a given value where a part has none."""
    sizes = np.bincount(part, minlength=count)[:, None]
    sums = np.column_stack([np.bincount(part, x, count) for x in values.T])
    nothing = np.zeros(sums.shape) if otherwise is None else otherwise
    return np.divide(sums, sizes, out=nothing.copy(), where=sizes > 0)


def matched_places(starts: Floats, ends: Floats) -> Ints:
    """Return the number of the end for each start, (n,), such that the sum of squared distances is least.

    Up to :data:`AT_ONCE` places, (n, 3) each, that is exact. More are halved, both sets by the same share
    along directions that the optimal map between their normal distributions takes to each other, until the
    parts are matched exactly; then neighbours exchange ends for as long as that makes the sum less.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.fibres.equal_shares import matched_places
    >>> starts = np.array([(0.0, 0, 0), (1, 0, 0), (2, 0, 0)])
    >>> matched_places(starts, starts[::-1] + [0.5, 0, 9])
    array([2, 1, 0])
    """
    goes_with = np.empty(len(starts), dtype=np.int64)
    waiting = [(np.arange(len(starts)), np.arange(len(ends)))]
    while waiting:
        mine, theirs = waiting.pop()
        x, y = starts[mine] - starts[mine].mean(axis=0), ends[theirs] - ends[theirs].mean(axis=0)
        forth = _normal_map(x.T @ x / len(x), y.T @ y / len(y))
        if len(mine) <= AT_ONCE:
            # Terms of one start or one end alone do not change which pairs are best. With those of the
            # optimal map for normal distributions good pairs cost about 0, and the assignment takes a quarter
            # of the time.
            back = np.linalg.inv(forth)
            costs = np.einsum("ij,jk,ik->i", x, forth, x)[:, None] - 2.0 * x @ y.T
            costs += np.einsum("ij,jk,ik->i", y, back, y)
            goes_with[mine] = theirs[linear_sum_assignment(costs)[1]]
            continue
        axis = np.linalg.eigh(x.T @ x)[1][:, -1]
        order = np.argsort(x @ axis, kind="stable")
        others = np.argsort(y @ np.linalg.inv(forth) @ axis, kind="stable")
        half = len(mine) // 2
        parts = slice(None, half), slice(half, None)
        waiting += [(mine[order[part]], theirs[others[part]]) for part in parts]
    if len(starts) > AT_ONCE:
        _uncross(starts, ends, goes_with)
    return goes_with


def _normal_map(a: Floats, b: Floats) -> Floats:
    """Return the symmetric maps (..., 3, 3) between normal distributions of covariances a and b (..., 3, 3).

    T = a^-1/2 (a^1/2 b a^1/2)^1/2 a^-1/2 is the optimal one (Olkin, Pukelsheim 1982,
    doi:10.1016/0024-3795(82)90112-4).
    """
    root, inverse = _power(_spread(a), 0.5), _power(_spread(a), -0.5)
    return inverse @ _power(root @ _spread(b) @ root, 0.5) @ inverse


def _spread(covariance: Floats) -> Floats:
    """Return regularised covariances: those of flat sets of points have no inverse."""
    sizes = np.trace(covariance, axis1=-2, axis2=-1)[..., None, None]
    return covariance + FLAT**2 * np.where(sizes > 0.0, sizes, 1.0) * np.eye(3)


def _power(matrix: Floats, exponent: float) -> Floats:
    """Return the power of positive definite matrices (..., 3, 3)."""
    values, vectors = np.linalg.eigh(matrix)
    powers = np.maximum(values, np.finfo(float).tiny) ** exponent
    result: Floats = (vectors * powers[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return result


def _uncross(starts: Floats, ends: Floats, goes_with: Ints) -> None:
    """Exchange ends, in place, between neighbours that cross, until none do."""
    near = cKDTree(starts).query(starts, NEIGHBOURS + 1)[1][:, 1:]
    pairs = np.column_stack([np.repeat(np.arange(len(starts)), NEIGHBOURS), near.reshape(-1)])
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    apart = starts[pairs[:, 0]] - starts[pairs[:, 1]]
    slack = np.finfo(float).eps * np.abs(starts).max() * np.abs(ends).max()
    while True:
        along = (apart * (ends[goes_with[pairs[:, 0]]] - ends[goes_with[pairs[:, 1]]])).sum(axis=1)
        crossing = np.flatnonzero(along < -slack)
        if not len(crossing):
            return
        crossing = crossing[np.argsort(along[crossing], kind="stable")]
        # Those that cross most first, one exchange per fibre: each makes the sum less, so this ends.
        rank = np.full(len(starts), len(crossing))
        np.minimum.at(rank, pairs[crossing].reshape(-1), np.repeat(np.arange(len(crossing)), 2))
        first = rank[pairs[crossing]]
        chosen = crossing[(first == np.arange(len(crossing))[:, None]).all(axis=1)]
        one, other = pairs[chosen].T
        goes_with[one], goes_with[other] = goes_with[other], goes_with[one]
