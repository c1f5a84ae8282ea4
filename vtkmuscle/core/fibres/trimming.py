"""Fibre ends on attachment areas: as printed, or evenly spread.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4, extended in
doi:10.1007/978-3-642-38241-3_3.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.fibres.between_areas import AT_ONCE, CANDIDATES, even_positions
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh import polylines
from vtkmuscle.core.mesh.normals import angles_between
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.types import Bools, FloatMap, Floats, Ints

#: Largest turn from a fibre into its new end segment [degrees]. For ten muscles of a hip and a knee 45 moves
#: the points by up to 2 mm (root mean square), 90 by up to 4 mm.
LARGEST_TURN = 60.0
#: Multiples of the cut at the plane, in the order of trial: from the plane outwards to no cut. The first
#: alone moves points by up to 5 mm.
CUTS = (1.0, 0.8, 1.2, 0.6, 1.4, 0.4, 1.7, 0.2, 2.0, 0.0)
#: Parameters along a new segment at which it is checked against the surface. Four instead of 16 move points
#: by at most 1 mm.
CHECKS = (np.arange(16) + 0.5) / 16.0
#: Points of the curve along a fibre from which its points are spaced anew, as a multiple of these: chords of
#: a quarter of a segment are a sixteenth as far off a bend.
FINER = 4
#: Least distance of spread ends, as a part of an even spacing; closer ends meet. With ends that meet kept,
#: the points of the ten muscles move by 1 to 24 mm.
LEAST_SPREAD = 0.1


class EndArea(NamedTuple):
    """Attachment area at one end of the muscle.

    The extremal of the landmarks (k, 3) of all areas of a side places the cutting plane [mm]. Fibres end on
    the samples, and may keep ends on the discs spanned by the landmarks.
    """

    landmarks: Floats
    samples: PatchSamples
    discs: PatchSamples | None = None


#: Lengths to cut off an end of fibres (k,), and new ends (k, 3) [mm].
_Ends = tuple[Floats, Floats]
#: Map into the muscle, tolerance and largest cut, as of :func:`trim_fibres`.
_Limits = tuple[FloatMap, float, float]


def trim_fibres(
    points: Floats, offsets: Ints, *, axis: Floats, areas: tuple[EndArea, EndArea], limits: _Limits,
    keep: bool = True,
) -> Floats:  # fmt: skip
    """Return fibres (n, 3) from area to area. The number of points is kept.

    On each side a plane perpendicular to the axis, through the landmark deepest in the muscle, cuts the
    fibre, and a straight segment to a position on the area replaces the end (see :func:`assign_positions`).
    If the segment leaves the muscle or turns too far, other multiples of the cut are tried (:data:`CUTS`); if
    none is allowed, the cut with the least violation is taken. With ``keep`` fibres that already end on an
    area, spread over it, are kept. Points are then spaced evenly along each fibre, and points outside move to
    the nearest point of the muscle.

    points, offsets : (n, 3), (k + 1,), fibres from origin to insertion [mm]; first point of each fibre, of
        two or more points, and n;
    axis : (3,), unit vector from origin to insertion;
    areas : EndArea, EndArea, areas of the origin and of the insertion;
    limits : map from points (j, 3) to the nearest points (j, 3) of the muscle, where inner points stay [mm];
        largest distance of a new segment outside the muscle [mm]; largest part of a fibre's length cut off at
        either end, at most 0.5.
    """
    backwards = points[np.repeat(offsets[:-1] + offsets[1:] - 1, np.diff(offsets)) - np.arange(offsets[-1])]
    starts = _new_ends(backwards, offsets, -axis, areas[0], limits, keep=keep)
    ends = _new_ends(points, offsets, axis, areas[1], limits, keep=keep)
    result = _replaced_ends(points, offsets, starts, ends)
    inner = polylines.inner_points(offsets)
    result[inner] = limits[0](result[inner])
    return result


def _replaced_ends(points: Floats, offsets: Ints, starts: _Ends, ends: _Ends) -> Floats:
    """Return fibres with new ends and evenly spaced points.

    What is kept of a fibre is a smooth curve: on chords the points of a bend would come nearer to its middle.
    """
    counts, n = np.diff(offsets), FINER * int(np.diff(offsets).max())
    points, offsets = polylines.evenly_spread(points, offsets, n).reshape(-1, 3), n * np.arange(len(offsets))
    along = polylines.segment_lengths(points, offsets)[1]
    along = along - np.repeat(along[offsets[:-1]], n)
    low, high = starts[0], along[offsets[1:] - 1] - ends[0]
    kept = (along > np.repeat(low, n)) & (along < np.repeat(high, n))
    bounds = np.append(0, np.cumsum(np.add.reduceat(kept.astype(np.int64), offsets[:-1]) + 4))
    outer = np.column_stack([bounds[:-1], bounds[:-1] + 1, bounds[1:] - 2, bounds[1:] - 1])
    cut = polylines.points_at_arcs(points, offsets, np.column_stack([low, high]))
    whole = np.empty((bounds[-1], 3))
    whole[outer] = np.stack([starts[1], cut[:, 0], cut[:, 1], ends[1]], axis=1)
    whole[np.setdiff1d(np.arange(len(whole)), outer)] = points[kept]
    result = np.empty((counts.sum(), 3))
    for count in np.unique(counts):
        of_count = counts == count
        even = polylines.evenly_spaced(whole, bounds, count)[of_count]
        result[np.repeat(of_count, counts)] = even.reshape(-1, 3)
    return result


def _new_ends(
    points: Floats, offsets: Ints, direction: Floats, area: EndArea, limits: _Limits, *, keep: bool
) -> _Ends:
    """Return cut lengths and new ends at the last points."""
    into_muscle, tolerance, largest_cut = limits
    lengths = polylines.polyline_lengths(points, offsets)
    ends = points[offsets[1:] - 1]
    kept = np.zeros(len(ends), dtype=np.bool_)
    if keep:
        kept = _ends_on_area(ends, area, tolerance) & (_sharpest_turns(points, offsets) <= LARGEST_TURN)
        kept &= kept.mean() > 0.5
    extremal = (area.landmarks @ direction).min()
    cuts = np.minimum(beyond_plane(points, offsets, points @ direction - extremal), largest_cut * lengths)
    tried = np.minimum(np.outer(CUTS, cuts), largest_cut * lengths)
    # Directions over the length of a mean segment: the rest of a cut segment may be very short.
    step = lengths / np.maximum(np.diff(offsets) - 1, 1)
    arcs = np.array([lengths - tried, np.maximum(lengths - tried - step, 0.0)])
    departures, before = (polylines.points_at_arcs(points, offsets, at.T).transpose(1, 0, 2) for at in arcs)
    levels, new_ends = np.zeros(len(cuts), dtype=np.int64), ends.copy()
    n_batches = -(-len(cuts) // AT_ONCE)
    for batch in range(n_batches):
        # A batch takes every n-th fibre, so each batch covers the whole area.
        members = np.arange(batch, len(cuts), n_batches)
        fibres = members[~kept[members]]
        if not len(fibres):
            continue
        # Part of the area lies behind the departures if the limit shortened the cut.
        height = float((departures[0, fibres] @ direction).min())
        candidates = area.samples.above(CANDIDATES * len(members), direction, height, seed=batch)
        free = area.samples.onto(even_positions([candidates], len(members))[0])
        if kept[members].any():
            taken = np.unique(cKDTree(free).query(ends[members[kept[members]]])[1])
            free = np.delete(free, taken[: len(free) - len(fibres)], axis=0)
        new_ends[fibres] = free[assign_positions(departures[0, fibres], free)]
        rays = (departures - before)[:, fibres]
        levels[fibres] = _best_cut(departures[:, fibres], rays, new_ends[fibres], into_muscle, tolerance)
    return np.where(kept, 0.0, tried[levels, np.arange(len(cuts))]), new_ends


def _best_cut(departures: Floats, rays: Floats, ends: Floats, into: FloatMap, tolerance: float) -> Ints:
    """Return the index into CUTS of each fibre's best cut.

    The first cut with a segment in the muscle and an easy turn; else the allowed cut with the least turn;
    else the cut that leaves or turns least, relative to the limits.
    """
    open_ = np.arange(len(ends))
    levels, least = np.zeros(len(ends), dtype=np.int64), np.full(len(ends), np.inf)
    for level in range(len(CUTS)):
        starts, segments = departures[level, open_], ends[open_] - departures[level, open_]
        turns = angles_between(rays[level, open_], segments)
        # A segment whose turn alone is worse than the best cut needs no check against the surface.
        worth = np.where(turns <= LARGEST_TURN, turns / 180.0, turns / LARGEST_TURN) < least[open_]
        if not worth.any():
            continue
        departure = np.full(len(open_), np.inf)
        checked = starts[worth, None] + CHECKS[:, None] * segments[worth, None]
        moved = into(checked.reshape(-1, 3)).reshape(checked.shape)
        departure[worth] = np.linalg.norm(moved - checked, axis=2).max(axis=1) / tolerance
        badness = np.maximum(departure, turns / LARGEST_TURN)
        badness[badness <= 1.0] = turns[badness <= 1.0] / 180.0
        better = badness < least[open_]
        levels[open_[better]] = level
        least[open_[better]] = badness[better]
        open_ = open_[(departure > 1.0) | (turns > LARGEST_TURN / 2.0)]
    return levels


def _ends_on_area(ends: Floats, area: EndArea, tolerance: float) -> Bools:
    """Return which fibres (k,) already end on the area. All are False unless most fibres end there, spread.

    Templates with fibres from area to area, such as pennate, need no new ends. In the pinched tip of a muscle
    the few fibres that end on the area are not kept.
    """
    on_area = area.samples.distances(ends) <= tolerance
    if area.discs is not None:
        on_area |= area.discs.distances(ends) <= tolerance
    if len(ends) > 1:
        spacing = np.sqrt(area.samples.area / len(ends))
        on_area &= cKDTree(ends).query(ends, 2)[0][:, 1] >= LEAST_SPREAD * spacing
    return np.asarray(on_area & bool(on_area.mean() > 0.5))


def _sharpest_turns(points: Floats, offsets: Ints) -> Floats:
    """Return each fibre's sharpest turn in its last third (k,) [degrees]."""
    i = polylines.inner_points(offsets)
    ends = offsets[np.searchsorted(offsets, i, side="right")]
    counts = ends - offsets[np.searchsorted(offsets, i, side="right") - 1]
    i = i[i >= ends - 1 - counts // 3]
    turns = np.zeros(len(points))
    turns[i] = angles_between(points[i] - points[i - 1], points[i + 1] - points[i])
    return np.maximum.reduceat(turns, offsets[:-1])


def assign_positions(departures: Floats, positions: Floats) -> Ints:
    """Return a different position (k,) for each fibre. The sum of segment lengths is least.

    Segments run from departures (k, 3) to positions (j, 3), j >= k. The paper takes the position on the area
    closest to the ray, for each fibre alone. Beside the rays this is the same point of the rim for many
    fibres. Segments of least sum do not cross, as exchanging their ends would shorten them, and neighbours
    stay neighbours. Fibre directions do not count: at an oblique, pinched end all directions point to the
    same side, and fibres that followed them changed sides of the muscle.
    """
    costs = cdist(departures, positions)
    # A cost common to all positions of a fibre, or all fibres of a position, decides nothing and takes time.
    costs -= costs.min(axis=1, keepdims=True)
    if len(departures) == len(positions):
        costs -= costs.min(axis=0)
    return np.asarray(linear_sum_assignment(costs)[1].astype(np.int64))


def beyond_plane(points: Floats, offsets: Ints, heights: Floats) -> Floats:
    """Return arc lengths (k,) beyond a plane. They begin at the last crossing of each polyline.

    `heights` (n,) are signed distances of the points, positive beyond the plane [mm]. The length is 0 for a
    line that ends on the near side, and the whole length for a line without a point there.
    """
    lengths, index = polylines.segment_lengths(points, offsets)[0], np.arange(len(points))
    preceding = heights[index - 1]
    through = (heights > 0.0) & (preceding < 0.0)
    lengths[through] *= heights[through] / (heights - preceding)[through]
    last = np.maximum.reduceat(np.where(heights > 0.0, -1, index), offsets[:-1])  # on this side
    lengths[index <= np.repeat(last, np.diff(offsets))] = 0.0
    return np.add.reduceat(lengths, offsets[:-1])


def ends_as_printed(
    points: Floats, offsets: Ints, *, axis: Floats, origin: EndArea, insertion: EndArea
) -> tuple[Floats, Ints]:
    """Return fibres with ends as printed. Points (j, 3) and offsets (k + 1,).

    Each fibre is cut at the plane through the extremal landmark, and gets a last segment to the point of the
    area closest to the ray of its last segment. In contrast to :func:`trim_fibres` many fibres may end in a
    point of the area's rim, a fibre entirely beyond the plane keeps its end, and points are not respaced. The
    axis is the unit vector (3,) from origin to insertion; each fibre has at least two points.
    """
    lines = [points[first:last] for first, last in pairwise(offsets)]
    for area, direction in ((insertion, axis), (origin, -axis)):
        height = float((area.landmarks @ direction).min())
        lines = [_extended(line, direction, height, area.samples.tree)[::-1] for line in lines]
    return np.vstack(lines), np.append(0, np.cumsum([len(line) for line in lines]))


def _extended(line: Floats, direction: Floats, height: float, area: TriangleTree) -> Floats:
    """Return a line cut at a plane near its end, with a segment to an area."""
    beyond = line @ direction - height
    if beyond[0] >= 0.0:
        return line
    past, kept = np.flatnonzero(beyond > 0.0), line
    if len(past):
        at = int(past[0])
        share = beyond[at - 1] / (beyond[at - 1] - beyond[at])
        crossing = line[at - 1] + share * (line[at] - line[at - 1])
        kept = np.vstack([line[:at], crossing]) if share > 0.0 else line[:at]
    steps = np.diff(kept, axis=0)
    steps = steps[steps.any(axis=1)]
    ahead = steps[-1] if len(steps) else line[1] - line[0]
    if ahead.any():
        kept = np.vstack([kept, closest_to_ray(kept[-1], ahead / np.linalg.norm(ahead), area)])
    return kept


def closest_to_ray(start: Floats, ahead: Floats, tree: TriangleTree) -> Floats:
    """Return the point (3,) of a tree's triangles closest to a ray.

    The ray has a start (3,) and a unit direction (3,). Of equal points the first along the ray.
    """
    low, high = np.hsplit(tree.boxes[1 - len(tree.leaves) :], 2)
    balls = np.column_stack([0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)])  # round leaves
    closest: Floats = tree.nearest(start[None])[1][0]
    _approach(start, ahead, tree.points, tree.triangles, tree.order, tree.leaves, balls, closest)
    return closest


