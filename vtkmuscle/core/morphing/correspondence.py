"""Correspondence between the template's rectangle and sections of the muscle.

The rectangle has the corners Q0 = (0, 0), (width, 0), (width, depth) and (0, depth), counterclockwise as the
loops. A loop, flat (k = 2) or in space (k = 3), is matched from its counterpart of Q0, and split into four
parts, a part for each side.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3, extended in
doi:10.1007/978-3-642-38241-3_3.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import ROUNDING, SAME, TINY, FloatMap, Floats, Ints

#: Candidate starts of a loop, and the least number of its segments. With 64 mean lengths of fibres in ten
#: muscles of a hip and a knee differ by at most 3.2 mm.
N_STARTS = 128


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
    samples = np.array([sampled_loop(loop, corner) for loop in loops])
    costs = ((samples - corner) ** 2).sum(axis=2) if start_costs is None else start_costs(samples)
    costs = costs * (np.gradient(levels) if len(levels) > 1 else np.ones(1))[:, None]
    centred = samples - samples.mean(axis=1, keepdims=True)
    square = (centred**2).sum(axis=2).mean(axis=1)
    twists = square[:-1, None] + square[1:, None] - 2.0 * cyclic_products(centred[:-1], centred[1:])
    twists *= (continuity**2 / np.diff(levels))[:, None]
    return samples[np.arange(len(loops)), _cheapest_chain(costs, twists)]


def followed_starts(stack: LoopStack, guides: LoopStack, continuity: float, corner: Floats) -> Floats:
    """Return starts (l, k) interpolated between guiding loops.

    Starts are chosen among samples of a loop. If each set of loops chose anew, a slightly different cut of
    the muscle could move a start by a sample, and the fibres with it. So starts are interpolated about the
    centroids of guiding loops at fixed levels. Without continuity, or without guides, each loop has the start
    of :func:`starting_points`.
    """
    if continuity == 0.0 or not len(guides.loops):
        return starting_points(stack, continuity, corner)
    offsets = starting_points(guides, continuity, corner) - boundary_centroids(guides.loops)
    between = [np.interp(stack.levels, guides.levels, column) for column in offsets.T]
    return np.asarray(boundary_centroids(stack.loops) + np.column_stack(between))


def cyclic_products(first: Floats, second: Floats) -> Floats:
    """Return mean dot products first[j, i] . second[j, i + p] over i, for every cyclic shift p, (j, n)."""
    spectra = np.fft.rfft(first, axis=1).conj() * np.fft.rfft(second, axis=1)
    n = first.shape[1]
    return np.asarray(np.fft.irfft(spectra.sum(axis=2), n, axis=1) / n)


def _cheapest_chain(costs: Floats, twists: Floats) -> Ints:
    """Return the chain p of least sum costs[j, p_j] + twists[j - 1, (p_j - p_{j-1}) mod n] over j."""
    n, best, predecessors = costs.shape[1], costs[0], []
    for cost, twist in zip(costs[1:], twists, strict=True):
        turned = np.lib.stride_tricks.sliding_window_view(np.tile(twist, 2), n)[n:0:-1]
        totals = best[:, None] + turned
        predecessors.append(totals.argmin(axis=0))
        best = cost + totals.min(axis=0)
    chain = [best.argmin()]
    for predecessor in reversed(predecessors):
        chain.append(predecessor[chain[-1]])
    return np.array(chain[::-1], dtype=np.int64)


def loop_lengths(loop: Floats) -> Floats:
    """Return arc lengths (n + 1,) up to each vertex of a loop (n, k), the perimeter last."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)))


def boundary_centroids(loops: Sequence[Floats]) -> Floats:
    """Return the centroids (l, k) of loops' boundaries: the segments' middles weighted by length."""
    points, sizes = np.vstack(loops), np.array([len(loop) for loop in loops])
    firsts = np.cumsum(sizes) - sizes
    after = np.roll(points, -1, axis=0)
    after[firsts + sizes - 1] = points[firsts]
    lengths = np.linalg.norm(after - points, axis=1)[:, None]
    return np.add.reduceat(lengths * (points + after), firsts) / (2.0 * np.add.reduceat(lengths, firsts))


