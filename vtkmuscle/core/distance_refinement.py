"""Blocks of a distance grid with half the cells, where whole cells miss too much: thin or sharp parts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.distance_blocks import SIDE

Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
Table = NDArray[np.int32]


def refined_blocks(
    coarse: Singles, places: Ints, refined: Table, fine: Sequence[tuple[Singles, Table]], *, limit: float
) -> Singles:
    """Return blocks of half the cells.

    Near the surface nodes have their own values, elsewhere those between the coarse nodes; so do nodes on
    the border to a block that is not refined, so that values do not jump there.

    Parameters
    ----------
    coarse : (n, 9, 9, 9) float32 array
        The blocks to be refined [mm].
    places : (n, 3) array
        Where they are in the grid [blocks].
    refined : (bx, by, bz) int32 array
        -1 for the blocks of the grid that are not refined.
    fine : sequence of ((k, 8, 8, 8) float32 array, (2 bx, 2 by, 2 bz) int32 array)
        Per shell: distances at the fine nodes [mm], and which block of them is where, -1 for none.
    limit : float
        Distance below which those are known; beyond it they are that of the right side [mm].

    Returns
    -------
    (8 n, 9, 9, 9) float32 array
        Eight blocks for each, in the order of z, y, x.
    """
    values = coarse
    for axis in (1, 2, 3):
        values = _doubled(values, axis)
    own = np.full(values.shape, np.inf, dtype=np.float32)
    nodes = [
        2 * SIDE * places[:, k].reshape(-1, 1) + np.arange(2 * SIDE + 1) for k in range(3)
    ]  # (n, 17) along each axis
    for of_shell, table in fine:
        own = np.minimum(own, _values_at(nodes, of_shell, table))
    # Beyond the limit only the side is known.
    own = np.where(own >= limit, np.where(own < np.inf, np.maximum(values, limit), values), own)
    own = np.where(own <= -limit, np.minimum(values, own), own)
    # A shell that has no node near is one that is far away, or one that this is deep in.
    own = np.where(values <= -limit, np.minimum(values, own), own)
    borders = _borders(places, refined)
    values = np.where(borders, values, own)
    children = np.empty((len(places), 8, SIDE + 1, SIDE + 1, SIDE + 1), dtype=np.float32)
    halves = slice(0, SIDE + 1), slice(SIDE, 2 * SIDE + 1)
    for child, (i, j, k) in enumerate(product(halves, repeat=3)):
        children[:, child] = values[:, i, j, k]
    return children.reshape(-1, SIDE + 1, SIDE + 1, SIDE + 1)


def _doubled(values: Singles, axis: int) -> Singles:
    """Return values with one more halfway between neighbours along an axis."""
    ahead = np.moveaxis(values, axis, 0)
    result = np.empty((2 * len(ahead) - 1, *ahead.shape[1:]), dtype=np.float32)
    result[::2] = ahead
    result[1::2] = 0.5 * (ahead[:-1] + ahead[1:])
    return np.moveaxis(result, 0, axis)


def _values_at(nodes: list[Ints], fine: Singles, table: Table) -> Singles:
    """Return the values at fine nodes, (n, 17, 17, 17), infinite where there is no block."""
    # Node 16 of a block at the end of the grid is beyond it: unknown.
    inside = [axis < SIDE * size for axis, size in zip(nodes, table.shape, strict=True)]
    block, within = zip(
        *(np.divmod(np.where(good, axis, 0), SIDE) for axis, good in zip(nodes, inside, strict=True)),
        strict=True,
    )
    x, y, z = np.s_[:, :, None, None], np.s_[:, None, :, None], np.s_[:, None, None, :]
    number = table[block[0][x], block[1][y], block[2][z]]
    number[~(inside[0][x] & inside[1][y] & inside[2][z])] = -1
    values = fine[number, within[0][x], within[1][y], within[2][z]]
    return np.where(number >= 0, values, np.float32(np.inf))


def _borders(places: Ints, refined: Table) -> NDArray[np.bool_]:
    """Return which of the nodes (n, 17, 17, 17) belong to a block that is not refined, too."""
    around = np.pad(refined >= 0, 1)
    borders = np.zeros((len(places),) + (2 * SIDE + 1,) * 3, dtype=np.bool_)
    ends: dict[int, int | slice] = {-1: 0, 0: slice(None), 1: 2 * SIDE}
    for shift in product((-1, 0, 1), repeat=3):
        coarse = ~around[tuple((places + 1 + np.array(shift)).T)]
        part = borders[(slice(None), *(ends[step] for step in shift))]
        part |= coarse.reshape((-1,) + (1,) * (part.ndim - 1))
    return borders
