"""Distances from bones far and near, computed where they are first asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.solids import FAR, Solids
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.space_order import space_order
from vtkmuscle.core.types import Bools, Floats, Ints, Table

#: Cells along an edge of a block; blocks are what is computed at a time.
SIDE = 8

#: Blocks of a bone's table, at most: 64 MB. Cells of a bone that would need more are larger.
MOST_BLOCKS = 2**24

_LATTICE = np.stack(np.meshgrid(*[np.arange(SIDE + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)

#: The nodes of a block, (9^3, 3), with those of its far faces; each is near those before it.
_NODES = _LATTICE[space_order(_LATTICE.astype(np.float64))]

#: What a table has for a block that was not computed yet.
UNKNOWN = -1


class BoneFields:
    """Signed distances from several bones at rest, negative inside, on grids that are filled on demand.

    A signed distance grid for collision knows a narrow band around a bone. Fibres keep the thickness of the
    tissue away from it, centimetres, but only in a few places: blocks of 8 x 8 x 8 cells are computed when a
    query first comes to them, from the triangles. But for rounding the values do not depend on the order of
    the queries.

    Parameters
    ----------
    bones : sequence of (Solids, axes (4, 4))
        At rest [mm], and the rigid transform from the scene to the axes that the grid is laid along.
    cell : float
        Distance of neighbouring nodes [mm].
    reach : sequence of float
        How far from each bone distances are asked for [mm]; farther away they are :data:`FAR`.

    Attributes
    ----------
    layout : (b, 8) array
        Per bone the position of node (0, 0, 0) in its axes, the cell, the number of blocks along each axis,
        and where the bone's table begins.
    table : (t,) int32 array
        Of all bones: which entry of ``values`` a block is.
    values : (v, 9, 9, 9) array
        At the nodes of each block [mm]; neighbours share the nodes of a face.
    to_axes : (b, 4, 4) array
        From the scene at rest to the axes of each bone.
    """

    def __init__(
        self, bones: Sequence[tuple[Solids, Floats]], *, cell: float, reach: Sequence[float]
    ) -> None:
        self._solids = [solids for solids, _ in bones]
        self.to_axes: Floats = np.array([axes for _, axes in bones]).reshape(-1, 4, 4)
        self.layout: Floats = np.zeros((len(bones), 8))
        start = 0
        for bone, ((solids, axes), far) in enumerate(zip(bones, reach, strict=True)):
            along = apply_transform(axes, solids.points)
            low, high = along.min(axis=0) - far - cell, along.max(axis=0) + far + cell
            size = max(cell, float((np.prod(high - low) / MOST_BLOCKS) ** (1.0 / 3.0)) / SIDE)
            counts = np.ceil((high - low) / (SIDE * size)).astype(np.int64) + 1
            self.layout[bone] = [*low, size, *counts, start]
            start += int(np.prod(counts))
        self.table: Table = np.full(start, UNKNOWN, dtype=np.int32)
        self.values: Floats = np.empty((0, SIDE + 1, SIDE + 1, SIDE + 1))
        self._used = 0

    def fill(self, missing: Ints) -> None:
        """Compute blocks.

        Parameters
        ----------
        missing : (k,) int array
            Their places in the table.
        """
        wanted = np.unique(missing[self.table[missing] == UNKNOWN])
        if self._used + len(wanted) > len(self.values):
            room = max(2 * len(self.values), self._used + len(wanted), 16)
            grown = np.empty((room, *self.values.shape[1:]))
            grown[: self._used] = self.values[: self._used]
            self.values = grown
        starts = self.layout[:, 7].astype(np.int64)
        for block in wanted:
            bone = int(np.searchsorted(starts, block, side="right")) - 1
            origin, cell, counts = self.layout[bone, :3], self.layout[bone, 3], self.layout[bone, 4:7]
            corner = np.array(np.unravel_index(block - starts[bone], counts.astype(np.int64)))
            values = self.values[self._used]
            unknown = self._without_neighbours(values, corner, bone)
            nodes = _NODES[unknown[tuple(_NODES.T)]]
            at = origin + cell * (SIDE * corner + nodes)
            rest = apply_transform(inverse(self.to_axes[bone]), at)
            values[tuple(nodes.T)] = self._solids[bone].distances(rest, run=len(rest))
            self.table[block] = self._used
            self._used += 1

    def _without_neighbours(self, values: Floats, corner: Ints, bone: int) -> Bools:
        """Copy to a block's values (9, 9, 9) what its neighbours have, and return which nodes none has."""
        unknown = np.ones(values.shape, dtype=np.bool_)
        counts, start = self.layout[bone, 4:7].astype(np.int64), int(self.layout[bone, 7])
        for axis in range(3):
            for step, mine, theirs in ((-1, 0, SIDE), (1, SIDE, 0)):
                beside = corner.copy()
                beside[axis] += step
                if not 0 <= beside[axis] < counts[axis]:
                    continue
                known = self.table[start + np.ravel_multi_index(tuple(beside), tuple(counts))]
                if known != UNKNOWN:
                    near, far = np.moveaxis(values, axis, 0), np.moveaxis(self.values[known], axis, 0)
                    near[mine] = far[theirs]
                    np.moveaxis(unknown, axis, 0)[mine] = False
        return unknown


