"""Look-ups of a bone's signed distances, by kernels."""

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from vtkmuscle.core.jit import kernel, lane
from vtkmuscle.core.mesh.tree_search import distance2_to_box
from vtkmuscle.core.types import SAME, Floats, Ints

#: A coarse node is every fourth node along each axis: its distance bounds those of all around it. With 2 and
#: 8 no length or moment arm of a hip changes.
COARSE = 4

#: Largest error of a trilinear value [cells]: no distance grows faster than the way, and the mean way from a
#: point of a cell to the nodes, by their weights, is greatest at the cell's middle.
FIELD_ERROR = 3.0**0.5 / 2.0

#: Largest growth of the trilinear value over a way: along each axis a value grows no faster than the way.
STEEPEST = 3.0**0.5

#: A direction shorter than this, instead of 1, lies on a ridge. With half and twice of it moment arms of four
#: muscles of a hip and a knee are the same; means of a supraspinatus without room change by 0.02 and 0.3 mm.
_FLAT = 0.2

Integer: TypeAlias = int | np.int64


class Field(NamedTuple):
    """The known part of a bone's field, for kernels.

    Positions are along the bone's axes [mm]. A look-up that needs an unknown node gives NaN, and notes the
    node in ``lacking``. A caller with nodes in ``lacking`` lets the bone fill them, and repeats look-ups.
    """

    nodes: Floats  # (a, b, c), signed distance at each node [mm], 0 where unknown
    low: Floats  # (3,), number of the lattice's first node along each axis; node 0 is at the axes' origin
    box: Floats  # (6,), low and high corner of the bone's box along its axes [mm]
    cell: float  # distance of neighbouring nodes [mm]
    per_mm: float  # its inverse
    lacking: Ints  # (2 + m,), number of look-ups of unknown nodes, number of notes, the notes


@lane
def _note(field: Field, i: Integer, j: Integer, k: Integer, coarse: bool) -> None:
    """Note unknown nodes: the number of the first of 27, or -1 - a coarse node's."""
    lacking = field.lacking
    _, height, depth = field.nodes.shape
    key = (i * height + j) * depth + k
    key = -1 - key if coarse else key
    lacking[0] += 1
    noted = lacking[1]
    if 2 + noted < len(lacking) and (noted == 0 or lacking[1 + noted] != key):
        lacking[2 + noted] = key
        lacking[1] = noted + 1


@lane
def _holds(field: Field, i: float, j: float, k: float, span: Integer) -> bool:
    """Return whether the lattice has the nodes from i, j, k to ``span`` nodes onward."""
    a, b, c = field.nodes.shape
    least, room = min(i, j, k), min(a - i, b - j, c - k)
    return least >= 0.0 and room > span


