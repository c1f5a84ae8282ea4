"""Signed distances and their gradients between the nodes of a distance grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.collision.distance_grid import DistanceGrid, Field
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Floats, Singles

#: A gradient shorter than this part of its due length 1 is that of a ridge: look farther.
_FLAT = 0.2


def signed_distance(grid: DistanceGrid, points: ArrayLike) -> Floats:
    """Return the distance of points from a bone in its rest pose, negative inside, (n,) [mm].

    Trilinear between the nodes of the grid; outside, beyond the band or the grid, it reads as the band.

    Parameters
    ----------
    grid : DistanceGrid
        The bone at rest.
    points : (n, 3) array
        In the rest pose [mm].
    """
    positions = np.ascontiguousarray(points, dtype=np.float64)
    result = np.empty(len(positions))
    _distances(grid.field, positions, result)
    return result


def rest_allowance(grid: DistanceGrid, points: ArrayLike, *, skin: float = 0.0) -> Floats:
    """Return how much deeper than the skin each point (n, 3) is at rest, (n,) >= 0 [mm].

    With it as ``allowance`` of
    :func:`~vtkmuscle.core.collision.distance_collision.resolve_distance_collisions` the rest pose stays as
    it is.
    """
    allowance: Floats = np.maximum(0.0, skin - signed_distance(grid, points))
    return allowance


@kernel
def _distances(field: Field, points: Floats, result: Floats) -> None:
    for i in range(len(points)):
        result[i] = distance_at(field, points[i, 0], points[i, 1], points[i, 2])


@kernel
def distance_at(field: Field, x: float, y: float, z: float) -> float:
    """Return the trilinear value of a grid at a position; its band outside, or far from the bone."""
    origin, cell, shape = field.origin, field.cell, field.table.shape
    u, v, w = (x - origin[0]) / cell, (y - origin[1]) / cell, (z - origin[2]) / cell
    within = 0.0 <= u < 8 * shape[0] and 0.0 <= v < 8 * shape[1] and 0.0 <= w < 8 * shape[2]
    if not within:
        return field.band
    i, j, k = np.int64(u), np.int64(v), np.int64(w)
    block = field.table[i >> 3, j >> 3, k >> 3]
    if block < 0:
        return field.band
    return trilinear(field.values[block], i & 7, j & 7, k & 7, u - i, v - j, w - k)


@kernel
def trilinear(
    values: Floats | Singles, i: np.int64, j: np.int64, k: np.int64, u: float, v: float, w: float
) -> float:
    """Return the value in cell (i, j, k) of nodes (9, 9, 9), at (u, v, w) in [0, 1] from its first node."""
    c00 = values[i, j, k] + w * (values[i, j, k + 1] - values[i, j, k])
    c01 = values[i, j + 1, k] + w * (values[i, j + 1, k + 1] - values[i, j + 1, k])
    c10 = values[i + 1, j, k] + w * (values[i + 1, j, k + 1] - values[i + 1, j, k])
    c11 = values[i + 1, j + 1, k] + w * (values[i + 1, j + 1, k + 1] - values[i + 1, j + 1, k])
    c0, c1 = c00 + v * (c01 - c00), c10 + v * (c11 - c10)
    value: float = c0 + u * (c1 - c0)
    return value


@kernel
def normal_at(field: Field, at: Floats, out: Floats) -> bool:
    """Write the unit direction in which the distance grows at a position (3,); False where there is none.

    By central differences over a cell: unlike the gradient of the trilinear value, which jumps from cell to
    cell, they are continuous, so that a point which slides along a bone does not jump.
    On a ridge, halfway through a bone, where the gradient vanishes, differences to one cell onward are taken
    (onward only, so that they differ from each other on a plane of symmetry).
    """
    cell = field.cell
    h = 0.5 * cell
    for k in range(3):
        x, y, z = h * (k == 0), h * (k == 1), h * (k == 2)
        out[k] = (
            distance_at(field, at[0] + x, at[1] + y, at[2] + z)
            - distance_at(field, at[0] - x, at[1] - y, at[2] - z)
        ) / cell
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    if not length > _FLAT:
        here = distance_at(field, at[0], at[1], at[2])
        for k in range(3):
            x, y, z = at[0] + cell * (k == 0), at[1] + cell * (k == 1), at[2] + cell * (k == 2)
            out[k] = (distance_at(field, x, y, z) - here) / cell
        length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
        if not length > 1e-6:
            return False
    for k in range(3):
        out[k] /= length
    return True