@kernel
def field_at(layout: Floats, table: Table, values: Floats, x: float, y: float, z: float) -> tuple[float, int]:
    """Return the trilinear distance at a position along a bone's axes, and the block that is missing.

    Parameters
    ----------
    layout : (8,) array
        Of the bone; this and the next two as of :class:`BoneFields`.
    table, values
        Of all bones.
    x, y, z : float
        Position along the bone's axes [mm].

    Returns
    -------
    distance : float
        [mm]; :data:`FAR` beyond the grid or where the block is missing.
    missing : int
        Place in the table of a block that has to be filled first; -1 where there is none.
    """
    cell = layout[3]
    u, v, w = (x - layout[0]) / cell, (y - layout[1]) / cell, (z - layout[2]) / cell
    nx, ny, nz = np.int64(layout[4]), np.int64(layout[5]), np.int64(layout[6])
    if not (0.0 <= u < SIDE * nx and 0.0 <= v < SIDE * ny and 0.0 <= w < SIDE * nz):
        return FAR, -1
    i, j, k = np.int64(u), np.int64(v), np.int64(w)
    place = np.int64(layout[7]) + ((i // SIDE) * ny + j // SIDE) * nz + k // SIDE
    block = table[place]
    if block == UNKNOWN:
        return FAR, int(place)
    return trilinear(values[block], i % SIDE, j % SIDE, k % SIDE, u - i, v - j, w - k), -1


@kernel
def trilinear(values: Floats, i: np.int64, j: np.int64, k: np.int64, u: float, v: float, w: float) -> float:
    """Return the value in cell (i, j, k) of nodes (9, 9, 9), at (u, v, w) in [0, 1] from its first node."""
    c00 = values[i, j, k] + w * (values[i, j, k + 1] - values[i, j, k])
    c01 = values[i, j + 1, k] + w * (values[i, j + 1, k + 1] - values[i, j + 1, k])
    c10 = values[i + 1, j, k] + w * (values[i + 1, j, k + 1] - values[i + 1, j, k])
    c11 = values[i + 1, j + 1, k] + w * (values[i + 1, j + 1, k + 1] - values[i + 1, j + 1, k])
    c0, c1 = c00 + v * (c01 - c00), c10 + v * (c11 - c10)
    value: float = c0 + u * (c1 - c0)
    return value


@kernel
def slope_at(layout: Floats, table: Table, values: Floats, x: float, y: float, z: float, out: Floats) -> int:
    """Write the unit direction in which the distance grows, by central differences over a cell.

    They are continuous, where the slope of the trilinear distance jumps from cell to cell.

    Returns
    -------
    int
        A block that is missing, as of :func:`field_at`; -1 where there is none.
    """
    cell = layout[3]
    u, v, w = (x - layout[0]) / cell, (y - layout[1]) / cell, (z - layout[2]) / cell
    ny, nz = np.int64(layout[5]), np.int64(layout[6])
    i, j, k = int(u - 0.5), int(v - 0.5), int(w - 0.5)
    a, b, c = i % SIDE, j % SIDE, k % SIDE
    inside = min(u, v, w) >= 0.5 and max(a, b, c) < SIDE - 1 and u < SIDE * np.int64(layout[4])
    if inside and v < SIDE * ny and w < SIDE * nz:
        place = np.int64(layout[7]) + ((i // SIDE) * ny + j // SIDE) * nz + k // SIDE
        block = table[place]
        if block == UNKNOWN:
            return int(place)
        _slope_within(values[block], a, b, c, u - i, v - j, w - k, out)
    else:
        h = 0.5 * cell
        for axis in range(3):
            dx, dy, dz = h * (axis == 0), h * (axis == 1), h * (axis == 2)
            above, lacking = field_at(layout, table, values, x + dx, y + dy, z + dz)
            if lacking >= 0:
                return lacking
            below, lacking = field_at(layout, table, values, x - dx, y - dy, z - dz)
            if lacking >= 0:
                return lacking
            out[axis] = above - below
    length = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    if length > 0.0 and length < FAR:
        for axis in range(3):
            out[axis] /= length
    else:
        out[:] = 0.0
    return -1


@kernel
def _slope_within(values: Floats, i: int, j: int, k: int, u: float, v: float, w: float, out: Floats) -> None:
    """Write a block's trilinear distance's differences over a cell, at u, v, w in [0.5, 1.5) from a node.

    The 27 nodes from (i, j, k) on are those of all six places that are compared.
    """
    x, y, z = 0.0, 0.0, 0.0
    for a in range(3):
        at_u, by_u = _weight(u, a), _gain(u, a)
        for b in range(3):
            at_v, by_v = _weight(v, b), _gain(v, b)
            p, q, r = values[i + a, j + b, k], values[i + a, j + b, k + 1], values[i + a, j + b, k + 2]
            here = _weight(w, 0) * p + _weight(w, 1) * q + _weight(w, 2) * r
            x += by_u * at_v * here
            y += at_u * by_v * here
            z += at_u * at_v * (_gain(w, 0) * p + _gain(w, 1) * q + _gain(w, 2) * r)
    out[0], out[1], out[2] = x, y, z


@kernel
def _weight(t: float, node: int) -> float:
    """Return the weight of node 0, 1 or 2 in the value at t."""
    return max(1.0 - abs(t - node), 0.0)


@kernel
def _gain(t: float, node: int) -> float:
    """Return how much that weight grows from half a cell before t to half a cell after."""
    if node == 1:
        return 2.0 - 2.0 * t
    return t - 1.5 if node == 0 else t - 0.5
