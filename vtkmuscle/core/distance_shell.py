"""Signed distance from one closed shell at the nodes of the blocks that its band and its inside meet."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from vtkmuscle.core.distance_blocks import (
    SIDE,
    fill_band,
    fill_inside,
    triangles_of_blocks,
    with_far_faces,
)
from vtkmuscle.core.distance_fit import fit_nodes, sample_cells
from vtkmuscle.core.triangle_distance import pseudonormals, winding_number

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Table = NDArray[np.int32]

#: Blocks that a thread works on at a time.
_BLOCKS_PER_TASK = 256

#: Distance of a corner from the surface up to which a cell takes part in the fit [cells].
_NEAR = 0.5

#: Distance from the surface up to which samples are taken [cells].
SAMPLED = 0.8

#: Error of a sample next to the surface that calls for half the cells [cells].
_POOR = 0.1

#: The blocks around a block.
_AROUND = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])


@dataclass(frozen=True, eq=False)
class ShellDistance:
    """Signed distance from a shell where that is less than the band.

    Attributes
    ----------
    blocks : (k,) int array
        Those with a node in the band or inside.
    values : (k, 8, 8, 8) float32 array
        At their nodes [mm], the band where it is more outside.
    fine : (l, 8, 8, 8) float32 array
        At the nodes of blocks of half the cells, where it is less than ``SAMPLED`` cells.
    fine_table : (2 bx, 2 by, 2 bz) int32 array
        Which of these is where, -1 for none.
    poor : (r,) int array
        Blocks where trilinear values miss too much.
    """

    blocks: Ints
    values: Singles
    fine: Singles
    fine_table: Table
    poor: Ints


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where the blocks of a grid may be; they are numbered in C order.

    Attributes
    ----------
    origin : (3,) array
        Node (0, 0, 0) [mm].
    cell : float
        Distance of neighbouring nodes [mm].
    shape : tuple of int
        Number of blocks of 8 x 8 x 8 nodes along each axis.
    """

    origin: Floats
    cell: float
    shape: tuple[int, ...]

    def places(self, blocks: Ints) -> Ints:
        """Return where blocks are, (n, 3) [blocks]."""
        return np.column_stack(np.unravel_index(blocks, self.shape)).astype(np.int64)

    def table(self, blocks: Ints) -> Table:
        """Return which of the blocks is where, -1 where there is none."""
        table = np.full(self.shape, -1, dtype=np.int32)
        table.reshape(-1)[blocks] = np.arange(len(blocks), dtype=np.int32)
        return table

    def halved(self) -> Lattice:
        """Return the lattice of half the cells, twice the blocks along each axis."""
        return Lattice(self.origin, self.cell / 2.0, tuple(2 * n for n in self.shape))

    def beside(self, blocks: Ints, side: int) -> tuple[Bools, Ints]:
        """Return which of the blocks have one beside them in the lattice, (n,), and where that is, (k, 3)."""
        places = self.places(blocks) + _AROUND[side]
        exists = ((places >= 0) & (places < self.shape)).all(axis=1)
        return exists, places[exists]


def shell_distance(
    points: Floats, shell: Ints, lattice: Lattice, *, band: float, solid: bool, threads: int
) -> ShellDistance:
    """Return the signed distance from a closed shell where it is less than the band.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    shell : (m, 3) int array
        Triangles of a closed, connected surface that face outward.
    lattice : Lattice
        Of the grid.
    band : float
        Distance up to which it is that to the triangles [mm].
    solid : bool
        False for a shell that encloses nothing: the distance is then without sign.
    threads : int
        0 for one per processor.
    """
    triangles = _within_reach(points, shell, lattice, band)
    if not len(triangles):
        return _all_or_nothing(points, shell, lattice, band, solid)
    corners = np.ascontiguousarray(points[triangles])
    normals = pseudonormals(points, triangles)
    blocks, values = _band_values(corners, normals, lattice, band, threads)
    fine, fine_table = _halved(corners, normals, lattice, threads)
    poor = _fit(blocks, values, fine, fine_table, lattice, band)
    if not solid:
        return ShellDistance(blocks, np.abs(values), np.abs(fine), fine_table, poor)
    inside = _blocks_inside(points, shell, lattice, blocks, values)
    deep = np.full((len(inside), SIDE, SIDE, SIDE), -band, dtype=np.float32)
    blocks, values = np.concatenate([blocks, inside]), np.concatenate([values, deep])
    table, neighbours = lattice.table(blocks), np.full((len(blocks), 6), -1, dtype=np.int64)
    for side in range(6):
        exists, places = lattice.beside(blocks, side)
        neighbours[exists, side] = table[tuple(places.T)]
    fill_inside(values, neighbours, lattice.cell, float(np.float32(band)))
    return ShellDistance(blocks, values, fine, fine_table, poor)


def _within_reach(points: Floats, shell: Ints, lattice: Lattice, band: float) -> Ints:
    """Return the triangles that the grid can see, with all that touch them (for the normals)."""
    reach = band + lattice.cell
    low = lattice.origin - reach
    high = lattice.origin + lattice.cell * SIDE * np.array(lattice.shape) + reach
    near = np.ones(len(shell), dtype=np.bool_)
    for k in range(3):  # column by column: numpy is slow along a short last axis
        a, b, c = (points[shell[:, corner], k] for corner in range(3))
        near &= (np.maximum(np.maximum(a, b), c) >= low[k]) & (np.minimum(np.minimum(a, b), c) <= high[k])
    touched = np.zeros(len(points), dtype=np.bool_)
    touched[shell[near]] = True
    return shell if near.all() else shell[touched[shell].any(axis=1)]


