"""Values at the nodes of a distance grid that are best for what lies between the nodes.

The trilinear interpolant of exact distances is too large outside of every convex bend of a surface. So the
nodes of cells at the surface get the values with which it agrees best, in the sense of least squares, with
the distances at the corners, and at the middles of the edges, faces and of the cell.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Singles = NDArray[np.float32]
Ints = NDArray[np.int64]

#: Passes of the fit; the error hardly falls after these.
_PASSES = 8

#: Distance at which a sample's weight has fallen to 1/e [cells].
_WIDTH = 0.3

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
    weights = np.nan_to_num(np.exp(-((samples / np.float32(_WIDTH * cell)) ** 2)))
    shares, belongs = _shares()
    total = _INERTIA + np.bincount(
        cells.reshape(-1), weights=(weights * belongs @ shares).reshape(-1), minlength=len(values)
    )
    weights *= belongs
    errors = np.empty(len(values))
    for _ in range(_PASSES):
        errors[:] = 0.0
        _add_errors(values, cells, samples, weights, shares, errors)
        values += errors / total
    left = np.abs(values[cells] @ shares.T.astype(np.float32) - samples)
    near = np.abs(samples) < 0.5 * cell
    worst: Singles = np.max(left, axis=1, where=near, initial=0.0)
    return worst


def _shares() -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return how much each sample depends on each corner, (27, 8), and belongs to the cell, (27,).

    Samples on faces, edges and corners belong to 2, 4 and 8 cells.
    """
    along = np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])
    single = np.array([0.5, 1.0, 0.5])
    shares = np.einsum("ia,jb,kc->ijkabc", along, along, along).reshape(27, 8)
    belongs = np.einsum("i,j,k->ijk", single, single, single).reshape(27)
    return shares, belongs.astype(np.float32)


@kernel
def _add_errors(
    values: Singles,
    cells: Ints,
    samples: Singles,
    weights: Singles,
    shares: NDArray[np.float64],
    errors: NDArray[np.float64],
) -> None:
    """Add to each node what the interpolant lacks at the samples that depend on it, (k,), in place."""
    at = np.empty(8)
    for n in range(len(cells)):
        for corner in range(8):
            at[corner] = values[cells[n, corner]]
        for sample in range(27):
            if weights[n, sample] == 0.0:
                continue
            value = 0.0
            for corner in range(8):
                value += shares[sample, corner] * at[corner]
            off = weights[n, sample] * (samples[n, sample] - value)
            for corner in range(8):
                errors[cells[n, corner]] += shares[sample, corner] * off
