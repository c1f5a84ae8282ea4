"""Correspondence between the template's rectangle and sections of the muscle.

The rectangle has the corners Q0 = (0, 0), (width, 0), (width, depth) and (0, depth), counterclockwise as the
loops. A loop, flat (k = 2) or in space (k = 3), is matched from its counterpart of Q0, and split into four
parts, a part for each side.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3, extended in
doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import FloatMap, Floats, Ints

#: Candidate starts of a loop, and the least number of its segments.
N_STARTS = 128
#: Shortest segment, as a part of the loop's perimeter: shorter segments come from rounding.
SHORTEST = 1e-9
#: Distance from a corner, as a part of the perimeter, within which the corner replaces a vertex.
CLOSEST = 1e-6


class LoopStack(NamedTuple):
    """Loops of a muscle, with levels and costs. Levels (l,) ascend [mm]."""

    loops: Sequence[Floats]
    levels: Floats
    start_costs: FloatMap | None = None


def starting_points(stack: LoopStack, continuity: float, corner: Floats) -> Floats:
    """Return a start (l, k) for each loop. It is near Q0, without twist between loops.

    The paper takes the vertex nearest to Q0, slice by slice: if a section turns past Q0 the vertex jumps, and
    all fibres turn with the section. Here the starts p_j minimise, over all slices at once,

        sum_j cost_j(p_j) dz_j  +  continuity^2 sum_j D_j(p_j, p_{j-1})^2 / (z_j - z_{j-1}),

    where cost_j is the squared distance from Q0, as in the paper, or a custom cost, and D_j the root mean
    square distance between corresponding points of the loops j and j - 1, both about their centroids. D
    depends on the difference of the starts alone, and a cyclic correlation gives all values at once; dynamic
    programming finds the exact minimum.

    continuity : height over which the start may drift towards Q0 [mm]; 0: each loop has its start of least
        cost;
    corner : (k,), Q0: candidates are counted from the point of each loop nearest to Q0 [mm].
    """
    loops, levels, start_costs = stack
    if continuity == 0.0 and start_costs is None:
        return np.tile(corner, (len(loops), 1))
    samples = np.array([sampled_loop(loop, corner, N_STARTS) for loop in loops])
    costs = ((samples - corner) ** 2).sum(axis=2) if start_costs is None else start_costs(samples)
    number = np.arange(len(loops))
    if continuity == 0.0:
        return np.asarray(samples[number, costs.argmin(axis=1)])
    costs = costs * (np.gradient(levels) if len(levels) > 1 else np.ones(1))[:, None]
    centred = samples - samples.mean(axis=1, keepdims=True)
    square = (centred**2).sum(axis=2).mean(axis=1)
    twists = square[:-1, None] + square[1:, None] - 2.0 * cyclic_products(centred[:-1], centred[1:])
    twists *= (continuity**2 / np.diff(levels))[:, None]
    return samples[number, _cheapest_chain(costs, twists)]


def followed_starts(stack: LoopStack, guides: LoopStack, continuity: float, corner: Floats) -> Floats:
    """Return starts (l, k) interpolated between guiding loops.

    Starts are chosen among samples of a loop. If each set of loops chose anew, a slightly different cut of
    the muscle could move a start by a sample, and the fibres with it. So starts are interpolated about the
    centroids of guiding loops at fixed levels. Without continuity, or without guides, each loop has the start
    of :func:`starting_points`.
    """
    if continuity == 0.0 or not len(guides.loops):
        return starting_points(stack, continuity, corner)
    starts = starting_points(guides, continuity, corner)
    offsets = starts - np.array([boundary_centroid(loop) for loop in guides.loops])
    centroids = np.array([boundary_centroid(loop) for loop in stack.loops])
    between = [np.interp(stack.levels, guides.levels, column) for column in offsets.T]
    return np.asarray(centroids + np.column_stack(between))


def cyclic_products(first: Floats, second: Floats) -> Floats:
    """Return mean dot products for every cyclic shift. Result (j, n).

    The mean over i of first[j, i] . second[j, i + p].
    """
    spectra = np.fft.rfft(first, axis=1).conj() * np.fft.rfft(second, axis=1)
    n = first.shape[1]
    return np.asarray(np.fft.irfft(spectra.sum(axis=2), n, axis=1) / n)


def _cheapest_chain(costs: Floats, twists: Floats) -> Ints:
    """Return the chain p of least cost.

    sum_j costs[j, p_j] + sum_j twists[j - 1, (p_j - p_{j-1}) mod n] is least.
    """
    start = np.arange(costs.shape[1])
    turns = (start - start[:, None]) % len(start)
    best, predecessors = costs[0], []
    for cost, twist in zip(costs[1:], twists, strict=True):
        totals = best[:, None] + twist[turns]
        predecessors.append(totals.argmin(axis=0))
        best = cost + totals.min(axis=0)
    chain = [best.argmin()]
    for predecessor in reversed(predecessors):
        chain.append(predecessor[chain[-1]])
    return np.array(chain[::-1], dtype=np.int64)


def loop_lengths(loop: Floats) -> Floats:
    """Return arc lengths up to each vertex, and the perimeter. Loop (n, k), lengths (n + 1,).

    The last is the perimeter.
    """
    return np.append(0.0, np.cumsum(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)))


def boundary_centroid(loop: Floats) -> Floats:
    """Return the centroid (k,) of a loop's boundary.

    The mean of the segments' middles, weighted by length.
    """
    lengths = loop_lengths(loop)
    return np.asarray(np.diff(lengths) @ (loop + np.roll(loop, -1, axis=0)) / (2.0 * lengths[-1]))


def sampled_loop(loop: Floats, corner: Floats, count: int) -> Floats:
    """Return `count` equidistant points along a loop (n, k). The first is the loop's point nearest to Q0."""
    lengths = loop_lengths(loop)
    first = nearest_arc(loop, lengths, corner)
    return points_at(loop, lengths, first + lengths[-1] * np.arange(count) / count)


