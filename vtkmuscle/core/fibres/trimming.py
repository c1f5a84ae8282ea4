"""Fibre ends on the attachment areas: as printed in the paper, and evenly spread over the area.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.mesh.polylines import (
    evenly_spaced,
    inner_points,
    places_along,
    polyline_lengths,
    segment_lengths,
)
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.surface import faces_between
from vtkmuscle.core.types import Bools, Floats, Ints

#: Largest turn from a fibre into its new end segment [degrees].
LARGEST_TURN = 60.0
#: A turn that needs no other cut [degrees].
EASY_TURN = 30.0
#: Multiples of the cut at the plane that are tried, the nearer to 1 the earlier.
CUTS = (1.0, 0.8, 1.2, 0.6, 1.4, 0.4, 1.7, 0.2, 2.0, 0.0)
#: Where along a new segment it is checked against the surface.
CHECKS = (np.arange(16) + 0.5) / 16.0
#: Ends nearer to each other than this share of an even spacing meet rather than spread over the area.
LEAST_SPREAD = 0.1
#: Fibres that share out an area together; the assignment costs the cube of their number.
BATCH = 256


@dataclass(frozen=True, eq=False)
class EndArea:
    """Attachment of one side of the muscle, on which fibres end.

    Of the landmarks (k, 3) of all its areas the extremal one places the cutting plane. The muscle is points
    (n, 3) and triangles (m, 3) [mm]; the attached points have the ids `patch` (j,). `distance` gives the
    distances (i,) of positions (i, 3) from the surface that the landmarks span [mm]: fibres that end there
    end on the area, as those that end on the patch.
    """

    landmarks: Floats
    points: Floats
    triangles: Ints
    patch: Ints
    distance: Callable[[Floats], Floats] | None = None

    @cached_property
    def samples(self) -> PatchSamples:
        """Positions on the area."""
        return PatchSamples(self.points, self.triangles, self.patch)


def trim_fibres(
    points: Floats,
    offsets: Ints,
    *,
    axis: Floats,
    areas: tuple[EndArea, EndArea],
    into_muscle: Callable[[Floats], Floats],
    tolerance: float,
    largest_cut: float,
) -> Floats:
    """Return fibres (n, 3) from the origin area to the insertion area, with as many points as before.

    At each side a plane perpendicular to the axis through the landmark that reaches furthest into the muscle
    cuts the fibre's end off, and a straight segment to a place on the area replaces it (see
    :func:`assign_places`). Where that segment would leave the muscle or turn too far, other cuts are tried,
    as multiples of this one (:data:`CUTS`); where none is allowed, the one that breaks the limits least is
    taken. If most fibres end on an area anyway, spread over it, they are left as they are there. The points
    are then spaced evenly along each fibre, and those outside of the muscle moved to the nearest point of its
    surface.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Fibres from the origin to the insertion [mm]; first point of each, two or more points apart, and n.
    axis : (3,) array
        Unit vector from the origin to the insertion.
    areas : EndArea, EndArea
        Of the origin, and of the insertion.
    into_muscle : callable
        From points (j, 3) to the nearest points (j, 3) of the muscle, themselves where they are in it [mm].
    tolerance : float
        How far a new segment may leave the muscle [mm].
    largest_cut : float
        Largest part of a fibre's length to cut off at either end, at most 0.5.
    """
    backwards = points[np.repeat(offsets[:-1] + offsets[1:] - 1, np.diff(offsets)) - np.arange(offsets[-1])]
    sides = ((backwards, -axis, areas[0]), (points, axis, areas[1]))
    starts, ends = (
        _new_ends(p, offsets, way, area, into_muscle, tolerance, largest_cut) for p, way, area in sides
    )
    result = _replaced_ends(points, offsets, starts, ends)
    inner = inner_points(offsets)
    result[inner] = into_muscle(result[inner])
    return result


#: Lengths cut off one end of fibres (k,), and their new ends (k, 3) [mm].
_Ends = tuple[Floats, Floats]


def _replaced_ends(points: Floats, offsets: Ints, starts: _Ends, ends: _Ends) -> Floats:
    """Return fibres with new starts and ends, their points spaced evenly."""
    counts, along = np.diff(offsets), segment_lengths(points, offsets)[1]
    along = along - np.repeat(along[offsets[:-1]], counts)
    low, high = starts[0], along[offsets[1:] - 1] - ends[0]
    kept = (along > np.repeat(low, counts)) & (along < np.repeat(high, counts))
    bounds = np.append(0, np.cumsum(np.add.reduceat(kept.astype(np.int64), offsets[:-1]) + 4))
    outer = np.column_stack([bounds[:-1], bounds[:-1] + 1, bounds[1:] - 2, bounds[1:] - 1])
    cut, whole = places_along(points, offsets, np.column_stack([low, high])), np.empty((bounds[-1], 3))
    whole[outer] = np.stack([starts[1], cut[:, 0], cut[:, 1], ends[1]], axis=1)
    whole[np.setdiff1d(np.arange(len(whole)), outer)] = points[kept]
    result = np.empty_like(points)
    for count in np.unique(counts):
        alike = counts == count
        result[np.repeat(alike, counts)] = evenly_spaced(whole, bounds, count)[alike].reshape(-1, 3)
    return result


def _new_ends(
    points: Floats,
    offsets: Ints,
    direction: Floats,
    area: EndArea,
    into_muscle: Callable[[Floats], Floats],
    tolerance: float,
    largest_cut: float,
) -> _Ends:
    """Return the lengths to cut off the last points of fibres, and their new ends."""
    lengths = polyline_lengths(points, offsets)
    ends = points[offsets[1:] - 1]
    there = _ends_on_area(ends, area, tolerance) & (_sharpest_turns(points, offsets) <= LARGEST_TURN)
    there &= there.mean() > 0.5
    extremal = (area.landmarks @ direction).min()
    cuts = np.minimum(beyond_plane(points, offsets, points @ direction - extremal), largest_cut * lengths)
    tried = np.minimum(np.outer(CUTS, cuts), largest_cut * lengths)
    departures, rays = _departures(points, offsets, lengths - tried)
    levels, places = np.zeros(len(cuts), dtype=np.int64), ends.copy()
    n_batches = -(-len(cuts) // BATCH)
    for batch in range(n_batches):
        # Fibres of a batch are spread over all fibres, so that each batch covers the whole area.
        mine = np.arange(batch, len(cuts), n_batches)
        fibres = mine[~there[mine]]
        if not len(fibres):
            continue
        # Part of the area lies behind the departures only where it reaches so far along the muscle that the
        # cut was limited.
        height = float((departures[0, fibres] @ direction).min())
        free = area.samples.even(len(mine), direction=direction, above=height, seed=batch)
        if there[mine].any():
            taken = np.unique(cKDTree(free).query(ends[mine[there[mine]]])[1])
            free = np.delete(free, taken[: len(free) - len(fibres)], axis=0)
        places[fibres] = free[assign_places(departures[0, fibres], free)]
        levels[fibres] = _best_cut(
            departures[:, fibres], rays[:, fibres], places[fibres], into_muscle, tolerance
        )
    cuts = np.where(there, 0.0, tried[levels, np.arange(len(cuts))])
    return cuts, places


def _best_cut(
    departures: Floats,
    rays: Floats,
    places: Floats,
    into_muscle: Callable[[Floats], Floats],
    tolerance: float,
) -> Ints:
    """Return the best cut for each fibre, a number into CUTS.

    It is the first whose segment stays in the muscle and turns easily; else that of the least turn among
    those that are allowed; else the one that leaves or turns least, relative to the limits.
    """
    open_ = np.arange(len(places))
    levels, least = np.zeros(len(places), dtype=np.int64), np.full(len(places), np.inf)
    for level in range(len(CUTS)):
        starts, segments = departures[level, open_], places[open_] - departures[level, open_]
        turns = np.degrees(np.arccos(np.clip(_cosines(rays[level, open_], segments), -1.0, 1.0)))
        # The badness of a segment that stays in the muscle: if that is too much already, no need to check.
        worth = np.where(turns <= LARGEST_TURN, turns / 180.0, turns / LARGEST_TURN) < least[open_]
        if not worth.any():
            continue
        leaves = np.full(len(open_), np.inf)
        checked = starts[worth, None] + CHECKS[:, None] * segments[worth, None]
        ways_back = into_muscle(checked.reshape(-1, 3)).reshape(checked.shape) - checked
        leaves[worth] = np.linalg.norm(ways_back, axis=2).max(axis=1) / tolerance
        badness = np.maximum(leaves, turns / LARGEST_TURN)
        badness[badness <= 1.0] = turns[badness <= 1.0] / 180.0
        better = badness < least[open_]
        levels[open_[better]] = level
        least[open_[better]] = badness[better]
        open_ = open_[(leaves > 1.0) | (turns > EASY_TURN)]
        if not len(open_):
            break
    return levels


def _ends_on_area(ends: Floats, area: EndArea, tolerance: float) -> Bools:
    """Return which fibres (k,) end on the area as they are; none, unless most of them do so without meeting.

    Templates whose fibres run from area to area, as the pennate one, need no new ends. But where fibres are
    pinched together in the tip of a muscle, the few that end on the area are not kept.
    """
    size, tree = area.samples.area, area.samples.tree(64 * len(ends))
    near = tolerance + np.sqrt(size / tree.n)
    # Without a bound a far end would be compared with thousands of positions that are about as far.
    on_area = tree.query(ends, distance_upper_bound=near * (1.0 + 1e-9))[0] <= near
    if area.distance is not None:
        on_area |= area.distance(ends) <= tolerance
    apart = np.full(len(ends), True)
    if len(ends) > 1:
        apart = cKDTree(ends).query(ends, 2)[0][:, 1] >= LEAST_SPREAD * np.sqrt(size / len(ends))
    there = on_area & apart
    return there if there.mean() > 0.5 else np.zeros(len(ends), dtype=np.bool_)


def _sharpest_turns(points: Floats, offsets: Ints) -> Floats:
    """Return the sharpest turn in the last third of each fibre (k,) [degrees]: one that hooks is not kept."""
    i = inner_points(offsets)
    ends = offsets[np.searchsorted(offsets, i, side="right")]
    counts = ends - offsets[np.searchsorted(offsets, i, side="right") - 1]
    i = i[i >= ends - 1 - counts // 3]
    before, after = points[i] - points[i - 1], points[i + 1] - points[i]
    sines = np.linalg.norm(np.cross(before, after), axis=1)
    turns = np.zeros(len(points))
    turns[i] = np.degrees(np.arctan2(sines, (before * after).sum(axis=1)))
    return np.maximum.reduceat(turns, offsets[:-1])


def _departures(points: Floats, offsets: Ints, arcs: Floats) -> tuple[Floats, Floats]:
    """Return the points (c, k, 3) of fibres at arc lengths (c, k), and the fibres' directions there.

    These are taken over the length of a mean segment: the rest of a segment that is cut may be very short.
    """
    step = polyline_lengths(points, offsets) / np.maximum(np.diff(offsets) - 1, 1)
    places, before = (
        places_along(points, offsets, at.T).transpose(1, 0, 2) for at in (arcs, np.maximum(arcs - step, 0.0))
    )
    return places, places - before


def _cosines(a: Floats, b: Floats) -> Floats:
    """Return the cosines (k,) of the angles between vectors (k, 3); 1 for a vector of no length."""
    scale = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    cosines: Floats = np.divide((a * b).sum(axis=1), scale, out=np.ones(len(a)), where=scale > 0)
    return cosines


def assign_places(departures: Floats, places: Floats) -> Ints:
    """Return the number of each fibre's place (k,), all different: the sum of the new segments is least.

    They run from departures (k, 3) to places (j, 3), j >= k. The paper takes the place on the area that is
    closest to the ray, for each fibre by itself. Where the area is beside the rays rather than in front of
    them, that is the same place on its rim for many fibres, and they meet in a point. Segments of the least
    sum do not cross, for two that cross would be shorter exchanged; so neighbours stay neighbours. The
    directions of the fibres do not count: where a section is pinched at an oblique end, they all point to the
    same side, and fibres that kept to them changed places from one edge of the muscle to the other.
    """
    costs = cdist(departures, places)
    # A cost common to all places of a fibre, or to all fibres of a place, decides nothing and takes time.
    costs -= costs.min(axis=1, keepdims=True)
    if len(departures) == len(places):
        costs -= costs.min(axis=0)
    taken: Ints = linear_sum_assignment(costs)[1].astype(np.int64)
    return taken


def beyond_plane(points: Floats, offsets: Ints, heights: Floats) -> Floats:
    """Return the arc length (k,) of each polyline beyond a plane, from where it last comes through it.

    `heights` (n,) are the points' signed distances from the plane, positive beyond it [mm]. The length is 0
    where a line ends on this side, and that of the whole line where none of it is on this side.
    """
    lengths, number = segment_lengths(points, offsets)[0], np.arange(len(points))
    before = heights[number - 1]
    through = (heights > 0.0) & (before < 0.0)
    lengths[through] *= heights[through] / (heights - before)[through]
    last = np.maximum.reduceat(np.where(heights > 0.0, -1, number), offsets[:-1])  # on this side
    lengths[number <= np.repeat(last, np.diff(offsets))] = 0.0
    return np.add.reduceat(lengths, offsets[:-1])


def ends_as_printed(
    points: Floats, offsets: Ints, *, axis: Floats, origin: EndArea, insertion: EndArea
) -> tuple[Floats, Ints]:
    """Return fibres as printed: points (j, 3) and offsets (k + 1,), cut at both planes and led to the areas.

    Each fibre is cut at the plane through the extremal landmark and gets one more segment, to the point of
    the area that is closest to the ray of its last one. Unlike those of :func:`trim_fibres`, fibres do not
    share the area out, so that many may end in one point of its rim; a fibre of which the plane leaves
    nothing keeps its end; and points are not spaced anew, so that fibres have different numbers of them. The
    axis is the unit vector (3,) from the origin to the insertion; each fibre has at least two points.
    """
    lines = []
    sides = [(_area_triangles(insertion), axis, insertion), (_area_triangles(origin), -axis, origin)]
    for first, last in pairwise(offsets):
        line = points[first:last]
        for corners, direction, area in sides:
            line = _extended(line, direction, float((area.landmarks @ direction).min()), corners)[::-1]
        lines.append(line)
    return np.vstack(lines), np.append(0, np.cumsum([len(line) for line in lines]))


def _area_triangles(area: EndArea) -> Floats:
    """Return the corners (m, 3, 3) of an area's triangles; its points as such where it has none."""
    triangles = faces_between(area.triangles, area.patch)
    if not len(triangles):
        triangles = np.repeat(area.patch[:, None], 3, axis=1)
    return np.ascontiguousarray(area.points[triangles])


