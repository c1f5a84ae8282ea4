"""Bones as voxels, and the collision response.

Kohout and Cervenka 2021, section 3.2, doi:10.1007/978-3-030-72379-8_24.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneBoxes, boxes_met
from vtkmuscle.core.errors import errors_at
from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.solids import closed_shells
from vtkmuscle.core.mesh.surface import box_of
from vtkmuscle.core.mesh.triangle_tree import MuscleContact, Neighbour
from vtkmuscle.core.motion.rigid import apply_transform, frame_at, inverse
from vtkmuscle.core.types import ROUNDING, SAME, Bools, Floats, Ints

Cells = NDArray[np.uint8]
#: Values of cells.
OUTSIDE, BOUNDARY, INSIDE = 0, 1, 2
#: Number of cells in the experiments of Kohout and Cervenka 2021, section 4.
DEFAULT_N_MAX = 8 * 64**3
#: Most cells along each axis: with a byte for each, 134 MB of a bone.
MOST_N_EQUAL = 512


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """A bone in rest pose as a uniform grid of cells; all beyond is outside."""

    origin: Floats  # (3,), lowest corner of cell (0, 0, 0) [mm]
    spacing: Floats  # (3,), size of a cell [mm]
    cells: Cells  # (nx, ny, nz), OUTSIDE, BOUNDARY (a triangle meets it) or INSIDE; outermost OUTSIDE

    def contains(self, points: Floats) -> Bools:
        """Return whether points lie in boundary or inside cells.

        Points are (n, 3) [mm, rest pose], the result (n,). A point on a face lies in two cells; both cells
        must be boundary or inside.
        """
        within: Bools = np.empty(len(points), dtype=np.bool_)
        _contains((np.asarray(points, dtype=np.float64) - self.origin) / self.spacing, self.cells, within)
        return within


#: Voxels of bones, by how these are divided, for all muscles that meet them.
_GRIDS: WeakKeyDictionary[Bone, dict[tuple[int, int | None], VoxelGrid]] = WeakKeyDictionary()


@kernel
def _contains(at: Floats, cells: Cells, within: Bools) -> None:
    """Write whether positions in cells (n, 3) lie in boundary or inside cells, not on a face."""
    a, b, c = cells.shape
    for n in range(len(at)):
        x, y, z = at[n, 0], at[n, 1], at[n, 2]
        within[n] = 0.0 <= x < a and 0.0 <= y < b and 0.0 <= z < c
        if within[n]:
            for i in (int(x - ROUNDING), min(int(x + ROUNDING), a - 1)):
                for j in (int(y - ROUNDING), min(int(y + ROUNDING), b - 1)):
                    for k in (int(z - ROUNDING), min(int(z + ROUNDING), c - 1)):
                        within[n] = within[n] and cells[i, j, k] >= BOUNDARY


def build_voxel_grid(
    points: Floats, triangles: Ints, *, n_max: int = DEFAULT_N_MAX, n_equal: int | None = None,
    what: str = "voxels",
) -> VoxelGrid:  # fmt: skip
    """Return the voxels of a closed surface.

    Points are (n, 3), triangles (m, 3) at rest; a layer of cells is added. The bounding box is divided into
    cells: about ``n_max`` >= 1 near-cubes, or ``n_equal`` >= 1 along each axis. Cells that a triangle meets
    are the boundary. Cells that cannot be reached from beyond the box without crossing it are inside, also
    cells in a hollow or behind a hole too narrow for the cells. Holes in the surface are closed first.

    Warns
    -----
    UserWarning
        If the surface is open, inside out or encloses no volume; the warning names ``what`` and the mending.
    """
    surface = closed_shells(points, triangles)
    points, triangles = surface.points, np.vstack(surface.shells)
    if surface.remarks:
        warnings.warn(f"{what}: " + "; ".join(surface.remarks), stacklevel=2)
    used = points[np.unique(triangles)]
    low, high = box_of(used)
    thinnest = SAME * (float(np.linalg.norm(high - low)) or 1.0)
    flat = high - low < thinnest
    low, high = np.where(flat, low - thinnest, low), np.where(flat, high + thinnest, high)
    counts = np.full(3, n_equal) if n_equal is not None else _shared_out(high - low, n_max)
    spacing = (high - low) / counts
    origin = low - spacing
    cells = np.full(counts + 2, INSIDE, dtype=np.uint8)
    _mark_boundary(((points - origin) / spacing)[triangles], cells)
    _flood_outside(cells)
    return VoxelGrid(origin, spacing, cells)


def _shared_out(sides: Floats, n_max: int) -> Ints:
    """Return the cells per side of a box, at least 1, for about n_max near-cubes."""
    counts, order = np.ones(3, dtype=np.int64), np.argsort(sides)
    for first in range(3):  # a side thinner than a cell has one, and leaves n_max to the others
        wide = sides[order[first:]]
        edge = (wide.prod() / n_max) ** (1.0 / len(wide))
        if wide[0] >= edge * (1.0 - 1e-12):
            counts[order[first:]] = np.maximum(1, np.floor(wide / edge * (1.0 + 1e-12)))
            break
    return counts


def _mark_boundary(corners: Floats, cells: Cells) -> None:
    """Mark the cells that a triangle meets.

    Cells (nx, ny, nz) are changed in place; corners (m, 3, 3) are in units of cells. Separating axes for a
    triangle and a box, Akenine-Moller 2001, *Fast 3D triangle-box overlap testing*,
    doi:10.1080/10867651.2001.10487535: the box's three axes (by the choice of the tried cells), the
    triangle's normal and the nine products of edges with axes.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    products = np.cross(edges[:, :, None], np.eye(3)).reshape(-1, 9, 3)
    axes = np.concatenate([np.cross(edges[:, :1], edges[:, 1:2]), products], axis=1)
    along, reach = corners @ axes.swapaxes(1, 2), (0.5 + ROUNDING) * np.abs(axes).sum(axis=2)
    # What touches the box from within does not make the layer around it a boundary.
    first = np.maximum(1, np.floor(corners.min(axis=1) - ROUNDING)).astype(np.int64)
    last = np.minimum(np.floor(corners.max(axis=1) + ROUNDING).astype(np.int64), np.array(cells.shape) - 2)
    _mark(first, last, axes, along.min(axis=1) - reach, along.max(axis=1) + reach, cells)


