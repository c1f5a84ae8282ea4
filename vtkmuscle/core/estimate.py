"""Errors of fibre numbers from a single run.

Errors of straight segments, and of few fibres.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats, Ints


def segment_errors(points: Floats, offsets: Ints) -> Floats:
    """Bound the shortening of polylines against curves (k,) [mm].

    The bound is the length by all points (n, 3), less the length by every second point and the last. Chords
    of smooth curves converge with the second order, so the difference is three times the error (Richardson).
    """
    counts = np.diff(offsets)
    position = np.arange(len(points)) - np.repeat(offsets[:-1], counts)
    kept = (position % 2 == 0) | (position == np.repeat(counts, counts) - 1)
    firsts = np.concatenate([[0], np.cumsum(kept)])[offsets]
    return np.asarray(polyline_lengths(points, offsets) - polyline_lengths(points[kept], firsts))


def sampling_errors(values: Floats) -> Floats:
    """Return the standard error of means, s / sqrt(k).

    The means are over the last axis; NaN for a single value.
    """
    count = values.shape[-1]
    if count < 2:
        return np.full(values.shape[:-1], np.nan)
    return np.asarray(values.std(axis=-1, ddof=1) / np.sqrt(count))


def root_mean_square(values: Floats) -> float | None:
    """Return the root mean square without NaN.

    None if all values are NaN.
    """
    numbers = values[~np.isnan(values)]
    return float(np.sqrt((numbers**2).mean())) if len(numbers) else None