@kernel
def _approach(
    start: Floats, ahead: Floats, points: Floats, triangles: Ints, order: Ints, leaves: Ints, balls: Floats,
    closest: Floats,
) -> None:  # fmt: skip
    """Move the point nearest to a ray's start to the point of triangles closest to the ray."""
    x, y, z, u, v, w = start[0], start[1], start[2], ahead[0], ahead[1], ahead[2]
    first, least = 0.0, math.sqrt((closest[0] - x) ** 2 + (closest[1] - y) ** 2 + (closest[2] - z) ** 2)
    for leaf in range(len(balls)):
        dx, dy, dz = balls[leaf, 0] - x, balls[leaf, 1] - y, balls[leaf, 2] - z
        t = max(dx * u + dy * v + dz * w, 0.0)
        if math.sqrt((dx - t * u) ** 2 + (dy - t * v) ** 2 + (dz - t * w) ** 2) > least + balls[leaf, 3]:
            continue
        for number in range(leaves[leaf], leaves[leaf + 1]):
            triangle = triangles[order[number]]
            low, high, across, above = 0.0, 0.0, 0.0, 0.0
            opposite = points[triangle[2]]
            for side in range(3):
                a, b = points[triangle[side]], points[triangle[side - 2]]
                dx, dy, dz = x - a[0], y - a[1], z - a[2]
                ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                nx, ny, nz = dy * ez - dz * ey, dz * ex - dx * ez, dx * ey - dy * ex
                turn = nx * u + ny * v + nz * w
                low, high, across = min(low, turn), max(high, turn), across + turn
                if side == 0:
                    above = nx * (opposite[0] - x) + ny * (opposite[1] - y) + nz * (opposite[2] - z)
                ee, eu = ex * ex + ey * ey + ez * ez, ex * u + ey * v + ez * w
                ed, du = ex * dx + ey * dy + ez * dz, dx * u + dy * v + dz * w
                apart = ee - eu * eu  # Ericson 2005, section 5.1.9
                s = min(max((ed - eu * du) / apart, 0.0), 1.0) if apart > 1e-14 * ee else 0.0
                t = s * eu - du
                if t < 0.0:
                    s, t = min(max(ed / ee, 0.0), 1.0) if ee > 0.0 else 0.0, 0.0
                dx, dy, dz = a[0] + s * ex, a[1] + s * ey, a[2] + s * ez
                away = math.sqrt((x + t * u - dx) ** 2 + (y + t * v - dy) ** 2 + (z + t * w - dz) ** 2)
                if away < least or (away == least and t < first):
                    least, first, closest[0], closest[1], closest[2] = away, t, dx, dy, dz
            t = above / across
            if low * high == 0.0 and 0.0 <= t < (first if least == 0.0 else math.inf):  # through the triangle
                least, first, closest[0], closest[1], closest[2] = 0.0, t, x + t * u, y + t * v, z + t * w
