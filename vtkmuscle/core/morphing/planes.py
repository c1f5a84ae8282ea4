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

    Parameters
    ----------
    fibre_points : (n, 3) array
        Points of the fitted template [mm].
    transform : (4, 4) array
        Unit cube to box, from :func:`vtkmuscle.core.template.fitting.fit_box`.
    muscle : ClosedSurface
        The muscle.
    slicing : Slicing
        Settings of slices and maps.

    Raises
    ------
    ValueError
        If no slice through the template has an inside.
    """
    box = Box(transform)
    inside = box.coordinates(fibre_points)
    tolerance = max(slicing.slice_tolerance, SAME_HEIGHT * box.length)
    grain = GRAIN * box.length
    boxed = _BoxedMuscle(box, muscle)
    slicing.report_progress(0.1)
    heights = np.clip(inside[:, 2], boxed.bottom + boxed.margin, boxed.top - boxed.margin)
    levels, slice_of = shared_levels(heights, tolerance, grain)
    course = _PlaneCourse(boxed, levels)
    branch = course.branch
    if course.ends is not None:
        heights = _squeezed(heights, *course.ends)
        levels, slice_of = shared_levels(heights, tolerance, grain)
        branch = boxed.branch(np.union1d(levels, boxed.guides))
    slicing.report_progress(0.35)
    mapped = _mapped(box, branch, levels, boxed.guides, slicing)
    result = np.column_stack([inside[:, :2], heights])
    result[:, :2], n_outside, split_error = mapped.positions(inside, heights, levels, slice_of)
    slicing.report_progress(1.0)
    return Morph(box.positions(result), n_outside, split_error, course.volume_share, course.steep_share)


class _BoxedMuscle:
    """Muscle in the coordinates of its box, with heights."""

    def __init__(self, box: Box, muscle: ClosedSurface) -> None:
        self.surface = box.surface(muscle)
        self.heights = np.ascontiguousarray(self.surface.points[:, 2])
        used = self.heights[self.surface.triangles]
        self.bottom, self.top = float(used.min()), float(used.max())
        self.margin = END_MARGIN * (self.top - self.bottom)
        self.guides = self.bottom + guide_levels(self.top - self.bottom)

    def branch(self, heights: Floats) -> Branch:
        """Return the main branch at some heights."""
        return Branch(self.surface, self.heights, heights, heights, lambda areas: areas[:, 2])


class _PlaneCourse:
    """Main branch at levels, and suitability of planes.

    For a branch that ends within the levels, `ends` are the heights of its first and last loop, and the
    muscle's lowest and highest height beyond the loops.
    """

    def __init__(self, boxed: _BoxedMuscle, levels: Floats) -> None:
        regular = boxed.bottom + (boxed.top - boxed.bottom) * (np.arange(N_COURSE) + 0.5) / N_COURSE
        self.volume_share, self.steep_share = _shares(boxed.branch(regular))
        self.branch = boxed.branch(np.union1d(levels, boxed.guides))
        self.ends: tuple[float, float, float, float] | None = None
        if (self.branch.at(levels[[0, -1]]) < 0).any():
            sections, hits = self.branch.sections, np.flatnonzero(self.branch.numbers >= 0)
            first, last = self.branch.numbers[hits[[0, -1]]]
            below = boxed.heights[sections.vertex_parts == sections.parts_below[first]]
            above = boxed.heights[sections.vertex_parts == sections.parts_above[last]]
            low, high = (float(height) for height in self.branch.heights[hits[[0, -1]]])
            self.ends = low, high, float(below.min()) + boxed.margin, float(above.max()) - boxed.margin


def _mapped(box: Box, branch: Branch, levels: Floats, guides: Floats, slicing: Slicing) -> SliceMaps:
    """Return sections at levels, matched to the template's rectangle."""

    def stack(heights: Floats) -> tuple[LoopStack, Ints]:
        loops, hits = branch.loops_at(heights)
        return LoopStack([np.ascontiguousarray(loop[:, :2]) for loop in loops], heights[hits]), hits

    slices, hits = stack(levels)
    starts = followed_starts(slices, stack(guides)[0], slicing.continuity * box.length, np.zeros(2))
    return SliceMaps(slices.loops, starts, hits, box.sides, slicing)


def _squeezed(heights: Floats, first: float, last: float, low: float, high: float) -> Floats:
    """Return heights squeezed into the muscle's ends.

    Heights below `first` begin at `low`; heights above `last` end at `high`.
    """
    result = heights.copy()
    below, above = heights < first, heights > last
    if below.any():
        result[below] = first - (first - heights[below]) * (first - low) / (first - heights.min())
    if above.any():
        result[above] = last + (heights[above] - last) * (high - last) / (heights.max() - last)
    return result


def _shares(branch: Branch) -> tuple[float, float]:
    """Return the main branch's volume share, and its steep share."""
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