def points_at(loop: Floats, lengths: Floats, arcs: Floats) -> Floats:
    """Return points (m, k) at arc lengths (m,). Loop (n, k)."""
    along, closed = arcs % lengths[-1], np.vstack([loop, loop[:1]])
    return np.column_stack([np.interp(along, lengths, column) for column in closed.T])


def nearest_arc(loop: Floats, lengths: Floats, target: Floats) -> float:
    """Return the arc length nearest to a point (k,). Loop (n, k)."""
    steps = np.roll(loop, -1, axis=0) - loop
    squares = np.maximum((steps**2).sum(axis=1), np.finfo(float).tiny)
    shares = (((target - loop) * steps).sum(axis=1) / squares).clip(0.0, 1.0)
    nearest = ((loop + shares[:, None] * steps - target) ** 2).sum(axis=1).argmin()
    return float(lengths[nearest] + shares[nearest] * (lengths[nearest + 1] - lengths[nearest]))


def refined_loop(loop: Floats, count: int) -> Floats:
    """Return a loop with segments up to perimeter / `count`.

    Matching of parts and sides is as exact as vertices allow. Vertices apart by rounding merge.
    """
    lengths = loop_lengths(loop)
    segments = np.diff(lengths)
    pieces = np.where(segments > SHORTEST * lengths[-1], np.ceil(segments * count / lengths[-1]), 0.0).astype(
        np.int64
    )
    segment = np.repeat(np.arange(len(loop)), pieces)
    number = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (number / pieces[segment])[:, None]
    return (1.0 - share) * loop[segment] + share * np.roll(loop, -1, axis=0)[segment]


def cornered_loop(loop: Floats, target: Floats, width: float, depth: float) -> Floats:
    """Return a loop (n, k) with vertices for all corners.

    It starts at its point nearest to a target (k,). A vertex is added at each corner's part of the
    rectangle's perimeter, in place of vertices next to the corner. The nearest vertices would differ between
    neighbouring slices.
    """
    lengths = loop_lengths(loop)
    perimeter, first = lengths[-1], nearest_arc(loop, lengths, target)
    corners = perimeter * (np.cumsum([0.0, width, depth, width]) / (2.0 * (width + depth)))
    arcs = (lengths[:-1] - first) % perimeter
    apart = np.abs(arcs[:, None] - corners)
    free = np.minimum(apart, perimeter - apart).min(axis=1) > CLOSEST * perimeter
    return points_at(loop, lengths, first + np.sort(np.concatenate([corners, arcs[free]])))


