"""Which point of a muscle's section corresponds to which point of the template's rectangle.

The rectangle has the corners Q0 = (0, 0), (width, 0), (width, depth) and (0, depth); loops run
counterclockwise as it does. A loop, flat (k = 2) or in space (k = 3), is matched once it is known which of
its vertices goes with Q0: from there it is split into four parts, one for each side.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Places around a loop at which its correspondence may start, and the least number of its segments.
N_PLACES = 128
#: Slices, at most, for which the start is optimised; in between it is interpolated.
N_KEYS = 64
#: A segment shorter than this part of its loop's perimeter is rounding.
SHORTEST = 1e-9
#: A vertex nearer than this part of the perimeter to the place of a corner is left out for it.
CLOSEST = 1e-6


def starting_points(
    loops: Sequence[Floats],
    levels: Floats,
    continuity: float,
    corner: Floats,
    place_costs: Callable[[Floats, Ints], Floats] | None = None,
) -> Floats:
    """Return where each loop starts, so that it starts near Q0 and neighbouring loops do not twist.

    The paper takes the vertex nearest to Q0, slice by slice: where a section turns past Q0 that vertex jumps
    along it, and all fibres turn with it. Here the places p_j minimise, over all slices at once,

        sum_j cost_j(p_j) dz_j  +  continuity^2 sum_j D_j(p_j, p_{j-1})^2 / (z_j - z_{j-1}),

    where cost_j is the squared distance from Q0, so that the first term is the paper's, unless another one is
    given, and D_j is the root mean square distance of the points of loop j from those of loop j - 1 that
    correspond to them, both loops about their centroids. D depends on the difference of the places only, and
    comes for all of them at once from a cyclic correlation; the minimum is found exactly, by dynamic
    programming. Where slices are dense, only :data:`N_KEYS` of them take part, and the others' starts, about
    their centroids, are interpolated.

    Parameters
    ----------
    loops : sequence of (n, k) arrays
        Vertices of each loop, counterclockwise [mm].
    levels : (l,) array
        Heights of the loops, strictly ascending [mm].
    continuity : float
        Height over which the start may drift towards Q0 [mm]; 0: each has the place of least cost.
    corner : (k,) array
        Q0: places are counted from the point of each loop that is nearest to it [mm].
    place_costs : callable, optional
        From places (j, N_PLACES, k) of some loops and the numbers (j,) of these to the cost of starting at
        each place, (j, N_PLACES) [mm^2].

    Returns
    -------
    (l, k) array
        A point on or near each loop: it starts at the vertex nearest to this [mm].
    """
    if continuity == 0.0 and place_costs is None:
        return np.tile(corner, (len(loops), 1))
    bins = ((levels - levels[0]) / (levels[-1] - levels[0] or 1.0) * (N_KEYS - 1)).astype(np.int64)
    keys = np.unique(bins, return_index=True)[1]
    if continuity == 0.0:
        keys = np.arange(len(loops))
    samples = np.array([sampled_loop(loops[key], corner, N_PLACES) for key in keys])
    costs = ((samples - corner) ** 2).sum(axis=2) if place_costs is None else place_costs(samples, keys)
    if continuity == 0.0:
        nearest: Floats = samples[keys, costs.argmin(axis=1)]
        return nearest
    costs = costs * (np.gradient(levels[keys]) if len(keys) > 1 else np.ones(1))[:, None]
    centred = samples - samples.mean(axis=1, keepdims=True)
    square = (centred**2).sum(axis=2).mean(axis=1)
    twists = square[:-1, None] + square[1:, None] - 2.0 * cyclic_products(centred[:-1], centred[1:])
    twists *= (continuity**2 / np.diff(levels[keys]))[:, None]
    starts = samples[np.arange(len(keys)), _cheapest_chain(costs, twists)]
    if len(keys) == len(loops):
        return starts
    return _between([loops[key] for key in keys], levels[keys], starts, loops, levels)


def followed_starts(
    loops: Sequence[Floats],
    levels: Floats,
    continuity: float,
    guides: tuple[Sequence[Floats], Floats, Floats],
    corner: Floats,
    place_costs: Callable[[Floats, Ints], Floats] | None = None,
) -> Floats:
    """Return the starting points of loops that follow guiding loops of the same muscle.

    Starting points are chosen among samples of a loop. If each set of loops chose anew, a slightly different
    cut of the muscle could move a starting point by one sample, and the fibres with it. So starting points
    are chosen on guiding loops at fixed heights, and interpolated between them.

    Parameters
    ----------
    loops, levels, continuity, corner, place_costs
        As for :func:`starting_points`, which is asked without continuity, or where there are no guides.
    guides : tuple of sequence of (n, k) arrays, (g,) array, (g, k) array
        The other loops, their heights, strictly ascending, and where they start.

    Returns
    -------
    (l, k) array
        A point near each loop: it starts where it is nearest to this [mm].
    """
    guiding, heights, starts = guides
    if continuity == 0.0 or not len(guiding):
        return starting_points(loops, levels, continuity, corner, place_costs)
    return _between(guiding, heights, starts, loops, levels)


def _between(
    guides: Sequence[Floats], heights: Floats, starts: Floats, loops: Sequence[Floats], levels: Floats
) -> Floats:
    """Return starts of loops from those of others, interpolated about the centroids of all."""
    offsets = starts - np.array([boundary_centroid(guide) for guide in guides])
    centroids = np.array([boundary_centroid(loop) for loop in loops])
    between = [np.interp(levels, heights, column) for column in offsets.T]
    points: Floats = centroids + np.column_stack(between)
    return points


def cyclic_products(first: Floats, second: Floats) -> Floats:
    """Return the mean over i of first[j, i] . second[j, i + p] for every shift p, (j, n).

    Parameters
    ----------
    first, second : (j, n, k) array
        Points along loops.
    """
    spectra = np.fft.rfft(first, axis=1).conj() * np.fft.rfft(second, axis=1)
    n = first.shape[1]
    products: Floats = np.fft.irfft(spectra.sum(axis=2), n, axis=1) / n
    return products


def _cheapest_chain(costs: Floats, twists: Floats) -> Ints:
    """Return p minimising sum_j costs[j, p_j] + sum_j twists[j - 1, (p_j - p_{j-1}) mod n]."""
    place = np.arange(costs.shape[1])
    turns = (place - place[:, None]) % len(place)
    best, before = costs[0], []
    for cost, twist in zip(costs[1:], twists, strict=True):
        ways = best[:, None] + twist[turns]
        before.append(ways.argmin(axis=0))
        best = cost + ways.min(axis=0)
    places = [best.argmin()]
    for chosen in reversed(before):
        places.append(chosen[places[-1]])
    return np.array(places[::-1], dtype=np.int64)


def loop_lengths(loop: Floats) -> Floats:
    """Return the length along a loop (n, k) up to each vertex, and the whole perimeter: (n + 1,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)))


