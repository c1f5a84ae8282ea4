"""Sections of a closed surface, and their main branch.

Levels of the height give parallel plane sections, levels of any other function its isolines. A point with a
value equal to a level counts as above: so levels through points or along edges give closed loops, too.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.surface import point_components, signed_volume
from vtkmuscle.core.morphing.correspondence import LoopStack
from vtkmuscle.core.types import FloatMap, Floats, Ints


class Sections(NamedTuple):
    """Loops of a surface at ascending levels, in sequence.

    The last point of a loop differs from the first. Seen from outside, the surface above the level is on the
    loop's left: about the direction of growing values, the outer boundary of a section runs counterclockwise
    and a hole clockwise.

    points, loop_offsets, level_offsets : (n, 3), (k + 1,), (l + 1,), intersections of surface edges and
        levels; first point of each loop, and n; first loop of each level, and k;
    parts_below, parts_above, vertex_parts : (k,)s, (v,), part of the surface, cut along all loops, on either
        side of each loop, and at each surface point.
    """

    points: Floats
    loop_offsets: Ints
    level_offsets: Ints
    parts_below: Ints
    parts_above: Ints
    vertex_parts: Ints

    def loop(self, number: int) -> Floats:
        """Return the points of a loop, (m, 3), a view."""
        return self.points[self.loop_offsets[number] : self.loop_offsets[number + 1]]

    def loops_of(self, level: int) -> range:
        """Return the numbers of the loops of a level."""
        return range(int(self.level_offsets[level]), int(self.level_offsets[level + 1]))


@dataclass(frozen=True, eq=False)
class ClosedSurface:
    """Surface without holes. Points (n, 3) [mm] and triangles (m, 3).

    `opposite` (3 m,) are the opposite half-edges.
    """

    points: Floats
    triangles: Ints
    opposite: Ints

    def outward(self) -> "ClosedSurface":
        """Return the surface with triangles that face outward."""
        if signed_volume(self.points, self.triangles) >= 0.0:
            return self
        # (a, b, c) becomes (c, b, a): half-edges 0 and 1 exchange, 2 stays.
        halves = self.opposite.reshape(-1, 3)[:, [1, 0, 2]].reshape(-1)
        turned = halves - halves % 3 + np.array([1, 0, 2])[halves % 3]
        return ClosedSurface(self.points, np.ascontiguousarray(self.triangles[:, ::-1]), turned)


def cut_surface(surface: ClosedSurface, values: Floats, levels: Floats) -> Sections:
    """Cut a closed surface along levels of a scalar. Levels (l,) ascend.

    The scalar (n,) is at the surface's points; triangles face outward. A triangle is visited once per
    crossing level, whatever the number of levels. Loops of fewer than three different points, at isolated
    extrema, are left out.
    """
    corners, ends = surface.triangles.reshape(-1), np.roll(surface.triangles, -1, axis=1).reshape(-1)
    slabs = np.searchsorted(levels, values, side="right")
    low, high = slabs[corners], slabs[ends]
    rising = np.flatnonzero(high > low)
    counts = (high - low)[rising]
    # Number of the first crossing of each rising half-edge; further crossings follow upwards.
    first = np.zeros(len(corners), dtype=np.int64)
    first[rising] = np.cumsum(counts) - counts
    crossed = np.repeat(rising, counts)
    level = low[crossed] + np.arange(len(crossed)) - first[crossed]
    a, b = corners[crossed], ends[crossed]
    share = ((levels[level] - values[a]) / (values[b] - values[a]))[:, None]
    # Written so that a share of 1 gives the end point to the last bit.
    points = (1.0 - share) * surface.points[a] + share * surface.points[b]
    # A loop enters a triangle by the falling half-edge, opposite to the rising half-edge of the last.
    down = surface.opposite[crossed]
    onward = np.where(low[_onward(down, 2)] > level, _onward(down, 1), _onward(down, 2))
    loop_of, order = np.full(len(level), -1), np.empty_like(level)
    following, by_level = first[onward] + level - low[onward], np.argsort(level, kind="stable")
    n_loops = _follow(following, by_level, loop_of, order)
    points, begins = points[order], np.flatnonzero(np.diff(loop_of[order], prepend=-1))
    after = np.arange(1, len(order) + 1)
    after[np.append(begins, len(order))[1:] - 1] = begins
    distinct = (points != points[after]).any(axis=1)
    sizes = np.bincount(loop_of[order], distinct, n_loops).astype(np.int64)
    proper = sizes >= 3
    per_level = np.bincount(level[order[begins]][proper], minlength=len(levels))
    # At loops left out the surface is not cut.
    loop_of = np.where(proper, np.cumsum(proper) - 1, -1)[loop_of]
    n_points, n_loops = len(values), int(proper.sum())
    kept = np.append(0, np.cumsum(loop_of >= 0))
    lower_sides, at = loop_of[loop_of >= 0] + n_points, first[rising]
    # Along a rising half-edge: from its lower end to the lower side of the first loop, from its upper side
    # to the lower side of the next, and so on.
    up = np.insert(lower_sides + n_loops, kept[at], corners[rising])
    flat = low == high
    onto = np.insert(lower_sides, kept[at + counts], ends[rising])
    edges = np.column_stack([np.append(corners[flat], up), np.append(ends[flat], onto)])
    parts = point_components(n_points + 2 * n_loops, edges)
    vertex_parts, below, above = np.split(parts, [n_points, n_points + n_loops])
    offsets = np.append(0, np.cumsum(sizes[proper])), np.append(0, np.cumsum(per_level))
    return Sections(points[distinct & (loop_of[order] >= 0)], *offsets, below, above, vertex_parts)


def _onward(half_edges: Ints, steps: int) -> Ints:
    """Return half-edges some steps onward in their triangles."""
    side = half_edges % 3
    return half_edges - side + (side + steps) % 3


@kernel
def _follow(following: Ints, begins: Ints, loop_of: Ints, order: Ints) -> int:
    """Write each crossing's loop, and crossings in sequence of loops; return the number of loops."""
    n_loops, n = 0, 0
    for begin in begins:
        if loop_of[begin] >= 0:
            continue
        i = begin
        while loop_of[i] < 0:
            loop_of[i], order[n] = n_loops, i
            i, n = following[i], n + 1
        n_loops += 1
    return n_loops