def split_chain(lengths: Floats, width: float, depth: float) -> tuple[Ints, float]:
    """Split a chain into four parts for the rectangle's sides.

    The least error is the sum over the parts of (side - k (length of the part))^2, where k scales the chain
    to the rectangle's perimeter. For a vertex i_2 at the far corner, the error is a parabola in the scaled
    length up to i_1, with its minimum at (width + l_{i_2} - depth) / 2: the best i_1 is the nearest vertex,
    and likewise i_3. Trying every i_2 gives the exact minimum.

    lengths : (n + 1,), length of the chain up to each vertex, the last the whole length [mm]; n >= 4;
    width, depth : sides of the rectangle [mm].

    Returns splits : (5,), vertices at the corners: 0, i_1, i_2, i_3, n; no part is empty;
    error : the least error [mm^2].
    """
    n, scaled = len(lengths) - 1, lengths * (2.0 * (width + depth) / lengths[-1])
    middle = np.arange(2, n - 1)
    far = scaled[middle]
    left = _nearest(scaled, 0.5 * (width + far - depth), 1, middle - 1)
    right = _nearest(scaled, 0.5 * (width + far - depth + scaled[n]), middle + 1, n - 1)
    errors = (width - scaled[left]) ** 2 + (depth - (far - scaled[left])) ** 2
    errors += (width - (scaled[right] - far)) ** 2 + (depth - (scaled[n] - scaled[right])) ** 2
    best = errors.argmin()
    return np.array([0, left[best], middle[best], right[best], n]), float(errors[best])


def _nearest(ascending: Floats, values: Floats, first: Ints | int, last: Ints | int) -> Ints:
    """Return indices of the nearest ascending values. From `first` to `last`."""
    after = np.searchsorted(ascending, values).clip(first, last)
    before = np.maximum(after - 1, first)
    return np.where(values - ascending[before] <= np.abs(ascending[after] - values), before, after)


def subdivided_rectangle(lengths: Floats, splits: Ints, width: float, depth: float) -> Floats:
    """Return the rectangle's boundary point (n, 2) per chain vertex.

    Sides are subdivided in the ratios of the segments in their parts (:func:`split_chain`).
    """
    corners = ((0.0, width, width, 0.0, 0.0), (0.0, 0.0, depth, depth, 0.0))
    return np.column_stack([np.interp(lengths[:-1], lengths[splits], column) for column in corners])


