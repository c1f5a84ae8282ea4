"""Look-ups of a bone's signed distances.

Kernels do the look-ups. Look-ups also give the distances' directions, in the known blocks.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from vtkmuscle.core.jit import kernel, lane
from vtkmuscle.core.mesh.solids import FAR
from vtkmuscle.core.types import Floats, Ints, Table

#: Cells along an edge of a block; a block is computed at a time.
SIDE = 4
#: Nodes along an edge of a block: neighbours share those of a face.
NODES = SIDE + 1

#: Blocks are numbered from minus this to this along each axis, so that three numbers make one key.
MOST = 2**19

#: Marks an empty slot of a table of keys.
EMPTY = -1

#: Largest error of a trilinear value [cells]: no distance grows faster than the way, and the mean way from a
#: point of a cell to the nodes, by their weights, is greatest at the cell's middle.
FIELD_ERROR = 3.0**0.5 / 2.0

#: A direction shorter than this, instead of 1, lies on a ridge.
_FLAT = 0.2

#: Fibonacci hashing: 2^64 divided by the golden ratio, as a signed number (Knuth 1998, *Sorting and
#: searching*, 6.4).
_GOLDEN = -7046029254386353131

Integer: TypeAlias = int | np.int64


class Field(NamedTuple):
    """The known part of a bone's field, for kernels.

    A look-up in an unknown block reads as :data:`FAR`, and notes the block in ``lacking``. A caller with new
    blocks in ``lacking`` lets the bone fill the blocks, and repeats the look-ups. Beside the field there is
    an overview, four times as coarse, to show points far from the bone.
    """

    keys: Ints  # (c,), hash table of the blocks, c a power of 2
    places: Table  # (c,), rows of their values
    values: Floats  # (n, 125), signed distances at the nodes of each block, 5 along each axis in C order [mm]
    box: Floats  # (6,), low and high corner of the bone's box along its axes [mm]
    cell: float  # distance of neighbouring nodes [mm], one of which is at the origin of the axes
    per_mm: float  # its inverse
    lacking: Ints  # (2 + m,), number of look-ups in unknown blocks, number of blocks noted, their keys


@lane
def key_of(i: Integer, j: Integer, k: Integer, level: Integer) -> Integer:
    """Return the key of a block.

    The block has a number along each axis, from -MOST to MOST - 1. level : 0 for a block of the field, 1 for
    a block of the overview, with cells as large as the field's blocks.
    """
    return ((level * (2 * MOST) + i + MOST) * (2 * MOST) + j + MOST) * (2 * MOST) + k + MOST


@lane
def _slot_of(keys: Ints, key: Integer) -> Integer:
    """Return the slot of a key in a hash table.

    A missing key gets the slot that the key would be in.
    """
    slot = (np.int64(key) * np.int64(_GOLDEN) >> 32) & (len(keys) - 1)
    while keys[slot] != key and keys[slot] != EMPTY:
        slot = (slot + 1) & (len(keys) - 1)
    return slot


@kernel
def put_into_table(keys: Ints, places: Table, more: Ints, first: int) -> None:
    """Add new keys to a hash table with room.

    The new keys' places count from the first.
    """
    for number in range(len(more)):
        slot = _slot_of(keys, more[number])
        keys[slot], places[slot] = more[number], first + number


@lane
def _block_at(field: Field, i: Integer, j: Integer, k: Integer, level: Integer) -> Integer:
    """Return the row of a block's values.

    An unknown block gives -1, and a note.
    """
    key = key_of(i, j, k, level)
    slot = _slot_of(field.keys, key)
    if field.keys[slot] != EMPTY:
        place: np.int64 = np.int64(field.places[slot])
        return place
    lacking = field.lacking
    lacking[0] += 1
    noted = lacking[1]
    if 2 + noted < len(lacking) and (noted == 0 or lacking[1 + noted] != key):
        lacking[2 + noted] = key
        lacking[1] = noted + 1
    return -1


@lane
def distance_at(field: Field, x: float, y: float, z: float) -> float:
    """Return the trilinear distance at a position along a bone's axes [mm].

    :data:`~vtkmuscle.core.mesh.solids.FAR` in unknown blocks, and beyond the blocks that can be numbered.
    """
    return _trilinear(field, x * field.per_mm, y * field.per_mm, z * field.per_mm, np.int64(0))


@lane
def least_distance_at(field: Field, x: float, y: float, z: float) -> float:
    """Return a lower bound of the distance at a position.

    The overview gives the bound; FAR where the overview is FAR.
    """
    scale = field.per_mm / SIDE
    distance = _trilinear(field, x * scale, y * scale, z * scale, np.int64(1))
    return distance - FIELD_ERROR * SIDE * field.cell if distance < FAR else FAR


@lane
def _trilinear(field: Field, u: float, v: float, w: float, level: Integer) -> float:
    """Return the distance at a position in a level's cells.

    A constant level would be compiled apart.
    """
    if not max(abs(u), abs(v), abs(w)) < SIDE * (MOST - 1):
        return FAR
    i, j, k = np.int64(np.floor(u)), np.int64(np.floor(v)), np.int64(np.floor(w))
    block = _block_at(field, i // SIDE, j // SIDE, k // SIDE, level)
    if block < 0:
        return FAR
    u, v, w = u - i, v - j, w - k
    values, node = field.values, ((i % SIDE) * NODES + j % SIDE) * NODES + k % SIDE
    c00 = values[block, node] + w * (values[block, node + 1] - values[block, node])
    node += NODES
    c01 = values[block, node] + w * (values[block, node + 1] - values[block, node])
    node += NODES * SIDE
    c10 = values[block, node] + w * (values[block, node + 1] - values[block, node])
    node += NODES
    c11 = values[block, node] + w * (values[block, node + 1] - values[block, node])
    c0, c1 = c00 + v * (c01 - c00), c10 + v * (c11 - c10)
    distance: float = c0 + u * (c1 - c0)
    return distance


@kernel
def normal_at(field: Field, at: Floats, out: Floats) -> bool:
    """Write the unit direction of growing distance.

    The position is (3,). Where no direction exists, write 0 and return False. Central differences over a cell
    are continuous, while the gradient of the trilinear value jumps from cell to cell: a point that slides
    along a bone must not jump. On a ridge, halfway through a bone, the gradient vanishes, and differences to
    the next cell onward are taken (onward only, so that the differences are not zero on a plane of symmetry).
    """
    x, y, z, cell = at[0], at[1], at[2], field.cell
    dx, dy, dz = _slope_at(field, x, y, z)
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if not length > _FLAT * cell:
        here = distance_at(field, x, y, z)
        dx = distance_at(field, x + cell, y, z) - here
        dy = distance_at(field, x, y + cell, z) - here
        dz = distance_at(field, x, y, z + cell) - here
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if not length > 1e-6 * cell:
            out[0], out[1], out[2] = 0.0, 0.0, 0.0
            return False
    scale = 1.0 / length
    out[0], out[1], out[2] = scale * dx, scale * dy, scale * dz
    return True


@lane
def _slope_at(field: Field, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the growth of the distance along each axis.

    The trilinear distance grows over a cell around a position.
    """
    u, v, w, h = x * field.per_mm, y * field.per_mm, z * field.per_mm, 0.5 * field.cell
    if not max(abs(u), abs(v), abs(w)) < SIDE * (MOST - 1):
        return 0.0, 0.0, 0.0
    i, j, k = np.int64(np.floor(u - 0.5)), np.int64(np.floor(v - 0.5)), np.int64(np.floor(w - 0.5))
    if max(i % SIDE, j % SIDE, k % SIDE) < SIDE - 1:
        block = _block_at(field, i // SIDE, j // SIDE, k // SIDE, np.int64(0))
        if block < 0:
            return 0.0, 0.0, 0.0
        node = ((i % SIDE) * NODES + j % SIDE) * NODES + k % SIDE
        return _slope_within(field.values, block, node, u - i, v - j, w - k)
    return (
        distance_at(field, x + h, y, z) - distance_at(field, x - h, y, z),
        distance_at(field, x, y + h, z) - distance_at(field, x, y - h, z),
        distance_at(field, x, y, z + h) - distance_at(field, x, y, z - h),
    )


@lane
def _slope_within(
    values: Floats, block: Integer, node: Integer, u: float, v: float, w: float
) -> tuple[float, float, float]:
    """Return the growth of the distance within a block.

    The growth is as of :func:`_slope_at`, at u, v, w in [0.5, 1.5) from a node. The 27 nodes from the node on
    are the nodes around all six compared positions.
    """
    x0, y0, z0 = _over_plane(values, block, node, v, w)
    x1, y1, z1 = _over_plane(values, block, node + NODES * NODES, v, w)
    x2, y2, z2 = _over_plane(values, block, node + 2 * NODES * NODES, v, w)
    return _growth(x0, x1, x2, u), _value(y0, y1, y2, u), _value(z0, z1, z2, u)


@lane
def _over_plane(
    values: Floats, block: Integer, node: Integer, v: float, w: float
) -> tuple[float, float, float]:
    """Return the value in a plane, and its growth.

    The value is at v, w between 3 x 3 nodes of the plane, and the growth is along v and w.
    """
    p, q, r = values[block, node], values[block, node + 1], values[block, node + 2]
    here0, onward0 = _value(p, q, r, w), _growth(p, q, r, w)
    p, q, r = values[block, node + NODES], values[block, node + NODES + 1], values[block, node + NODES + 2]
    here1, onward1 = _value(p, q, r, w), _growth(p, q, r, w)
    node += NODES
    p, q, r = values[block, node + NODES], values[block, node + NODES + 1], values[block, node + NODES + 2]
    here2, onward2 = _value(p, q, r, w), _growth(p, q, r, w)
    return (
        _value(here0, here1, here2, v),
        _growth(here0, here1, here2, v),
        _value(onward0, onward1, onward2, v),
    )


@lane
def _value(p: float, q: float, r: float, t: float) -> float:
    """Interpolate between three nodes at t, in [0.5, 1.5)."""
    return q + max(1.0 - t, 0.0) * (p - q) + max(t - 1.0, 0.0) * (r - q)


@lane
def _growth(p: float, q: float, r: float, t: float) -> float:
    """Return the growth of the interpolation around t.

    The growth of :func:`_value` is from half a cell before t to half a cell after.
    """
    return (1.5 - t) * (q - p) + (t - 0.5) * (r - q)
