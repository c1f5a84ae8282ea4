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
