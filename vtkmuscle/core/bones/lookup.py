"""Look-ups of a bone's signed distances, by kernels."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from vtkmuscle.core.jit import kernel, lane
from vtkmuscle.core.types import Floats, Ints, Table

#: A block of 2 x 2 x 2 nodes is measured at a time, and a cube of the overview has 4 x 4 x 4 cells: binary
#: digits of their edges. A look-up needs 27 nodes; with such blocks 64 are measured for a single one.
BLOCK, CUBE = 1, 2

#: Largest error of a trilinear value [cells]: no distance grows faster than the way, and the mean way from a
#: point of a cell to the nodes, by their weights, is greatest at the cell's middle.
FIELD_ERROR = 3.0**0.5 / 2.0

#: A direction shorter than this, instead of 1, lies on a ridge.
_FLAT = 0.2

Integer: TypeAlias = int | np.int64


class Field(NamedTuple):
    """The known part of a bone's field, for kernels.

    Positions are along the bone's axes [mm]. A look-up that needs an unknown block gives NaN, and notes the
    block in ``lacking``. A caller with blocks in ``lacking`` lets the bone fill the blocks, and repeats the
    look-ups.
    """

    rows: Table  # (a, b, c), row of each block's values, 0 of an unknown block
    values: Floats  # (n, 8), signed distances at the nodes of each block [mm]; the first row is NaN
    overview: (
        Floats  # (a / 2, b / 2, c / 2), signed distance at the middle of each cube [mm], 0 where unknown
    )
    low: Floats  # (3,), number of the lattice's first node along each axis; node 0 is at the axes' origin
    box: Floats  # (6,), low and high corner of the bone's box along its axes [mm]
    cell: float  # distance of neighbouring nodes [mm]
    per_mm: float  # its inverse
    lacking: Ints  # (2 + m,), number of look-ups in unknown blocks, number of notes, the notes


@lane
def _note(field: Field, key: Integer) -> None:
    """Note an unknown block by its number, or a cube by -1 - number."""
    lacking = field.lacking
    lacking[0] += 1
    noted = lacking[1]
    if 2 + noted < len(lacking) and (noted == 0 or lacking[1 + noted] != key):
        lacking[2 + noted] = key
        lacking[1] = noted + 1


@kernel
def _note_blocks(field: Field, i: Integer, j: Integer, k: Integer, span: Integer) -> None:
    """Note the unknown blocks of the nodes from i, j, k to ``span`` nodes onward."""
    _, height, depth = field.rows.shape
    for a in range(i >> BLOCK, (i + span >> BLOCK) + 1):
        for b in range(j >> BLOCK, (j + span >> BLOCK) + 1):
            for c in range(k >> BLOCK, (k + span >> BLOCK) + 1):
                row = field.rows[a, b, c]
                if row == 0 or row >= len(field.values):
                    _note(field, (a * height + b) * depth + c)


@lane
def _node(field: Field, i: Integer, j: Integer, k: Integer) -> float:
    """Return the distance at a node, NaN where unknown."""
    row = field.rows[i >> BLOCK, j >> BLOCK, k >> BLOCK]
    if row >= len(field.values):  # another thread has just filled the block
        row = 0
    value: float = field.values[row, (i & 1) << 2 | (j & 1) << 1 | k & 1]
    return value


@lane
def _holds(field: Field, i: float, j: float, k: float, span: Integer) -> bool:
    """Return whether the lattice has the nodes from i, j, k to ``span`` nodes onward."""
    a, b, c = field.rows.shape
    least, room = min(i, j, k), min((a << BLOCK) - i, (b << BLOCK) - j, (c << BLOCK) - k)
    return least >= 0.0 and room > span


@lane
def _in_cells(field: Field, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a position in cells, from the first node."""
    low = field.low
    return x * field.per_mm - low[0], y * field.per_mm - low[1], z * field.per_mm - low[2]


@lane
def _along_edge(field: Field, i: Integer, j: Integer, k: Integer, w: float) -> float:
    """Return the distance between a node and the next."""
    first = _node(field, i, j, k)
    return first + w * (_node(field, i, j, k + 1) - first)