def boundary_centroid(loop: Floats) -> Floats:
    """Return the centroid of a loop's boundary, (k,): the mean of its segments' middles by length."""
    lengths = loop_lengths(loop)
    centroid: Floats = np.diff(lengths) @ (loop + np.roll(loop, -1, axis=0)) / (2.0 * lengths[-1])
    return centroid


def sampled_loop(loop: Floats, corner: Floats, count: int) -> Floats:
    """Return `count` points at equal distances along a loop (n, k), from its point nearest to Q0 on."""
    lengths = loop_lengths(loop)
    return points_at(
        loop, lengths, nearest_place(loop, lengths, corner) + lengths[-1] * np.arange(count) / count
    )


def points_at(loop: Floats, lengths: Floats, places: Floats) -> Floats:
    """Return the points of a loop (n, k) at some lengths (m,) along it, (m, k)."""
    along, closed = places % lengths[-1], np.vstack([loop, loop[:1]])
    return np.column_stack([np.interp(along, lengths, column) for column in closed.T])


def nearest_place(loop: Floats, lengths: Floats, target: Floats) -> float:
    """Return the length along a loop (n, k) at which it is nearest to a point (k,)."""
    steps = np.roll(loop, -1, axis=0) - loop
    squares = np.maximum((steps**2).sum(axis=1), np.finfo(float).tiny)
    shares = (((target - loop) * steps).sum(axis=1) / squares).clip(0.0, 1.0)
    nearest = ((loop + shares[:, None] * steps - target) ** 2).sum(axis=1).argmin()
    return float(lengths[nearest] + shares[nearest] * (lengths[nearest + 1] - lengths[nearest]))


