"""Segments of polylines: the distance to them, the nearest one, and its direction."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats, Ints

#: Distances that differ by less than this part of half the longest segment are equal.
EQUALLY_NEAR = 1e-7

#: Segments that the search for the nearest one looks at first, around each point.
FIRST_CANDIDATES = 8


def segments(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return both ends (s, 3) of all segments of polylines, points (n, 3) with offsets (k + 1,)."""
    starts = np.setdiff1d(np.arange(len(points) - 1), offsets[1:-1] - 1)
    return points[starts], points[starts + 1]


def proper_segments(points: Floats, offsets: Ints) -> tuple[Floats, Floats, Floats]:
    """Return both ends (s, 3) of the segments that have a length, and their lengths (s,).

    Raises
    ------
    ValueError
        If no fibre has a length.
    """
    a, b = segments(points, offsets)
    lengths = np.linalg.norm(b - a, axis=1)
    proper = lengths > 0.0
    if not proper.any():
        raise InputError("", "no fibre has a length, so that fibres have no direction")
    return a[proper], b[proper], lengths[proper]


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


def fibre_directions_at(queries: Floats, fibre_points: Floats, offsets: Ints) -> Floats:
    """Return the direction of the nearest fibre segment.

    Parameters
    ----------
    queries : (q, 3) array
        Positions [mm].
    fibre_points : (n, 3) array
        Points of all fibres, one after the other [mm].
    offsets : (k + 1,) int array
        First point of each fibre, and n.

    Returns
    -------
    (q, 3) array
        Unit directions.

    Raises
    ------
    ValueError
        If no fibre has a length.
    """
    a, b, lengths = proper_segments(fibre_points, offsets)
    nearest = nearest_segments(queries, a, b)
    directions: Floats = (b[nearest] - a[nearest]) / lengths[nearest, None]
    return directions


def nearest_segments(queries: Floats, a: Floats, b: Floats) -> Ints:
    """Return the segment nearest to each point, exactly; of equally near ones the first.

    Symmetric muscles have edges midway between two fibres, and consecutive segments are equally near to
    what is nearest to the point they share. Rounding must not choose there: a muscle that is moved rigidly
    would not deform as before.

    Candidates come by the distance d of their midpoints. A segment of length s is no nearer than
    d - s / 2; so once the farthest candidate is farther than the best distance found and half the longest
    segment, no other can win. Points where that does not hold yet look at twice as many candidates.

    Parameters
    ----------
    queries : (q, 3) array
        Positions.
    a, b : (s, 3) arrays
        Ends of the segments, s >= 1.

    Returns
    -------
    (q,) int array
        Indices into the segments.
    """
    tree = cKDTree((a + b) / 2.0)
    reach = float(np.linalg.norm(b - a, axis=1).max()) / 2.0
    nearest = np.zeros(len(queries), dtype=np.int64)
    open_ = np.arange(len(queries))
    count = FIRST_CANDIDATES
    while len(open_):
        count = min(count, len(a))
        far, candidates = tree.query(queries[open_], k=[*range(1, count + 1)])
        distances = segment_distances(queries[open_][:, None], a[candidates], b[candidates])
        bound = distances.min(axis=1) + EQUALLY_NEAR * reach
        nearest[open_] = np.where(distances <= bound[:, None], candidates, len(a)).min(axis=1)
        if count == len(a):
            break
        open_ = open_[far[:, -1] - reach <= bound]
        count *= 2
    return nearest
