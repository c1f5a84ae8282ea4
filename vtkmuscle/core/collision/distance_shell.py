"""Signed distance from one closed shell at the nodes of the blocks that its band and its inside meet."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from vtkmuscle.core.collision.distance_blocks import SIDE, fill_band, fill_inside, triangles_of_blocks
from vtkmuscle.core.mesh.triangle_distance import Sides, sides_of, winding_number
from vtkmuscle.core.types import Bools, Floats, Ints, Singles, Table

#: Blocks that a thread works on at a time.
_BLOCKS_PER_TASK = 256

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
    """

    blocks: Ints
    values: Singles


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

    def numbers(self, places: Ints) -> Ints:
        """Return the numbers of the blocks at places (n, 3), (n,)."""
        numbers: Ints = np.ravel_multi_index(tuple(places.T), self.shape)
        return numbers

    def table(self, blocks: Ints) -> Table:
        """Return which of the blocks is where, -1 where there is none."""
        table = np.full(self.shape, -1, dtype=np.int32)
        table.reshape(-1)[blocks] = np.arange(len(blocks), dtype=np.int32)
        return table

    def part(self, low: Floats, high: Floats) -> tuple[Lattice, Ints] | None:
        """Return the blocks that meet a box, as a lattice, and the place of its first; None without any."""
        side = SIDE * self.cell
        first = np.clip(np.floor((low - self.origin) / side), 0, self.shape).astype(np.int64)
        last = np.clip(np.floor((high - self.origin) / side), -1, np.array(self.shape) - 1).astype(np.int64)
        if (first > last).any():
            return None
        return Lattice(self.origin + side * first, self.cell, tuple((last - first + 1).tolist())), first

    def beside(self, blocks: Ints, side: int) -> tuple[Bools, Ints]:
        """Return which of the blocks have one beside them in the lattice, (n,), and where that is, (k, 3)."""
        places = self.places(blocks) + _AROUND[side]
        exists = ((places >= 0) & (places < self.shape)).all(axis=1)
        return exists, places[exists]


def shell_distance(
    points: Floats, shell: Ints, lattice: Lattice, *, band: float, solid: bool, threads: int
) -> ShellDistance:
    """Return the signed distance from a closed shell where it is less than the band.

    The work is done in the blocks that the shell's box meets, so that a speck of bone costs what a speck
    does, wherever it lies and however large the grid is.

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
        How many work at a time, at most.

    Returns
    -------
    ShellDistance
        Without blocks where the grid does not reach the shell.
    """
    used, numbers = np.unique(shell, return_inverse=True)
    points, shell = points[used], numbers.reshape(-1, 3).astype(np.int64)
    near = lattice.part(points.min(axis=0) - band, points.max(axis=0) + band)
    if near is None:
        return ShellDistance(np.empty(0, np.int64), np.empty((0, SIDE, SIDE, SIDE), np.float32))
    part, first = near
    blocks, values = _distance_in(part, points, shell, band=band, solid=solid, threads=threads)
    return ShellDistance(lattice.numbers(part.places(blocks) + first), values)


def _distance_in(
    lattice: Lattice, points: Floats, shell: Ints, *, band: float, solid: bool, threads: int
) -> tuple[Ints, Singles]:
    """Return the blocks with a node in the band or inside, and the values there."""
    triangles = _within_reach(points, shell, lattice, band)
    if not len(triangles):
        return _all_or_nothing(points, shell, lattice, band, solid)
    corners = np.ascontiguousarray(points[triangles])
    blocks, values = _band_values(corners, sides_of(points, triangles), lattice, band, threads)
    if not solid:
        return blocks, np.abs(values)
    inside = _blocks_inside(points, shell, lattice, blocks, values)
    deep = np.full((len(inside), SIDE, SIDE, SIDE), -band, dtype=np.float32)
    blocks, values = np.concatenate([blocks, inside]), np.concatenate([values, deep])
    table, neighbours = lattice.table(blocks), np.full((len(blocks), 6), -1, dtype=np.int64)
    for side in range(6):
        exists, places = lattice.beside(blocks, side)
        neighbours[exists, side] = table[tuple(places.T)]
    fill_inside(values, neighbours, lattice.cell, float(np.float32(band)))
    return blocks, values


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


def _all_or_nothing(
    points: Floats, shell: Ints, lattice: Lattice, band: float, solid: bool
) -> tuple[Ints, Singles]:
    """Return all blocks where the grid is wholly within a shell, else none."""
    blocks = np.arange(int(np.prod(lattice.shape)))
    if not (solid and _winds_round(points, shell, lattice, blocks[0])):
        blocks = blocks[:0]
    return blocks, np.full((len(blocks), SIDE, SIDE, SIDE), -band, dtype=np.float32)


def _winds_round(points: Floats, shell: Ints, lattice: Lattice, block: np.int64) -> bool:
    middle = lattice.origin + lattice.cell * SIDE * (lattice.places(np.array([block]))[0] + 0.5)
    return winding_number(points, shell, middle) > 0.5


def _band_values(
    corners: Floats, sides: Sides, lattice: Lattice, band: float, threads: int
) -> tuple[Ints, Singles]:
    """Return the blocks with a node in the band, and the distances there."""
    offsets, members = triangles_of_blocks(corners, lattice.origin, lattice.cell, band, lattice.shape)
    blocks = np.flatnonzero(np.diff(offsets))
    places = lattice.places(blocks)
    values = np.empty((len(blocks), SIDE, SIDE, SIDE), dtype=np.float32)
    in_band = np.empty(len(blocks), dtype=np.bool_)

    def fill(start: int) -> None:
        part = slice(start, start + _BLOCKS_PER_TASK)
        of_part = blocks[part], places[part], offsets, members, corners, sides
        fill_band(*of_part, lattice.origin, lattice.cell, band, values[part], in_band[part])

    tasks = range(0, len(blocks), _BLOCKS_PER_TASK)
    if len(tasks) > 1 and threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(fill, tasks))
    else:
        for task in tasks:
            fill(task)
    return blocks[in_band], values[in_band]


def _blocks_inside(points: Floats, shell: Ints, lattice: Lattice, blocks: Ints, values: Singles) -> Ints:
    """Return the blocks beyond the band that are inside.

    Connected blocks beyond the band are on one side, that of the nodes of the band next to them: most of
    them, in case the surface meets itself. Where there are none, or as many on either side, the winding
    number decides.
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
