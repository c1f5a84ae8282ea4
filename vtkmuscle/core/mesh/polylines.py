"""Polylines stored one after the other, points (n, 3) and offsets (k + 1,): lengths, positions, segments."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.types import Floats, Ints


def polyline_lengths(points: Floats, offsets: Ints) -> Floats:
    """Return the length of each polyline, (k,), in the unit of the points (n, 3).

    The offsets (k + 1,) are the first point of each line, and n.
    """
    return np.add.reduceat(segment_lengths(points, offsets)[0], offsets[:-1])


#: Cosine of the least turn between segments that counts as a corner, not as part of a curve.
CORNER = 0.5 * 3.0**0.5


def smooth_polylines(points: Floats, offsets: Ints, k: float, iterations: int) -> Floats:
    """Return polylines smoothed by p'_i = (p_{i-1} + k p_i + p_{i+1}) / (k + 2), end points kept.

    Kohout et al. 2012, *Muscle Fibres Modelling*, section 3.4. All points of a pass are read before any is
    written. The points (n, 3) may be rows of other values; the weight k is >= 0.
    """
    result, i = points.copy(), inner_points(offsets)
    for _ in range(iterations):
        result[i] = (result[i - 1] + k * result[i] + result[i + 1]) / (k + 2.0)
    return result


def inner_points(offsets: Ints) -> Ints:
    """Return the numbers of the points of polylines that are no ends."""
    inner = np.ones(offsets[-1], dtype=np.bool_)
    inner[offsets[:-1]] = inner[offsets[1:] - 1] = False
    return np.flatnonzero(inner)


def points_at_arcs(points: Floats, offsets: Ints, arcs: Floats) -> Floats:
    """Return the points (m, k, 3) of polylines at arc lengths (m, k) from the first point of each line.

    A line has at least one point; arc lengths beyond a line give its ends.
    """
    lengths, along = segment_lengths(points, offsets)
    firsts, wanted = offsets[:-1, None], arcs + along[offsets[:-1], None]
    after = np.searchsorted(along, wanted).clip(firsts + 1, offsets[1:, None] - 1)
    before = np.maximum(after - 1, firsts)
    whole = lengths[after]
    share = np.divide(wanted - along[before], whole, out=np.zeros(arcs.shape), where=whole > 0.0)
    share = share.clip(0.0, 1.0)[..., None]
    # Written so that share 0 and 1 give the end points to the last bit.
    places: Floats = (1.0 - share) * points[before] + share * points[after]
    return places


def segment_lengths(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return the length of the segment to each point of polylines (n,), 0 to a first one, and their sums."""
    lengths = np.zeros(len(points))
    lengths[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    lengths[offsets[:-1]] = 0.0  # the step from one line to the next belongs to neither
    return lengths, np.cumsum(lengths)


def evenly_spaced(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return `count` >= 2 points at equal distances along each polyline (m, count, 3), its ends kept."""
    along = segment_lengths(points, offsets)[1]
    lengths = along[offsets[1:] - 1] - along[offsets[:-1]]
    spaced = points_at_arcs(points, offsets, np.linspace(0.0, lengths, count, axis=1))
    spaced[:, 0], spaced[:, -1] = points[offsets[:-1]], points[offsets[1:] - 1]
    return spaced


def end_directions(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return the unit vectors (m, 3) in which polylines leave their first and arrive at their last points.

    That is the tangent of the parabola through the end and the two points next to it, by arc length: a
    segment is a chord, which differs from the tangent at its end by half the angle of its turn. The sharper
    the turn between the two segments, the less it counts; one of 30 degrees or more is a corner, beyond which
    the line has the direction of its last segment. Segments without a length do not count; a line without any
    gives 0.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    lengths[offsets[1:-1] - 1] = 0.0  # from one line to the next
    proper = np.flatnonzero(lengths)
    ways, lengths = steps[proper] / lengths[proper, None], lengths[proper]
    line = np.searchsorted(offsets, proper, side="right") - 1
    tangents = np.zeros((2, len(offsets) - 1, 3))
    for tangent, inward in zip(tangents, (1, -1), strict=True):
        own, first = np.unique(line[::inward], return_index=True)
        one = first if inward == 1 else len(line) - 1 - first
        two = np.clip(one + inward, 0, len(line) - 1)
        cosines = (ways[one] * ways[two]).sum(axis=1)
        smooth = np.where(line[two] == own, np.maximum((cosines - CORNER) / (1.0 - CORNER), 0.0), 0.0)
        smooth *= lengths[one] / (lengths[one] + lengths[two])
        tangent[own] = ways[one] + smooth[:, None] * (ways[one] - ways[two])
    return unit_vectors(tangents[0]), unit_vectors(tangents[1])


def curve_segments(curves: Floats) -> tuple[Floats, Floats, Floats]:
    """Return start arcs, lengths and unit directions of the segments of curves (..., n, 3)."""
    steps = np.diff(curves, axis=-2)
    lengths = np.linalg.norm(steps, axis=-1)
    return np.cumsum(lengths, axis=-1) - lengths, lengths, unit_vectors(steps)


#: Distances that differ by less than this part of half the longest segment count as equal.
EQUALLY_NEAR = 1e-7

#: Pieces of segments around each point that the search for the nearest one begins with, and pieces of the
#: longest segment.
FIRST_CANDIDATES, PIECES = 8, 4


def segments(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return both ends (s, 3) of all segments of polylines, points (n, 3) with offsets (k + 1,)."""
    starts = np.setdiff1d(np.arange(len(points) - 1), offsets[1:-1] - 1)
    return points[starts], points[starts + 1]


def proper_segments(points: Floats, offsets: Ints) -> tuple[Floats, Floats, Floats]:
    """Return both ends (s, 3) of the segments that have a length, and their lengths (s,); at least one."""
    a, b = segments(points, offsets)
    lengths = np.linalg.norm(b - a, axis=1)
    proper = lengths > 0.0
    if not proper.any():
        raise InputError("", "no fibre has a length, so that fibres have no direction")
    return a[proper], b[proper], lengths[proper]


def segment_distances(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return the distance of each point from its segment a to b, which may have no length, (...)."""
    along = b - a
    squares = np.einsum("...i,...i->...", along, along)
    dots = np.einsum("...i,...i->...", points - a, along)
    t = np.clip(np.divide(dots, squares, out=np.zeros_like(dots), where=squares > 0), 0.0, 1.0)
    distances: Floats = np.linalg.norm(points - a - t[..., None] * along, axis=-1)
    return distances


def fibre_directions_at(queries: Floats, fibre_points: Floats, offsets: Ints) -> Floats:
    """Return the unit direction (q, 3) of the fibre segment nearest to each of some positions (q, 3)."""
    a, b, lengths = proper_segments(fibre_points, offsets)
    nearest = nearest_segments(queries, a, b)
    return (b[nearest] - a[nearest]) / lengths[nearest, None]


def nearest_segments(queries: Floats, a: Floats, b: Floats) -> Ints:
    """Return the index of the segment nearest to each point, exactly, (q,); of equally near ones the first.

    Symmetric muscles have edges midway between two fibres, and consecutive segments are equally near to a
    point beyond the point they share. Rounding must not choose there: a muscle that is moved rigidly would
    not deform as before.

    Candidates come by the distance d of the midpoints of their pieces, of length s at most. A piece is no
    nearer than d - s / 2. So once the farthest candidate is farther than the best distance and that, no other
    can be nearest. Points where that does not hold yet get twice as many candidates.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 -- not needed for drawing

    lengths = np.linalg.norm(b - a, axis=1)
    longest = max(float(lengths.max()), np.finfo(float).tiny)
    counts = np.ceil(PIECES * lengths / longest).clip(min=1.0).astype(np.int64)
    owner = np.repeat(np.arange(len(a)), counts)
    nth = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    tree = cKDTree(a[owner] + ((nth + 0.5) / counts[owner])[:, None] * (b - a)[owner])
    reach = 0.5 * longest / PIECES
    nearest = np.zeros(len(queries), dtype=np.int64)
    open_ = np.arange(len(queries))
    count = FIRST_CANDIDATES
    while len(open_):
        count = min(count, len(owner))
        far, pieces = tree.query(queries[open_], k=[*range(1, count + 1)])
        candidates = owner[pieces]
        distances = segment_distances(queries[open_][:, None], a[candidates], b[candidates])
        bound = distances.min(axis=1) + EQUALLY_NEAR * 0.5 * longest
        nearest[open_] = np.where(distances <= bound[:, None], candidates, len(a)).min(axis=1)
        if count == len(owner):
            break
        open_ = open_[far[:, -1] - reach <= bound]
        count *= 2
    return nearest