@kernel
def _mark(first: Ints, last: Ints, axes: Floats, low: Floats, high: Floats, cells: Cells) -> None:
    """Mark cells whose middles lie between low and high (m, 10) along all axes (m, 10, 3)."""
    for t in range(len(axes)):
        for i in range(first[t, 0], last[t, 0] + 1):
            for j in range(first[t, 1], last[t, 1] + 1):
                for k in range(first[t, 2], last[t, 2] + 1):
                    met = cells[i, j, k] != BOUNDARY
                    for n in range(len(axes[t]) if met else 0):
                        x, y, z = axes[t, n, 0], axes[t, n, 1], axes[t, n, 2]
                        at = x * (i + 0.5) + y * (j + 0.5) + z * (k + 0.5)
                        met = met and low[t, n] <= at <= high[t, n]
                    if met:
                        cells[i, j, k] = BOUNDARY


def _flood_outside(cells: Cells) -> None:
    """Mark cells reached from the corner as outside.

    The flood starts at (0, 0, 0), works in place, and does not enter the boundary. Kohout and Cervenka fill
    "with 8-directions", the diagonal neighbourhood of a plane; space is left open. We go to the 6 face
    neighbours: no step passes between two boundary cells that meet in an edge.
    """
    from scipy.ndimage import label  # noqa: PLC0415 -- only the published model has voxels

    parts = label(cells != BOUNDARY)[0]
    cells[parts == parts[0, 0, 0]] = OUTSIDE


