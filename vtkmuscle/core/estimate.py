"""Errors of fibre numbers that follow from one run: of straight segments, and of few fibres."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats, Ints


def segment_errors(points: Floats, offsets: Ints) -> Floats:
    """Bound by how much polylines are shorter than smooth curves, (k,) [mm].

    The length by all points (n, 3), less the length by every second point and the last. Chords converge with
    the second order, so that the difference is three times the error (Richardson).
    """
    counts = np.diff(offsets)
    position = np.arange(len(points)) - np.repeat(offsets[:-1], counts)
    kept = (position % 2 == 0) | (position == np.repeat(counts, counts) - 1)
    firsts = np.concatenate([[0], np.cumsum(kept)])[offsets]
    return np.asarray(polyline_lengths(points, offsets) - polyline_lengths(points[kept], firsts))


def sampling_errors(values: Floats) -> Floats:
    """Return the standard error of means over the last axis, s / sqrt(k); NaN for a single value."""
    count = values.shape[-1]
    if count < 2:
        return np.full(values.shape[:-1], np.nan)
    return np.asarray(values.std(axis=-1, ddof=1) / np.sqrt(count))


def root_mean_square(values: Floats) -> float | None:
    """Return the root mean square of the values that are not NaN, None where all are."""
    numbers = values[~np.isnan(values)]
    return float(np.sqrt((numbers**2).mean())) if len(numbers) else None
