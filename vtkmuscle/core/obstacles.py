"""Bones that a muscle's points are kept out of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256
from threading import Lock
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.distance_collision import resolve_distance_collisions
from vtkmuscle.core.distance_grid import DistanceGrid
from vtkmuscle.core.distance_lookup import rest_allowance, signed_distance
from vtkmuscle.core.grid_cache import cached_distance_grid
from vtkmuscle.core.rigid import apply_transform, inverse
from vtkmuscle.core.voxels import VoxelGrid, build_voxel_grid, resolve_collisions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: By how much the weights of a bone's points differ.
UNEVENNESS = 1e-3

#: Cells of a distance grid along the diagonal of a bone's box along its axes, where no size is given: 1.0 mm
#: on a pelvis, 1.2 mm on a femur. Measured there over hip flexion: points end at most 0.1 mm within the bone
#: with cells of 1 mm, and 0.2 mm with 2 mm.
CELLS_PER_DIAGONAL = 400.0


class Obstacle(ABC):
    """A bone that points are kept out of; what that takes is built when a muscle first comes near.

    Parameters
    ----------
    bone : int
        Index among the bones' transforms.
    points : (n, 3) array
        Of the bone in the rest pose [mm].
    triangles : (m, 3) int array
        Point ids.
    margin : float
        How far around the bone's box a point may be that it concerns [mm].
    """

    def __init__(self, bone: int, points: Floats, triangles: Ints, margin: float) -> None:
        self.bone = bone
        self.points = points
        self.triangles = triangles
        #: From the scene at rest to the axes along which the grid is laid.
        self.axes: Floats = bone_axes(points)
        along = apply_transform(self.axes, points)
        low, high = along.min(axis=0), along.max(axis=0)
        self._corners = np.array(np.meshgrid(*zip(low - margin, high + margin, strict=True))).reshape(3, -1).T

    #: Whether points move along the surface, so that their path can be followed in short pieces.
    slides: bool

    @property
    @abstractmethod
    def resolution(self) -> float:
        """How fine the grid is, in the obstacle's own terms."""

    def same_as(self, other: Obstacle) -> bool:
        """Return whether another obstacle is the same bone, on the same grid."""
        return (
            type(self) is type(other)
            and (self.bone, self.resolution) == (other.bone, other.resolution)
            and np.array_equal(self.points, other.points)
            and np.array_equal(self.triangles, other.triangles)
        )

    def meets(self, transform: Floats, low: Floats, high: Floats) -> bool:
        """Return False where the bone, moved from its own axes, is outside a box for sure."""
        corners = apply_transform(transform, self._corners)
        return bool((corners.max(axis=0) >= low).all() and (corners.min(axis=0) <= high).all())

    @abstractmethod
    def allowance(self, points: Floats) -> Floats | None:
        """Return how deep points (n, 3) [mm], at rest and in the bone's axes, may be in the bone, (n,)."""

    def distance(self, points: Floats) -> Floats:
        """Return at most the distance of points (n, 3) [mm], in the bone's axes, from the bone, (n,)."""
        return np.zeros(len(points))

    @abstractmethod
    def keep_out(
        self,
        now: Floats,
        step: Floats,
        x: Floats,
        p: Floats,
        free: Bools,
        *,
        allowance: Floats | None,
        bone_push: bool,
    ) -> Bools:
        """Move predicted positions out of the bone; return which.

        Parameters
        ----------
        now : (4, 4) array
            From the bone's axes to where it is now.
        step : (4, 4) array
            Motion of the bone from the previous frame to now.
        x, p : (n, 3) arrays
            Previous and predicted positions [mm]; p is changed in place.
        free : (n,) bool array
            Points that may be moved.
        allowance : (n,) array or None
            From :meth:`allowance`.
        bone_push : bool
            Whether the bone takes points along that it moved over, where the method leaves the choice.

        Returns
        -------
        (n,) bool array
            Points that were moved.
        """


