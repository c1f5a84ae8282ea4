"""Sections of a closed surface at many levels of a scalar at once, as closed loops that know each other.

With a height for the scalar these are parallel plane sections; with any other function on the points they
are its isolines. A point counts as above a level if its value is equal or greater: a level through points
or along edges is thereby as good as any other, and every loop is closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sections:
    """Loops of a surface at ascending levels, all of level 0 first.

    A loop has the part of the surface that is above its level to the left, seen from outside: about the
    direction in which the scalar grows, the outer boundary of a section runs counterclockwise and a hole
    clockwise. The next loop begins where one ends, and the last point is not the first one again.

    Attributes
    ----------
    points : (n, 3) float array
        Points where edges of the surface meet the levels, in the unit of the surface's points.
    loop_offsets : (k + 1,) int array
        First point of each loop, and n.
    level_offsets : (l + 1,) int array
        First loop of each level, and k.
    parts_below, parts_above : (k,) int array
        Number of the part of the surface, cut along all loops, on either side of each loop.
    vertex_parts : (v,) int array
        Number of the part in which each point of the surface is.
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


def opposite_half_edges(triangles: Ints, n_points: int) -> Ints:
    """Return for each half-edge of a closed surface the one that runs along it in the other triangle.

    Parameters
    ----------
    triangles : (m, 3) int array
        Point ids; half-edge 3 i + j runs from corner j of triangle i to the next corner.
    n_points : int
        Number of points of the surface.

    Returns
    -------
    (3 m,) int array
        Half-edges.

    Raises
    ------
    ValueError
        If the surface is open, or neighbouring triangles face different sides.
    """
    opposite = _opposites(triangles, n_points)
    alone = int((opposite < 0).sum())
    if alone:
        raise ValueError(
            f"the surface must be closed and its triangles must agree on the outside, but {alone} triangle "
            "edge(s) have no counterpart; fill its holes and run vtkPolyDataNormals with ConsistencyOn"
        )
    return opposite


def cut_surface(points: Floats, triangles: Ints, opposite: Ints, values: Floats, levels: Floats) -> Sections:
    """Cut a closed surface along levels of a scalar.

    Every triangle is visited once per level that crosses it, whatever the number of levels.

    Parameters
    ----------
    points : (n, 3) array
        Positions.
    triangles : (m, 3) int array
        Point ids.
    opposite : (3 m,) int array
        From :func:`opposite_half_edges`.
    values : (n,) array
        The scalar at each point, linear in between.
    levels : (l,) array
        Strictly ascending.

    Returns
    -------
    Sections
        Loops of at least three different points; smaller ones, at isolated extrema, are left out.
    """
    # The number of levels that a point is above, which is also that of the slab it is in.
    slabs = np.searchsorted(levels, values, side="right")
    crossings = _first_crossings(triangles, slabs)
    crossed, starts = _crossed_by(triangles, slabs, crossings, len(levels))
    cut, loop_offsets, level_offsets, loop_of = _traced(
        points, triangles, opposite, values, levels, slabs, crossings, crossed, starts
    )
    n_points, n_loops = len(points), len(loop_offsets) - 1
    parts = _parts(triangles, slabs, crossings, loop_of, n_points, n_loops)
    return Sections(
        points=cut,
        loop_offsets=loop_offsets,
        level_offsets=level_offsets,
        parts_below=parts[n_points : n_points + n_loops],
        parts_above=parts[n_points + n_loops :],
        vertex_parts=parts[:n_points],
    )


@kernel
def _opposites(triangles: Ints, n_points: int) -> Ints:
    """Pair half-edges that join the same two points in opposite directions; -1 where there is no partner."""
    count = np.zeros(n_points + 1, dtype=np.int64)
    corners = triangles.reshape(-1)
    ends = np.empty(len(corners), dtype=np.int64)
    for half_edge in range(len(corners)):
        ends[half_edge] = corners[half_edge - 2 if half_edge % 3 == 2 else half_edge + 1]
        count[min(corners[half_edge], ends[half_edge]) + 1] += 1
    first = np.cumsum(count)
    filled = first.copy()
    bucket = np.empty(len(corners), dtype=np.int64)
    opposite = np.full(len(corners), -1, dtype=np.int64)
    for half_edge in range(len(corners)):
        a, b = corners[half_edge], ends[half_edge]
        low = min(a, b)
        for i in range(first[low], filled[low]):
            other = bucket[i]
            if opposite[other] < 0 and corners[other] == b and ends[other] == a:
                opposite[half_edge], opposite[other] = other, half_edge
                break
        bucket[filled[low]] = half_edge
        filled[low] += 1
    return opposite


@kernel
def _first_crossings(triangles: Ints, slabs: Ints) -> Ints:
    """Return the number of the first crossing of each half-edge that goes up with a level.

    A half-edge from slab i to slab j > i crosses the levels i, i + 1, ... j - 1.
    """
    corners = triangles.reshape(-1)
    result = np.zeros(len(corners) + 1, dtype=np.int64)
    for half_edge in range(len(corners)):
        end = corners[half_edge - 2 if half_edge % 3 == 2 else half_edge + 1]
        result[half_edge + 1] = result[half_edge] + max(slabs[end] - slabs[corners[half_edge]], 0)
    return result


