"""Slice by slice from the fitted template into the muscle.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.correspondence import boundary_centroid, starting_points
from vtkmuscle.core.loop_chains import loop_areas, main_loops
from vtkmuscle.core.mesh import signed_volume
from vtkmuscle.core.section_maps import count_outside, map_section
from vtkmuscle.core.sections import Sections, cut_surface, opposite_half_edges
from vtkmuscle.core.superficial import SeenFibres
from vtkmuscle.core.twist import STRAIGHT, Found, Twisting, guide_levels, turned_starts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How far inside of the muscle's ends the first and the last slice are, as a part of its length: far enough
#: to cut a flat end that is not quite level, too near to be seen.
END_MARGIN = 1e-6
#: Heights that differ by no more than this part of the box's length are equal but for rounding.
SAME_HEIGHT = 1e-9
#: Slices by which the muscle's course is judged.
N_COURSE = 16
#: A muscle is bent too much for parallel planes where more than this part of its course runs more steeply
#: than this angle to the box's axis [degrees], or its main branch holds less than this part of its volume.
LARGEST_STEEP_SHARE = 0.15
STEEP = 45.0
LEAST_SHARE = 0.8


@dataclass(frozen=True, eq=False)
class Morph:
    """Fibres in a muscle, and how well the method suits it.

    Attributes
    ----------
    points : (n, 3) float array
        Points of the fibres [mm].
    n_outside : int
        By planes, points that the mean value map put outside of their section; along isolines, which are not
        flat, points outside of the muscle but for ends on the attachment areas.
    n_unmapped : int
        Sections that cross themselves and so have no one-to-one map, where one was asked for.
    split_error : float
        Largest error of a section's four parts: root of the sum of their squared errors over the perimeter.
    volume_share : float
        Part of the muscle's volume that is in the branch which the fibres fill.
    steep_share : float
        Part of the branch's course that runs at more than :data:`STEEP` degrees to the box's axis.
    twist : Found
        By which sections are turned against each other, and how well that suits what was seen.
    """

    points: Floats
    n_outside: int
    n_unmapped: int
    split_error: float
    volume_share: float
    steep_share: float
    twist: Found

    @property
    def suits(self) -> bool:
        """False where parallel planes do not follow the muscle's course."""
        return self.volume_share >= LEAST_SHARE and self.steep_share <= LARGEST_STEEP_SHARE


def morph_by_planes(
    fibre_points: Floats,
    transform: Floats,
    points: Floats,
    triangles: Ints,
    *,
    slice_tolerance: float,
    continuity: float,
    mapping: str,
    spread: str = "map",
    twisting: Twisting = STRAIGHT,
    report_progress: Callable[[float], None] = lambda fraction: None,
) -> Morph:
    """Return fibre points moved from the fitted template into the muscle.

    For each height along the box's z axis at which there are fibre points, the plane there cuts the box in
    a rectangle and the muscle in loops, of which :func:`vtkmuscle.core.loop_chains.main_loops` chooses one.
    Rectangle and loop are matched (:mod:`vtkmuscle.core.correspondence`) and the points of one mapped to the
    other (:mod:`vtkmuscle.core.section_maps`). A point keeps its height, unless the chosen loops end before
    the box does: then the heights beyond the last slice that hits are squeezed into what is left of the
    muscle there.

    Parameters
    ----------
    fibre_points : (n, 3) array
        Points of the fitted template [mm].
    transform : (4, 4) array
        Unit cube to box, from :func:`vtkmuscle.core.fitting.fit_box`.
    points : (m, 3) array
        Points of the muscle's surface [mm].
    triangles : (k, 3) int array
        Its triangles, closed.
    slice_tolerance : float
        Points whose heights differ by no more than this share a slice [mm].
    continuity : float
        Part of the box's length over which neighbouring slices resist twisting; 0 is the paper's rule.
    mapping : str
        One of :data:`vtkmuscle.core.section_maps.MAPPINGS`.
    spread : str, optional
        One of :data:`vtkmuscle.core.section_maps.SPREADS`.
    twisting : Twisting, optional
        How sections are turned along their contours, from origin to insertion.
    report_progress : callable, optional
        Told the part of the work that is done.

    Returns
    -------
    Morph
        Points in the muscle [mm], and what there is to say about them.

    Raises
    ------
    ValueError
        If the surface is not closed, or no slice through the template has an inside.
    """
    box = Box(transform)
    inside, surface = box.coordinates(fibre_points), box.coordinates(points)
    triangles, opposite = outward(surface, triangles)
    report_progress(0.1)

    def cut(levels: Floats) -> tuple[Sections, Floats, Ints]:
        sections = cut_surface(surface, triangles, opposite, surface[:, 2], levels)
        sizes = loop_areas(sections.points, sections.loop_offsets)[:, 2]
        return sections, sizes, main_loops(sections, levels, sizes)

    tolerance = max(slice_tolerance, SAME_HEIGHT * box.length)
    extent = surface[triangles, 2]  # of the points that are used
    bottom, top = float(extent.min()), float(extent.max())
    margin = END_MARGIN * (top - bottom)
    heights = np.clip(inside[:, 2], bottom + margin, top - margin)
    levels, slice_of = shared_levels(heights, tolerance)
    sections, _, loops = cut(levels)
    # Not by the fibres' heights: the same muscle must be judged the same whatever they are.
    regular = bottom + (top - bottom) * (np.arange(N_COURSE) + 0.5) / N_COURSE
    volume_share, steep_share = _course(*cut(regular))
    if loops[0] < 0 or loops[-1] < 0:
        low, high = _branch_ends(sections, loops, surface[:, 2])
        hit = levels[loops >= 0]
        heights = _squeezed(heights, hit[0], hit[-1], low + margin, high - margin)
        levels, slice_of = shared_levels(heights, tolerance)
        sections, _, loops = cut(levels)
    report_progress(0.35)

    hits = np.flatnonzero(loops >= 0)
    slices = [np.ascontiguousarray(sections.loop(int(loop))[:, :2]) for loop in loops[hits]]
    starts = starting_points(slices, levels[hits], continuity * box.length, np.zeros(2))

    def guide() -> tuple[list[Floats], Floats, Floats]:
        at = bottom + guide_levels(top - bottom)
        cuts, _, main = cut(at)
        at, rings = at[main >= 0], [cuts.loop(int(loop)) for loop in main[main >= 0]]
        flat = [np.ascontiguousarray(ring[:, :2]) for ring in rings]
        begin = starting_points(flat, at, continuity * box.length, np.zeros(2))
        return rings, np.column_stack([begin, at]), at / box.length

    twist = twisting.found(guide, box.seen, inside, box.sides)
    starts = turned_starts(slices, starts, levels[hits] / box.length, twist.twist)
    report_progress(0.5)

    result = np.column_stack([inside[:, :2], heights])
    n_outside = n_unmapped = 0
    split_error = 0.0
    for level, mine in enumerate(members(slice_of, len(levels))):
        number = nearest_hit(hits, level)
        points_in = inside[mine, :2]
        section = map_section(
            slices[number], starts[number], box.sides, points_in, mapping=mapping, spread=spread
        )
        result[mine, :2] = section.places
        split_error = max(split_error, section.split_error)
        n_unmapped += not section.one_to_one and mapping == "bijective"
        if not section.one_to_one:
            n_outside += count_outside(slices[number], section.places)
        report_progress(0.5 + 0.5 * (level + 1) / len(levels))
    return Morph(
        box.positions(result),
        n_outside,
        n_unmapped,
        split_error,
        volume_share,
        steep_share,
        twist,
    )


