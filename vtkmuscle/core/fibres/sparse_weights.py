"""Mean value coordinates that groups of vertices have in common: a thirtieth of the work of a frame."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.fibres.mean_value import coordinate_mesh, in_chunks
from vtkmuscle.core.fibres.vertex_groups import VertexGroups, vertex_groups
from vtkmuscle.core.jit import array_kernel, kernel, reduction
from vtkmuscle.core.processors import processors
from vtkmuscle.core.types import Floats, Ints

#: Added to the diagonal of the equations for the making up, where that is 1: means in one plane.
_RIDGE = 1e-12
#: What is left to make up for counts as nothing below this part of the terms it is a sum of.
_MADE_UP = 1e-10
#: Weights are changed by no more than this part of their sum; a row that would be is divided further.
LARGEST_CHANGE = 1.0
#: Weights that a thread of its own pays for: it takes as long to start as half a million take to apply.
WORTH_A_THREAD = 4_000_000
#: Weights of a group that are compared with their mean before it is first asked whether that is enough.
_STRETCH = 8
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
    report: Callable[[float], None] = lambda part: None,
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
    report : callable, optional
        Told the part of the points that is done.

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
    groups = vertex_groups(points)
    centred, order = points - mesh.centre, groups.order
    bent = centred**2 / (2.0 * mesh.diagonal)
    known = (
        groups.with_means(centred),
        groups.sizes,
        groups.with_means(bent),
        np.ascontiguousarray(bent[order].T),
    )
    threshold = 2.0 * prune * groups.radii.max(initial=0.0) / len(points)

    def keep(rows: slice, weights: Floats) -> tuple[Ints, NDArray[np.int32], Floats, float]:
        return _grouped(weights, groups, *known, queries[rows] - mesh.centre, threshold)

    # Rows in the order of the groups: a group's weights are next to each other.
    parts = in_chunks(mesh, queries, keep, threads, places=np.argsort(order), report=report)
    counts = np.concatenate([part[0] for part in parts]) if parts else np.zeros(0, dtype=np.int64)
    return SparseWeights(
        np.append(0, np.cumsum(counts)),
        np.concatenate([part[1] for part in parts]) if parts else np.zeros(0, dtype=np.int32),
        np.concatenate([part[2] for part in parts]) if parts else np.zeros(0),
        max((part[3] for part in parts), default=0.0),
        groups,
    )


def sparse_transport(weights: SparseWeights, points: Floats, *, threads: int = 0) -> Floats:
    """Return the points (q, 3) that sparse weights make of vertices (n, 3), v_i = sum_j w_ij p_j.

    Each point is summed up by itself, so that the result does not depend on the number of threads; few
    weights are left to one.
    """
    centre = points.mean(axis=0)
    centred = weights.groups.with_means(points - centre)
    moved = np.empty((len(weights.starts) - 1, 3))
    count = min(threads or processors(), 1 + len(weights.values) // WORTH_A_THREAD)
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
    probe: Floats,
    bent: Floats,
    queries: Floats,
    threshold: float,
) -> tuple[Ints, NDArray[np.int32], Floats, float]:
    """Return how many weights each row (q, n) keeps, their columns and values, and the probe's error.

    Rows are in the order of the groups, and so is the probe's ``bent`` (3, n).
    """
    counts = np.zeros(len(weights), dtype=np.int64)
    columns = np.empty(weights.size, dtype=np.int32)
    values = np.empty(weights.size)
    waiting, totals = np.empty(len(groups.order), dtype=np.int64), np.empty(len(groups.first))
    start, error = 0, 0.0
    for q in range(len(weights)):
        most = threshold
        _total(weights[q], groups, totals)
        while True:
            count, rounded = _gather(
                weights[q], totals, groups, most, waiting, columns[start:], values[start:]
            )
            end = start + count
            if not rounded or _make_up(columns[start:end], values[start:end], means, sizes, queries[q]):
                break
            most = 0.1 * most if most > _LEAST * threshold else 0.0  # too few are left, or nearly in a plane
        square = 0.0
        for axis in range(3):
            missed = -_product(weights[q], bent[axis])
            for i in range(start, end):
                missed += values[i] * probe[columns[i], axis]
            square += missed * missed
        error = max(error, np.sqrt(square))
        counts[q] = count
        start = end
    return counts, columns[:start].copy(), values[:start].copy(), error


@reduction
def _product(a: Floats, b: Floats) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@reduction
def _deviation(values: Floats, mean: float) -> float:
    total = 0.0
    for value in values:
        total += abs(value - mean)
    return total


@kernel
def _total(weights: Floats, groups: VertexGroups, totals: Floats) -> None:
    """Write the sum of the weights (n,) of each group, the smallest groups first."""
    for group in range(len(totals) - 1, -1, -1):
        one, two = groups.parts[group, 0], groups.parts[group, 1]
        totals[group] = totals[one] if one >= 0 else weights[groups.first[group]]
        totals[group] += totals[two] if two >= 0 else weights[groups.last[group] - 1]


@kernel
def _gather(
    weights: Floats,
    totals: Floats,
    groups: VertexGroups,
    most: float,
    waiting: Ints,
    columns: NDArray[np.int32],
    values: Floats,
) -> tuple[int, bool]:
    """Write the columns and values of a row (n,), by the largest groups that err by no more than `most`.

    Returns how many there are, and whether they err at all; waiting : (n,) working memory, of groups, and of
    vertices as -1 - their place in the order.
    """
    n = len(groups.order)
    count, rounded = 0, False
    waiting[0], depth = (0 if n > 1 else -1), 1
    while depth > 0:
        depth -= 1
        group = waiting[depth]
        if group < 0:
            column, total = groups.order[-1 - group], weights[-1 - group]
        else:
            column, total = n + group, totals[group]
            first, last, off = groups.first[group], groups.last[group], 0.0
            mean = total / (last - first)
            begin, stretch = first, _STRETCH
            while begin < last and not off > most:
                end = min(begin + stretch, last)
                off += groups.radii[group] * _deviation(weights[begin:end], mean)
                begin, stretch = end, 2 * stretch
            if off > most:
                one, two = groups.parts[group, 0], groups.parts[group, 1]
                waiting[depth] = two if two >= 0 else -last
                waiting[depth + 1] = one if one >= 0 else -1 - first
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
