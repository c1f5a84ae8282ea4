"""Values at the nodes of a distance grid that are best for what lies between the nodes.

The trilinear interpolant of exact distances is too large outside of every convex bend of a surface. So the
nodes of cells at the surface get the values with which it agrees best, in the sense of least squares, with
the distances at the corners, and at the middles of the edges, faces and of the cell.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]

#: Passes of the fit; the error hardly falls after these.
_PASSES = 8

#: Distance at which a sample's weight has fallen to 1/e [cells].
_WIDTH = 0.3

#: Which of a cell's 27 samples are its corners, in the order of z, y, x.
_CORNERS = (0, 2, 6, 8, 18, 20, 24, 26)

#: Weight of a node's own value: nodes that no sample near the surface depends on stay as they are.
_INERTIA = 0.02


@kernel
def sample_cells(
    nodes: Ints, fine: Singles, table: NDArray[np.int32], limit: float, samples: Singles
) -> None:
    """Write the values at 27 places of some cells: all combinations of 0, 1/2 and 1 along x, y, z.

    nodes : (n, 3) lowest nodes of the cells;  fine : (k, 8, 8, 8) blocks of half the cells, where table is;
    samples : (n, 27), written, NaN where there is no block or the value reaches the limit [mm].
    """
    for n in range(len(nodes)):
        for sample in range(27):
            i, j, k = (
                2 * nodes[n, 0] + sample // 9,
                2 * nodes[n, 1] + sample // 3 % 3,
                2 * nodes[n, 2] + sample % 3,
            )
            samples[n, sample] = np.nan
            if (i >> 3) < table.shape[0] and (j >> 3) < table.shape[1] and (k >> 3) < table.shape[2]:
                block = table[i >> 3, j >> 3, k >> 3]
                if block >= 0 and abs(fine[block, i & 7, j & 7, k & 7]) < limit:
                    samples[n, sample] = fine[block, i & 7, j & 7, k & 7]


def fit_nodes(values: Singles, cells: Ints, samples: Singles, cell: float) -> Singles:
    """Change the values of nodes so that the trilinear interpolant agrees with samples of the cells.

    Simultaneous iteration: each node takes the mean of the errors of the samples that depend on it,
    weighted by how much they do and how near the surface they are (Andersen, Kak 1984,
    doi:10.1016/0161-7346(84)90008-7).

    Parameters
    ----------
    values : (k,) array
        At all nodes [mm], changed in place.
    cells : (n, 8) array
        Nodes of the cells, in the order of z, y, x.
    samples : (n, 27) array
        As of :func:`sample_cells`; NaN is left out.
    cell : float
        Distance of neighbouring nodes [mm].

    Returns
    -------
    (n,) array
        The largest error that is left of the samples nearer to the surface than half a cell [mm].
    """
    weights = np.empty(samples.shape, dtype=np.float32)
    total = np.full(len(values), _INERTIA)
    _weigh(samples, cells, _WIDTH * cell, weights, total)
    errors = np.empty(len(values))
    for _ in range(_PASSES):
        errors[:] = 0.0
        _add_errors(values, cells, samples, weights, errors)
        values += errors / total
    worst = np.empty(len(cells), dtype=np.float32)
    _worst_errors(values, cells, samples, 0.5 * cell, worst)
    return worst


@kernel
def _weigh(samples: Singles, cells: Ints, width: float, weights: Singles, total: Floats) -> None:
    """Write the weight of each sample, and add to each node how much of them depends on it.

    The nearer to the surface, the more a sample counts; NaN counts nothing. Samples on faces, edges and
    corners belong to 2, 4 and 8 cells, and count as a part for each.
    """
    work = np.empty(27)
    for n in range(len(samples)):
        for sample in range(27):
            middles = (sample // 9 == 1) + (sample // 3 % 3 == 1) + (sample % 3 == 1)
            value = samples[n, sample]
            weight = 0.0
            if not np.isnan(value):
                weight = np.exp(-((value / width) ** 2)) * 0.125 * (1 << middles)
            weights[n, sample] = weight
            work[sample] = weight
        _to_corners(work)
        for corner in range(8):
            total[cells[n, corner]] += work[_CORNERS[corner]]


@kernel
def _add_errors(values: Singles, cells: Ints, samples: Singles, weights: Singles, errors: Floats) -> None:
    """Add to each node what the interpolant lacks at the samples that depend on it, (k,), in place."""
    work = np.empty(27)
    for n in range(len(cells)):
        for corner in range(8):
            work[_CORNERS[corner]] = values[cells[n, corner]]
        _from_corners(work)
        for sample in range(27):
            weight = np.float64(weights[n, sample])
            # The weight of a sample that is not known is 0, but 0 times NaN is not.
            off = weight * (samples[n, sample] - work[sample])
            work[sample] = off if weight > 0.0 else 0.0
        _to_corners(work)
        for corner in range(8):
            errors[cells[n, corner]] += work[_CORNERS[corner]]


@kernel
def _worst_errors(values: Singles, cells: Ints, samples: Singles, near: float, worst: Singles) -> None:
    """Write the largest error of each cell at the samples nearer to the surface than that, (n,)."""
    work = np.empty(27)
    for n in range(len(cells)):
        for corner in range(8):
            work[_CORNERS[corner]] = values[cells[n, corner]]
        _from_corners(work)
        worst[n] = 0.0
        for sample in range(27):
            if abs(samples[n, sample]) < near:
                worst[n] = max(worst[n], abs(work[sample] - samples[n, sample]))


@kernel
def _from_corners(work: Floats) -> None:
    """Fill in a cell's 27 samples between its corners, axis by axis; work : (27,), in place."""
    for i in range(0, 27, 18):
        for j in range(0, 9, 6):
            work[i + j + 1] = 0.5 * (work[i + j] + work[i + j + 2])
    for i in range(0, 27, 18):
        for k in range(3):
            work[i + 3 + k] = 0.5 * (work[i + k] + work[i + 6 + k])
    for rest in range(9):
        work[9 + rest] = 0.5 * (work[rest] + work[18 + rest])


@kernel
def _to_corners(work: Floats) -> None:
    """Add to the corners what depends on them of a cell's 27 samples; work : (27,), in place.

    The transpose of the interpolation: half of each middle goes either way.
    """
    for rest in range(9):
        half = 0.5 * work[9 + rest]
        work[rest] += half
        work[18 + rest] += half
    for i in range(0, 27, 18):
        for k in range(3):
            half = 0.5 * work[i + 3 + k]
            work[i + k] += half
            work[i + 6 + k] += half
    for i in range(0, 27, 18):
        for j in range(0, 9, 6):
            half = 0.5 * work[i + j + 1]
            work[i + j] += half
            work[i + j + 2] += half
