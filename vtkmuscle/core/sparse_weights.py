"""Mean value coordinates without the small ones: a tenth of the memory and of the time of a frame."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mean_value import coordinate_mesh, in_chunks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Added to the diagonal of the equations for the making up, where that is 1: kept vertices in one plane.
_RIDGE = 1e-12
#: Weights are changed by no more than this part of their sum; a row that would be keeps more of them.
LARGEST_CHANGE = 1.0
#: Weights that a thread of its own pays for: it takes as long to start as half a million take to apply.
WORTH_A_THREAD = 4_000_000
#: Thresholds below this keep all [1].
_LEAST = 1e-15


@dataclass(frozen=True, eq=False)
class SparseWeights:
    """The larger mean value coordinates of points, row after row.

    Attributes
    ----------
    starts : (q + 1,) int array
        Where the weights of each point begin, and their number.
    columns : (k,) int32 array
        The vertices that they belong to, ascending in each row.
    values : (k,) array
        The weights [1]; rows sum to 1 and reproduce linear functions.
    error : float
        How far a point is from where all its weights would put it, at most, if the mesh is bent by the
        quadratic x_i^2 / (2 d) along each axis, with d the diagonal of the mesh [mm]: about one radian.
    """

    starts: Ints
    columns: NDArray[np.int32]
    values: Floats
    error: float


def sparse_mean_value_coordinates(
    points: Floats, triangles: Ints, queries: Floats, *, prune: float, threads: int = 0
) -> SparseWeights:
    """Return mean value coordinates without the small ones.

    Most vertices are far from a point, and their weights small; together they are not. What a row loses is
    made up for by the smallest change of the weights that are kept by which they sum to 1 and reproduce
    their point again. So rigid and affine motions are exact, and only bending costs accuracy.

    Parameters
    ----------
    points, triangles, queries, threads
        As of :func:`~vtkmuscle.core.mean_value.mean_value_coordinates`.
    prune : float
        Weights smaller than this part of the mean weight 1 / n are dropped, >= 0.

    Returns
    -------
    SparseWeights
        A row per query point.

    Raises
    ------
    ValueError
        As :func:`~vtkmuscle.core.mean_value.mean_value_coordinates`.
    """
    mesh = coordinate_mesh(points, triangles)
    centre, diagonal = mesh.centre, mesh.diagonal
    vertices = points - centre
    probe = vertices**2 / (2.0 * diagonal)

    def keep(rows: slice, weights: Floats) -> tuple[Ints, NDArray[np.int32], Floats, float]:
        return _pruned(weights, vertices, queries[rows] - centre, probe, prune / len(points))

    parts = in_chunks(mesh, queries, keep, threads)
    counts = np.concatenate([part[0] for part in parts]) if parts else np.zeros(0, dtype=np.int64)
    return SparseWeights(
        np.append(0, np.cumsum(counts)),
        np.concatenate([part[1] for part in parts]) if parts else np.zeros(0, dtype=np.int32),
        np.concatenate([part[2] for part in parts]) if parts else np.zeros(0),
        max((part[3] for part in parts), default=0.0),
    )


def sparse_transport(weights: SparseWeights, points: Floats, *, threads: int = 0) -> Floats:
    """Return the points (q, 3) that sparse weights make of vertices (n, 3), v_i = sum_j w_ij p_j.

    Each point is summed up by itself, so that the result does not depend on the number of threads; few
    weights are left to one.
    """
    centre = points.mean(axis=0)
    centred = np.ascontiguousarray(points - centre)
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


@kernel
def _pruned(
    weights: Floats, vertices: Floats, queries: Floats, probe: Floats, threshold: float
) -> tuple[Ints, NDArray[np.int32], Floats, float]:
    """Return how many weights each row (q, n) keeps, their columns and new values, and the probe's error."""
    counts = np.zeros(len(weights), dtype=np.int64)
    columns = np.empty(weights.size, dtype=np.int32)
    values = np.empty(weights.size)
    first, error = 0, 0.0
    for q in range(len(weights)):
        least = threshold
        while True:
            k, dropped = first, False
            for j in range(weights.shape[1]):
                if abs(weights[q, j]) >= least and weights[q, j] != 0.0:
                    columns[k], values[k] = j, weights[q, j]
                    k += 1
                elif weights[q, j] != 0.0:
                    dropped = True
            if not dropped or _make_up(columns[first:k], values[first:k], vertices, queries[q]):
                break
            least = 0.1 * least if least > _LEAST else 0.0  # too few are left, or nearly in a plane
        missed = np.zeros(3)
        for i in range(first, k):
            missed += values[i] * probe[columns[i]]
        for j in range(weights.shape[1]):
            for axis in range(3):
                missed[axis] -= weights[q, j] * probe[j, axis]
        error = max(error, np.sqrt((missed**2).sum()))
        counts[q] = k - first
        first = k
    return counts, columns[:first].copy(), values[:first].copy(), error


@kernel
def _make_up(columns: NDArray[np.int32], values: Floats, vertices: Floats, query: Floats) -> bool:
    """Change weights so that they sum to 1 and reproduce their point: by a + b . v, the least change.

    (In proportion to the weights the bending error is twice as large: vertices beside the point would make
    up for all the others.) Returns False where that cannot be done, or would change them more than they are
    in all.
    """
    matrix, lack = np.zeros((4, 4)), np.zeros(4)
    lack[0] = 1.0
    row = np.ones(4)
    for i in range(len(columns)):
        for axis in range(3):
            row[1 + axis] = vertices[columns[i], axis] - query[axis]
        for a in range(4):
            lack[a] -= values[i] * row[a]
            for b in range(4):
                matrix[a, b] += row[a] * row[b]
    scale = np.sqrt(np.diag(matrix))
    if not scale.min() > 0.0:
        return False
    for a in range(4):
        for b in range(4):
            matrix[a, b] /= scale[a] * scale[b]
        matrix[a, a] += _RIDGE
    wanted = lack / scale
    change = np.linalg.solve(matrix, wanted)
    if not np.abs(matrix @ change - wanted).max() <= 1e-9 * np.abs(wanted).max():
        return False
    change /= scale
    moved, size = 0.0, 0.0
    for i in range(len(columns)):
        total = change[0]
        for axis in range(3):
            total += change[1 + axis] * (vertices[columns[i], axis] - query[axis])
        moved += abs(total)
        size += abs(values[i])
        values[i] += total
    return moved <= LARGEST_CHANGE * size