@kernel
def _crossed_by(triangles: Ints, slabs: Ints, crossings: Ints, n_levels: int) -> tuple[Ints, Ints]:
    """Return the half-edges that cross each level upwards, those of level i from starts[i] on."""
    corners = triangles.reshape(-1)
    starts = np.zeros(n_levels + 1, dtype=np.int64)
    for half_edge in range(len(corners)):
        for i in range(crossings[half_edge + 1] - crossings[half_edge]):
            starts[slabs[corners[half_edge]] + i + 1] += 1
    starts = np.cumsum(starts)
    filled = starts.copy()
    crossed = np.empty(crossings[-1], dtype=np.int64)
    for half_edge in range(len(corners)):
        for i in range(crossings[half_edge + 1] - crossings[half_edge]):
            level = slabs[corners[half_edge]] + i
            crossed[filled[level]] = half_edge
            filled[level] += 1
    return crossed, starts


@kernel
def _traced(
    points: Floats,
    triangles: Ints,
    opposite: Ints,
    values: Floats,
    levels: Floats,
    slabs: Ints,
    crossings: Ints,
    crossed: Ints,
    starts: Ints,
) -> tuple[Floats, Ints, Ints, Ints]:
    """Return the points of all loops, their offsets, those of the levels, and the loop of each crossing.

    Through each triangle that a level crosses, a loop enters by the half-edge that goes down and leaves by
    the one that goes up, which is the other side of the next triangle's way in. Crossings of loops that are
    left out get -2: there the surface is not cut.
    """
    corners = triangles.reshape(-1)
    cut = np.empty((len(crossed), 3))
    loop_of = np.full(len(crossed), -1, dtype=np.int64)
    loop_offsets = np.zeros(len(crossed) + 1, dtype=np.int64)
    level_offsets = np.zeros(len(levels) + 1, dtype=np.int64)
    visited = np.empty(len(crossed), dtype=np.int64)
    n_loops, n_cut = 0, 0
    for level in range(len(levels)):
        for i in range(starts[level], starts[level + 1]):
            half_edge, first, n_visited = crossed[i], n_cut, 0
            crossing = crossings[half_edge] + level - slabs[corners[half_edge]]
            while loop_of[crossing] == -1:
                loop_of[crossing] = n_loops
                visited[n_visited] = crossing
                n_visited += 1
                a = corners[half_edge]
                b = corners[half_edge - 2 if half_edge % 3 == 2 else half_edge + 1]
                share = (levels[level] - values[a]) / (values[b] - values[a])
                same = n_cut > first
                for axis in range(3):
                    # Written so that a share of 1 gives the end point to the last bit.
                    cut[n_cut, axis] = (1.0 - share) * points[a, axis] + share * points[b, axis]
                    same = same and cut[n_cut, axis] == cut[n_cut - 1, axis]
                n_cut += 0 if same else 1
                down = opposite[half_edge]
                before = down + 2 if down % 3 == 0 else down - 1
                after = down - 2 if down % 3 == 2 else down + 1
                half_edge = after if slabs[corners[before]] > level else before
                crossing = crossings[half_edge] + level - slabs[corners[half_edge]]
            while n_cut > first + 1 and (cut[n_cut - 1] == cut[first]).all():
                n_cut -= 1
            if n_cut - first >= 3:
                n_loops += 1
                loop_offsets[n_loops] = n_cut
            else:
                n_cut = first
                loop_of[visited[:n_visited]] = -2
        level_offsets[level + 1] = n_loops
    return cut[:n_cut].copy(), loop_offsets[: n_loops + 1].copy(), level_offsets, loop_of


@kernel
def _parts(triangles: Ints, slabs: Ints, crossings: Ints, loop_of: Ints, n_points: int, n_loops: int) -> Ints:
    """Return the part of each point, of each loop's lower side and of each loop's upper side.

    Union and find along every half-edge that goes up or is level, from loop to loop.
    """
    corners = triangles.reshape(-1)
    parent = np.arange(n_points + 2 * n_loops)
    for half_edge in range(len(corners)):
        node = corners[half_edge]
        end = corners[half_edge - 2 if half_edge % 3 == 2 else half_edge + 1]
        if slabs[node] > slabs[end]:
            continue
        for crossing in range(crossings[half_edge], crossings[half_edge + 1]):
            loop = loop_of[crossing]
            if loop >= 0:
                _unite(parent, node, n_points + loop)
                node = n_points + n_loops + loop
        _unite(parent, node, end)
    for node in range(len(parent)):
        parent[node] = _root(parent, node)
    return parent


@kernel
def _root(parent: Ints, node: int) -> int:
    """Return the root of a node, and shorten the way to it by halves."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@kernel
def _unite(parent: Ints, a: int, b: int) -> None:
    """Join the sets of two nodes; the lower root stays, so that the result has no order of calls in it."""
    first, second = _root(parent, a), _root(parent, b)
    if first < second:
        parent[second] = first
    else:
        parent[first] = second
