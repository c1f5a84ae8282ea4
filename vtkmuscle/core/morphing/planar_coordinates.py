"""Mean value coordinates in the plane: a point as the weighted mean of a polygon's vertices.

Hormann, Floater 2006, *Mean value coordinates for arbitrary planar polygons*,
doi:10.1145/1183287.1183295.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Floats


@kernel
def mean_value_weights(polygon: Floats, x: float, y: float, weights: Floats) -> None:
    """Compute the mean value coordinates of one point.

    w_i = (tan(a_{i-1} / 2) + tan(a_i / 2)) / r_i, divided by their sum, where r_i is the distance from the
    point to vertex i and a_i the signed angle under which it sees the edge from vertex i to the next.
    tan(a / 2) is sin a / (1 + cos a) for acute and (1 - cos a) / sin a for obtuse angles, neither of which
    cancels. On an edge, where one tangent is infinite, the coordinates are those of linear interpolation.

    Parameters
    ----------
    polygon : (n, 2) array
        Vertices in order, convex or not, n >= 3; equal neighbours are allowed.
    x, y : float
        The point, anywhere.
    weights : (n,) array
        Receives the coordinates: their sum is 1, and sum w_i p_i is the point.
    """
    n = len(polygon)
    weights[:] = 0.0
    bx, by = polygon[n - 1, 0] - x, polygon[n - 1, 1] - y
    b_length = np.sqrt(bx * bx + by * by)
    total = 0.0
    for i in range(n):
        before = n - 1 if i == 0 else i - 1
        ax, ay, a_length = bx, by, b_length
        bx, by = polygon[i, 0] - x, polygon[i, 1] - y
        b_length = np.sqrt(bx * bx + by * by)
        if b_length == 0.0:
            weights[:] = 0.0
            weights[i] = 1.0
            return
        sine, cosine = ax * by - ay * bx, ax * bx + ay * by
        product = a_length * b_length
        if cosine >= 0.0:
            tangent = sine / (product + cosine)
        elif abs(sine) > 1e-15 * product:
            tangent = (product - cosine) / sine
        else:
            weights[:] = 0.0
            weights[before] = b_length / (a_length + b_length)
            weights[i] = a_length / (a_length + b_length)
            return
        weights[before] += tangent / a_length
        weights[i] += tangent / b_length
        total += tangent / a_length + tangent / b_length
    for i in range(n):
        weights[i] /= total
