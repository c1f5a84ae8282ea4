"""Arithmetic on polylines stored one after the other: points (n, 3) and offsets (k + 1,)."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.types import Floats, Ints

#: Cosine of the least turn between segments that is a corner and not part of a curve.
CORNER = 0.5 * 3.0**0.5


@array_kernel
def smooth_polylines(points: Floats, offsets: Ints, k: float, iterations: int) -> Floats:
    """Return polylines smoothed by p'_i = (p_{i-1} + k p_i + p_{i+1}) / (k + 2), end points kept.

    Kohout et al. 2012, *Muscle Fibres Modelling*, section 3.4. All points of a pass are read before
    any is written.

    Parameters
    ----------
    points, offsets : (n, 3) array, (m + 1,) int array
        Positions [mm]; first point of each line, and n.
    k : float
        Weight of the middle point, >= 0.
    iterations : int
        Number of passes, >= 0.

    Returns
    -------
    (n, 3) array
        New positions [mm].
    """
    result = points.copy()
    for line in range(len(offsets) - 1):
        first, last = offsets[line], offsets[line + 1] - 1
        for _ in range(iterations):
            for axis in range(3):
                before = result[first, axis]
                for i in range(first + 1, last):
                    here = result[i, axis]
                    result[i, axis] = (before + k * here + result[i + 1, axis]) / (k + 2.0)
                    before = here
    return result


@kernel
def distance_between(points: Floats, i: int, j: int) -> float:
    """Return the distance of two of some points (n, 3)."""
    x, y, z = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
    return float(np.sqrt(x * x + y * y + z * z))


@kernel
def turn_at(points: Floats, i: int) -> tuple[float, float]:
    """Return sine and cosine, times both lengths, of the angle between a point's segments."""
    ax, ay, az = (
        points[i, 0] - points[i - 1, 0],
        points[i, 1] - points[i - 1, 1],
        points[i, 2] - points[i - 1, 2],
    )
    bx, by, bz = (
        points[i + 1, 0] - points[i, 0],
        points[i + 1, 1] - points[i, 1],
        points[i + 1, 2] - points[i, 2],
    )
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return np.sqrt(x * x + y * y + z * z), ax * bx + ay * by + az * bz


@array_kernel
def even_arcs(points: Floats, count: int) -> Floats:
    """Return `count` arc lengths at equal distances along a polyline (n, 3), from 0 to its whole length."""
    length = 0.0
    for i in range(1, len(points)):
        length += distance_between(points, i, i - 1)
    arcs = np.empty(count)
    for i in range(count):
        arcs[i] = i * (length / (count - 1))
    arcs[-1] = length
    return arcs


@array_kernel
def resample_polyline(points: Floats, arcs: Floats) -> Floats:
    """Return the points of one polyline at given arc lengths.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm], n >= 1.
    arcs : (k,) array
        Ascending arc lengths from the first point [mm]; those outside of the polyline give its ends.

    Returns
    -------
    (k, 3) array
        Positions [mm].
    """
    result = np.empty((len(arcs), 3))
    segment, start, length = 0, 0.0, 0.0
    if len(points) > 1:
        length = distance_between(points, 1, 0)
    for i in range(len(arcs)):
        while segment < len(points) - 2 and arcs[i] > start + length:
            segment += 1
            start += length
            length = distance_between(points, segment + 1, segment)
        share = 0.0 if length == 0.0 else min(max((arcs[i] - start) / length, 0.0), 1.0)
        after = min(segment + 1, len(points) - 1)
        for axis in range(3):
            # Written so that share 0 and 1 give the end points to the last bit.
            result[i, axis] = (1.0 - share) * points[segment, axis] + share * points[after, axis]
    return result


@array_kernel
def evenly_spaced(points: Floats, count: int) -> Floats:
    """Return a polyline of `count` points at equal distances along another, which has the same ends.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    count : int
        Number of points, >= 2.

    Returns
    -------
    (count, 3) array
        Positions [mm].
    """
    spaced = resample_polyline(points, even_arcs(points, count))
    for axis in range(3):
        spaced[0, axis], spaced[-1, axis] = points[0, axis], points[-1, axis]
    return spaced


@array_kernel
def end_directions(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return the unit vectors in which polylines leave their first points and arrive at their last ones.

    That is the tangent of the parabola through the end and the two points next to it, by arc length: a
    segment is a chord, which differs from the tangent at its end by half the angle that a curve turns by
    along it. The sharper the turn between the two segments, the less it counts; one of 30 degrees or more is
    a corner, beyond which the line has the direction of its last segment.

    Parameters
    ----------
    points, offsets : (n, 3) array, (m + 1,) int array
        Positions; first point of each line, and n.

    Returns
    -------
    starts, ends : (m, 3) arrays
        Unit vectors, by the segments with a length; 0 where a line has none.
    """
    n_lines = len(offsets) - 1
    starts, ends = np.zeros((n_lines, 3)), np.zeros((n_lines, 3))
    for line in range(n_lines):
        first, last = offsets[line], offsets[line + 1] - 1
        _arrival(points, last, first, starts[line])
        _arrival(points, first, last, ends[line])
        for axis in range(3):
            starts[line, axis] = -starts[line, axis]
    return starts, ends


@array_kernel
def _arrival(points: Floats, start: int, end: int, tangent: Floats) -> None:
    """Write the unit vector in which a line arrives at the point `end`, coming from `start`."""
    step = 1 if end >= start else -1
    found = 0
    lengths, ways = np.zeros(2), np.zeros((2, 3))
    i = end
    while i != start and found < 2:
        length = distance_between(points, i, i - step)
        if length > 0.0:
            lengths[found] = length
            for axis in range(3):
                ways[found, axis] = (points[i, axis] - points[i - step, axis]) / length
            found += 1
        i -= step
    smooth = 0.0
    if found == 2:
        cosine = ways[0, 0] * ways[1, 0] + ways[0, 1] * ways[1, 1] + ways[0, 2] * ways[1, 2]
        smooth = max((cosine - CORNER) / (1.0 - CORNER), 0.0)
    square = 0.0
    for axis in range(3):
        tangent[axis] = ways[0, axis]
        if found == 2:
            tangent[axis] += smooth * (ways[0, axis] - ways[1, axis]) * lengths[0] / (lengths[0] + lengths[1])
        square += tangent[axis] * tangent[axis]
    if square > 0.0:
        for axis in range(3):
            tangent[axis] /= np.sqrt(square)
