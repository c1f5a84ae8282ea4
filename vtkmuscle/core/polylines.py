"""Arithmetic on polylines stored one after the other: points (n, 3) and offsets (k + 1,)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def smooth_polylines(points: Floats, offsets: Ints, k: float, iterations: int) -> Floats:
    """Return polylines smoothed by p'_i = (p_{i-1} + k p_i + p_{i+1}) / (k + 2), end points kept.

    Kohout et al. 2012, *Muscle Fibres Modelling*, section 3.4. All points of a pass are read before
    any is written.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    offsets : (m + 1,) int array
        First point of each line, and n.
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


def polyline_lengths(points: Floats, offsets: Ints) -> Floats:
    """Return the length of each polyline, (k,), in the unit of the points."""
    steps = np.zeros(len(points))
    steps[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    steps[offsets[:-1]] = 0.0  # the step from one line to the next belongs to neither
    lengths: Floats = np.add.reduceat(steps, offsets[:-1])
    return lengths


@kernel
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
        length = np.sqrt(((points[1] - points[0]) ** 2).sum())
    for i in range(len(arcs)):
        while segment < len(points) - 2 and arcs[i] > start + length:
            segment += 1
            start += length
            length = np.sqrt(((points[segment + 1] - points[segment]) ** 2).sum())
        share = 0.0 if length == 0.0 else min(max((arcs[i] - start) / length, 0.0), 1.0)
        after = min(segment + 1, len(points) - 1)
        for axis in range(3):
            # Written so that share 0 and 1 give the end points to the last bit.
            result[i, axis] = (1.0 - share) * points[segment, axis] + share * points[after, axis]
    return result


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
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    spaced: Floats = resample_polyline(points, np.linspace(0.0, length, count))
    spaced[0], spaced[-1] = points[0], points[-1]
    return spaced


@kernel
def end_directions(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return the unit vectors in which polylines leave their first points and arrive at their last ones.

    Parameters
    ----------
    points : (n, 3) array
        Positions.
    offsets : (k + 1,) int array
        First point of each line, and n.

    Returns
    -------
    starts, ends : (k, 3) arrays
        Unit vectors, taken from the first segment with a length; 0 where a line has none.
    """
    n_lines = len(offsets) - 1
    starts, ends = np.zeros((n_lines, 3)), np.zeros((n_lines, 3))
    for line in range(n_lines):
        first, last = offsets[line], offsets[line + 1] - 1
        for i in range(first, last):
            length = np.sqrt(((points[i + 1] - points[i]) ** 2).sum())
            if length > 0.0:
                starts[line] = (points[i + 1] - points[i]) / length
                break
        for i in range(last, first, -1):
            length = np.sqrt(((points[i] - points[i - 1]) ** 2).sum())
            if length > 0.0:
                ends[line] = (points[i] - points[i - 1]) / length
                break
    return starts, ends
