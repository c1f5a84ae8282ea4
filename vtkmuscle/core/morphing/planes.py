"""Along parallel planes from the fitted template into the muscle.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.morphing.correspondence import boundary_centroid, followed_starts, starting_points
from vtkmuscle.core.morphing.sections import ClosedSurface, Sections, cut_surface, loop_areas, main_loops
from vtkmuscle.core.morphing.slices import (
    GRAIN,
    SAME_HEIGHT,
    STEEP,
    Box,
    Morph,
    SliceMaps,
    Slicing,
    guide_levels,
    map_sections,
    mapped_slices,
    shared_levels,
)
from vtkmuscle.core.types import Floats, Ints

#: How far inside of the muscle's ends the first and the last slice are, as a part of its length: far enough
#: to cut a flat end that is not quite level, too near to be seen.
END_MARGIN = 1e-6
#: Slices by which the muscle's course is judged.
N_COURSE = 16


def morph_by_planes(
    fibre_points: Floats, transform: Floats, muscle: ClosedSurface, slicing: Slicing
) -> Morph:
    """Return fibre points moved from the fitted template into the muscle.

    For each height along the box's z axis at which there are fibre points, the plane there cuts the box in
    a rectangle and the muscle in loops, of which :func:`vtkmuscle.core.morphing.sections.main_loops`
    chooses one. Rectangle and loop are matched (:mod:`vtkmuscle.core.morphing.correspondence`) and the
    points of one mapped to the other (:mod:`vtkmuscle.core.morphing.section_maps`). A point keeps its
    height, unless the chosen loops end before the box does: then the heights beyond the last slice that hits
    are squeezed into what is left of the muscle there.

    Parameters
    ----------
    fibre_points : (n, 3) array
        Points of the fitted template [mm].
    transform : (4, 4) array
        Unit cube to box, from :func:`vtkmuscle.core.template.fitting.fit_box`.
    muscle : ClosedSurface
        The muscle.
    slicing : Slicing
        How finely it is sliced, and how slices are mapped.

    Returns
    -------
    Morph
        Points in the muscle [mm], and what there is to say about them.

    Raises
    ------
    ValueError
        If no slice through the template has an inside.
    """
    box = Box(transform)
    inside = box.coordinates(fibre_points)
    tolerance = max(slicing.slice_tolerance, SAME_HEIGHT * box.length)
    grain = GRAIN * box.length
    raised = slicing.once(("raised", slicing.key(transform)), lambda: _muscle_in_box(box, muscle))
    slicing.report_progress(0.1)
    heights = np.clip(inside[:, 2], raised.bottom + raised.margin, raised.top - raised.margin)
    levels, slice_of = shared_levels(heights, tolerance, grain)
    course = slicing.once(("course", slicing.key(transform, levels)), lambda: _course(raised, levels))
    followed = course.followed
    if course.ends is not None:
        heights = _squeezed(heights, *course.ends)
        levels, slice_of = shared_levels(heights, tolerance, grain)
    slicing.report_progress(0.35)

    def slices() -> SliceMaps:
        at_levels = followed if course.ends is None else _branch_at(raised, levels)
        return _mapped(box, at_levels, levels, raised.guides, slicing)

    mapped = slicing.once(("planes", slicing.key(transform, levels)), slices)
    result = np.column_stack([inside[:, :2], heights])
    places, n_outside, split_error = map_sections(mapped, levels, heights, slice_of, inside, slicing)
    result[:, :2] = places
    return Morph(
        box.positions(result),
        n_outside,
        split_error,
        course.volume_share,
        course.steep_share,
    )


@dataclass(frozen=True, eq=False)
class _BoxedMuscle:
    """A muscle in the coordinates of its box, its height, and how far from its ends slices stay."""

    surface: ClosedSurface
    heights: Floats
    bottom: float
    top: float

    @property
    def margin(self) -> float:
        return END_MARGIN * (self.top - self.bottom)

    @property
    def guides(self) -> Floats:
        """Heights of sections, independent of the resolution of the fibres."""
        return self.bottom + guide_levels(self.top - self.bottom)


@dataclass(frozen=True, eq=False)
class _Branch:
    """Sections at some heights, and of each the loop of the main branch, -1 for none."""

    sections: Sections
    heights: Floats
    loops: Ints

    def at(self, heights: Floats) -> Ints:
        """Return the loops at some of the heights."""
        return self.loops[np.searchsorted(self.heights, heights)]


@dataclass(frozen=True, eq=False)
class _Course:
    """The main branch of a muscle, and the heights that it is scaled to where it ends before the box."""

    followed: _Branch
    volume_share: float
    steep_share: float
    ends: tuple[float, float, float, float] | None


def _muscle_in_box(box: Box, muscle: ClosedSurface) -> _BoxedMuscle:
    surface = box.surface(muscle)
    heights = np.ascontiguousarray(surface.points[:, 2])
    extent = heights[surface.triangles]  # of the points that are used
    return _BoxedMuscle(surface, heights, float(extent.min()), float(extent.max()))


def _branch_at(raised: _BoxedMuscle, levels: Floats) -> _Branch:
    """Return sections at the levels and the guides."""
    at = np.union1d(levels, raised.guides)
    sections = cut_surface(raised.surface, raised.heights, at)
    sizes = loop_areas(sections.points, sections.loop_offsets)[:, 2]
    return _Branch(sections, at, main_loops(sections, at, sizes))


def _course(raised: _BoxedMuscle, levels: Floats) -> _Course:
    """Return the course of the main branch, by regular heights, and the sections at the levels."""
    bottom, top = raised.bottom, raised.top
    regular = bottom + (top - bottom) * (np.arange(N_COURSE) + 0.5) / N_COURSE
    followed = np.union1d(levels, raised.guides)
    together = np.union1d(followed, regular)
    sections = cut_surface(raised.surface, raised.heights, together)
    sizes = loop_areas(sections.points, sections.loop_offsets)[:, 2]
    at_regular = np.searchsorted(together, regular)
    branch = main_loops(sections, together, sizes, at_regular)
    shares = _shares(sections, sizes, at_regular, branch)
    main = main_loops(sections, together, sizes, np.searchsorted(together, followed))
    found = _Branch(sections, followed, main)
    if (found.at(levels[[0, -1]]) >= 0).all():
        return _Course(found, *shares, None)
    at = _branch_at(raised, levels)
    low, high = _branch_ends(at.sections, at.loops, raised.heights)
    hit = at.heights[at.loops >= 0]
    ends = float(hit[0]), float(hit[-1]), low + raised.margin, high - raised.margin
    return _Course(at, *shares, ends)


def _mapped(box: Box, followed: _Branch, levels: Floats, guides: Floats, slicing: Slicing) -> SliceMaps:
    """Return the sections at the levels, matched to the template's rectangle."""
    sections = followed.sections
    loops, guiding = followed.at(levels), followed.at(guides)
    hits, guides = np.flatnonzero(loops >= 0), guides[guiding >= 0]
    slices = [np.ascontiguousarray(sections.loop(int(loop))[:, :2]) for loop in loops[hits]]
    flat = [np.ascontiguousarray(sections.loop(int(loop))[:, :2]) for loop in guiding[guiding >= 0]]
    reach = slicing.continuity * box.length
    begin = starting_points(flat, guides, reach, np.zeros(2))
    starts = followed_starts(slices, levels[hits], reach, (flat, guides, begin), np.zeros(2))
    slicing.report_progress(0.5)
    return mapped_slices(slices, starts, hits, box.sides, slicing)


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


def _shares(sections: Sections, sizes: Floats, levels: Ints, loops: Ints) -> tuple[float, float]:
    """Return which part of the volume the main branch holds, and which part of its course is steep."""
    branch = loops[loops >= 0]
    whole = sum(float(sizes[sections.loops_of(int(level))].sum()) for level in levels)
    share = float(sizes[branch].sum() / whole)
    steps = np.diff([boundary_centroid(sections.loop(int(loop))) for loop in branch], axis=0)
    if not len(steps):
        return share, 0.0
    lengths = np.linalg.norm(steps, axis=1)
    steep = steps[:, 2] < np.cos(np.radians(STEEP)) * lengths
    return share, float(lengths[steep].sum() / lengths.sum())
