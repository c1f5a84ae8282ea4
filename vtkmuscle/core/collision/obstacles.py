"""What a muscle's points are kept out of: bones, as voxels and as signed distances, and other muscles."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vtkmuscle.core.bones.bone import CELLS_PER_DIAGONAL, Bone, bone_of
from vtkmuscle.core.collision.distance_collision import Clearance, resolve_distance_collisions
from vtkmuscle.core.collision.voxels import VoxelGrid, build_voxel_grid, resolve_collisions
from vtkmuscle.core.errors import errors_at
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Bools, Floats, Ints


@dataclass(eq=False)
class Approach:
    """The relative motion of a bone and the points of a muscle in a step.

    Attributes
    ----------
    now : (4, 4) array
        From the bone's axes to where it is now.
    step : (4, 4) array
        Motion of the bone from the previous frame to now.
    x : (n, 3) array
        Positions of the previous frame [mm].
    free : (n,) bool array
        Points that may be moved.
    allowance : (n,) array or None
        How deep each point may be in the bone [mm], from :meth:`Obstacle.allowance`.
    bone_push : bool
        Whether the bone takes points along that it moved over, where the method leaves the choice.
    clearance : Clearance
        Which points are known to be away from the bone, where the method keeps account.
    """

    now: Floats
    step: Floats
    x: Floats
    free: Bools
    allowance: Floats | None
    bone_push: bool
    clearance: Clearance


class Obstacle(ABC):
    """A bone that points are kept out of; its data are built when a muscle first comes near.

    Parameters
    ----------
    bone : int
        Index among the bones' transforms.
    points : (n, 3) array
        Of the bone in the rest pose [mm].
    triangles : (m, 3) int array
        Point ids.
    name : str
        Of the bone, for warnings.
    """

    def __init__(self, bone: int, points: Floats, triangles: Ints, name: str) -> None:
        self.bone = bone
        self.name = name
        self.points = points
        self.triangles = triangles
        #: Lowest and highest corner of a box in the scene at rest that holds the bone [mm].
        self.box: tuple[Floats, Floats] = points.min(axis=0), points.max(axis=0)

    #: Whether points move along the surface, so that their path can be followed in short pieces.
    slides: bool

    #: Distance that points keep from the bone [mm].
    skin: float = 0.0

    @property
    @abstractmethod
    def margin(self) -> float:
        """How far around the bone's box a point may be that it concerns [mm]."""

    @cached_property
    def shape(self) -> Bone:
        """The bone at rest, the same for all muscles that meet it."""
        return bone_of(self.points, self.triangles)

    @property
    @abstractmethod
    def axes(self) -> Floats:
        """From the scene at rest to the axes along which the grid is laid, (4, 4)."""

    @property
    @abstractmethod
    def box_along_axes(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the bone's box along its axes [mm]."""

    @property
    @abstractmethod
    def settings(self) -> tuple[float | None, ...]:
        """The settings of the grid and the response."""

    def same_as(self, other: Obstacle) -> bool:
        """Return whether another obstacle is the same bone, on the same grid."""
        return (
            type(self) is type(other)
            and (self.bone, self.settings) == (other.bone, other.settings)
            and np.array_equal(self.points, other.points)
            and np.array_equal(self.triangles, other.triangles)
        )

    @abstractmethod
    def allowance(self, points: Floats) -> Floats | None:
        """Return how deep points (n, 3) [mm], at rest and in the bone's axes, may be in the bone, (n,)."""

    @abstractmethod
    def entered(self, points: Floats, moved: Bools) -> Bools:
        """Return which of the points (n, 3) [mm], in the bone's axes, were in it: it moved some, (n,)."""

    @abstractmethod
    def begin(self, approach: Approach) -> None:
        """Begin a step, with the known distances of points far from the bone."""

    @abstractmethod
    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move predicted positions p (n, 3) [mm] out of the bone, in place; return which, (n,)."""


class VoxelObstacle(Obstacle):
    """A bone as voxels: Kohout and Cervenka 2021 section 3.2, :mod:`vtkmuscle.core.collision.voxels`.

    Parameters
    ----------
    bone, points, triangles, name
        As of :class:`Obstacle`.
    n_max : int
        Number of voxels, about, shared out so that they are nearly cubes.
    n_equal : int or None
        Voxels along each axis instead.
    """

    slides = False

    def __init__(
        self,
        bone: int,
        points: Floats,
        triangles: Ints,
        *,
        n_max: int,
        n_equal: int | None = None,
        name: str = "bone",
    ) -> None:
        super().__init__(bone, points, triangles, name)
        self.n_max, self.n_equal = n_max, n_equal

    @property
    def settings(self) -> tuple[float | None, ...]:
        """Numbers of voxels."""
        return self.n_max, self.n_equal

    @property
    def margin(self) -> float:
        """No voxel reaches farther over the bone's box than it is long."""
        diagonal = float(np.linalg.norm(self.box[1] - self.box[0]))
        return 2.0 * diagonal / (self.n_equal or max(self.n_max, 1) ** (1.0 / 3.0))

    @cached_property
    def axes(self) -> Floats:
        """The axes of the scene at rest, along which a bone's bounding box lies."""
        return np.eye(4)

    @property
    def box_along_axes(self) -> tuple[Floats, Floats]:
        """The box in the scene."""
        return self.box

    @cached_property
    def grid(self) -> VoxelGrid:
        """The bone's voxels."""
        with errors_at(self.name):
            return build_voxel_grid(
                self.points, self.triangles, n_max=self.n_max, n_equal=self.n_equal, what=self.name
            )

    def allowance(self, points: Floats) -> None:
        """Return None: a point that was in the bone before is not moved."""

    def entered(self, points: Floats, moved: Bools) -> Bools:
        """Return the points in the voxels of the bone, moved or not."""
        return self.grid.contains(points)

    def begin(self, approach: Approach) -> None:
        """Do nothing: all points are looked at."""

    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move points back the way they came, to the first voxel outside."""
        way = approach
        return resolve_collisions(self.grid, way.now, way.step, way.x, p, way.free, bone_push=way.bone_push)


class DistanceObstacle(Obstacle):
    """A bone as signed distances: points slide along its surface.

    The response is in :mod:`vtkmuscle.core.collision.distance_collision`.

    Points that are in the bone or its skin at rest may be as deep as they are there, so that the rest pose
    stays as it is.

    Parameters
    ----------
    bone, points, triangles, name
        As of :class:`Obstacle`.
    skin : float
        Distance that points keep from the bone [mm].
    """

    slides = True

    def __init__(
        self, bone: int, points: Floats, triangles: Ints, *, skin: float = 0.0, name: str = "bone"
    ) -> None:
        super().__init__(bone, points, triangles, name)
        self.skin = skin

    @property
    def settings(self) -> tuple[float | None, ...]:
        """The skin."""
        return (self.skin,)

    @property
    def margin(self) -> float:
        """The skin, and a cell for the error of the interpolation between nodes."""
        # The box in the scene is at least as long as that along the axes.
        diagonal = float(np.linalg.norm(self.box[1] - self.box[0]))
        return 2.0 * diagonal / CELLS_PER_DIAGONAL + self.skin

    @cached_property
    def shape(self) -> Bone:
        """The bone at rest, shared by all muscles that meet it; warns of faults of its surface."""
        with errors_at(self.name):
            shape = super().shape
            if shape.solids.remarks:
                warnings.warn(f"{self.name}: " + "; ".join(shape.solids.remarks), stacklevel=2)
        return shape

    @property
    def axes(self) -> Floats:
        """The bone's principal axes."""
        return self.shape.axes

    @property
    def box_along_axes(self) -> tuple[Floats, Floats]:
        """The box along these."""
        return self.shape.box_along_axes

    def allowance(self, points: Floats) -> Floats:
        """Return how deep points are in the bone, or its skin, at rest."""
        distance, _ = self.shape.field(apply_transform(inverse(self.axes), points), within=self.skin)
        return np.maximum(0.0, self.skin - distance)

    def entered(self, points: Floats, moved: Bools) -> Bools:
        """Return the points that were moved: all that were in the bone."""
        return moved

    def begin(self, approach: Approach) -> None:
        """Move the known distances with the bone."""
        approach.clearance.begin(approach.now, approach.step, approach.x)

    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move points to the bone's surface; the bone pushes those that it moved over."""
        return resolve_distance_collisions(
            self.shape,
            approach.now,
            approach.step,
            approach.x,
            p,
            approach.free,
            skin=self.skin,
            allowance=approach.allowance,
            clearance=approach.clearance,
        )


#: A point that is known to be farther from a neighbour is not looked at before it has moved this part of it.
_SURELY_CLEAR = 0.9

#: Part of a neighbour's mean edge within which its surface counts as flat.
_FLAT = 0.25


@dataclass(frozen=True, eq=False)
class Neighbour:
    """The surface of another muscle at one time.

    Attributes
    ----------
    tree : TriangleTree
        Its triangles, which face outward, in the scene [mm].
    allowance : (n,) array
        How deep each point of the muscle may be in it [mm]: as deep as at rest.
    """

    tree: TriangleTree
    allowance: Floats


class MuscleContact:
    """The neighbours of a muscle during one step, in which they stand still.

    A point that is deeper in a neighbour than at rest goes to the plane that touches the neighbour at the
    place nearest to the point. The plane is found again when the point has moved on by a part of
    the neighbour's edges.

    Parameters
    ----------
    neighbours : sequence of Neighbour
        Where they are now.
    free : (n,) bool array
        Points that may be moved.
    centre : (3,) array
        Where the points' origin is in the scene [mm].
    """

    def __init__(self, neighbours: Sequence[Neighbour], free: Bools, centre: Floats) -> None:
        self._planes = [_Planes(neighbour, len(free)) for neighbour in neighbours]
        self._free = free
        self._centre = centre

    def keep_out(self, p: Floats) -> Bools:
        """Move predicted positions, (n, 3) about the centre [mm], out of the neighbours, in place.

        Returns
        -------
        (n,) bool array
            Points that were moved.
        """
        hit = np.zeros(len(p), dtype=np.bool_)
        for planes in self._planes:
            hit |= planes.keep_out(p, self._free, self._centre)
        return hit


class _Planes:
    """The tangent plane of a neighbouring muscle at the point nearest to each point of the muscle."""

    def __init__(self, neighbour: Neighbour, n_points: int) -> None:
        self._neighbour = neighbour
        self._seen_from = np.zeros((n_points, 3))
        self._valid_for = np.full(n_points, -1.0)  # how far a point may go from there, squared
        self._place = np.zeros((n_points, 3))
        self._normal = np.zeros((n_points, 3))
        corners = neighbour.tree.corners
        self._detail = _FLAT * float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    def keep_out(self, p: Floats, free: Bools, centre: Floats) -> Bools:
        neighbour = self._neighbour
        low, high = neighbour.tree.boxes[0, :3] - centre, neighbour.tree.boxes[0, 3:] - centre
        near = np.flatnonzero(free & ((p >= low) & (p <= high)).all(axis=1))
        hit = np.zeros(len(p), dtype=np.bool_)
        if not len(near):
            return hit
        moved = p[near] - self._seen_from[near]
        stale = near[np.einsum("ij,ij->i", moved, moved) > self._valid_for[near]]
        if len(stale):
            distance, place, normal = neighbour.tree.tangent_planes(p[stale] + centre)
            self._seen_from[stale] = p[stale]
            self._valid_for[stale] = np.maximum(_SURELY_CLEAR * distance, self._detail) ** 2
            self._place[stale], self._normal[stale] = place - centre, normal
        height = np.einsum("ij,ij->i", p[near] - self._place[near], self._normal[near])
        push = -neighbour.allowance[near] - height
        deep = push > 0.0
        p[near[deep]] += push[deep, None] * self._normal[near[deep]]
        hit[near[deep]] = True
        return hit
