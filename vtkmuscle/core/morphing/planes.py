"""Template fibres into the muscle, along parallel planes.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3, extended in
doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.morphing.correspondence import (
    GRAIN,
    SAME_HEIGHT,
    STEEP,
    Box,
    LoopStack,
    Morph,
    SliceMaps,
    Slicing,
    boundary_centroid,
    followed_starts,
    guide_levels,
    shared_levels,
)
from vtkmuscle.core.morphing.sections import Branch, ClosedSurface
from vtkmuscle.core.types import Floats, Ints

#: Distance of the first and last slice from the muscle's ends, as a part of its length: far enough to cut a
#: flat, slightly tilted end, too near to be seen.
END_MARGIN = 1e-6
#: Slices that measure the muscle's course.
N_COURSE = 16


def morph_by_planes(
    fibre_points: Floats, transform: Floats, muscle: ClosedSurface, slicing: Slicing
) -> Morph:
    """Return template fibres moved into the muscle by planes.

    A plane at each height of fibre points along the box's z axis cuts the box in a rectangle and the muscle
    in loops, of which :func:`vtkmuscle.core.morphing.sections.main_loops` chooses one. Rectangle and loop are
    matched, and the rectangle's points mapped to the loop (:mod:`vtkmuscle.core.morphing.correspondence`).
    Points keep their heights, but heights beyond the last loop are squeezed into the rest of the muscle.

    fibre_points : (n, 3), points of the fitted template [mm];
    transform : (4, 4), Unit cube to box, from :func:`vtkmuscle.core.template.fitting.fit_box`;
    muscle : ClosedSurface, the muscle;
    slicing : Slicing, settings of slices and maps.

    Raises a ValueError if no slice through the template has an inside.
    """
    box = Box(transform)
    inside = box.coordinates(fibre_points)
    tolerance, grain = max(slicing.slice_tolerance, SAME_HEIGHT * box.length), GRAIN * box.length
    course = _PlaneCourse(box.surface(muscle))
    volume_share, steep_share = course.shares()
    heights = np.clip(inside[:, 2], course.bottom + course.margin, course.top - course.margin)
    levels, slice_of = shared_levels(heights, tolerance, grain)
    branch = course.branch(np.union1d(levels, course.guides))
    if (branch.at(levels[[0, -1]]) < 0).any():
        heights = course.squeezed(heights, branch)
        levels, slice_of = shared_levels(heights, tolerance, grain)
        branch = course.branch(np.union1d(levels, course.guides))
    mapped = _mapped(box, branch, levels, course.guides, slicing)
    result = np.column_stack([inside[:, :2], heights])
    result[:, :2], n_outside = mapped.positions(inside, heights, levels, slice_of)
    return Morph(box.positions(result), n_outside, volume_share, steep_share)


class _PlaneCourse:
    """Muscle in the coordinates of its box, cut at heights."""

    def __init__(self, surface: ClosedSurface) -> None:
        self.surface, self.heights = surface, np.ascontiguousarray(surface.points[:, 2])
        used = self.heights[surface.triangles]
        self.bottom, self.top = float(used.min()), float(used.max())
        self.margin = END_MARGIN * (self.top - self.bottom)
        self.guides = self.bottom + guide_levels(self.top - self.bottom)

    def branch(self, heights: Floats) -> Branch:
        """Return the main branch at some heights."""
        return Branch(self.surface, self.heights, heights, heights, lambda areas: areas[:, 2])

    def shares(self) -> tuple[float, float]:
        """Return the main branch's volume share, and its steep share."""
        branch = self.branch(self.bottom + (self.top - self.bottom) * (np.arange(N_COURSE) + 0.5) / N_COURSE)
        sections, numbers = branch.sections, branch.numbers[branch.numbers >= 0]
        levels = range(len(branch.heights))
        whole = sum(float(branch.sizes[sections.loops_of(level)].sum()) for level in levels)
        share = float(branch.sizes[numbers].sum() / whole)
        steps = np.diff([boundary_centroid(sections.loop(int(number))) for number in numbers], axis=0)
        if not len(steps):
            return share, 0.0
        lengths = np.linalg.norm(steps, axis=1)
        steep = steps[:, 2] < np.cos(np.radians(STEEP)) * lengths
        return share, float(lengths[steep].sum() / lengths.sum())

    def squeezed(self, heights: Floats, branch: Branch) -> Floats:
        """Return heights with those beyond the branch's loops squeezed into the muscle's ends."""
        sections, hits = branch.sections, np.flatnonzero(branch.numbers >= 0)
        (lower, upper), (first, last) = branch.numbers[hits[[0, -1]]], branch.heights[hits[[0, -1]]]
        low = self.heights[sections.vertex_parts == sections.parts_below[lower]].min() + self.margin
        high = self.heights[sections.vertex_parts == sections.parts_above[upper]].max() - self.margin
        result = heights.copy()
        below, above = heights < first, heights > last
        if below.any():
            result[below] = first - (first - heights[below]) * (first - low) / (first - heights.min())
        if above.any():
            result[above] = last + (heights[above] - last) * (high - last) / (heights.max() - last)
        return result


def _mapped(box: Box, branch: Branch, levels: Floats, guides: Floats, slicing: Slicing) -> SliceMaps:
    """Return sections at levels, matched to the template's rectangle."""

    def stack(heights: Floats) -> tuple[LoopStack, Ints]:
        loops, hits = branch.loops_at(heights)
        return LoopStack([np.ascontiguousarray(loop[:, :2]) for loop in loops], heights[hits]), hits

    slices, hits = stack(levels)
    starts = followed_starts(slices, stack(guides)[0], slicing.continuity * box.length, np.zeros(2))
    return SliceMaps(slices.loops, starts, hits, box.sides, slicing)