class VoxelObstacle(Obstacle):
    """A bone as voxels: P21 section 3.2, :mod:`vtkmuscle.core.voxels`.

    Parameters
    ----------
    bone, points, triangles
        As of :class:`Obstacle`.
    n_max : int
        Largest number of voxels.
    """

    slides = False

    def __init__(self, bone: int, points: Floats, triangles: Ints, *, n_max: int) -> None:
        self.n_max = n_max
        diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
        # A voxel may reach over the bone's box; the largest is about this long.
        super().__init__(bone, points, triangles, 2.0 * diagonal / max(n_max, 1) ** (1.0 / 3.0))

    @property
    def resolution(self) -> float:
        """Largest number of voxels."""
        return self.n_max

    @cached_property
    def grid(self) -> VoxelGrid:
        """The bone's voxels, in its own axes."""
        return build_voxel_grid(apply_transform(self.axes, self.points), self.triangles, n_max=self.n_max)

    def allowance(self, points: Floats) -> None:
        """Return None: a point that was in the bone before is not moved."""

    def keep_out(
        self,
        now: Floats,
        step: Floats,
        x: Floats,
        p: Floats,
        free: Bools,
        *,
        allowance: Floats | None,
        bone_push: bool,
    ) -> Bools:
        """Move points back the way they came, to the first voxel outside."""
        return resolve_collisions(self.grid, now, step, x, p, free, bone_push=bone_push)


class DistanceObstacle(Obstacle):
    """A bone as signed distances: points slide along its surface, :mod:`vtkmuscle.core.distance_collision`.

    Points that are in the bone at rest may be as deep as they are there, so that the rest pose stays as it
    is.

    Parameters
    ----------
    bone, points, triangles
        As of :class:`Obstacle`.
    cell : float or None
        Distance of the grid's nodes [mm]; None for the bone's diagonal / :data:`CELLS_PER_DIAGONAL`.
    """

    slides = True

    def __init__(self, bone: int, points: Floats, triangles: Ints, *, cell: float | None = None) -> None:
        if cell is None:
            along = apply_transform(bone_axes(points), points)
            cell = float(np.linalg.norm(np.ptp(along, axis=0))) / CELLS_PER_DIAGONAL
        self.cell = cell
        super().__init__(bone, points, triangles, self.cell)

    @property
    def resolution(self) -> float:
        """Distance of the grid's nodes [mm]."""
        return self.cell

    @cached_property
    def grid(self) -> DistanceGrid:
        """Distances from the bone, in its own axes."""
        return _shared_grid(apply_transform(self.axes, self.points), self.triangles, self.cell)

    def allowance(self, points: Floats) -> Floats:
        """Return how deep points are in the bone at rest."""
        return rest_allowance(self.grid, points)

    def distance(self, points: Floats) -> Floats:
        """Return the distance from the bone, less what the interpolation between nodes can be wrong by."""
        return signed_distance(self.grid, points) - self.cell

    def keep_out(
        self,
        now: Floats,
        step: Floats,
        x: Floats,
        p: Floats,
        free: Bools,
        *,
        allowance: Floats | None,
        bone_push: bool,
    ) -> Bools:
        """Move points to the bone's surface; the bone pushes those that it moved over."""
        return resolve_distance_collisions(self.grid, now, step, x, p, free, allowance=allowance)


_shared: WeakValueDictionary[bytes, DistanceGrid] = WeakValueDictionary()
_building = Lock()


def _shared_grid(points: Floats, triangles: Ints, cell: float) -> DistanceGrid:
    """Return the distances of a bone; muscles that are deformed side by side share one grid."""
    key = sha256(points.tobytes() + triangles.tobytes() + np.float64(cell).tobytes()).digest()
    with _building:
        grid = _shared.get(key)
        if grid is None:
            grid = cached_distance_grid(points, triangles, cell=cell)
            _shared[key] = grid
    return grid


def bone_axes(points: Floats) -> Floats:
    """Return the rigid transform from the scene to a bone's principal axes.

    Voxels along the axes of the scene would make the result depend on how the scene is turned; along the
    bone's own they are also fewer around it. Where the principal axes are not determined (a bone that is
    round), the order of its points decides: they are weighted a little unevenly.

    Parameters
    ----------
    points : (n, 3) array
        The bone at rest [mm].

    Returns
    -------
    (4, 4) array
        Rigid; the bone's centre goes to the origin.
    """
    centre = points.mean(axis=0)
    arms = points - centre
    golden_ratio = 0.5 * (1.0 + 5.0**0.5)
    weights = 1.0 + UNEVENNESS * np.modf(golden_ratio * np.arange(len(points)))[0]
    axes = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1].T
    # An eigenvector's sign is anybody's guess; the order of the points decides here, too.
    axes[(weights - weights.mean()) @ (arms @ axes.T) < 0.0] *= -1.0
    axes[2] = np.cross(axes[0], axes[1])  # a rotation, not a reflection
    transform = np.eye(4)
    transform[:3, :3] = axes
    transform[:3, 3] = -axes @ centre
    return transform


