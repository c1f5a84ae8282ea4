"""Mean value coordinates that groups of vertices have in common: a thirtieth of the work of a frame."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.fibres.mean_value import coordinate_mesh, in_chunks
from vtkmuscle.core.fibres.vertex_groups import VertexGroups, vertex_groups
from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.surface import mean_point
from vtkmuscle.core.types import Floats, Ints

#: Added to the diagonal of the equations for the making up, where that is 1: means in one plane.
_RIDGE = 1e-12
#: What is left to make up for counts as nothing below this part of the terms it is a sum of.
_MADE_UP = 1e-10
#: Weights are changed by no more than this part of their sum; a row that would be is divided further.
LARGEST_CHANGE = 1.0
#: Weights that a thread of its own pays for: it takes as long to start as half a million take to apply.
WORTH_A_THREAD = 4_000_000
#: Thresholds below this divide all groups [1].
_LEAST = 1e-15


@dataclass(frozen=True, eq=False)
class SparseWeights:
    """Mean value coordinates of points in vertices and in means of groups of them, row after row.

    Attributes
    ----------
    starts : (q + 1,) int array
        Where the weights of each point begin, and their number.
    columns : (k,) int32 array
        What they belong to: vertices (n) and, from n on, the groups.
    values : (k,) array
        The weights [1]; rows sum to 1 and reproduce linear functions.
    error : float
        How far a point is from where all its weights would put it, at most, if the mesh is bent by the
        quadratic x_i^2 / (2 d) along each axis, with d the diagonal of the mesh [mm]: about one radian.
    groups : VertexGroups
        Of the mesh.
    """

    starts: Ints
    columns: NDArray[np.int32]
    values: Floats
    error: float
    groups: VertexGroups


def sparse_mean_value_coordinates(
    points: Floats,
    triangles: Ints,
    queries: Floats,
    *,
    prune: float,
    threads: int = 0,
    groups: VertexGroups | None = None,
) -> SparseWeights:
    """Return mean value coordinates with one weight for many vertices, where theirs are much the same.

    Far from a point the weights vary slowly: those of a group of vertices differ little from their mean w,
    and sum w_j p_j from w sum p_j by no more than sum abs(w_j - w) times the radius of the group. What a row
    errs by is made up for by the smallest change of the vertices' weights by which they sum to 1 and
    reproduce their point again. So rigid and affine motions are exact, and only bending costs accuracy.

    Parameters
    ----------
    points, triangles, queries, threads
        As of :func:`~vtkmuscle.core.fibres.mean_value.mean_value_coordinates`.
    prune : float
        A group has one weight where sum abs(w_j - w) r < 2 prune R / n, with r its radius, R that of all n
        vertices, >= 0.
    groups : VertexGroups, optional
        Of the points, where they are known.

    Returns
    -------
    SparseWeights
        A row per query point.

    Raises
    ------
    ValueError
        As :func:`~vtkmuscle.core.fibres.mean_value.mean_value_coordinates`.
    """
    mesh = coordinate_mesh(points, triangles)
    groups = vertex_groups(points) if groups is None else groups
    columns = groups.with_means(points - mesh.centre), groups.sizes
    probe = groups.with_means((points - mesh.centre) ** 2 / (2.0 * mesh.diagonal))
    threshold = 2.0 * prune * groups.radii.max(initial=0.0) / len(points)

    def keep(rows: slice, weights: Floats) -> tuple[Ints, NDArray[np.int32], Floats, float]:
        return _grouped(weights, groups, *columns, queries[rows] - mesh.centre, probe, threshold)

    parts = in_chunks(mesh, queries, keep, threads)
    counts = np.concatenate([part[0] for part in parts]) if parts else np.zeros(0, dtype=np.int64)
    return SparseWeights(
        np.append(0, np.cumsum(counts)),
        np.concatenate([part[1] for part in parts]) if parts else np.zeros(0, dtype=np.int32),
        np.concatenate([part[2] for part in parts]) if parts else np.zeros(0),
        max((part[3] for part in parts), default=0.0),
        groups,
    )


def joined(parts: Sequence[SparseWeights]) -> SparseWeights:
    """Return the weights of the points of all parts, of the same mesh, one after the other."""
    ends = np.cumsum([len(part.values) for part in parts])
    starts = [part.starts[:-1] + end - len(part.values) for part, end in zip(parts, ends, strict=True)]
    return SparseWeights(
        np.concatenate([*starts, ends[-1:]]),
        np.concatenate([part.columns for part in parts]),
        np.concatenate([part.values for part in parts]),
        max(part.error for part in parts),
        parts[0].groups,
    )


def sparse_transport(weights: SparseWeights, points: Floats, *, threads: int = 0) -> Floats:
    """Return the points (q, 3) that sparse weights make of vertices (n, 3), v_i = sum_j w_ij p_j.

    Each point is summed up by itself, so that the result does not depend on the number of threads; few
    weights are left to one.
    """
    centre = mean_point(points)
    centred = weights.groups.with_means(points - centre)
    moved = np.empty((len(weights.starts) - 1, 3))
    count = min(threads or os.cpu_count() or 1, 1 + len(weights.values) // WORTH_A_THREAD)
    bounds = np.linspace(0, len(moved), count + 1).astype(np.int64)

    def work(part: int) -> None:
        first, last = bounds[part], bounds[part + 1]
        _apply(weights.starts, weights.columns, weights.values, centred, first, moved[first:last])

    if count == 1:
        work(0)
    else:
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(work, range(count)))
    moved += centre
    return moved


@kernel
def _apply(
    starts: Ints, columns: NDArray[np.int32], values: Floats, points: Floats, first: int, moved: Floats
) -> None:
    for i in range(len(moved)):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(starts[first + i], starts[first + i + 1]):
            j, w = columns[k], values[k]
            x += w * points[j, 0]
            y += w * points[j, 1]
            z += w * points[j, 2]
        moved[i, 0], moved[i, 1], moved[i, 2] = x, y, z


@array_kernel
def _grouped(
    weights: Floats,
    groups: VertexGroups,
    means: Floats,
    sizes: Ints,
    queries: Floats,
    probe: Floats,
    threshold: float,
) -> tuple[Ints, NDArray[np.int32], Floats, float]:
    """Return how many weights each row (q, n) keeps, their columns and values, and the probe's error."""
    counts = np.zeros(len(weights), dtype=np.int64)
    columns = np.empty(weights.size, dtype=np.int32)
    values = np.empty(weights.size)
    waiting = np.empty(len(groups.order), dtype=np.int64)
    start, error = 0, 0.0
    for q in range(len(weights)):
        most = threshold
        while True:
            count, rounded = _gather(weights[q], groups, most, waiting, columns[start:], values[start:])
            end = start + count
            if not rounded or _make_up(columns[start:end], values[start:end], means, sizes, queries[q]):
                break
            most = 0.1 * most if most > _LEAST * threshold else 0.0  # too few are left, or nearly in a plane
        square = 0.0
        for axis in range(3):
            missed = 0.0
            for i in range(start, end):
                missed += values[i] * probe[columns[i], axis]
            for j in range(len(groups.order)):
                missed -= weights[q, j] * probe[j, axis]
            square += missed * missed
        error = max(error, np.sqrt(square))
        counts[q] = count
        start = end
    return counts, columns[:start].copy(), values[:start].copy(), error