def sampled_loop(loop: Floats, corner: Floats) -> Floats:
    """Return :data:`N_STARTS` equidistant points along a loop (n, k), from its point nearest to Q0 on."""
    lengths = loop_lengths(loop)
    first = nearest_arc(loop, lengths, corner)
    return points_at(loop, lengths, first + lengths[-1] * np.arange(N_STARTS) / N_STARTS)


def points_at(loop: Floats, lengths: Floats, arcs: Floats) -> Floats:
    """Return points (m, k) at arc lengths (m,). Loop (n, k)."""
    along, closed = arcs % lengths[-1], np.vstack([loop, loop[:1]])
    return np.column_stack([np.interp(along, lengths, column) for column in closed.T])


def nearest_arc(loop: Floats, lengths: Floats, target: Floats) -> float:
    """Return the arc length nearest to a point (k,). Loop (n, k)."""
    steps = np.roll(loop, -1, axis=0) - loop
    squares = np.maximum((steps**2).sum(axis=1), TINY)
    shares = (((target - loop) * steps).sum(axis=1) / squares).clip(0.0, 1.0)
    nearest = ((loop + shares[:, None] * steps - target) ** 2).sum(axis=1).argmin()
    return float(lengths[nearest] + shares[nearest] * (lengths[nearest + 1] - lengths[nearest]))


def refined_loop(loop: Floats, count: int) -> Floats:
    """Return a loop with segments up to perimeter / `count`.

    Matching of parts and sides is as exact as vertices allow. Vertices apart by rounding merge.
    """
    lengths = loop_lengths(loop)
    segments = np.diff(lengths)
    pieces = np.ceil(segments * count / lengths[-1]).astype(np.int64)
    pieces[segments <= ROUNDING * lengths[-1]] = 0
    segment = np.repeat(np.arange(len(loop)), pieces)
    number = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (number / pieces[segment])[:, None]
    return np.asarray((1.0 - share) * loop[segment] + share * np.roll(loop, -1, axis=0)[segment])


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
    free = np.minimum(apart, perimeter - apart).min(axis=1) > SAME * perimeter
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
    weights = np.empty((len(points), len(polygon)))
    _weigh(polygon, points, weights)
    return weights


@kernel
def _weigh(polygon: Floats, points: Floats, weights: Floats) -> None:
    n = len(polygon)
    for q in range(len(points)):
        row, px, py = weights[q], points[q, 0], points[q, 1]
        x, y = polygon[n - 1, 0] - px, polygon[n - 1, 1] - py
        r, edge, share, total = math.sqrt(x * x + y * y), -1, 0.0, 0.0
        for i in range(n):  # tangent of the edge to vertex i
            u, v = polygon[i, 0] - px, polygon[i, 1] - py
            s = math.sqrt(u * u + v * v)
            product, sine, cosine = r * s, x * v - y * u, x * u + y * v
            if cosine <= 0.0 and abs(sine) <= 1e-15 * product:
                edge, share = i, r / max(r + s, 1e-300)
                break
            row[i] = sine / (product + cosine) if cosine >= 0.0 else (product - cosine) / sine
            x, y, r = u, v, s
        if edge >= 0:
            row[:] = 0.0
            row[edge - 1] = 1.0 - share
            row[edge] = share
            continue
        first = row[0]
        for i in range(n):
            u, v = polygon[i, 0] - px, polygon[i, 1] - py
            row[i] = (row[i] + (row[i + 1] if i + 1 < n else first)) / math.sqrt(u * u + v * v)
            total += row[i]
        for i in range(n):
            row[i] /= total


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
    # Each vertex on the rectangle's boundary, in the ratios of the segments.
    corners = ((0.0, width, width, 0.0, 0.0), (0.0, 0.0, depth, depth, 0.0))
    sides_of = [np.interp(lengths[:-1], lengths[splits], column) for column in corners]
    return SectionMap(ring, np.column_stack(sides_of))
