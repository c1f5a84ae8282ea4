"""Maps of the template's rectangle to a section of the muscle, by mean value coordinates in the plane.

Hormann, Floater 2006, *Mean value coordinates for arbitrary planar polygons*,
doi:10.1145/1183287.1183295.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.morphing.correspondence import (
    N_PLACES,
    cornered_loop,
    loop_lengths,
    refined_loop,
    rolled_loop,
    split_chain,
    subdivided_rectangle,
)
from vtkmuscle.core.types import Floats


def mean_value_weights(polygon: Floats, points: Floats) -> Floats:
    """Return the mean value coordinates of points in a polygon, (m, n).

    w_i = (tan(a_{i-1} / 2) + tan(a_i / 2)) / r_i, divided by their sum, where r_i is the distance from the
    point to vertex i and a_i the signed angle under which it sees the edge from vertex i to the next.
    tan(a / 2) is sin a / (1 + cos a) for acute and (1 - cos a) / sin a for obtuse angles, neither of which
    cancels. On an edge, where one tangent is infinite, the coordinates are those of linear interpolation.

    Parameters
    ----------
    polygon : (n, 2) array
        Vertices in order, convex or not, n >= 3; equal neighbours are allowed.
    points : (m, 2) array
        Points of the plane.

    Returns
    -------
    (m, n) array
        Rows of sum 1; their products with the vertices are the points.
    """
    x, y = polygon.T[:, None] - points.T[:, :, None]
    next_x, next_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    lengths = np.sqrt(x * x + y * y)
    products = lengths * np.roll(lengths, -1, axis=1)
    sines, cosines = x * next_y - y * next_x, x * next_x + y * next_y
    with np.errstate(divide="ignore", invalid="ignore"):  # on the polygon: replaced below
        acute = cosines >= 0.0
        tangents = np.where(acute, sines, products - cosines) / np.where(acute, products + cosines, sines)
        weights: Floats = (np.roll(tangents, 1, axis=1) + tangents) / lengths
        weights /= weights.sum(axis=1, keepdims=True)
    on_edge = (cosines < 0.0) & (np.abs(sines) <= 1e-15 * products)
    for row in np.flatnonzero(on_edge.any(axis=1) | (lengths == 0.0).any(axis=1)):
        weights[row] = 0.0
        if lengths[row].min() == 0.0:
            weights[row, lengths[row].argmin()] = 1.0
            continue
        start = int(on_edge[row].argmax())
        ends = [start, (start + 1) % len(polygon)]
        weights[row, ends] = lengths[row, ends[::-1]] / lengths[row, ends].sum()
    return weights


@dataclass(frozen=True, eq=False)
class SectionMap:
    """A map of the template's rectangle to a section of the muscle.

    Attributes
    ----------
    ring, rectangle : (n, k) array, (n, 2) array
        The section's boundary, and the points of the rectangle that go with it [mm].
    split_error : float
        Root of the sum of the four parts' squared errors, as a part of the rectangle's perimeter.
    """

    ring: Floats
    rectangle: Floats
    split_error: float

    def places(self, points: Floats) -> Floats:
        """Return where points (m, 2) of the rectangle are in the section, (m, k) [mm].

        f' = sum_i w_i(f) p_i, with w_i the mean value coordinates of f in the subdivided rectangle and p_i
        the vertices of the section that go with the rectangle's. It may lie outside of a concave section.
        """
        return mean_value_weights(self.rectangle, points) @ self.ring


def section_map(loop: Floats, target: Floats, sides: Floats, *, as_printed: bool) -> SectionMap:
    """Return the map of the template's rectangle to a section of the muscle.

    Parameters
    ----------
    loop : (n, k) array
        The section's boundary, counterclockwise, n >= 3; k is 2, or 3 for a loop in space, of which x and y
        are a view [mm].
    target : (k,) array
        The correspondence starts where the section is nearest to this [mm].
    sides : (2,) array or longer
        Sides of the rectangle [mm].
    as_printed : bool
        Whether it starts at the vertex nearest to the target, and is split at vertices, as in the paper.
        Otherwise vertices are added at both.
    """
    width, depth = float(sides[0]), float(sides[1])
    if as_printed:  # a triangle has too few vertices for four sides, and becomes a hexagon
        ring = rolled_loop(refined_loop(loop, 1 if len(loop) > 3 else 6), target)
    else:
        ring = cornered_loop(refined_loop(loop, N_PLACES), target, width, depth)
    lengths = loop_lengths(ring)
    splits, error = split_chain(lengths, width, depth)
    rectangle = subdivided_rectangle(lengths, splits, width, depth)
    return SectionMap(ring, rectangle, float(np.sqrt(error)) / (2.0 * (width + depth)))


def count_outside(loop: Floats, points: Floats) -> int:
    """Return the number of points (m, 2) outside of a closed loop (n, 2), by the even-odd rule."""
    x, y = points[:, 0, None], points[:, 1, None]
    (bx, by), (ax, ay) = loop[:, :2].T, np.roll(loop[:, :2], 1, axis=0).T
    rises = np.where(by == ay, 1.0, by - ay)
    crossed = ((ay > y) != (by > y)) & ((bx - ax) * (y - ay) / rises + ax > x)
    return int((crossed.sum(axis=1) % 2 == 0).sum())
