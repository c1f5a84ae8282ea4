"""Mean value coordinates shared by groups of vertices: a twentieth of the work per frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack

from vtkmuscle.core.fibres.equal_shares import halved
from vtkmuscle.core.fibres.mean_value import coordinate_mesh, weights_of
from vtkmuscle.core.jit import reduction
from vtkmuscle.core.types import Bools, Floats, Ints

#: Added to the unit diagonal of the equations for the correction, in case all means lie in one plane.
_RIDGE = 1e-12
#: An error after the correction is rounding below this part of the terms it is a sum of.
_CORRECTED = 1e-10
#: The correction may change weights by this part of their sum; a row that needs more keeps all its weights.
LARGEST_CHANGE = 1.0
#: Points whose weights are grouped at once.
AT_ONCE = 128
#: Halvings from a group to its groups on the next level.
HALVINGS = 2


class Groups(NamedTuple):
    """Groups (g,) of vertices of about equal size, in the order of :attr:`VertexGroups.order`.

    These are the first vertex of each and its number of vertices, the greatest distance of these from their
    mean [mm], and the number of groups of the next level that it is made of.
    """

    starts: Ints
    sizes: Ints
    radii: Floats
    made_of: Ints


@dataclass(frozen=True, eq=False)
class VertexGroups:
    """Vertices of a mesh in groups, level by level: all in one, that in four, and so on to single vertices.

    In `order` (n,) the vertices of each group are next to each other.
    """

    order: Ints
    levels: list[Groups]

    def with_means(self, values: Floats) -> Floats:
        """Return the means of values of the vertices (n, k) over all groups, level after level."""
        ordered = values[self.order]
        return np.vstack([np.add.reduceat(ordered, g.starts) / g.sizes[:, None] for g in self.levels])


def vertex_groups(points: Floats) -> VertexGroups:
    """Return the vertices of a mesh (n, 3) in groups that are halved across their longest axes [mm]."""
    n = len(points)
    depth = -(-max(n - 1, 0).bit_length() // HALVINGS) * HALVINGS
    part = halved([points], 2 ** (depth - HALVINGS))[0] << HALVINGS if depth else np.zeros(n, dtype=np.int64)
    order = np.argsort(part, kind="stable")
    ancestors = (part[order] >> depth - level for level in range(0, depth, HALVINGS))
    levels, bounds = [], [*(np.unique(each, return_index=True)[1] for each in ancestors), np.arange(n)]
    for starts, finer in zip(bounds, [*bounds[1:], bounds[-1]], strict=True):
        sizes = np.diff(np.append(starts, n))
        means = np.add.reduceat(points[order], starts) / sizes[:, None]
        apart = np.linalg.norm(points[order] - np.repeat(means, sizes, axis=0), axis=1)
        made_of = np.diff(np.append(np.searchsorted(finer, starts), len(finer)))
        levels.append(Groups(starts, sizes, np.maximum.reduceat(apart, starts), made_of))
    return VertexGroups(order, levels)


@dataclass(frozen=True, eq=False)
class SparseWeights:
    """Mean value coordinates of points in the means of groups of vertices, down to single ones.

    Rows of the matrix (q, g) sum to 1 and reproduce linear functions. `error` is the largest distance of a
    point from where all its weights would put it, if the mesh is bent by the quadratic x_i^2 / (2 d) along
    each axis, with d the diagonal of the mesh [mm]: about one radian.
    """

    matrix: csr_array
    error: float
    groups: VertexGroups


def sparse_mean_value_coordinates(
    points: Floats,
    triangles: Ints,
    queries: Floats,
    *,
    prune: float,
    threads: int = 0,
    report: Callable[[float], None] = lambda part: None,
) -> SparseWeights:
    """Return mean value coordinates with one weight for many vertices where theirs are nearly equal.

    Far from a point the weights vary slowly: those of a group of vertices differ little from their mean w,
    and sum w_j p_j from w sum p_j by no more than sum abs(w_j - w) times the radius of the group. The error
    of a row is corrected by the least-squares change of the weights after which they sum to 1 and reproduce
    their point. So rigid and affine motions are exact, and only bending costs accuracy.

    Parameters
    ----------
    points, triangles, queries, threads
        As of :func:`~vtkmuscle.core.fibres.mean_value.mean_value_coordinates`.
    prune : float
        A group has one weight where sum abs(w_j - w) r < 2 prune R / n, with r its radius, R that of all n
        vertices, >= 0.
    report : callable, optional
        Called with the part of the points that is done.
    """
    groups = vertex_groups(points)
    # Vertices in the order of the groups: a group's weights are next to each other.
    mesh = coordinate_mesh(points[groups.order], np.argsort(groups.order)[triangles])
    centred = points - mesh.centre
    bent = centred**2 / (2.0 * mesh.diagonal)
    means, means_of_bent = groups.with_means(centred), groups.with_means(bent)
    sizes = np.concatenate([level.sizes for level in groups.levels])
    threshold = 2.0 * prune * groups.levels[0].radii.max() / len(points)

    ordered_bent = bent[groups.order]
    parts, error = [csr_array((0, len(sizes)))], 0.0
    for first in range(0, len(queries), AT_ONCE):
        some = queries[first : first + AT_ONCE]
        weights = weights_of(mesh, some, threads, first=first)
        grouped = _grouped(weights, groups, threshold)
        corrected = _reproduce_points(grouped, means, sizes, some - mesh.centre)
        if not corrected.all():
            whole = _grouped(weights, groups, -np.inf)
            rows = [(grouped if good else whole)[[i]] for i, good in enumerate(corrected)]
            grouped = csr_array(vstack(rows))
        missed = grouped @ means_of_bent - np.einsum("qn,nk->qk", weights, ordered_bent)
        error = max(error, float(np.linalg.norm(missed, axis=1).max()))
        parts.append(grouped)
        report(min(1.0, (first + AT_ONCE) / len(queries)))
    return SparseWeights(csr_array(vstack(parts, format="csr")), error, groups)


def sparse_transport(weights: SparseWeights, points: Floats) -> Floats:
    """Return the new positions (q, 3) of points, from those of the mesh's vertices (n, 3) [mm]."""
    centre = points.mean(axis=0)
    moved: Floats = weights.matrix @ weights.groups.with_means(points - centre) + centre
    return moved


