"""Maps of the template's rectangle to a section of the muscle, flat or in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.morphing.correspondence import (
    N_PLACES,
    cornered_loop,
    loop_lengths,
    refined_loop,
    rolled_loop,
    split_chain,
    subdivided_rectangle,
)
from vtkmuscle.core.morphing.planar_coordinates import mean_value_weights
from vtkmuscle.core.types import Floats

#: 1 + cos a below which a point that sees an edge under the angle a counts as close to it.
LEAST_OPENING = 1e-3


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
        return mean_value_map(self.rectangle, self.ring, points)


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
    if as_printed:  # a triangle has too few vertices for four sides, and becomes a hexagon
        ring = rolled_loop(refined_loop(loop, 1 if len(loop) > 3 else 6), target)
    else:
        ring = cornered_loop(refined_loop(loop, N_PLACES), target, float(sides[0]), float(sides[1]))
    return SectionMap(ring, *_split(ring, float(sides[0]), float(sides[1])))


@array_kernel
def _split(ring: Floats, width: float, depth: float) -> tuple[Floats, float]:
    """Return the point of the rectangle for each vertex of a loop, and the split's error."""
    lengths = loop_lengths(ring)
    splits, error = split_chain(lengths, width, depth)
    rectangle = subdivided_rectangle(lengths, splits, width, depth)
    return rectangle, np.sqrt(error) / (2.0 * (width + depth))


@array_kernel
def mean_value_map(polygon: Floats, images: Floats, points: Floats) -> Floats:
    """Return sum_i w_i(p) q_i, the mean value coordinates w_i of points applied to the polygon's images.

    The coordinates are those of :func:`vtkmuscle.core.morphing.planar_coordinates.mean_value_weights`, which
    is asked for points on the polygon or close to it; for others a simpler form allows for several vertices
    at a time.

    Parameters
    ----------
    polygon : (n, 2) array
        Vertices in order.
    images : (n, k) array
        Where they go.
    points : (m, 2) array
        Points of the plane.

    Returns
    -------
    (m, k) array
        Their images.
    """
    n = len(polygon)
    # One vertex more, so that the inner loops need no modulo.
    xs, ys = np.append(polygon[:, 0], polygon[0, 0]), np.append(polygon[:, 1], polygon[0, 1])
    dx, dy, r, tangents = np.empty(n + 1), np.empty(n + 1), np.empty(n + 1), np.empty(n + 1)
    weights, exact = np.empty(n), np.empty(n)
    result = np.zeros((len(points), images.shape[1]))
    for p in range(len(points)):
        x, y = points[p, 0], points[p, 1]
        for i in range(n + 1):
            dx[i], dy[i] = xs[i] - x, ys[i] - y
            r[i] = np.sqrt(dx[i] * dx[i] + dy[i] * dy[i])
        close = 0
        for i in range(n):
            product = r[i] * r[i + 1]
            opening = product + dx[i] * dx[i + 1] + dy[i] * dy[i + 1]
            tangents[i + 1] = (dx[i] * dy[i + 1] - dy[i] * dx[i + 1]) / opening
            # 1 + cos a: near 0 where the point is on an edge, 0 / 0 at a vertex.
            close += 0 if opening > LEAST_OPENING * product else 1
        tangents[0] = tangents[n]
        if close == 0:
            total = 0.0
            for i in range(n):
                weights[i] = (tangents[i] + tangents[i + 1]) / r[i]
            for i in range(n):
                total += weights[i]
            for i in range(n):
                weights[i] /= total
        else:
            mean_value_weights(polygon, x, y, exact)
            weights[:] = exact
        for i in range(n):
            for axis in range(images.shape[1]):
                result[p, axis] += weights[i] * images[i, axis]
    return result


@kernel
def count_outside(loop: Floats, points: Floats) -> int:
    """Return the number of points (m, 2) outside of a closed loop (n, 2), by the even-odd rule."""
    outside = 0
    for p in range(len(points)):
        x, y, inside = points[p, 0], points[p, 1], False
        bx, by = loop[-1, 0], loop[-1, 1]
        for i in range(len(loop)):
            ax, ay = bx, by
            bx, by = loop[i, 0], loop[i, 1]
            if (ay > y) != (by > y) and (bx - ax) * (y - ay) / (by - ay) + ax > x:
                inside = not inside
        outside += not inside
    return outside
