"""Segments of polylines, and the distance to them."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints


def segments(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return both ends (s, 3) of all segments of polylines, points (n, 3) with offsets (k + 1,)."""
    starts = np.setdiff1d(np.arange(len(points) - 1), offsets[1:-1] - 1)
    return points[starts], points[starts + 1]


def segment_distances(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return the distance of each point from its segment, whose ends may be one and the same.

    Parameters
    ----------
    points, a, b : (..., 3) arrays
        Positions, and both ends of the segments, of shapes that broadcast.

    Returns
    -------
    (...) array
        Distances, in the unit of the points.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.segments import segment_distances
    >>> float(segment_distances(np.array([3.0, 4.0, 0.0]), np.zeros(3), np.array([1.0, 0.0, 0.0])).round(3))
    4.472
    """
    along = b - a
    squares = np.einsum("...i,...i->...", along, along)
    dots = np.einsum("...i,...i->...", points - a, along)
    t = np.clip(np.divide(dots, squares, out=np.zeros_like(dots), where=squares > 0), 0.0, 1.0)
    distances: Floats = np.linalg.norm(points - a - t[..., None] * along, axis=-1)
    return distances