def mean_value_weights(polygon: Floats, points: Floats) -> Floats:
    """Return mean value coordinates (m, n) in a polygon.

    w_i = (tan(a_{i-1} / 2) + tan(a_i / 2)) / r_i, divided by their sum, where r_i is the distance from the
    point to vertex i and a_i the signed visual angle of the edge from vertex i to the next. tan(a / 2) is sin
    a / (1 + cos a) for acute and (1 - cos a) / sin a for obtuse angles, free of cancellation. On an edge,
    with an infinite tangent, the coordinates interpolate linearly.

    polygon : (n, 2), vertices in order, convex or not, n >= 3; equal neighbours are allowed;
    points : (m, 2), points of the plane.

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


class SectionMap(NamedTuple):
    """Map of the template's rectangle to a section.

    `ring` (n, k) is the section's boundary, `rectangle` (n, 2) its counterpart [mm].
    """

    ring: Floats
    rectangle: Floats

    def positions(self, points: Floats) -> Floats:
        """Return rectangle points in the section [mm]. Points (m, 2), result (m, k).

        f' = sum_i w_i(f) p_i, with the mean value coordinates w_i of f in the subdivided rectangle and the
        section's vertices p_i. The result may lie outside of a concave section.
        """
        return mean_value_weights(self.rectangle, points) @ self.ring


def section_map(loop: Floats, target: Floats, sides: Floats, *, as_printed: bool) -> SectionMap:
    """Return the map of the template's rectangle to a section.

    The section's boundary (n, k) runs counterclockwise, n >= 3, in x and y. Sides (2,) or longer [mm]. The
    correspondence starts at the point nearest to the target (k,). `as_printed` starts and splits at vertices,
    as in the paper; otherwise vertices are added.
    """
    width, depth = float(sides[0]), float(sides[1])
    if as_printed:  # a triangle has too few vertices for four sides, and becomes a hexagon
        ring = refined_loop(loop, 1 if len(loop) > 3 else 6)
        ring = np.roll(ring, -int(((ring - target) ** 2).sum(axis=1).argmin()), axis=0)
    else:
        ring = cornered_loop(refined_loop(loop, N_STARTS), target, width, depth)
    lengths = loop_lengths(ring)
    splits = split_chain(lengths, width, depth)[0]
    return SectionMap(ring, subdivided_rectangle(lengths, splits, width, depth))


def count_outside(loop: Floats, points: Floats) -> int:
    """Return the number of points outside a loop. Points (m, 2), loop (n, 2), by the even-odd rule.

    By the even-odd rule.
    """
    x, y = points[:, 0, None], points[:, 1, None]
    (bx, by), (ax, ay) = loop[:, :2].T, np.roll(loop[:, :2], 1, axis=0).T
    rises = np.where(by == ay, 1.0, by - ay)
    crossed = ((ay > y) != (by > y)) & ((bx - ax) * (y - ay) / rises + ax > x)
    return int((crossed.sum(axis=1) % 2 == 0).sum())


#: Heights within this part of the box's length are equal but for rounding.
SAME_HEIGHT = 1e-9
#: Heights of slices are multiples of this part of the box's length, between rounding and `SAME_HEIGHT`.
GRAIN = 1e-12
#: Parallel planes do not suit a muscle whose course exceeds an angle to the box's axis [degrees] over more
#: than a share of its length, or whose main branch has less than a share of the volume.
LARGEST_STEEP_SHARE, STEEP, LEAST_SHARE = 0.15, 45.0, 0.8
#: Guiding sections at fixed heights, between which starts are interpolated: their number, and the distance of
#: the first and last from the ends, as a part of the length.
N_GUIDES, GUIDE_MARGIN = 33, 0.02


class Morph(NamedTuple):
    """Fibre points (n, 3) in a muscle [mm], with measures.

    `n_outside` counts points outside of their section (planes), or outside of the muscle except ends on
    attachment areas (isolines, not flat). `volume_share` is the part of the muscle's volume in the branch
    with fibres, `steep_share` the part of the branch's course at more than :data:`STEEP` degrees to the axis.
    """

    points: Floats
    n_outside: int
    volume_share: float
    steep_share: float

    @property
    def suits(self) -> bool:
        """False if parallel planes do not follow the course."""
        return self.volume_share >= LEAST_SHARE and self.steep_share <= LARGEST_STEEP_SHARE


class Slicing(NamedTuple):
    """Settings of slices through a muscle, by planes or isolines.

    Fibre points within `slice_tolerance` [mm] of height share a slice. `continuity` is the part of the
    muscle's length over which neighbouring slices resist twisting; 0 is the paper's rule, with sections
    started and split at their vertices.
    """

    slice_tolerance: float
    continuity: float


class SliceMaps:
    """Maps of the template's rectangle to sections of a muscle.

    The boundaries `loops` (j, k) of the sections run counterclockwise about z from `starts` (l, k) [mm];
    `hits` (l,) are the numbers of their levels, `sides` (2,) or longer the rectangle's sides. Sections in
    space are viewed along z after the rotations `views` (l, 3, 3).
    """

    def __init__(
        self,
        loops: Sequence[Floats],
        starts: Floats,
        hits: Ints,
        sides: Floats,
        slicing: Slicing,
        views: Floats | None = None,
    ) -> None:
        if views is not None:
            loops = [loop @ view.T for loop, view in zip(loops, views, strict=True)]
            starts = np.einsum("lij,lj->li", views, starts)
        self._loops, self._views, self._hits = loops, views, hits
        printed = slicing.continuity == 0.0
        self._maps = [
            section_map(loop, start, sides, as_printed=printed)
            for loop, start in zip(loops, starts, strict=True)
        ]

    def positions(
        self, inside: Floats, heights: Floats, levels: Floats, slice_of: Ints
    ) -> tuple[Floats, int]:
        """Return template points in the muscle's sections.

        A point off its slice's level is interpolated between the maps of the slice and of the next slice on
        its side. A level without a section, by rounding, takes the section of the nearest level. Points (n,
        2) or wider are in the rectangle; heights (n,) and ascending levels (h,) have one unit; `slice_of`
        (n,) is the level of each point.

        Returns positions : (n, k), points in the muscle, in their order [mm];
        n_outside : points outside of their section, seen along z.
        """
        above = heights - levels[slice_of]
        adjacent = slice_of + np.sign(above).astype(np.int64)
        apart = np.abs(above) > SAME_HEIGHT * (levels[-1] - levels[0])
        shared = np.flatnonzero(apart & (adjacent >= 0) & (adjacent < len(levels)))
        shares = above[shared] / (levels[adjacent[shared]] - levels[slice_of[shared]])
        weights = np.concatenate([np.ones(len(inside)), shares])
        weights[shared] -= shares
        points = np.concatenate([np.arange(len(inside)), shared])
        at_level = np.concatenate([slice_of, adjacent[shared]])
        order = np.argsort(at_level, kind="stable")
        positions = np.zeros((len(inside), self._loops[0].shape[1]))
        flat = np.ascontiguousarray(inside[:, :2])
        n_outside = 0
        for level, members in enumerate(
            np.split(order, np.searchsorted(at_level[order], np.arange(1, len(levels))))
        ):
            number = int(np.abs(self._hits - level).argmin())
            mapped = self._maps[number].positions(flat[points[members]])
            turned = mapped if self._views is None else mapped @ self._views[number]
            positions[points[members]] += weights[members, None] * turned
            n_outside += count_outside(self._loops[number], mapped[members < len(inside)])
        return positions, n_outside


class Box:
    """Fitted template's box, with coordinates along its sides.

    A mirroring transform (4, 4) of the unit cube gives left-handed sides, and coordinates of the muscle's
    mirror image.
    """

    def __init__(self, transform: Floats) -> None:
        self.sides: Floats = np.linalg.norm(transform[:3, :3], axis=0)
        self._frame: Floats = transform[:3, :3] / self.sides
        self._corner: Floats = transform[:3, 3]

    @property
    def length(self) -> float:
        """Length along z [mm]."""
        return float(self.sides[2])

    def coordinates(self, points: Floats) -> Floats:
        """Return points (n, 3) along the sides [mm]. From corner Q0."""
        return (points - self._corner) @ self._frame

    def surface(self, muscle: ClosedSurface) -> ClosedSurface:
        """Return a muscle in box coordinates, facing outward."""
        return ClosedSurface(self.coordinates(muscle.points), muscle.triangles, muscle.opposite).outward()

    def positions(self, coordinates: Floats) -> Floats:
        """Return the points (n, 3) of coordinates [mm]."""
        return coordinates @ self._frame.T + self._corner


def guide_levels(length: float) -> Floats:
    """Return heights (k,) of guiding sections [mm]."""
    return length * np.linspace(GUIDE_MARGIN, 1.0 - GUIDE_MARGIN, N_GUIDES)


def shared_levels(heights: Floats, tolerance: float, grain: float = 0.0) -> tuple[Floats, Ints]:
    """Return slice levels (k,) [mm] and each height's slice (n,).

    From the lowest height on, a slice takes all heights within the tolerance [mm] of its lowest. Its level is
    half way between its lowest and highest height, rounded to a multiple of the grain, far below the
    tolerance: heights that differ by rounding share their slices.
    """
    order = np.argsort(heights, kind="stable")
    slice_of = np.empty(len(heights), dtype=np.int64)
    ascending = heights[order]
    levels: list[float] = []
    first = 0
    while first < len(ascending):
        last = int(np.searchsorted(ascending, ascending[first] + tolerance, side="right"))
        slice_of[order[first:last]] = len(levels)
        levels.append(0.5 * (ascending[first] + ascending[last - 1]))
        first = last
    exact = np.array(levels)
    return np.round(exact / grain) * grain if grain > 0.0 else exact, slice_of