def loop_areas(points: Floats, loop_offsets: Ints) -> Floats:
    """Return the vector area of each loop, (k, 3).

    Half the sum of the edges' cross products: for a flat loop its length is the area, directed against
    clockwise motion.
    """
    if len(loop_offsets) == 1:
        return np.empty((0, 3))
    firsts, lasts = loop_offsets[:-1], loop_offsets[1:] - 1
    about = points - np.repeat(points[lasts], lasts + 1 - firsts, axis=0)
    after = np.roll(about, -1, axis=0)
    after[lasts] = 0.0
    return np.add.reduceat(np.cross(about, after), firsts) / 2.0


def main_loops(sections: Sections, levels: Floats, sizes: Floats) -> Ints:
    """Return the main branch's loop per level (l,). -1 beyond its ends.

    A loop continues a loop of the level below if the surface between both levels joins them. The main branch
    is the chain of continued loops that encloses most volume, by area times distance of levels, so it never
    jumps between branches. Levels ascend strictly [mm]; loops of a size (k,) <= 0 [mm^2], as the boundaries
    of holes, take no part. Raises a ValueError if no level has a loop with an inside.
    """
    thickness = np.gradient(levels) if len(levels) > 1 else np.ones(1)
    best, previous = np.zeros(len(sizes)), np.full(len(sizes), -1)
    chain = np.full(len(thickness), -1, dtype=np.int64)
    by_level = [sections.loops_of(level) for level in range(len(thickness))]
    for level, loops in enumerate(by_level):
        for loop in loops:
            if sizes[loop] <= 0.0:
                continue
            for lower in by_level[level - 1] if level else ():
                if sections.parts_above[lower] == sections.parts_below[loop] and best[lower] > best[loop]:
                    best[loop], previous[loop] = best[lower], lower
            best[loop] += sizes[loop] * thickness[level]
    if not best.any():
        problem = "no section of the muscle through the template has an inside"
        raise InputError("", problem, "fit the template first")
    end = int(best.argmax())
    level = next(number for number, loops in enumerate(by_level) if end in loops)
    while end >= 0:
        chain[level] = end
        end, level = int(previous[end]), level - 1
    return chain


class Branch:
    """Sections of a muscle, with the main branch. Heights (h,) ascend [mm].

    The surface is cut at as many levels of the values at its points; `size` gives loop areas from vector
    areas (k, 3).
    """

    def __init__(
        self, surface: ClosedSurface, values: Floats, levels: Floats, heights: Floats, size: FloatMap
    ) -> None:
        self.heights, self.sections = heights, cut_surface(surface, values, levels)
        self.areas = loop_areas(self.sections.points, self.sections.loop_offsets)
        self.sizes = size(self.areas)
        self.numbers = main_loops(self.sections, heights, self.sizes)

    @property
    def share(self) -> float:
        """Part of the sections' area in the main branch."""
        return float(self.sizes[self.numbers[self.numbers >= 0]].sum() / self.sizes.sum())

    def at(self, heights: Floats) -> Ints:
        """Return loop numbers at some heights, -1 for none."""
        return self.numbers[np.searchsorted(self.heights, heights)]

    def stack(self, heights: Floats, dimension: int) -> tuple[LoopStack, Ints]:
        """Return loops (n, dimension) and the numbers of hit heights."""
        numbers = self.at(heights)
        hits = np.flatnonzero(numbers >= 0)
        loops = [self.sections.loop(int(number))[:, :dimension] for number in numbers[hits]]
        return LoopStack([np.ascontiguousarray(loop) for loop in loops], heights[hits]), hits
