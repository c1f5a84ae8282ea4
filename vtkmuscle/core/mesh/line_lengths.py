"""Lengths of polylines, by NumPy alone: what only draws loads no compiled kernels for them."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints


def polyline_lengths(points: Floats, offsets: Ints) -> Floats:
    """Return the length of each polyline, (k,), in the unit of the points (n, 3).

    The offsets (k + 1,) are the first point of each line, and n.
    """
    steps = np.zeros(len(points))
    steps[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    steps[offsets[:-1]] = 0.0  # the step from one line to the next belongs to neither
    lengths: Floats = np.add.reduceat(steps, offsets[:-1])
    return lengths