class Box:
    """A fitted template's box, and coordinates along its sides.

    Parameters
    ----------
    transform : (4, 4) array
        Unit cube to box. A mirrored one has left-handed sides: all that is done in its coordinates is done to
        the mirror image of the muscle.
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
        """Return points (n, 3) along the sides, from the corner Q0 on [mm]."""
        inside: Floats = (points - self._corner) @ self._frame
        return inside

    def positions(self, coordinates: Floats) -> Floats:
        """Return the points (n, 3) that have these coordinates [mm]."""
        points: Floats = coordinates @ self._frame.T + self._corner
        return points

    def seen(self, fibres: SeenFibres) -> SeenFibres:
        """Return fibres on the surface in these coordinates."""
        return fibres.within(self._corner, self._frame)


def outward(points: Floats, triangles: Ints) -> tuple[Ints, Ints]:
    """Return a closed surface's triangles, facing outward, and their opposite half-edges.

    Raises
    ------
    ValueError
        If the surface is open, or neighbouring triangles face different sides.
    """
    if signed_volume(points, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return triangles, opposite_half_edges(triangles, len(points))


def nearest_hit(hits: Ints, level: int) -> int:
    """Return which of the levels that the main branch has, (k,), is nearest to a level.

    A level that the branch misses after all, by rounding, takes the section next to it.
    """
    return int(np.abs(hits - level).argmin())


def members(slice_of: Ints, n_slices: int) -> list[Ints]:
    """Return the numbers of the points of each slice."""
    order = np.argsort(slice_of, kind="stable")
    return np.split(order, np.searchsorted(slice_of[order], np.arange(1, n_slices)))


def shared_levels(heights: Floats, tolerance: float) -> tuple[Floats, Ints]:
    """Return the levels of slices that heights can share, and the slice of each height.

    From the lowest height on, a slice takes all heights up to the tolerance above its lowest one; its
    level is half way between its lowest and its highest.

    Parameters
    ----------
    heights : (n,) array
        In any order [mm].
    tolerance : float
        Largest difference in one slice [mm].

    Returns
    -------
    levels : (k,) array
        Strictly ascending [mm].
    slice_of : (n,) int array
        Which level each height has.
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
    return np.array(levels), slice_of


def _branch_ends(sections: Sections, loops: Ints, heights: Floats) -> tuple[float, float]:
    """Return the lowest and the highest height of the surface beyond the ends of a branch."""
    branch = loops[loops >= 0]
    below = heights[sections.vertex_parts == sections.parts_below[branch[0]]]
    above = heights[sections.vertex_parts == sections.parts_above[branch[-1]]]
    return float(below.min()), float(above.max())


def _squeezed(heights: Floats, first: float, last: float, low: float, high: float) -> Floats:
    """Return heights with those below `first` scaled to begin at `low`, above `last` to end at `high`."""
    result = heights.copy()
    below, above = heights < first, heights > last
    if below.any():
        result[below] = first - (first - heights[below]) * (first - low) / (first - heights.min())
    if above.any():
        result[above] = last + (heights[above] - last) * (high - last) / (heights.max() - last)
    return result


def _course(sections: Sections, sizes: Floats, loops: Ints) -> tuple[float, float]:
    """Return which part of the volume the main branch holds, and which part of its course is steep."""
    branch = loops[loops >= 0]
    share = float(sizes[branch].sum() / sizes.sum())
    steps = np.diff([boundary_centroid(sections.loop(int(loop))) for loop in branch], axis=0)
    if not len(steps):
        return share, 0.0
    lengths = np.linalg.norm(steps, axis=1)
    steep = steps[:, 2] < np.cos(np.radians(STEEP)) * lengths
    return share, float(lengths[steep].sum() / lengths.sum())
