"""Along parallel planes from the fitted template into the muscle.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.morphing.correspondence import boundary_centroid, followed_starts, starting_points
from vtkmuscle.core.morphing.loop_chains import loop_areas, main_loops
from vtkmuscle.core.morphing.sections import ClosedSurface, Sections, cut_surface
from vtkmuscle.core.morphing.slices import (
    SAME_HEIGHT,
    STEEP,
    Morph,
    Slicing,
    in_box,
    map_sections,
    shared_levels,
)
from vtkmuscle.core.morphing.twist import guide_levels, turned_starts
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
    a rectangle and the muscle in loops, of which :func:`vtkmuscle.core.morphing.loop_chains.main_loops`
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
    box, inside, surface = in_box(fibre_points, transform, muscle, slicing)
    tolerance = max(slicing.slice_tolerance, SAME_HEIGHT * box.length)
    all_heights = np.ascontiguousarray(surface.points[:, 2])
    extent = all_heights[surface.triangles]  # of the points that are used
    bottom, top = float(extent.min()), float(extent.max())
    margin = END_MARGIN * (top - bottom)
    heights = np.clip(inside[:, 2], bottom + margin, top - margin)
    levels, slice_of = shared_levels(heights, tolerance)
    # Neither the course nor where sections begin must depend on the heights that fibres happen to have.
    regular = bottom + (top - bottom) * (np.arange(N_COURSE) + 0.5) / N_COURSE
    guides = bottom + guide_levels(top - bottom)

    def cut(at: Floats) -> tuple[Sections, Floats]:
        sections = cut_surface(surface, all_heights, at)
        return sections, loop_areas(sections.points, sections.loop_offsets)[:, 2]

    followed = np.union1d(levels, guides)
    together = np.union1d(followed, regular)
    sections, sizes = cut(together)
    course = main_loops(sections, together, sizes, np.searchsorted(together, regular))
    volume_share, steep_share = _course(sections, sizes, np.searchsorted(together, regular), course)
    main = main_loops(sections, together, sizes, np.searchsorted(together, followed))
    if (main[np.searchsorted(followed, levels[[0, -1]])] < 0).any():
        sections, sizes = cut(followed)
        main = main_loops(sections, followed, sizes)
        low, high = _branch_ends(sections, main, all_heights)
        hit = followed[main >= 0]
        heights = _squeezed(heights, hit[0], hit[-1], low + margin, high - margin)
        levels, slice_of = shared_levels(heights, tolerance)
        followed = np.union1d(levels, guides)
        sections, sizes = cut(followed)
        main = main_loops(sections, followed, sizes)
    slicing.report_progress(0.35)

    loops, guiding = main[np.searchsorted(followed, levels)], main[np.searchsorted(followed, guides)]
    hits, guides = np.flatnonzero(loops >= 0), guides[guiding >= 0]
    slices = [np.ascontiguousarray(sections.loop(int(loop))[:, :2]) for loop in loops[hits]]
    rings = [sections.loop(int(loop)) for loop in guiding[guiding >= 0]]
    flat = [np.ascontiguousarray(ring[:, :2]) for ring in rings]
    reach = slicing.continuity * box.length
    begin = starting_points(flat, guides, reach, np.zeros(2))
    starts = followed_starts(slices, levels[hits], reach, (flat, guides, begin), np.zeros(2))

    def guide() -> tuple[list[Floats], Floats, Floats]:
        return rings, np.column_stack([begin, guides]), guides / box.length

    twist = slicing.twisting.found(guide, box.seen, inside, box.sides)
    starts = turned_starts(slices, starts, levels[hits] / box.length, twist.twist)
    slicing.report_progress(0.5)

    result = np.column_stack([inside[:, :2], heights])
    mapped = map_sections(slices, starts, hits, levels, heights, slice_of, inside, box.sides, slicing)
    result[:, :2] = mapped.places
    return Morph(
        box.positions(result),
        mapped.n_outside,
        mapped.n_unmapped,
        mapped.split_error,
        volume_share,
        steep_share,
        twist,
    )


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


def _course(sections: Sections, sizes: Floats, levels: Ints, loops: Ints) -> tuple[float, float]:
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
