"""From the template's rectangle to a section of the muscle: which points correspond, and the map between.

The rectangle has the corners Q0 = (0, 0), (width, 0), (width, depth) and (0, depth); loops run
counterclockwise as it does. A loop, flat (k = 2) or in space (k = 3), is matched from the point on that goes
with Q0: it is split into four parts, one for each side.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Points of a loop at which it may start, and the least number of its segments.
N_PLACES = 128
#: A segment shorter than this part of its loop's perimeter comes from rounding.
SHORTEST = 1e-9
#: A vertex nearer to a corner than this part of the perimeter is replaced by the corner.
CLOSEST = 1e-6


def starting_points(
    loops: Sequence[Floats],
    levels: Floats,
    continuity: float,
    corner: Floats,
    place_costs: Callable[[Floats], Floats] | None = None,
) -> Floats:
    """Return a point (l, k) on or near each loop at which it starts: near Q0, without twist between loops.

    The paper takes the vertex nearest to Q0, slice by slice: where a section turns past Q0 that vertex jumps
    along it, and all fibres turn with it. Here the places p_j minimise, over all slices at once,

        sum_j cost_j(p_j) dz_j  +  continuity^2 sum_j D_j(p_j, p_{j-1})^2 / (z_j - z_{j-1}),

    where cost_j is the squared distance from Q0, as in the paper, or a given one, and D_j the root mean
    square distance between corresponding points of the loops j and j - 1, both about their centroids. D
    depends on the difference of the places only, and comes for all of them at once from a cyclic correlation;
    the minimum is found exactly, by dynamic programming.

    Parameters
    ----------
    loops : sequence of (n, k) arrays
        Vertices of each loop, counterclockwise [mm].
    levels : (l,) array
        Heights of the loops, strictly ascending [mm].
    continuity : float
        Height over which the start may drift towards Q0 [mm]; 0: each loop has the place of least cost.
    corner : (k,) array
        Q0: places are counted from the point of each loop that is nearest to it [mm].
    place_costs : callable, optional
        From the places (l, N_PLACES, k) of the loops to the cost of each, (l, N_PLACES) [mm^2].
    """
    if continuity == 0.0 and place_costs is None:
        return np.tile(corner, (len(loops), 1))
    samples = np.array([sampled_loop(loop, corner, N_PLACES) for loop in loops])
    costs = ((samples - corner) ** 2).sum(axis=2) if place_costs is None else place_costs(samples)
    number = np.arange(len(loops))
    if continuity == 0.0:
        starts: Floats = samples[number, costs.argmin(axis=1)]
        return starts
    costs = costs * (np.gradient(levels) if len(levels) > 1 else np.ones(1))[:, None]
    centred = samples - samples.mean(axis=1, keepdims=True)
    square = (centred**2).sum(axis=2).mean(axis=1)
    twists = square[:-1, None] + square[1:, None] - 2.0 * cyclic_products(centred[:-1], centred[1:])
    twists *= (continuity**2 / np.diff(levels))[:, None]
    return samples[number, _cheapest_chain(costs, twists)]


class LoopStack(NamedTuple):
    """Loops of a muscle, their ascending levels (l,) [mm], and optionally the costs of places on them."""

    loops: Sequence[Floats]
    levels: Floats
    place_costs: Callable[[Floats], Floats] | None = None


def followed_starts(stack: LoopStack, guides: LoopStack, continuity: float, corner: Floats) -> Floats:
    """Return a start (l, k) for each loop, interpolated about the centroids of guiding loops at fixed levels.

    Starts are chosen among samples of a loop. If each set of loops chose anew, a slightly different cut of
    the muscle could move a start by one sample, and the fibres with it. Without continuity, or without
    guides, each loop has the start of :func:`starting_points`.
    """
    if continuity == 0.0 or not len(guides.loops):
        return starting_points(stack.loops, stack.levels, continuity, corner, stack.place_costs)
    starts = starting_points(guides.loops, guides.levels, continuity, corner, guides.place_costs)
    offsets = starts - np.array([boundary_centroid(loop) for loop in guides.loops])
    centroids = np.array([boundary_centroid(loop) for loop in stack.loops])
    between = [np.interp(stack.levels, guides.levels, column) for column in offsets.T]
    points: Floats = centroids + np.column_stack(between)
    return points


def cyclic_products(first: Floats, second: Floats) -> Floats:
    """Return the mean over i of first[j, i] . second[j, i + p] for every shift p, (j, n)."""
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
    first = nearest_place(loop, lengths, corner)
    return points_at(loop, lengths, first + lengths[-1] * np.arange(count) / count)


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

    Parts are matched to sides as exactly as vertices allow. Vertices apart by rounding become one.
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

    A vertex is added for each corner, where the rectangle's perimeter has the corner, in place of vertices
    right beside. If the nearest vertices were taken, neighbouring slices would differ.
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
    """Return a point of the rectangle's boundary for every vertex of a chain, (n, 2).

    The sides are subdivided in the ratios of the segments that :func:`split_chain` gave them.
    """
    corners = ((0.0, width, width, 0.0, 0.0), (0.0, 0.0, depth, depth, 0.0))
    return np.column_stack([np.interp(lengths[:-1], lengths[splits], places) for places in corners])


def mean_value_weights(polygon: Floats, points: Floats) -> Floats:
    """Return the mean value coordinates of points in a polygon, (m, n).

    w_i = (tan(a_{i-1} / 2) + tan(a_i / 2)) / r_i, divided by their sum, where r_i is the distance from the
    point to vertex i and a_i the signed angle under which it sees the edge from vertex i to the next.
    tan(a / 2) is sin a / (1 + cos a) for acute and (1 - cos a) / sin a for obtuse angles, neither of which
    cancels. On an edge, where one tangent is infinite, the coordinates are those of linear interpolation.

    Parameters
    ----------
    polygon : (n, 2) array
        Vertices in order, convex or not, n >= 3; equal neighbours are allowed.
    points : (m, 2) array
        Points of the plane.

    References
    ----------
    Hormann, Floater 2006, *Mean value coordinates for arbitrary planar polygons*,
    doi:10.1145/1183287.1183295.
    """
    x, y = polygon.T[:, None] - points.T[:, :, None]
    next_x, next_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    lengths = np.sqrt(x * x + y * y)
    products = lengths * np.roll(lengths, -1, axis=1)
    sines, cosines = x * next_y - y * next_x, x * next_x + y * next_y
    with np.errstate(divide="ignore", invalid="ignore"):  # on the polygon: replaced below
        acute = cosines >= 0.0
        tangents = np.where(acute, sines, products - cosines) / np.where(acute, products + cosines, sines)
        weights: Floats = (np.roll(tangents, 1, axis=1) + tangents) / lengths
        weights /= weights.sum(axis=1, keepdims=True)
    on_edge = (cosines < 0.0) & (np.abs(sines) <= 1e-15 * products)
    for row in np.flatnonzero(on_edge.any(axis=1) | (lengths == 0.0).any(axis=1)):
        weights[row] = 0.0
        if lengths[row].min() == 0.0:
            weights[row, lengths[row].argmin()] = 1.0
            continue
        start = int(on_edge[row].argmax())
        ends = [start, (start + 1) % len(polygon)]
        weights[row, ends] = lengths[row, ends[::-1]] / lengths[row, ends].sum()
    return weights


@dataclass(frozen=True, eq=False)
class SectionMap:
    """A map of the template's rectangle to a section of the muscle.

    `ring` (n, k) is the section's boundary, `rectangle` (n, 2) the points of the rectangle that go with it
    [mm]; `split_error` the root of the four parts' squared errors, as a part of the rectangle's perimeter.
    """

    ring: Floats
    rectangle: Floats
    split_error: float

    def places(self, points: Floats) -> Floats:
        """Return where points (m, 2) of the rectangle are in the section, (m, k) [mm].

        f' = sum_i w_i(f) p_i, with w_i the mean value coordinates of f in the subdivided rectangle and p_i
        the vertices of the section that go with the rectangle's. It may lie outside of a concave section.
        """
        return mean_value_weights(self.rectangle, points) @ self.ring


def section_map(loop: Floats, target: Floats, sides: Floats, *, as_printed: bool) -> SectionMap:
    """Return the map of the template's rectangle, with sides (2,) or longer, to a section of the muscle [mm].

    The section's boundary (n, k) runs counterclockwise, n >= 3; of one in space x and y are a view. The
    correspondence starts where it is nearest to the target (k,). `as_printed` it starts at the nearest vertex
    and is split at vertices, as in the paper; otherwise vertices are added at both.
    """
    width, depth = float(sides[0]), float(sides[1])
    if as_printed:  # a triangle has too few vertices for four sides, and becomes a hexagon
        ring = refined_loop(loop, 1 if len(loop) > 3 else 6)
        ring = np.roll(ring, -int(((ring - target) ** 2).sum(axis=1).argmin()), axis=0)
    else:
        ring = cornered_loop(refined_loop(loop, N_PLACES), target, width, depth)
    lengths = loop_lengths(ring)
    splits, error = split_chain(lengths, width, depth)
    rectangle = subdivided_rectangle(lengths, splits, width, depth)
    return SectionMap(ring, rectangle, float(np.sqrt(error)) / (2.0 * (width + depth)))


def count_outside(loop: Floats, points: Floats) -> int:
    """Return the number of points (m, 2) outside of a closed loop (n, 2), by the even-odd rule."""
    x, y = points[:, 0, None], points[:, 1, None]
    (bx, by), (ax, ay) = loop[:, :2].T, np.roll(loop[:, :2], 1, axis=0).T
    rises = np.where(by == ay, 1.0, by - ay)
    crossed = ((ay > y) != (by > y)) & ((bx - ax) * (y - ay) / rises + ax > x)
    return int((crossed.sum(axis=1) % 2 == 0).sum())