class VoxelContact:
    """Keeps a muscle's free points out of bone voxels.

    bones : mapping of int to Bone, bones by index among the transforms; the voxels of a bone are made when a
        muscle first meets the bone's box;
    free : (n,) bool, points that may be moved;
    n_max, n_equal, as of :func:`build_voxel_grid`;
    bone_push : bool, whether a bone takes along the points that the bone moved over.
    """

    def __init__(
        self, bones: Mapping[int, Bone], free: Bools, *, n_max: int, n_equal: int | None, bone_push: bool
    ) -> None:
        self._bones, self._free, self._bone_push = tuple(bones.values()), free, bone_push
        # No voxel reaches farther over the bone's box than it is long.
        diagonals = [float(np.linalg.norm(bone.box[1] - bone.box[0])) for bone in self._bones]
        per_side = n_equal or n_max ** (1.0 / 3.0)
        self._boxes = BoneBoxes(bones, [2.0 * diagonal / per_side for diagonal in diagonals])
        self._divided = n_max, n_equal

    def grid(self, number: int) -> VoxelGrid:
        """Return the voxels of a bone."""
        bone, (n_max, n_equal) = self._bones[number], self._divided
        grids = _GRIDS.setdefault(bone, {})
        if self._divided not in grids:
            surface = bone.points, bone.triangles
            with errors_at(bone.name):
                grid = build_voxel_grid(*surface, n_max=n_max, n_equal=n_equal, what=bone.name)
                grids[self._divided] = grid
        return grids[self._divided]

    def at(
        self, now: Floats, neighbours: Sequence[Neighbour], centre: Floats, before: Floats, x: Floats
    ) -> Callable[[Floats], Bools]:
        """Return the contact in a step of the bones.

        The step leads to transforms now, (b, 4, 4), from the transforms before. Positions, also the positions
        x (n, 3) before the step, are relative to a centre (3,) in the scene.
        """
        met = np.empty(len(self._bones), dtype=np.bool_)
        muscles = MuscleContact(neighbours, self._free, centre)
        corners = self._boxes.moved(now, centre)
        about = frame_at(-centre)
        poses = {bone: about @ now[bone] for bone in self._boxes.indices}
        moves = [(pose, pose @ inverse(before[bone]) @ inverse(about)) for bone, pose in poses.items()]

        def keep_out(p: Floats) -> Bools:
            moved = muscles.keep_out(p)
            boxes_met(p, self._free, *corners, met)
            for number in np.flatnonzero(met).tolist():
                motion = *moves[number], x, p, self._free
                moved |= resolve_collisions(self.grid(number), *motion, bone_push=self._bone_push)
            return moved

        return keep_out


def resolve_collisions(
    grid: VoxelGrid, now: Floats, step: Floats, x: Floats, p: Floats, free: Bools, *, bone_push: bool
) -> Bools:
    """Move predicted positions out of a bone.

    Positions p are changed in place; the moved points, (n,), are returned. Kohout and Cervenka 2021, section
    3.2. A point with its predicted position in a boundary or inside cell collides, unless a bone has stopped
    it on the face of an outside cell, where rounding would decide. If the point's previous position x is
    outside the bone's present pose (scenario one, the muscle hits the bone), the segment from p to x is
    followed to the first outside cell: if x is in the outside cell p becomes x, else p becomes the point
    where the segment enters the cell. If not (scenario two, the bone hits the muscle), p becomes x moved by
    the bone's step; ``bone_push`` of False then leaves p unchanged (section 4.2, the iliacus).

    now, step : (4, 4), of the bone to now, from rest and from the previous frame;  x, p : (n, 3) [mm]; free :
    (n,), points that may be moved.
    """
    to_rest, ids = inverse(now), np.flatnonzero(free)
    ends = apply_transform(to_rest, p[ids])
    inside = grid.contains(ends)
    ids, ends = ids[inside], ends[inside]
    begins = apply_transform(to_rest, x[ids])
    hit, stop = ~grid.contains(begins), np.empty(3)
    segments = ((points[hit] - grid.origin) / grid.spacing for points in (ends, begins))
    for i, end, begin in zip(ids[hit], *segments, strict=True):
        p[i] = x[i]
        if not _traverse(grid.cells, end, begin, stop):
            p[i] = apply_transform(now, grid.origin + grid.spacing * stop)
    pushed = ids[~hit] if bone_push else ids[:0]
    p[pushed] = apply_transform(step, x[pushed])
    moved = np.zeros(len(p), dtype=np.bool_)
    moved[ids[hit]] = moved[pushed] = True
    return moved


@array_kernel
def _traverse(cells: Cells, start: Floats, end: Floats, stop: Floats) -> bool:
    """Follow a segment to the first outside cell.

    The segment starts in a cell of the bone and is followed cell by cell. Amanatides, Woo 1987, *A fast voxel
    traversal algorithm for ray tracing*, doi:10.2312/egtp.19871000. The end cells give the number of steps
    along each axis, so rounding changes the order of two nearly simultaneous steps at most, never the end of
    the walk. start, end : (3,) in units of cells, the end outside. Returns True where the end is in the first
    outside cell; else stop (3,) is written.
    """
    cell, left = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        cell[k] = int(start[k])
        # Beyond the grid all is outside, so how far the end is beyond does not matter.
        left[k] = math.floor(min(max(end[k], -1.0), cells.shape[k])) - cell[k]
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
        at_end = at_end and cell[k] - ROUNDING <= end[k] <= cell[k] + 1.0 + ROUNDING
        stop[k] = start[k] + t * (end[k] - start[k])
    return at_end
