"""Bones as signed distances on a sparse grid: exact near the surface, known all through the inside.

The grid stores blocks of 8 x 8 x 8 cells where the surface is within the band, and inside; elsewhere the
distance reads as the band.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.collision.distance_blocks import SIDE, with_far_faces
from vtkmuscle.core.collision.distance_shell import Lattice, ShellDistance, shell_distance
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.closed_shells import closed_shells
from vtkmuscle.core.types import Floats, Ints, Singles, Table

#: Half width of the band in cells, where none is given: a cell of the surface, and room for the gradient.
BAND_CELLS = 2.5

#: Blocks in the table of a grid, at most.
MOST_BLOCKS = 2**23


#: Lowest and highest corner [mm].
Corners = tuple[ArrayLike, ArrayLike]


class Field(NamedTuple):
    """A :class:`DistanceGrid` as kernels take it; the attributes are the grid's."""

    values: Singles
    table: Table
    origin: Floats
    cell: float
    band: float


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Signed distance from a bone in its rest pose, negative inside, at the nodes of a sparse uniform grid.

    Attributes
    ----------
    origin : (3,) float array
        Node (0, 0, 0) [mm].
    cell : float
        Distance of neighbouring nodes [mm].
    band : float
        Up to this distance values are those to the triangles; outside they never exceed it [mm].
    table : (bx, by, bz) int32 array
        Which entry of ``values`` a block of 8 x 8 x 8 cells is; -1 where all of it is beyond the band,
        outside.
    values : (n, 9, 9, 9) float32 array
        At the nodes of each block [mm]; neighbours share the nodes of a face.
    remarks : tuple of str
        What was wrong with the surface, in words.
    """

    origin: Floats
    cell: float
    band: float
    table: Table
    values: Singles
    remarks: tuple[str, ...] = ()

    @cached_property
    def field(self) -> Field:
        """The grid for kernels."""
        return Field(self.values, self.table, self.origin, self.cell, self.band)

    @property
    def nbytes(self) -> int:
        """Memory of the grid [bytes]."""
        return self.table.nbytes + self.values.nbytes


def build_distance_grid(
    points: Floats,
    triangles: Ints,
    *,
    cell: float,
    band: float | None = None,
    region: Corners | None = None,
    threads: int = 0,
    what: str = "distance grid",
) -> DistanceGrid:
    """Return the signed distance from a surface of one or several shells, which may overlap.

    Within the band, distances are those to the triangles and the side follows from angle-weighted normals
    (Baerentzen, Aanaes 2005, doi:10.1109/TVCG.2005.49). Farther inside, the distance is that of a front
    that moves inward at unit speed from the band (Zhao 2005, doi:10.1090/S0025-5718-04-01678-3), to first
    order. Each shell has an inside of its own, whether it faces outward or inward; of several the least
    distance counts. Shells may lie anywhere: what is out of the region's reach costs nothing.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions in the rest pose [mm]; point ids.
    cell : float
        Distance of neighbouring nodes [mm].
    band : float, optional
        Distance from the surface up to which it is that to the triangles [mm], at least 2 cells;
        2.5 cells by default.
    region : (low, high), optional
        Corners of the box in which distances will be asked for [mm]; all of the bone by default. The nodes
        are the same, whatever the region is.
    threads : int, optional
        Threads to work in, 0 for one per processor; the result does not depend on it.
    what : str, optional
        Named in warnings.

    Returns
    -------
    DistanceGrid
        Of memory in proportion to the bone's surface and volume.

    Warns
    -----
    UserWarning
        If the surface is open, inside out or encloses no volume; says what was made of it.

    Raises
    ------
    ValueError
        If cell, band or region make no sense, the grid would be too large, or the surface has no
        triangles or a coordinate that is not finite.
    """
    band = BAND_CELLS * cell if band is None else float(band)
    if not (np.isfinite(cell) and cell > 0 and np.isfinite(band) and band >= 2 * cell):
        raise InputError(
            "", f"a distance grid needs cell > 0 and band >= 2 cells, got cell={cell:g} mm, band={band:g} mm"
        )
    surface = closed_shells(points, triangles)
    warn_of(surface.remarks, what)
    low = np.min([surface.points[shell].min(axis=(0, 1)) for shell in surface.shells], axis=0)
    high = np.max([surface.points[shell].max(axis=(0, 1)) for shell in surface.shells], axis=0)
    # The outermost nodes are outside, and farther from the bone than the band.
    base, top = low - (band + cell), high + (band + cell)
    first, count = _blocks_of(base, top, cell, region)
    if np.prod(count.astype(np.float64)) > MOST_BLOCKS:
        raise InputError(
            "",
            f"cells of {cell:g} mm are too small for a box of {np.ptp([base, top], axis=0).round(1)} mm",
            "use larger cells or a smaller region",
        )
    threads = threads or os.cpu_count() or 1
    lattice = Lattice(base + SIDE * cell * first, float(cell), tuple(int(n) for n in count))

    def measured(number: int) -> ShellDistance:
        shell, solid = surface.shells[number], surface.solid[number]
        return shell_distance(surface.points, shell, lattice, band=band, solid=solid, threads=threads)

    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(measured, range(len(surface.shells))))
    table, values = _united(parts, lattice, band)
    return DistanceGrid(lattice.origin, lattice.cell, band, table, values, surface.remarks)


def _united(parts: Sequence[ShellDistance], lattice: Lattice, band: float) -> tuple[Table, Singles]:
    """Return table and values of the grid of several shells: everywhere the least distance."""
    blocks = np.unique(np.concatenate([part.blocks for part in parts]))
    table = lattice.table(blocks)
    values = np.full((len(blocks), SIDE, SIDE, SIDE), band, dtype=np.float32)
    for part in parts:
        at = table.reshape(-1)[part.blocks]
        values[at] = np.minimum(values[at], part.values)
    more = np.setdiff1d(_before(blocks, values, lattice, band), blocks)
    values = np.concatenate([values, np.full((len(more), SIDE, SIDE, SIDE), band, dtype=np.float32)])
    blocks = np.concatenate([blocks, more])
    table = lattice.table(blocks)
    whole = np.empty((len(blocks), SIDE + 1, SIDE + 1, SIDE + 1), dtype=np.float32)
    with_far_faces(values, table, lattice.places(blocks), band, whole)
    return table, whole


def _before(blocks: Ints, values: Singles, lattice: Lattice, band: float) -> Ints:
    """Return the blocks whose last cells end at nodes of the given blocks that are within the band."""
    places = lattice.places(blocks)
    result = [blocks[:0]]
    for shift in list(product((0, 1), repeat=3))[1:]:
        i, j, k = (0 if step else slice(None) for step in shift)
        in_band = values[:, i, j, k] < np.float32(band)
        before = places[in_band.any(axis=tuple(range(1, in_band.ndim)))] - np.array(shift)
        before = before[(before >= 0).all(axis=1)]
        result.append(lattice.numbers(before))
    return np.concatenate(result)


def warn_of(remarks: tuple[str, ...], what: str) -> None:
    """Warn of what was wrong with a surface, in the name of the caller's caller."""
    if remarks:
        warnings.warn(f"{what}: " + "; ".join(remarks), stacklevel=3)


def _blocks_of(base: Floats, top: Floats, cell: float, region: Corners | None) -> tuple[Ints, Ints]:
    """Return the first block of the grid, counted from the base, and the number of blocks."""
    low, high = base, top
    if region is not None:
        corners = np.asarray(region, dtype=np.float64)
        if corners.shape != (2, 3) or not np.isfinite(corners).all() or (corners[0] > corners[1]).any():
            raise InputError(
                "", f"a region is a low and a high corner, three finite numbers each, got {region}"
            )
        # Two more cells, so that a gradient at the edge of the region has all its nodes.
        low = np.clip(corners[0] - 2 * cell, base, top)
        high = np.clip(corners[1] + 2 * cell, base, top)
    first = np.floor((low - base) / (SIDE * cell)).astype(np.int64)
    last = np.ceil((high - base) / (SIDE * cell)).astype(np.int64)
    return first, np.maximum(last - first, 1)