@lane
def _in_cells(field: Field, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a position in cells, from the first node."""
    low = field.low
    return x * field.per_mm - low[0], y * field.per_mm - low[1], z * field.per_mm - low[2]


@lane
def distance_at(field: Field, x: float, y: float, z: float) -> float:
    """Return the trilinear distance at a position [mm], NaN where unknown and beyond the lattice."""
    return look_at(field, x, y, z)[0]


@lane
def least_distance_at(field: Field, x: float, y: float, z: float, enough: float, span: int = COARSE) -> float:
    """Return a lower bound of a position's trilinear distance [mm], NaN where unknown and beyond the lattice.

    The bound is the distance from the bone's box where that is beyond `enough`, or follows from the nearest
    node of every `span`-th: no distance grows faster than the way.
    """
    least = math.sqrt(distance2_to_box(field.box, x, y, z)) - FIELD_ERROR * field.cell
    if least > enough:
        return least
    u, v, w = _in_cells(field, x, y, z)
    a, b, c = np.floor(u / span + 0.5), np.floor(v / span + 0.5), np.floor(w / span + 0.5)
    a, b, c = span * a, span * b, span * c
    if not _holds(field, a, b, c, 0):
        return np.nan
    i, j, k = np.int64(a), np.int64(b), np.int64(c)
    distance = field.nodes[i, j, k]
    if distance == 0.0:
        _note(field, i, j, k, True)
        return np.nan
    u, v, w = u - a, v - b, w - c
    least = distance - field.cell * (math.sqrt(u * u + v * v + w * w) + FIELD_ERROR)
    return float(least)


@kernel
def distance_and_normal(field: Field, at: Floats, normal: Floats) -> float:
    """Return the trilinear distance at a position (3,), and write the unit direction (3,) in which it grows.

    Where no direction exists, write 0. Central differences over a cell are continuous, while the gradient of
    the trilinear value jumps from cell to cell: a point that slides along a bone must not jump. On a ridge,
    halfway through a bone, the gradient vanishes, and differences to the next cell onward are taken (onward
    only, so that the differences are not zero on a plane of symmetry).
    """
    x, y, z, cell = at[0], at[1], at[2], field.cell
    here, dx, dy, dz = look_at(field, x, y, z)
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if not length > _FLAT * cell:
        dx = distance_at(field, x + cell, y, z) - here
        dy = distance_at(field, x, y + cell, z) - here
        dz = distance_at(field, x, y, z + cell) - here
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
    scale = 1.0 / length
    if not length > SAME * cell:
        dx, dy, dz, scale = 0.0, 0.0, 0.0, 0.0
    normal[0], normal[1], normal[2] = scale * dx, scale * dy, scale * dz
    return here


@lane
def look_at(field: Field, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return the trilinear distance at a position, and its growth over a cell along each axis [mm].

    Both are NaN where unknown and beyond the lattice.
    """
    u, v, w = _in_cells(field, x, y, z)
    a, b, c = np.floor(u - 0.5), np.floor(v - 0.5), np.floor(w - 0.5)
    if not _holds(field, a, b, c, 2):
        return np.nan, np.nan, np.nan, np.nan
    i, j, k, u, v, w = np.int64(a), np.int64(b), np.int64(c), u - a, v - b, w - c
    x0, y0, z0, all0 = _over_plane(field, i, j, k, v, w)
    x1, y1, z1, all1 = _over_plane(field, i + 1, j, k, v, w)
    x2, y2, z2, all2 = _over_plane(field, i + 2, j, k, v, w)
    if not (all0 and all1 and all2):
        _note(field, i, j, k, False)
        return np.nan, np.nan, np.nan, np.nan
    return _value(x0, x1, x2, u), _growth(x0, x1, x2, u), _value(y0, y1, y2, u), _value(z0, z1, z2, u)


@lane
def _over_plane(
    field: Field, i: Integer, j: Integer, k: Integer, v: float, w: float
) -> tuple[float, float, float, bool]:
    """Return the value at v, w between nodes of a plane, its growth, and completeness."""
    here0, onward0, all0 = _over_line(field, i, j, k, w)
    here1, onward1, all1 = _over_line(field, i, j + 1, k, w)
    here2, onward2, all2 = _over_line(field, i, j + 2, k, w)
    value, growth = _value(here0, here1, here2, v), _growth(here0, here1, here2, v)
    return value, growth, _value(onward0, onward1, onward2, v), all0 & all1 & all2


@lane
def _over_line(field: Field, i: Integer, j: Integer, k: Integer, w: float) -> tuple[float, float, bool]:
    """Return the value at w between three nodes in a line, its growth, and whether all are known."""
    p, q, r = field.nodes[i, j, k], field.nodes[i, j, k + 1], field.nodes[i, j, k + 2]
    return _value(p, q, r, w), _growth(p, q, r, w), (p != 0.0) & (q != 0.0) & (r != 0.0)


@lane
def _value(p: float, q: float, r: float, t: float) -> float:
    """Interpolate between three nodes at t, in [0.5, 1.5)."""
    return q + max(1.0 - t, 0.0) * (p - q) + max(t - 1.0, 0.0) * (r - q)


@lane
def _growth(p: float, q: float, r: float, t: float) -> float:
    """Return the growth of :func:`_value` from half a cell before t to half a cell after."""
    return (1.5 - t) * (q - p) + (t - 0.5) * (r - q)
