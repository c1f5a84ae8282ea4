"""Which points are inside of a closed surface, for few points and a surface that is new each time."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.bins import sorted_into_bins
from vtkmuscle.core.types import Bools, Floats, Ints

#: Triangles per cell of the grid, about as many.
PER_CELL = 4.0


def points_inside(queries: Floats, points: Floats, triangles: Ints) -> Bools:
    """Return which points are inside of a closed surface, by the number of triangles beyond them.

    Rays run along the axis that the points are least spread along: across a long muscle, where few are in
    line. Points are sorted into a grid across it, and each triangle is tried on those in the cells that it is
    in. Seen along the rays, of two triangles that share an edge exactly one has a place on it: no ray slips
    through.

    Parameters
    ----------
    queries : (k, 3) array
        Points.
    points : (n, 3) array
        Points of the surface.
    triangles : (m, 3) int array
        Its triangles; closed, whichever way they face.

    Returns
    -------
    (k,) bool array
        True inside; on the surface either.
    """
    above = np.zeros(len(queries), dtype=np.bool_)
    if len(queries):
        along = int(np.ptp(queries, axis=0).argmin())
        order = [(along + 1) % 3, (along + 2) % 3, along]
        side = max(int(np.sqrt(len(triangles) / PER_CELL)), 1)
        turned = np.ascontiguousarray(queries[:, order])
        _count(turned, np.ascontiguousarray(points[:, order]), triangles, *_grid(turned, side), side, above)
    return above


def _grid(queries: Floats, side: int) -> tuple[Ints, Ints, Floats]:
    """Return points by cells of a grid across z: their numbers, where each cell begins, and its frame."""
    low = queries[:, :2].min(axis=0)
    size = np.maximum(queries[:, :2].max(axis=0) - low, 1e-300) * (1.0 + 1e-9)
    columns, lines = np.minimum((queries[:, :2] - low) / size * side, side - 1.0).astype(np.int64).T
    order, starts = sorted_into_bins(lines * side + columns, side * side)
    return order, starts, np.concatenate([low, size])


@kernel
def _count(
    queries: Floats,
    points: Floats,
    triangles: Ints,
    order: Ints,
    starts: Ints,
    frame: Floats,
    side: int,
    above: Bools,
) -> None:
    """Turn over ``above`` (k,) of each point for each triangle above it."""
    low_x, low_y, wide, deep = frame[0], frame[1], frame[2], frame[3]
    for t in range(len(triangles)):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        first = (min(a[0], b[0], c[0]) - low_x) / wide * side
        last = (max(a[0], b[0], c[0]) - low_x) / wide * side
        bottom = (min(a[1], b[1], c[1]) - low_y) / deep * side
        top = (max(a[1], b[1], c[1]) - low_y) / deep * side
        if last < 0.0 or first > side or top < 0.0 or bottom > side:
            continue
        from_cell, to_cell = int(max(first, 0.0)), int(min(last, side - 1.0))
        for line in range(int(max(bottom, 0.0)), int(min(top, side - 1.0)) + 1):
            for i in range(starts[line * side + from_cell], starts[line * side + to_cell + 1]):
                q = order[i]
                if _is_below(queries[q], a, b, c):
                    above[q] = not above[q]


@kernel
def _is_below(query: Floats, a: Floats, b: Floats, c: Floats) -> bool:
    """Return True where a triangle is above a point, seen along z; an edge belongs to one of its sides."""
    x, y = query[0], query[1]
    within = _crosses(x, y, a, b) != _crosses(x, y, b, c)
    if within == _crosses(x, y, c, a):
        return False
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    area = ux * vy - uy * vx
    if area == 0.0:
        return False
    one = ((x - a[0]) * vy - (y - a[1]) * vx) / area
    other = (ux * (y - a[1]) - uy * (x - a[0])) / area
    return bool(a[2] + one * uz + other * vz > query[2])


@kernel
def _crosses(x: float, y: float, a: Floats, b: Floats) -> bool:
    """Return True where an edge crosses the ray from a place towards greater x, whichever way it runs."""
    if (a[1] > y) == (b[1] > y):
        return False
    # From the lower end on, so that the edge's other triangle gets the same answer to the last digit.
    low, high = (b, a) if a[1] > b[1] else (a, b)
    return bool(low[0] + (y - low[1]) / (high[1] - low[1]) * (high[0] - low[0]) > x)