def _grouped(weights: Floats, groups: VertexGroups, threshold: float) -> csr_array:
    """Return weights (q, n) of ordered vertices by the largest groups in which they differ little."""
    parts, first, divided = [], 0, np.ones((len(weights), 1), dtype=np.bool_)
    for level, group in enumerate(groups.levels):
        totals, taken = np.zeros(divided.shape), divided.copy()
        most = threshold if level < len(groups.levels) - 1 else np.inf
        _take(weights, np.append(group.starts, weights.shape[1]), group.radii, most, totals, taken)
        row, column = np.nonzero(taken & (totals != 0.0))
        parts.append((totals[row, column], row, first + column))
        first += len(group.starts)
        divided = np.repeat(divided & ~taken, group.made_of, axis=1)
    values, row, column = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return csr_array((values, (row, column)), shape=(len(weights), first))


@reduction
def _take(weights: Floats, starts: Ints, radii: Floats, most: float, totals: Floats, taken: Bools) -> None:
    """Sum the weights of each group, and keep the groups whose weights differ little.

    `taken` (q, g), changed in place, holds the groups to look at, and then those of them whose weights differ
    by no more than ``most``, times the radius.
    """
    for q in range(len(weights)):
        for g in range(len(radii)):
            if not taken[q, g]:
                continue
            group = weights[q, starts[g] : starts[g + 1]]
            total, off = 0.0, 0.0
            for weight in group:
                total += weight
            mean = total / len(group)
            for weight in group:
                off += abs(weight - mean)
            totals[q, g], taken[q, g] = total, radii[g] * off <= most


def _reproduce_points(weights: csr_array, means: Floats, sizes: Ints, queries: Floats) -> Bools:
    """Change weights (q, g) by least squares to sum to 1 and reproduce points (q, 3); return where they do.

    With c_j vertices in group j, minimise sum_j d_j^2 / c_j such that the weights w + d do so.
    """
    row = np.repeat(np.arange(len(queries)), np.diff(weights.indptr))
    terms = np.vstack([np.ones(len(row)), (means[weights.indices] - queries[row]).T])
    counts, starts = sizes[weights.indices], weights.indptr[:-1]

    def summed(values: Floats) -> Floats:
        return np.add.reduceat(values, starts, axis=-1).T

    # Term by term: an array of all products at once would not stay in the processor's cache.
    matrices = np.array([[summed(counts * one * other) for one in terms] for other in terms]).transpose(
        2, 0, 1
    )
    scales = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), np.finfo(float).tiny))
    matrices = matrices / (scales[:, :, None] * scales[:, None]) + _RIDGE * np.eye(4)
    wanted = np.array([1.0, 0.0, 0.0, 0.0])
    missing = (wanted - summed(weights.data * terms)) / scales
    multipliers = np.linalg.solve(matrices, missing[..., None])[..., 0] / scales
    change = counts * sum(term * some[row] for term, some in zip(terms, multipliers.T, strict=True))
    most = LARGEST_CHANGE * summed(np.abs(weights.data))
    weights.data += change
    products = weights.data * terms
    left = np.abs(wanted - summed(products)) <= _CORRECTED * (wanted + summed(np.abs(products)))
    return left.all(axis=1) & (summed(np.abs(change)) <= most)
