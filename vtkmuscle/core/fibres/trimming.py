"""Fibre ends: cut away what lies beside an attachment area, and end the fibre on the area instead.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
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
from vtkmuscle.core.types import Floats, Ints

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
    """Where the fibres end at one side of the muscle.

    Attributes
    ----------
    landmarks : (k, 3) array
        Of all areas of this side [mm]; the extremal one places the cutting plane.
    points : (n, 3) array
        Points of the muscle [mm].
    triangles : (m, 3) int array
        Triangles of the muscle.
    patch : (j,) int array
        Ids of the points that are attached.
    distance : callable or None
        From positions (i, 3) to how far they are from what the landmarks span (i,) [mm]; a fibre that ends
        there ends on the area. None: only ends on the patch do.
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
    """Return fibres that run from the origin area to the insertion area, with as many points as before.

    At each side a plane perpendicular to the axis through the landmark that reaches furthest into the
    muscle cuts the fibre's end off, and a straight segment to a place on the area replaces it (see
    :func:`assign_places`). Where that segment would leave the muscle or turn by more than 60 degrees, less of
    the fibre is cut: the whole cut is tried first, then three quarters of it, and so on; where nothing will
    do, the least evil is taken. If most fibres end on an area anyway, spread over it, those that do are left
    as they are there. The points are then spaced evenly along each fibre, and those that are
    outside of the muscle moved to the nearest point of its surface.

    Parameters
    ----------
    points : (n, 3) array
        Fibre points [mm], from the origin to the insertion.
    offsets : (k + 1,) int array
        First point of each fibre, and n. A fibre has at least two points.
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

    Returns
    -------
    (n, 3) array
        Fibre points [mm].
    """
    backwards = points[_reversed_order(offsets)]
    starts = _new_ends(backwards, offsets, -axis, areas[0], into_muscle, tolerance, largest_cut)
    ends = _new_ends(points, offsets, axis, areas[1], into_muscle, tolerance, largest_cut)
    result = _replaced_ends(points, offsets, starts.cuts, starts.places, ends.cuts, ends.places)
    inner = inner_points(offsets)
    result[inner] = into_muscle(result[inner])
    return result


@dataclass(frozen=True, eq=False)
class _Ends:
    cuts: Floats  # (k,) length cut off each fibre [mm]
    places: Floats  # (k, 3) its new end [mm]


def _replaced_ends(
    points: Floats, offsets: Ints, cut_first: Floats, firsts: Floats, cut_last: Floats, lasts: Floats
) -> Floats:
    """Return fibres with lengths cut off both ends and other ends put there, their points spaced evenly."""
    counts, along = np.diff(offsets), segment_lengths(points, offsets)[1]
    along = along - np.repeat(along[offsets[:-1]], counts)
    low, high = cut_first, along[offsets[1:] - 1] - cut_last
    kept = (along > np.repeat(low, counts)) & (along < np.repeat(high, counts))
    bounds = np.append(0, np.cumsum(np.add.reduceat(kept.astype(np.int64), offsets[:-1]) + 4))
    ends = np.column_stack([bounds[:-1], bounds[:-1] + 1, bounds[1:] - 2, bounds[1:] - 1])
    cut, whole = places_along(points, offsets, np.column_stack([low, high])), np.empty((bounds[-1], 3))
    whole[ends] = np.stack([firsts, cut[:, 0], cut[:, 1], lasts], axis=1)
    whole[np.setdiff1d(np.arange(len(whole)), ends)] = points[kept]
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
    """Return how much to cut off the last points of fibres, and where they end instead."""
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
        # Behind the departures there is something only where the area reaches so far along the muscle that
        # the cut was limited.
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
    return _Ends(cuts, places)


