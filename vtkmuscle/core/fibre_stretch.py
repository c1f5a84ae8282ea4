"""A muscle's rest shape that follows its fibres: longer or shorter along them, thinner or thicker across."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from vtkmuscle.core.anisotropy import fibre_directions_at, harmonic_directions
from vtkmuscle.core.harmonic import harmonic_field
from vtkmuscle.core.mesh import signed_volume
from vtkmuscle.core.polylines import polyline_lengths
from vtkmuscle.core.topology import MeshTopology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part p of a constant volume's thinning that the rest shape has across the fibres: l^(-p / 2) for a stretch
#: l. With 1 all of it would come from the width; a broad muscle, held along its attachments, thins in its
#: thickness instead. With 0.5 the width of a muscle of the hip stays within 8 % at stretches of 0.7 to 1.35.
THINNING = 0.5

#: Bounds of the stretch, beyond which no rest shape is sensible (a muscle works between about 0.5 and 1.6).
LEAST_STRETCH, GREATEST_STRETCH = 0.25, 4.0

#: Slopes of the harmonic function that differ by less than this part of the greatest are equal.
EQUALLY_STEEP = 1e-7

#: Points that the stretch at an edge is a mean of, at most, where it comes from fibres.
_NEIGHBOURS = 48

#: Rounds of averaging over neighbours, where the stretch comes from the harmonic function: enough to even
#: out which of many near ends a line of steepest ascent happens to meet.
_SMOOTHING = 10


@dataclass(frozen=True, eq=False)
class FibreStretch:
    """How far apart the ends of a muscle's fibres are, edge by edge of its surface.

    The ends are fixed to bones, so that their distance follows from the bones alone, whatever the muscle
    does between them.

    Attributes
    ----------
    directions : (k, 3) array
        Unit direction of the fibres at each edge at rest, 0 where there is none.
    starts, ends : (s, 3) arrays
        Ends of the fibres at rest [mm].
    start_bones, end_bones : (s,) int arrays
        Which bones they are fixed to.
    weights : (k, s) sparse array
        How much each fibre counts at each edge; rows sum to 1, or 0 between fixed points.
    averaging : (s, s) sparse array or None
        Mean of each fibre and its neighbours, taken several times over before; rows sum to 1 or 0.
    """

    directions: Floats
    starts: Floats
    ends: Floats
    start_bones: Ints
    end_bones: Ints
    weights: csr_array
    averaging: csr_array | None = None

    def at(self, transforms: Floats) -> Floats:
        """Return the distance of the ends, by that at rest, at each edge (k,).

        Parameters
        ----------
        transforms : (b, 4, 4) array
            Of the bones, rest to now.
        """
        rest = np.linalg.norm(self.ends - self.starts, axis=1)
        start, end = transforms[self.start_bones], transforms[self.end_bones]
        a = np.einsum("nij,nj->ni", start[:, :3, :3], self.starts) + start[:, :3, 3]
        b = np.einsum("nij,nj->ni", end[:, :3, :3], self.ends) + end[:, :3, 3]
        now = np.linalg.norm(b - a, axis=1)
        # About 1, so that weights whose sum is rounded leave the rest shape as it is.
        longer = np.divide(now - rest, rest, out=np.zeros(len(rest)), where=rest > 0)
        if self.averaging is not None:
            for _ in range(_SMOOTHING):
                longer = self.averaging @ longer
        bounded: Floats = np.clip(1.0 + self.weights @ longer, LEAST_STRETCH, GREATEST_STRETCH)
        return bounded


def stretch_of_fibres(
    points: Floats, topology: MeshTopology, fixed_to: Ints, fibre_points: Floats, offsets: Ints
) -> FibreStretch | None:
    """Return the stretch of edges by the fibres beside them.

    A fibre's point at the distance r from an edge, the nearest one at r0, counts exp((r0^2 - r^2) / 2 s^2),
    less that at the last of the points looked at, with s the distance between fibres in a muscle that is
    filled with them evenly.

    Parameters
    ----------
    points : (n, 3) array
        The muscle at rest [mm].
    topology : MeshTopology
        Of its surface.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    fibre_points : (f, 3) array
        Points of all fibres, one after the other [mm].
    offsets : (s + 1,) int array
        First point of each fibre, and f.

    Returns
    -------
    FibreStretch or None
        None where no point is fixed. An end belongs to the bone of the fixed point nearest to it.
    """
    fixed = np.flatnonzero(fixed_to >= 0)
    if not len(fixed):
        return None
    middles = points[topology.edges].mean(axis=1)
    lengths = polyline_lengths(fibre_points, offsets)
    count = len(lengths)
    spacing = math.sqrt(abs(signed_volume(points, topology.triangles)) / lengths.sum())
    owner = np.repeat(np.arange(count), np.diff(offsets))
    near, found = cKDTree(fibre_points).query(middles, k=min(_NEIGHBOURS, len(fibre_points)))
    near, found = near.reshape(len(middles), -1), found.reshape(len(middles), -1)
    values = _falling_off(near, spacing)
    rows = np.repeat(np.arange(len(middles)), values.shape[1])
    weights = coo_array((values.reshape(-1), (rows, owner[found].reshape(-1))), (len(middles), count))
    starts, ends = fibre_points[offsets[:-1]], fibre_points[offsets[1:] - 1]
    tree = cKDTree(points[fixed])
    return FibreStretch(
        directions=fibre_directions_at(middles, fibre_points, offsets),
        starts=starts,
        ends=ends,
        start_bones=fixed_to[fixed[tree.query(starts)[1]]],
        end_bones=fixed_to[fixed[tree.query(ends)[1]]],
        weights=weights.tocsr(),
    )


def _falling_off(near: Floats, spacing: float) -> Floats:
    """Return the weights (m, c) of neighbours at the distances ``near``, nearest first; rows sum to 1.

    They fall to 0 at the last neighbour: of two that are equally far one may be beyond the search, and
    rounding would choose which.
    """
    values: Floats = np.exp((near[:, :1] ** 2 - near**2) / (2.0 * spacing**2))
    falling = values - values[:, -1:]
    values = np.where(falling.sum(axis=1, keepdims=True) > 0, falling, values)
    values /= values.sum(axis=1, keepdims=True)
    return values


def stretch_of_harmonic(points: Floats, topology: MeshTopology, fixed_to: Ints) -> FibreStretch | None:
    """Return the stretch of edges where no fibres are known.

    The lines of steepest ascent and descent of the harmonic function between the ends of a muscle stand in
    for fibres: from each point along edges to the fixed points that they meet.

    Parameters
    ----------
    points, topology, fixed_to
        As of :func:`stretch_of_fibres`.

    Returns
    -------
    FibreStretch or None
        None where fewer than two bones have fixed points.
    """
    directions = harmonic_directions(points, topology, fixed_to)
    field = harmonic_field(points, topology.triangles, fixed_to)
    if directions is None or field is None:
        return None
    ends = [_steepest(points, topology.edges, sign * field, fixed_to) for sign in (-1.0, 1.0)]
    bones = [fixed_to[end] for end in ends]
    # Fixed points, and places where the function is constant, have no line: they do not count.
    whole = (fixed_to < 0) & (bones[0] >= 0) & (bones[1] >= 0)
    if not whole.any():
        return None
    for end, bone in zip(ends, bones, strict=True):
        end[~whole], bone[~whole] = 0, 0
    n, k = len(points), len(topology.edges)
    i, j = topology.edges.T
    every, rows = np.arange(n), np.arange(k)
    averaging = _means(np.r_[i, j, every], np.r_[j, i, every], whole, (n, n))
    weights = _means(np.r_[rows, rows], np.r_[i, j], whole, (k, n))
    starts, stops = (points[end] for end in ends)
    return FibreStretch(directions, starts, stops, bones[0], bones[1], weights, averaging)


def _means(rows: Ints, columns: Ints, whole: NDArray[np.bool_], shape: tuple[int, int]) -> csr_array:
    """Return the matrix of means over the columns of each row that count; 0 where none does."""
    kept = whole[columns]
    matrix = coo_array((np.ones(kept.sum()), (rows[kept], columns[kept])), shape).tocsr()
    matrix.data /= np.repeat(np.diff(matrix.indptr), np.diff(matrix.indptr))
    return matrix


def _steepest(points: Floats, edges: Ints, height: Floats, fixed_to: Ints) -> Ints:
    """Return for each point where the steepest way up along edges leads to; fixed points stay."""
    both = np.vstack([edges, edges[:, ::-1]])
    length = np.linalg.norm(points[both[:, 1]] - points[both[:, 0]], axis=1)
    slope = (height[both[:, 1]] - height[both[:, 0]]) / np.maximum(length, np.finfo(float).tiny)
    # Of equally steep edges the one to the last point counts, whatever rounding says.
    steps = np.round(slope / (EQUALLY_STEEP * max(slope.max(), np.finfo(float).tiny)))
    order = np.lexsort((both[:, 1], steps, both[:, 0]))
    last = np.flatnonzero(np.append(np.diff(both[order, 0]) > 0, True))
    steepest = order[last]
    onward = np.arange(len(points))
    rising = steepest[(slope[steepest] > 0) & (fixed_to[both[steepest, 0]] < 0)]
    onward[both[rising, 0]] = both[rising, 1]
    while (onward[onward] != onward).any():
        onward = onward[onward]
    return onward