def _all_or_nothing(points: Floats, shell: Ints, lattice: Lattice, band: float, solid: bool) -> ShellDistance:
    """Return all blocks where the grid is wholly within a shell, else none."""
    blocks = np.arange(int(np.prod(lattice.shape)))
    none = blocks[:0]
    if not (solid and _winds_round(points, shell, lattice, blocks[0])):
        blocks = none
    values = np.full((len(blocks), SIDE, SIDE, SIDE), -band, dtype=np.float32)
    return ShellDistance(blocks, values, values[:0], lattice.halved().table(none), none)


def _winds_round(points: Floats, shell: Ints, lattice: Lattice, block: np.int64) -> bool:
    middle = lattice.origin + lattice.cell * SIDE * (lattice.places(np.array([block]))[0] + 0.5)
    return winding_number(points, shell, middle) > 0.5


def _band_values(
    corners: Floats, normals: Floats, lattice: Lattice, band: float, threads: int
) -> tuple[Ints, Singles]:
    """Return the blocks with a node in the band, and the distances there."""
    offsets, members = triangles_of_blocks(corners, lattice.origin, lattice.cell, band, lattice.shape)
    blocks = np.flatnonzero(np.diff(offsets))
    places = lattice.places(blocks)
    values = np.empty((len(blocks), SIDE, SIDE, SIDE), dtype=np.float32)
    in_band = np.empty(len(blocks), dtype=np.bool_)

    def fill(start: int) -> None:
        part = slice(start, start + _BLOCKS_PER_TASK)
        of_part = blocks[part], places[part], offsets, members, corners, normals
        fill_band(*of_part, lattice.origin, lattice.cell, band, values[part], in_band[part])

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        list(pool.map(fill, range(0, len(blocks), _BLOCKS_PER_TASK)))
    return blocks[in_band], values[in_band]


def _halved(corners: Floats, normals: Floats, lattice: Lattice, threads: int) -> tuple[Singles, Table]:
    """Return the distances next to the surface at nodes twice as dense, and which block of them is where."""
    halved = lattice.halved()
    blocks, values = _band_values(corners, normals, halved, SAMPLED * lattice.cell, threads)
    return values, halved.table(blocks)


def _fit(
    blocks: Ints, values: Singles, fine: Singles, fine_table: Table, lattice: Lattice, band: float
) -> Ints:
    """Change the values of nodes next to the surface to those that are best between the nodes.

    Returns the blocks where even these are not good enough.
    """
    table, places = lattice.table(blocks), lattice.places(blocks)
    nearest = np.empty((len(blocks), SIDE + 1, SIDE + 1, SIDE + 1), dtype=np.float32)
    with_far_faces(values, table, places, band, nearest)
    np.abs(nearest, out=nearest)
    for axis in (1, 2, 3):  # from nodes to cells: the least of the corners
        lower, upper = nearest.take(range(SIDE), axis), nearest.take(range(1, SIDE + 1), axis)
        nearest = np.minimum(lower, upper)
    of_block, *in_block = np.nonzero(nearest < _NEAR * lattice.cell)
    nodes = SIDE * places[of_block] + np.column_stack(in_block)
    cells = np.empty((len(nodes), 8), dtype=np.int64)
    for corner, shift in enumerate(np.ndindex(2, 2, 2)):
        place, within = np.divmod(nodes + np.array(shift), SIDE)
        exists = (place < lattice.shape).all(axis=1)
        place[~exists] = 0
        block = np.where(exists, table[tuple(place.T)], -1).astype(np.int64)
        flat = np.ravel_multi_index(tuple(within.T), (SIDE, SIDE, SIDE))
        cells[:, corner] = np.where(block >= 0, block * SIDE**3 + flat, -1)
    complete = (cells >= 0).all(axis=1)
    samples = np.empty((int(complete.sum()), 27), dtype=np.float32)
    sample_cells(nodes[complete], fine, fine_table, known_up_to(lattice.cell), samples)
    worst = fit_nodes(values.reshape(-1), cells[complete], samples, lattice.cell)
    return np.unique(blocks[of_block[complete][worst > _POOR * lattice.cell]])


def known_up_to(cell: float) -> float:
    """Return the distance below which values at the nodes of half cells are known [mm]."""
    return SAMPLED * cell * (1.0 - 1e-6)  # the limit itself stands for all that is farther


def _blocks_inside(points: Floats, shell: Ints, lattice: Lattice, blocks: Ints, values: Singles) -> Ints:
    """Return the blocks beyond the band that are inside.

    Connected blocks beyond the band are on one side, that of the nodes of the band next to them: most of
    them, in case the surface meets itself. Where there are none, or as many on either side, the winding
    number tells.
    """
    beyond = np.ones(lattice.shape, dtype=np.bool_)
    beyond.reshape(-1)[blocks] = False
    parts, n_parts = label(beyond)
    votes = np.zeros(n_parts + 1)
    for side in range(6):
        exists, places = lattice.beside(blocks, side)
        face = np.take(values[exists], 0 if side % 2 == 0 else SIDE - 1, axis=1 + side // 2)
        sides = np.sign(face).sum(axis=(1, 2))
        votes += np.bincount(parts[tuple(places.T)], weights=sides, minlength=n_parts + 1)
    flat = parts.reshape(-1)
    within = votes < 0
    for tie in np.flatnonzero(votes[1:] == 0) + 1:
        within[tie] = _winds_round(points, shell, lattice, np.flatnonzero(flat == tie)[0])
    within[0] = False  # the blocks of the band
    return np.flatnonzero(within[flat])