def refined_loop(loop: Floats, count: int) -> Floats:
    """Return a loop with points added so that no segment is longer than the perimeter / `count`.

    Parts are matched to sides as exactly as vertices allow. Those that only rounding keeps apart become one.
    """
    lengths = loop_lengths(loop)
    own = np.diff(lengths)
    pieces = np.where(own > SHORTEST * lengths[-1], np.ceil(own * count / lengths[-1]), 0.0).astype(np.int64)
    segment = np.repeat(np.arange(len(loop)), pieces)
    number = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (number / pieces[segment])[:, None]
    return (1.0 - share) * loop[segment] + share * np.roll(loop, -1, axis=0)[segment]


def cornered_loop(loop: Floats, target: Floats, width: float, depth: float) -> Floats:
    """Return a loop (n, k) that starts where it is nearest to a point (k,), with vertices for all corners.

    Vertices are added at the parts of its length that the rectangle's sides are of its perimeter; those right
    beside make way. With the next ones instead, neighbouring slices would differ.
    """
    lengths = loop_lengths(loop)
    perimeter, first = lengths[-1], nearest_place(loop, lengths, target)
    corners = perimeter * (
        np.array([0.0, width, width + depth, 2.0 * width + depth]) / (2.0 * (width + depth))
    )
    places = (lengths[:-1] - first) % perimeter
    apart = np.abs(places[:, None] - corners)
    free = np.minimum(apart, perimeter - apart).min(axis=1) > CLOSEST * perimeter
    return points_at(loop, lengths, first + np.sort(np.concatenate([corners, places[free]])))


def rolled_loop(loop: Floats, target: Floats) -> Floats:
    """Return a loop (n, k) from its vertex nearest to a point (k,) on, as in the paper."""
    return np.roll(loop, -int(((loop - target) ** 2).sum(axis=1).argmin()), axis=0)


def split_chain(lengths: Floats, width: float, depth: float) -> tuple[Ints, float]:
    """Split a chain of vertices into four parts, one for each side of the rectangle, at the least error.

    The error is the sum over the parts of (side - k (length of the part))^2, where k scales the whole chain
    to the rectangle's perimeter. With the vertex i_2 at the far corner given, the error is a parabola in the
    scaled length up to i_1, with its minimum at (width + l_{i_2} - depth) / 2: the best i_1 is the vertex
    nearest to that. The same goes for i_3. Trying every i_2 thus gives the exact minimum.

    Parameters
    ----------
    lengths : (n + 1,) array
        Length of the chain up to each vertex, the last one that of the whole [mm]; n >= 4.
    width, depth : float
        Sides of the rectangle [mm].

    Returns
    -------
    splits : (5,) int array
        Vertices at the corners: 0, i_1, i_2, i_3, n; no part is empty.
    error : float
        The least error [mm^2].
    """
    n, scaled = len(lengths) - 1, lengths * (2.0 * (width + depth) / lengths[-1])
    middle = np.arange(2, n - 1)
    far = scaled[middle]
    one = _nearest(scaled, 0.5 * (width + far - depth), 1, middle - 1)
    three = _nearest(scaled, 0.5 * (width + far - depth + scaled[n]), middle + 1, n - 1)
    errors = (width - scaled[one]) ** 2 + (depth - (far - scaled[one])) ** 2
    errors += (width - (scaled[three] - far)) ** 2 + (depth - (scaled[n] - scaled[three])) ** 2
    best = errors.argmin()
    return np.array([0, one[best], middle[best], three[best], n]), float(errors[best])


def _nearest(ascending: Floats, values: Floats, first: Ints | int, last: Ints | int) -> Ints:
    """Return the indices from `first` to `last` at which an ascending array is nearest to some values."""
    after = np.searchsorted(ascending, values).clip(first, last)
    before = np.maximum(after - 1, first)
    return np.where(values - ascending[before] <= np.abs(ascending[after] - values), before, after)


def subdivided_rectangle(lengths: Floats, splits: Ints, width: float, depth: float) -> Floats:
    """Return a vertex of the rectangle's boundary for every vertex of a chain, (n, 2).

    The sides are subdivided in the ratios of the segments that :func:`split_chain` gave them.
    """
    corners = ((0.0, width, width, 0.0, 0.0), (0.0, 0.0, depth, depth, 0.0))
    return np.column_stack([np.interp(lengths[:-1], lengths[splits], places) for places in corners])