class Barrier:
    """What keeps the free points of one muscle out of the bones.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        Bones, in scene coordinates at rest.
    rest : (n, 3) array
        The muscle at rest, about its centre [mm].
    centre : (3,) array
        Where the points' origin is in the scene at rest [mm].
    free : (n,) bool array
        Points that may be moved.
    bone_push : bool
        See :meth:`Obstacle.keep_out`.
    """

    def __init__(
        self, obstacles: Sequence[Obstacle], rest: Floats, centre: Floats, free: Bools, *, bone_push: bool
    ) -> None:
        self.obstacles = tuple(obstacles)
        self.free = free
        self.bone_push = bone_push
        self._rest = rest
        about_centre = np.eye(4)
        about_centre[:3, 3] = -centre
        #: From each bone's axes to the scene at rest, about the muscle's centre.
        self.from_axes = [about_centre @ inverse(obstacle.axes) for obstacle in self.obstacles]
        self._allowances: dict[int, Floats | None] = {}

    def allowance(self, number: int) -> Floats | None:
        """Return how deep points may be in an obstacle."""
        if number not in self._allowances:
            at_rest = apply_transform(inverse(self.from_axes[number]), self._rest)
            self._allowances[number] = self.obstacles[number].allowance(at_rest)
        return self._allowances[number]


class Contact:
    """A muscle and the bones during one step.

    Where points slide along the bones, their path is followed from one call to the next. A point that is
    known to be away from a bone is not tested again before it has moved that far.

    Parameters
    ----------
    barrier : Barrier
        What keeps points out.
    now, before : (b, 4, 4) arrays
        Transforms of all bones, rest to now and rest to the previous frame, of points about the centre.
    x : (n, 3) array
        Positions of the previous frame, about the centre [mm].
    """

    def __init__(self, barrier: Barrier, now: Floats, before: Floats, x: Floats) -> None:
        self._barrier = barrier
        self._bones_now = [
            now[obstacle.bone] @ from_axes
            for obstacle, from_axes in zip(barrier.obstacles, barrier.from_axes, strict=True)
        ]
        self._steps = [now[obstacle.bone] @ inverse(before[obstacle.bone]) for obstacle in barrier.obstacles]
        self._x = [x for _ in barrier.obstacles]
        #: Where points were when their distance was found, and its square (0 inside).
        self._clear: dict[int, tuple[Floats, Floats]] = {}

    def keep_out(self, p: Floats) -> Bools:
        """Move predicted positions out of the bones that they can have met.

        Parameters
        ----------
        p : (n, 3) array
            Positions about the centre [mm], changed in place.

        Returns
        -------
        (n,) bool array
            Points that were moved.
        """
        hit = np.zeros(len(p), dtype=np.bool_)
        for number, obstacle in enumerate(self._barrier.obstacles):
            bone, step, x = self._bones_now[number], self._steps[number], self._x[number]
            # Seen from the bone, points come from where it would have taken them.
            corners = np.vstack([apply_transform(step, _box_corners(x)), _box_corners(p)])
            if not obstacle.meets(bone, corners.min(axis=0), corners.max(axis=0)):
                continue
            hit |= obstacle.keep_out(
                bone,
                step,
                x,
                p,
                self._concerned(number, p),
                allowance=self._barrier.allowance(number),
                bone_push=self._barrier.bone_push,
            )
            if obstacle.slides:
                if number not in self._clear:
                    distance = np.maximum(obstacle.distance(apply_transform(inverse(bone), p)), 0.0)
                    self._clear[number] = p.copy(), distance**2
                self._x[number], self._steps[number] = p.copy(), np.eye(4)
        return hit

    def _concerned(self, number: int, p: Floats) -> Bools:
        """Return the free points that may have met a bone."""
        if number not in self._clear:
            return self._barrier.free
        there, squares = self._clear[number]
        moved = p - there
        concerned: Bools = self._barrier.free & (np.einsum("ij,ij->i", moved, moved) >= squares)
        return concerned


def _box_corners(points: Floats) -> Floats:
    """Return the corners of the points' box, (8, 3)."""
    # Column by column: numpy is ten times slower along the first axis.
    sides = [(points[:, k].min(), points[:, k].max()) for k in range(3)]
    return np.array(np.meshgrid(*sides)).reshape(3, -1).T
