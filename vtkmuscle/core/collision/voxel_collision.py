"""The collision response of a bone that is given as voxels.

Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*, section 3.2,
doi:10.1007/978-3-030-72379-8_24.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.collision.voxels import ON_A_FACE, OUTSIDE, Cells, VoxelGrid
from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.motion.rigid import inverse, transform_point
from vtkmuscle.core.types import Bools, Floats


def resolve_collisions(
    grid: VoxelGrid, now: Floats, step: Floats, x: Floats, p: Floats, free: Bools, *, bone_push: bool
) -> Bools:
    """Move the predicted positions that are in a bone out of it.

    Kohout and Cervenka 2021, section 3.2. A point whose predicted position is in a boundary or inside cell
    collides (but see :data:`~vtkmuscle.core.collision.voxels.ON_A_FACE`). If its previous position is outside
    the bone as the bone is now (scenario one, the muscle hits the bone), the segment from p to x is followed
    to the first outside cell: if x is in that cell p becomes x, else p becomes the point where the segment
    enters the cell. If not (scenario two, the bone hits the muscle), p becomes x moved by the bone's step.

    Parameters
    ----------
    grid : VoxelGrid
        The bone at rest.
    now, step : (4, 4) arrays
        Rigid transforms of the bone to now: from rest, and from the previous frame.
    x, p : (n, 3) arrays
        Positions of the previous frame, and those predicted, which are changed in place [mm].
    free : (n,) bool array
        Points that may be moved.
    bone_push : bool
        False leaves p as it is in scenario two (Kohout and Cervenka 2021, section 4.2, the iliacus).

    Returns
    -------
    (n,) bool array
        Points that were moved.
    """
    moved = np.zeros(len(p), dtype=np.bool_)
    to_rest = inverse(now)
    _resolve(grid.cells, grid.origin, grid.spacing, now, to_rest, step, x, p, free, bone_push, moved)
    return moved


@array_kernel
def _resolve(
    cells: Cells,
    origin: Floats,
    spacing: Floats,
    now: Floats,
    to_rest: Floats,
    step: Floats,
    x: Floats,
    p: Floats,
    free: Bools,
    bone_push: bool,
    moved: Bools,
) -> None:
    """Do what :func:`resolve_collisions` says; moved : (n,), changed in place."""
    start, end = np.empty(3), np.empty(3)  # p and x in units of cells
    stop = np.empty((1, 3))
    for i in range(len(p)):
        if not free[i]:
            continue
        transform_point(to_rest, p, i, start)
        if not _in_bone(cells, origin, spacing, start):
            continue
        transform_point(to_rest, x, i, end)
        if not _in_bone(cells, origin, spacing, end):
            if _traverse(cells, start, end, stop[0]):
                p[i] = x[i]
            else:
                for k in range(3):
                    stop[0, k] = origin[k] + spacing[k] * stop[0, k]
                transform_point(now, stop, 0, p[i])
            moved[i] = True
        elif bone_push:
            transform_point(step, x, i, p[i])
            moved[i] = True


@kernel
def _in_bone(cells: Cells, origin: Floats, spacing: Floats, at: Floats) -> bool:
    """Return whether a position lies in a cell of the bone; at : (3,) [mm], turned into units of cells."""
    within = True
    for k in range(3):
        at[k] = (at[k] - origin[k]) / spacing[k]
        within = within and 0.0 <= at[k] < cells.shape[k]
    if not within or cells[int(at[0]), int(at[1]), int(at[2])] == OUTSIDE:
        return False
    # The bone has no cell in the outermost layer: all neighbours are there.
    for i in range(int(at[0] - ON_A_FACE), int(at[0] + ON_A_FACE) + 1):
        for j in range(int(at[1] - ON_A_FACE), int(at[1] + ON_A_FACE) + 1):
            for k in range(int(at[2] - ON_A_FACE), int(at[2] + ON_A_FACE) + 1):
                if cells[i, j, k] == OUTSIDE:
                    return False
    return True


@array_kernel
def _traverse(cells: Cells, start: Floats, end: Floats, stop: Floats) -> bool:
    """Follow a segment, cell by cell, from a cell of the bone to the first outside cell.

    Amanatides, Woo 1987, *A fast voxel traversal algorithm for ray tracing*,
    doi:10.2312/egtp.19871000. The number of steps along each axis is known from the end cells, so
    rounding changes the order of two nearly simultaneous steps at most, never where the walk ends.
    start, end : (3,) in units of cells, the end outside;  stop : (3,), written where the result is False.
    Returns True where the end is in the first outside cell.
    """
    cell, left = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        cell[k] = int(start[k])
        # Beyond the grid all is outside, so how far the end is beyond does not matter.
        last = -1
        if end[k] >= cells.shape[k]:
            last = cells.shape[k]
        elif end[k] >= 0.0:
            last = int(end[k])
        left[k] = last - cell[k]
    t = 0.0
    while left[0] or left[1] or left[2]:
        axis, t = -1, np.inf
        for k in range(3):
            if left[k]:
                face = cell[k] + 1.0 if left[k] > 0 else float(cell[k])
                crossing = (face - start[k]) / (end[k] - start[k])
                if axis < 0 or crossing < t:
                    axis, t = k, crossing
        side = 1 if left[axis] > 0 else -1
        cell[axis] += side
        left[axis] -= side
        beyond = not 0 <= cell[axis] < cells.shape[axis]
        if beyond or cells[cell[0], cell[1], cell[2]] == OUTSIDE:
            break
    # A point on a face is in the cells of both sides.
    at_end = True
    for k in range(3):
        at_end = at_end and cell[k] - ON_A_FACE <= end[k] <= cell[k] + 1.0 + ON_A_FACE
        stop[k] = start[k] + t * (end[k] - start[k])
    return at_end
