"""Slice by slice from the fitted template into the muscle.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.correspondence import (
    N_PLACES,
    loop_lengths,
    nearest_vertex,
    refined_loop,
    split_chain,
    starting_points,
    subdivided_rectangle,
)
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh import signed_volume
from vtkmuscle.core.planar_coordinates import mean_value_weights
from vtkmuscle.core.sections import Sections, cut_surface, opposite_half_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How far inside of the muscle's ends the first and the last slice are, as a part of its length: far enough
#: to cut a flat end that is not quite level, too near to be seen.
END_MARGIN = 1e-6
#: Heights that differ by no more than this part of the box's length are equal but for rounding.
SAME_HEIGHT = 1e-9


def morph_by_planes(
    fibre_points: Floats,
    transform: Floats,
    points: Floats,
    triangles: Ints,
    *,
    slice_tolerance: float,
    continuity: float,
    report_progress: Callable[[float], None] = lambda fraction: None,
) -> Floats:
    """Return fibre points moved from the fitted template into the muscle.

    For each height along the box's z axis at which there are fibre points, the plane there cuts the box in
    a rectangle and the muscle in loops, of which :func:`main_loops` chooses one. Rectangle and loop are
    matched (:mod:`vtkmuscle.core.correspondence`); the mean value coordinates of a fibre point in the
    rectangle, applied to the loop, give its place in the muscle. A point keeps its height, unless the chosen
    loops end before the box does: then the heights beyond the last slice that hits are squeezed into what is
    left of the muscle there.

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
    report_progress : callable, optional
        Told the part of the work that is done.

    Returns
    -------
    (n, 3) array
        Points in the muscle [mm].

    Raises
    ------
    ValueError
        If the surface is not closed, or no slice through the template has an inside.
    """
    sides = np.linalg.norm(transform[:3, :3], axis=0)
    frame = transform[:3, :3] / sides
    inside = (fibre_points - transform[:3, 3]) @ frame
    surface = (points - transform[:3, 3]) @ frame
    if signed_volume(points, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    opposite = opposite_half_edges(triangles, len(points))
    report_progress(0.1)

    def cut(levels: Floats) -> tuple[Sections, Ints]:
        sections = cut_surface(surface, triangles, opposite, surface[:, 2], levels)
        return sections, main_loops(sections, levels)

    tolerance = max(slice_tolerance, SAME_HEIGHT * float(sides[2]))
    extent = surface[triangles, 2]  # of the points that are used
    margin = END_MARGIN * float(np.ptp(extent))
    heights = np.clip(inside[:, 2], extent.min() + margin, extent.max() - margin)
    levels, slice_of = shared_levels(heights, tolerance)
    sections, loops = cut(levels)
    if loops[0] < 0 or loops[-1] < 0:
        low, high = _branch_ends(sections, loops, surface[:, 2])
        hit = levels[loops >= 0]
        heights = _squeezed(heights, hit[0], hit[-1], low + margin, high - margin)
        levels, slice_of = shared_levels(heights, tolerance)
        sections, loops = cut(levels)
    report_progress(0.3)

    hits = np.flatnonzero(loops >= 0)
    slices = [np.ascontiguousarray(sections.loop(int(loop))[:, :2]) for loop in loops[hits]]
    starts = starting_points(slices, levels[hits], continuity * float(sides[2]))
    report_progress(0.5)

    order = np.argsort(slice_of, kind="stable")
    bounds = np.searchsorted(slice_of[order], np.arange(len(levels) + 1))
    result = np.column_stack([inside[:, :2], heights])
    for level in range(len(levels)):
        # A level that the main branch misses after all takes the nearest slice of the branch.
        number = int(np.abs(hits - level).argmin())
        mine = order[bounds[level] : bounds[level + 1]]
        result[mine, :2] = morph_slice(slices[number], starts[number], sides[0], sides[1], inside[mine, :2])
        report_progress(0.5 + 0.5 * (level + 1) / len(levels))
    moved: Floats = result @ frame.T + transform[:3, 3]
    return moved


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


def main_loops(sections: Sections, levels: Floats) -> Ints:
    """Return the loop of each level that belongs to the muscle's main branch, -1 beyond its ends.

    A loop continues another one of the next level if the surface between the two levels joins them. Of all
    chains of loops that continue each other the one is taken that encloses most (area times distance of
    the levels): so it never changes from one branch to another one that it does not meet.

    Parameters
    ----------
    sections : Sections
        By height: loops are counterclockwise in x and y where they are outer boundaries.
    levels : (l,) array
        Heights, strictly ascending [mm].

    Returns
    -------
    (l,) int array
        Numbers of loops; the levels of those that are not -1 follow each other.

    Raises
    ------
    ValueError
        If no level has a loop with an inside.
    """
    thickness = np.gradient(levels) if len(levels) > 1 else np.ones(1)
    chain: Ints = _largest_chain(
        sections.points,
        sections.loop_offsets,
        sections.level_offsets,
        sections.parts_below,
        sections.parts_above,
        thickness,
    )
    if (chain < 0).all():
        raise ValueError("no plane through the template cuts the muscle; fit the template to it first")
    return chain


@kernel
def _largest_chain(
    points: Floats, loop_offsets: Ints, level_offsets: Ints, below: Ints, above: Ints, thickness: Floats
) -> Ints:
    """Return the chain of loops that encloses the largest volume, by dynamic programming."""
    n_loops = len(loop_offsets) - 1
    best = np.zeros(n_loops)
    previous = np.full(n_loops, -1, dtype=np.int64)
    chain = np.full(len(thickness), -1, dtype=np.int64)
    end, end_level = -1, -1
    for level in range(len(thickness)):
        for loop in range(level_offsets[level], level_offsets[level + 1]):
            first, last = loop_offsets[loop], loop_offsets[loop + 1] - 1
            x, y = points[last, 0], points[last, 1]
            double_area = 0.0
            for i in range(first, last):
                double_area += (points[i, 0] - x) * (points[i + 1, 1] - y)
                double_area -= (points[i + 1, 0] - x) * (points[i, 1] - y)
            if double_area <= 0.0:
                continue
            if level > 0:
                for other in range(level_offsets[level - 1], level_offsets[level]):
                    if above[other] == below[loop] and best[other] > best[loop]:
                        best[loop] = best[other]
                        previous[loop] = other
            best[loop] += 0.5 * double_area * thickness[level]
            if end < 0 or best[loop] > best[end]:
                end, end_level = loop, level
    while end >= 0:
        chain[end_level] = end
        end, end_level = previous[end], end_level - 1
    return chain


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


@kernel
def morph_slice(loop: Floats, target: Floats, width: float, depth: float, points: Floats) -> Floats:
    """Map points of the template's rectangle to a section of the muscle.

    f' = sum_i w_i(f) p_i, with w_i the mean value coordinates of f in the subdivided rectangle and p_i the
    vertices of the section that correspond to the rectangle's.

    Parameters
    ----------
    loop : (n, 2) array
        The section's boundary, counterclockwise, n >= 3 [mm].
    target : (2,) array
        The correspondence starts at the vertex nearest to this [mm].
    width, depth : float
        Sides of the rectangle [mm].
    points : (m, 2) array
        Points of the rectangle [mm].

    Returns
    -------
    (m, 2) array
        Points of the section [mm].
    """
    refined = refined_loop(loop, N_PLACES)
    n = len(refined)
    start = nearest_vertex(refined, target[0], target[1])
    ring = np.empty((n, 2))
    for i in range(n):
        ring[i] = refined[(start + i) % n]
    lengths = loop_lengths(ring)
    splits, _ = split_chain(lengths, width, depth)
    rectangle = subdivided_rectangle(lengths, splits, width, depth)
    weights = np.empty(n)
    result = np.zeros((len(points), 2))
    for i in range(len(points)):
        mean_value_weights(rectangle, points[i, 0], points[i, 1], weights)
        for j in range(n):
            result[i, 0] += weights[j] * ring[j, 0]
            result[i, 1] += weights[j] * ring[j, 1]
    return result