@kernel
def _gather(
    weights: Floats,
    groups: VertexGroups,
    most: float,
    waiting: Ints,
    columns: NDArray[np.int32],
    values: Floats,
) -> tuple[int, bool]:
    """Write the columns and values of a row (n,), by the largest groups that err by no more than `most`.

    Returns how many there are, and whether they err at all; waiting : (n,) working memory.
    """
    n = len(groups.order)
    count, rounded = 0, False
    waiting[0], depth = (0 if n > 1 else -1), 1
    while depth > 0:
        depth -= 1
        group = waiting[depth]
        column, total = -1 - group, 0.0
        if group < 0:
            total = weights[column]
        else:
            column = n + group
            vertices = groups.order[groups.first[group] : groups.last[group]]
            for j in vertices:
                total += weights[j]
            mean, off = total / len(vertices), 0.0
            for j in vertices:
                off += groups.radii[group] * abs(weights[j] - mean)
                if off > most:
                    break
            if off > most:
                waiting[depth], waiting[depth + 1] = groups.parts[group, 1], groups.parts[group, 0]
                depth += 2
                continue
            rounded = rounded or off > 0.0
        if total != 0.0:
            columns[count], values[count] = column, total
            count += 1
    return count, rounded


@array_kernel
def _make_up(columns: NDArray[np.int32], values: Floats, means: Floats, sizes: Ints, query: Floats) -> bool:
    """Change weights so that they sum to 1 and reproduce their point: each vertex's by a + b . v, the least.

    (In proportion to the weights the bending error is twice as large: vertices beside the point would make
    up for all the others.) Returns False where that cannot be done, or would change them more than they are
    in all.
    """
    matrix, lack = np.zeros((4, 4)), np.zeros(4)
    lack[0] = 1.0
    row = np.empty(4)
    row[0] = 1.0
    for i in range(len(columns)):
        for axis in range(3):
            row[1 + axis] = means[columns[i], axis] - query[axis]
        for a in range(4):
            lack[a] -= values[i] * row[a]
            for b in range(4):
                matrix[a, b] += sizes[columns[i]] * row[a] * row[b]
    if not min(matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[3, 3]) > 0.0:
        return False
    change = lack
    _solve(matrix, change)
    moved, size = 0.0, 0.0
    left, terms = np.zeros(4), np.zeros(4)
    left[0] = terms[0] = 1.0
    for i in range(len(columns)):
        total = change[0]
        for axis in range(3):
            row[1 + axis] = means[columns[i], axis] - query[axis]
            total += change[1 + axis] * row[1 + axis]
        total *= sizes[columns[i]]
        moved += abs(total)
        size += abs(values[i])
        values[i] += total
        for a in range(4):
            left[a] -= values[i] * row[a]
            terms[a] += abs(values[i]) * abs(row[a])
    # Where the means are in a plane and the point is not, nothing makes up for it.
    made_up = moved <= LARGEST_CHANGE * size
    for a in range(4):
        made_up = made_up and abs(left[a]) <= _MADE_UP * terms[a]
    return made_up


@array_kernel
def _solve(matrix: Floats, x: Floats) -> None:
    """Replace a right-hand side (n,) by the solution for a positive definite matrix; overwrite the matrix.

    Of the matrix scaled to a unit diagonal, with :data:`_RIDGE` on it, by Cholesky's factors.
    """
    n = len(x)
    scale = np.empty(n)
    for a in range(n):
        scale[a] = np.sqrt(matrix[a, a])
    for a in range(n):
        for b in range(n):
            matrix[a, b] /= scale[a] * scale[b]
        matrix[a, a] += _RIDGE
        x[a] /= scale[a]
    for a in range(n):
        for b in range(a + 1):
            for k in range(b):
                matrix[a, b] -= matrix[a, k] * matrix[b, k]
            matrix[a, b] = matrix[a, b] / matrix[b, b] if b < a else np.sqrt(matrix[a, a])
        for b in range(a):
            x[a] -= matrix[a, b] * x[b]
        x[a] /= matrix[a, a]
    for a in range(n - 1, -1, -1):
        x[a] /= matrix[a, a]
        for b in range(a):
            x[b] -= matrix[a, b] * x[a]
    for a in range(n):
        x[a] /= scale[a]