@lane
def distance_at(field: Field, x: float, y: float, z: float) -> float:
    """Return the trilinear distance at a position [mm], NaN where unknown and beyond the lattice."""
    u, v, w = _in_cells(field, x, y, z)
    a, b, c = np.floor(u), np.floor(v), np.floor(w)
    if not _holds(field, a - 1.0, b - 1.0, c - 1.0, 3):  # with the nodes of the normal
        return np.nan
    i, j, k, u, v, w = np.int64(a), np.int64(b), np.int64(c), u - a, v - b, w - c
    c00, c01 = _along_edge(field, i, j, k, w), _along_edge(field, i, j + 1, k, w)
    c10, c11 = _along_edge(field, i + 1, j, k, w), _along_edge(field, i + 1, j + 1, k, w)
    c0, c1 = c00 + v * (c01 - c00), c10 + v * (c11 - c10)
    distance: float = c0 + u * (c1 - c0)
    if np.isnan(distance):  # the normal there will need the nodes on both sides
        _note_blocks(field, i - np.int64(u < 0.5), j - np.int64(v < 0.5), k - np.int64(w < 0.5), 2)
    return distance


@lane
def least_distance_at(field: Field, x: float, y: float, z: float) -> float:
    """Return a lower bound of the distance at a position [mm], NaN where unknown and beyond the lattice.

    No distance grows faster than the way from the middle of the position's cube.
    """
    u, v, w = _in_cells(field, x, y, z)
    if not _holds(field, u, v, w, 0):
        return np.nan
    i, j, k = np.int64(u) >> CUBE, np.int64(v) >> CUBE, np.int64(w) >> CUBE
    distance = field.overview[i, j, k]
    if distance == 0.0:
        _, height, depth = field.overview.shape
        _note(field, -1 - ((i * height + j) * depth + k))
        return np.nan
    u, v, w = u - ((i << CUBE) + 2.0), v - ((j << CUBE) + 2.0), w - ((k << CUBE) + 2.0)
    least: float = distance - field.cell * np.sqrt(u * u + v * v + w * w)
    return least


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
    """Return the growth over a cell along each axis, NaN where unknown and beyond the lattice."""
    u, v, w = _in_cells(field, x, y, z)
    a, b, c = np.floor(u - 0.5), np.floor(v - 0.5), np.floor(w - 0.5)
    if not _holds(field, a, b, c, 2):
        return np.nan, np.nan, np.nan
    i, j, k, u, v, w = np.int64(a), np.int64(b), np.int64(c), u - a, v - b, w - c
    x0, y0, z0 = _over_plane(field, i, j, k, v, w)
    x1, y1, z1 = _over_plane(field, i + 1, j, k, v, w)
    x2, y2, z2 = _over_plane(field, i + 2, j, k, v, w)
    dx, dy, dz = _growth(x0, x1, x2, u), _value(y0, y1, y2, u), _value(z0, z1, z2, u)
    if np.isnan(dx + dy + dz):
        _note_blocks(field, i, j, k, 2)
    return dx, dy, dz


@lane
def _over_plane(
    field: Field, i: Integer, j: Integer, k: Integer, v: float, w: float
) -> tuple[float, float, float]:
    """Return the value at v, w between 3 x 3 nodes of a plane, and its growth along v and w."""
    here0, onward0 = _over_line(field, i, j, k, w)
    here1, onward1 = _over_line(field, i, j + 1, k, w)
    here2, onward2 = _over_line(field, i, j + 2, k, w)
    return (
        _value(here0, here1, here2, v),
        _growth(here0, here1, here2, v),
        _value(onward0, onward1, onward2, v),
    )


@lane
def _over_line(field: Field, i: Integer, j: Integer, k: Integer, w: float) -> tuple[float, float]:
    """Return the value at w between three nodes in a line, and its growth."""
    p, q, r = _node(field, i, j, k), _node(field, i, j, k + 1), _node(field, i, j, k + 2)
    return _value(p, q, r, w), _growth(p, q, r, w)


@lane
def _value(p: float, q: float, r: float, t: float) -> float:
    """Interpolate between three nodes at t, in [0.5, 1.5)."""
    return q + max(1.0 - t, 0.0) * (p - q) + max(t - 1.0, 0.0) * (r - q)


@lane
def _growth(p: float, q: float, r: float, t: float) -> float:
    """Return the growth of :func:`_value` from half a cell before t to half a cell after."""
    return (1.5 - t) * (q - p) + (t - 0.5) * (r - q)