def _best_cut(
    departures: Floats,
    rays: Floats,
    places: Floats,
    into_muscle: Callable[[Floats], Floats],
    tolerance: float,
) -> Ints:
    """Return which cut suits each fibre, a number into CUTS.

    The first one whose segment stays in the muscle and turns easily; else that of the least turn among
    those that are allowed; else the one that leaves or turns least, relative to what is allowed.
    """
    open_ = np.arange(len(places))
    levels, least = np.zeros(len(places), dtype=np.int64), np.full(len(places), np.inf)
    for level in range(len(CUTS)):
        starts, segments = departures[level, open_], places[open_] - departures[level, open_]
        turns = np.degrees(np.arccos(np.clip(_cosines(rays[level, open_], segments), -1.0, 1.0)))
        # What it is if the segment stays in the muscle: where that is too much, it need not be looked at.
        worth = np.where(turns <= LARGEST_TURN, turns / 180.0, turns / LARGEST_TURN) < least[open_]
        if not worth.any():
            continue
        leaves = np.full(len(open_), np.inf)
        checked = starts[worth, None] + CHECKS[:, None] * segments[worth, None]
        ways_back = into_muscle(checked.reshape(-1, 3)).reshape(checked.shape) - checked
        leaves[worth] = np.linalg.norm(ways_back, axis=2).max(axis=1) / tolerance
        evil = np.maximum(leaves, turns / LARGEST_TURN)
        evil[evil <= 1.0] = turns[evil <= 1.0] / 180.0
        better = evil < least[open_]
        levels[open_[better]] = level
        least[open_[better]] = evil[better]
        open_ = open_[(leaves > 1.0) | (turns > EASY_TURN)]
        if not len(open_):
            break
    return levels


def _ends_on_area(ends: Floats, area: EndArea, tolerance: float) -> NDArray[np.bool_]:
    """Return which fibres end on the area as they are; none, unless most of them do so without meeting.

    Templates whose fibres run from area to area, as the pennate one, need no new ends. But where fibres
    are pinched together in the tip of a muscle, that a few end on the area is no reason to keep those.
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
    """Return the points (c, k, 3) of fibres at arc lengths (c, k), and the directions that they run in.

    The direction is that of one mean segment back, for what is left of the segment that is cut may be
    arbitrarily short.
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
    """Return which place each fibre ends at, no two fibres at the same: the new segments are short in all.

    The paper takes the place on the area that is closest to the ray, for each fibre by itself. Where the area
    is beside the rays rather than in front of them, that is the same place on its rim for many fibres, and
    they meet in a point. So each fibre is given a place of its own, such that the sum of the lengths of the
    new segments is least: two that cross would be shorter exchanged, so they do not cross, and neighbours
    stay neighbours. Where the area runs beside the fibres, the fibre next to it ends on its nearest part. The
    way that a fibre goes there does not count: where a section is pinched at an oblique end, all ways go to
    the same side, and fibres that kept to them changed places from one edge of the muscle to the other.

    Parameters
    ----------
    departures : (k, 3) array
        Where the new segments begin [mm].
    places : (j, 3) array
        Positions on the area, j >= k [mm].

    Returns
    -------
    (k,) int array
        Numbers of places, all different.
    """
    costs = cdist(departures, places)
    # What all places cost a fibre, or a place all fibres, decides nothing, and takes longer.
    costs -= costs.min(axis=1, keepdims=True)
    if len(departures) == len(places):
        costs -= costs.min(axis=0)
    taken: Ints = linear_sum_assignment(costs)[1].astype(np.int64)
    return taken


def beyond_plane(points: Floats, offsets: Ints, heights: Floats) -> Floats:
    """Return how much of each polyline's end is beyond a plane: from where it last comes through it.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Positions [mm]; first point of each line, and n.
    heights : (n,) array
        Signed distances from the plane, positive beyond it [mm].

    Returns
    -------
    (k,) array
        Arc lengths, 0 where a line ends on this side, its whole length where none of it is on this side.
    """
    lengths, number = segment_lengths(points, offsets)[0], np.arange(len(points))
    before = heights[number - 1]
    through = (heights > 0.0) & (before < 0.0)
    lengths[through] *= heights[through] / (heights - before)[through]
    last = np.maximum.reduceat(np.where(heights > 0.0, -1, number), offsets[:-1])  # on this side
    lengths[number <= np.repeat(last, np.diff(offsets))] = 0.0
    return np.add.reduceat(lengths, offsets[:-1])


def _reversed_order(offsets: Ints) -> Ints:
    """Return the ids of all points, those of each line backwards."""
    sums = np.repeat(offsets[:-1] + offsets[1:] - 1, np.diff(offsets))
    return sums - np.arange(offsets[-1])