def _extended(line: Floats, direction: Floats, height: float, corners: Floats) -> Floats:
    """Return a line (n, 3), cut at a plane near its end, with a segment from there to an area."""
    beyond = line @ direction - height
    if beyond[0] >= 0.0:
        return line
    first = int(np.argmax(beyond > 0.0)) if (beyond > 0.0).any() else len(line)
    kept = line[:first]
    if first < len(line):
        t = beyond[first - 1] / (beyond[first - 1] - beyond[first])
        if t > 0.0:
            kept = np.vstack([kept, line[first - 1] + t * (line[first] - line[first - 1])])
    back = 1
    while back < len(line) - 1 and len(kept) > 1 and np.array_equal(kept[-1], kept[-1 - back]):
        back += 1
    ahead = kept[-1] - kept[-1 - back] if len(kept) > back else line[1] - line[0]
    length = float(np.linalg.norm(ahead))
    if length == 0.0:
        return kept
    return np.vstack([kept, closest_to_ray(kept[-1], ahead / length, corners)])


def closest_to_ray(start: Floats, ahead: Floats, corners: Floats) -> Floats:
    """Return the point (3,) of triangles, by their corners (m, 3, 3), closest to a ray; the first of several.

    The ray begins at `start` (3,) in the unit direction `ahead` (3,).
    """
    a = corners[:, 0]
    e, f = corners[:, 1] - a, corners[:, 2] - a
    normals = np.cross(e, f)
    sizes, off = (normals * normals).sum(axis=1), (normals * (a - start)).sum(axis=1)
    places, ways, distances = [], [], []
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles without area, or along the ray
        through = off / (normals @ ahead)
        # Through a triangle, or from the ray's start straight to it.
        for at, way, distance in (
            (start + through[:, None] * ahead, through, np.zeros(len(a))),
            (start + (off / sizes)[:, None] * normals, np.zeros(len(a)), np.sqrt(off * off / sizes)),
        ):
            u = (normals * np.cross(at - a, f)).sum(axis=1) / sizes
            v = (normals * np.cross(e, at - a)).sum(axis=1) / sizes
            met = (way >= 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
            places.append(at[met])
            ways.append(way[met])
            distances.append(distance[met])
    p, edges = corners.reshape(-1, 3), (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
    s, t = _nearest_to_ray(start - p, ahead, edges)
    places.append(p + s[:, None] * edges)
    ways.append(t)
    distances.append(np.linalg.norm(start + t[:, None] * ahead - places[-1], axis=1))
    best = np.lexsort((np.concatenate(ways), np.concatenate(distances)))[0]
    closest: Floats = np.vstack(places)[best]
    return closest


def _nearest_to_ray(to_start: Floats, ahead: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """Return the places on edges (k, 3) (0 to 1) and along a ray (0 and more) at which the two are closest.

    Ericson 2005, *Real-time collision detection*, section 5.1.9.
    """
    ee, ea = (edges * edges).sum(axis=1), edges @ ahead
    es, as_ = (edges * to_start).sum(axis=1), to_start @ ahead
    apart = ee - ea * ea
    s = np.divide(es - ea * as_, apart, out=np.zeros(len(ee)), where=apart > 1e-14 * ee).clip(0.0, 1.0)
    t = s * ea - as_
    behind = np.divide(es, ee, out=np.zeros(len(ee)), where=ee > 0.0).clip(0.0, 1.0)
    return np.where(t < 0.0, behind, s), np.maximum(t, 0.0)
