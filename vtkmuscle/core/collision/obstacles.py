"""What a muscle's points are kept out of: bones, as voxels or as signed distances, and other muscles."""

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
    """The relative motion of a bone and the points of a muscle in a step."""

    now: Floats  # (4, 4), from the bone's axes to its present position
    step: Floats  # (4, 4), motion of the bone from the previous frame to now
    x: Floats  # (n, 3), positions of the previous frame [mm]
    free: Bools  # (n,), points that may be moved
    allowance: Floats | None  # (n,), depth that each point may have in the bone [mm]
    bone_push: bool  # whether the bone takes points along that it moved over, where the method has the choice
    clearance: Clearance  # which points are known to be away from the bone, where the method keeps account


class Obstacle(ABC):
    """A bone that points are kept out of; its data are built when a muscle first comes near.

    ``bone`` is its index among the bones' transforms; points (n, 3) [mm] and triangles (m, 3) are those at
    rest.
    """

    #: Whether points move along the surface, so that their path can be followed in short pieces.
    slides: bool
    #: Distance that points keep from the bone [mm].
    skin: float = 0.0
    #: How far around the bone's box points are tested [mm].
    margin: float
    #: The settings of the grid and the response.
    settings: tuple[float | None, ...]

    def __init__(self, bone: int, points: Floats, triangles: Ints, name: str) -> None:
        self.bone, self.points, self.triangles, self.name = bone, points, triangles, name
        #: Lowest and highest corner of a box in the scene at rest that holds the bone, and its diagonal [mm].
        self.box: tuple[Floats, Floats] = points.min(axis=0), points.max(axis=0)
        self.diagonal = float(np.linalg.norm(self.box[1] - self.box[0]))

    @cached_property
    def shape(self) -> Bone:
        """The bone at rest, the same for all muscles that meet it."""
        return bone_of(self.points, self.triangles)

    @property
    def axes(self) -> Floats:
        """From the scene at rest to the axes along which the grid is laid, (4, 4)."""
        return np.eye(4)

    @property
    def box_along_axes(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the bone's box along its axes [mm]."""
        return self.box

    def same_as(self, other: Obstacle) -> bool:
        """Return whether another obstacle is the same bone, on the same grid."""
        return (
            type(self) is type(other)
            and (self.bone, self.settings) == (other.bone, other.settings)
            and np.array_equal(self.points, other.points)
            and np.array_equal(self.triangles, other.triangles)
        )

    def allowance(self, points: Floats) -> Floats | None:
        """Return the depth (n,) that points (n, 3), at rest and in the bone's axes, may have in it [mm]."""
        return None

    @abstractmethod
    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move predicted positions p (n, 3) [mm] out of the bone, in place; return which, (n,)."""


class VoxelObstacle(Obstacle):
    """A bone as voxels along the axes of the scene at rest: Kohout and Cervenka 2021 section 3.2.

    Points are moved back the way they came, to the first voxel outside; one that was in the bone before is
    not moved. The voxels are about ``n_max`` near-cubes, or ``n_equal`` along each axis.
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
        self.settings = self.n_max, self.n_equal = n_max, n_equal
        # No voxel reaches farther over the bone's box than it is long.
        self.margin = 2.0 * self.diagonal / (n_equal or max(n_max, 1) ** (1.0 / 3.0))

    @cached_property
    def grid(self) -> VoxelGrid:
        """The bone's voxels."""
        with errors_at(self.name):
            return build_voxel_grid(
                self.points, self.triangles, n_max=self.n_max, n_equal=self.n_equal, what=self.name
            )

    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move points back the way they came, to the first voxel outside."""
        motion = approach.now, approach.step, approach.x, p, approach.free
        return resolve_collisions(self.grid, *motion, bone_push=approach.bone_push)


class DistanceObstacle(Obstacle):
    """A bone as signed distances along its own axes, with a skin [mm]: points slide along its surface.

    Points that are in the bone or its skin at rest may be as deep as they are there, so that the rest pose
    stays as it is.
    """

    slides = True

    def __init__(
        self, bone: int, points: Floats, triangles: Ints, *, skin: float = 0.0, name: str = "bone"
    ) -> None:
        super().__init__(bone, points, triangles, name)
        self.skin, self.settings = skin, (skin,)
        # A cell for the error of the field; the box in the scene is at least as long as that along the axes.
        self.margin = 2.0 * self.diagonal / CELLS_PER_DIAGONAL + skin

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
        """Return the depth (n,) of points (n, 3) in the bone's skin at rest."""
        distance, _ = self.shape.field(apply_transform(inverse(self.axes), points), within=self.skin)
        return np.maximum(0.0, self.skin - distance)

    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move points to the bone's surface; the bone pushes those that it moved over."""
        motion = approach.now, approach.step, approach.x, p, approach.free
        deep, clearance = approach.allowance, approach.clearance
        return resolve_distance_collisions(
            self.shape, *motion, skin=self.skin, allowance=deep, clearance=clearance
        )


#: Part of its distance from a neighbour that a point may move before it is tested again.
_SURELY_CLEAR = 0.9

#: Part of a neighbour's mean edge within which its surface counts as flat.
_FLAT = 0.25


@dataclass(frozen=True, eq=False)
class Neighbour:
    """Another muscle: the tree of its surface, facing outward, in the scene now [mm].

    The allowance (n,) is the depth that each point of the muscle may have in it [mm]: its depth at rest.
    """

    tree: TriangleTree
    allowance: Floats


class MuscleContact:
    """The neighbours of a muscle during one step, in which they stand still.

    A point that is deeper in a neighbour than at rest goes to the plane that touches the neighbour at its
    place nearest to the point. The plane is updated when the point has moved by a part of the neighbour's
    edges. Points may be moved where ``free`` (n,); ``centre`` (3,) is their origin in the scene [mm].
    """

    def __init__(self, neighbours: Sequence[Neighbour], free: Bools, centre: Floats) -> None:
        self._planes = [_Planes(neighbour, len(free)) for neighbour in neighbours]
        self._free = free
        self._centre = centre

    def keep_out(self, p: Floats) -> Bools:
        """Move predicted positions (n, 3) out of the neighbours, in place; return which were moved, (n,)."""
        hit = np.zeros(len(p), dtype=np.bool_)
        for planes in self._planes:
            hit |= planes.keep_out(p, self._free, self._centre)
        return hit


class _Planes:
    """The tangent plane of a neighbouring muscle at the point nearest to each point of the muscle."""

    def __init__(self, neighbour: Neighbour, n_points: int) -> None:
        self._neighbour = neighbour
        self._seen_from, self._place, self._normal = np.zeros((3, n_points, 3))
        self._valid_for = np.full(n_points, -1.0)  # squared distance that a point may move from there
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
