"""Mean value coordinates in the plane: a point as the weighted mean of a polygon's vertices.

Hormann, Floater 2006, *Mean value coordinates for arbitrary planar polygons*,
doi:10.1145/1183287.1183295.
"""

from __future__ import annotations

import numpy as np

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
