"""Bones that a muscle's points are kept out of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from hashlib import sha256
from threading import Lock
from weakref import WeakValueDictionary

import numpy as np

from vtkmuscle.core.collision.distance_collision import SKIN_CELLS, Clearance, resolve_distance_collisions
from vtkmuscle.core.collision.distance_grid import BAND_CELLS, DistanceGrid
from vtkmuscle.core.collision.distance_lookup import rest_allowance
from vtkmuscle.core.collision.grid_cache import cached_distance_grid
from vtkmuscle.core.collision.voxels import VoxelGrid, build_voxel_grid, resolve_collisions
from vtkmuscle.core.mesh.sampling import uneven_weights
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import Bools, Floats, Ints

#: By how much the weights of a bone's points differ.
UNEVENNESS = 1e-3

#: Cells of a distance grid along the diagonal of a bone's box along its axes, where no size is given: 1.0 mm
#: on a pelvis, 1.2 mm on a femur. Measured there over hip flexion: points end at most 0.1 mm within the bone
#: with cells of 1 mm, and 0.2 mm with 2 mm.
CELLS_PER_DIAGONAL = 600.0

#: By how much a grid goes beyond where muscles are foreseen, as a part of the diagonal of that: they bulge.
BULGE = 0.05


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

    def cover(self, low: Floats, high: Floats) -> bool:
        """Return whether the grid had to be made anew for points in a box along the bone's axes [mm]."""
        return False

    @cached_property
    def axes(self) -> Floats:
        """From the scene at rest to the axes along which the grid is laid, (4, 4)."""
        return bone_axes(self.points)

    @cached_property
    def box_along_axes(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the bone's box along its axes [mm]."""
        along = apply_transform(self.axes, self.points)
        return along.min(axis=0), along.max(axis=0)

    @property
    @abstractmethod
    def settings(self) -> tuple[float | None, ...]:
        """What the grid and the response depend on, beside the bone."""

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
    def begin(self, clearance: Clearance, bone: Floats, step: Floats, x: Floats) -> None:
        """Begin a step with what is known of the points that are away from the bone, where that is used.

        Parameters
        ----------
        clearance : Clearance
            Of the points.
        bone : (4, 4) array
            From the bone's axes to where it is now.
        step : (4, 4) array
            Motion of the bone from the previous frame to now.
        x : (n, 3) array
            Positions of the previous frame [mm].
        """

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
        clearance: Clearance | None = None,
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
        clearance : Clearance, optional
            Which points are known to be away from the bone; brought up to date where the method knows.

        Returns
        -------
        (n,) bool array
            Points that were moved.
        """


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
    def grid(self) -> VoxelGrid:
        """The bone's voxels, in its own axes."""
        along = apply_transform(self.axes, self.points)
        with _named(self.name):
            return build_voxel_grid(
                along, self.triangles, n_max=self.n_max, n_equal=self.n_equal, what=self.name
            )

    def allowance(self, points: Floats) -> None:
        """Return None: a point that was in the bone before is not moved."""

    def entered(self, points: Floats, moved: Bools) -> Bools:
        """Return which points are in the bone's voxels: not all that are need have been moved."""
        inside: Bools = self.grid.contains(points)
        return inside

    def begin(self, clearance: Clearance, bone: Floats, step: Floats, x: Floats) -> None:
        """Do nothing: all points are looked at."""

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
        clearance: Clearance | None = None,
    ) -> Bools:
        """Move points back the way they came, to the first voxel outside."""
        return resolve_collisions(self.grid, now, step, x, p, free, bone_push=bone_push)


class DistanceObstacle(Obstacle):
    """A bone as signed distances: points slide along its surface.

    The response is in :mod:`vtkmuscle.core.collision.distance_collision`.

    Points that are in the bone or its skin at rest may be as deep as they are there, so that the rest pose
    stays as it is.

    Parameters
    ----------
    bone, points, triangles, name
        As of :class:`Obstacle`.
    cell : float or None
        Distance of the grid's nodes [mm]; None for the bone's diagonal / :data:`CELLS_PER_DIAGONAL`.
    skin : float
        Distance that points keep from the bone [mm].
    friction : float
        Coulomb's coefficient [1].
    reach : (k, 3) array, optional
        Points in the scene at rest, in whose convex hull, seen from the bone, muscles are foreseen [mm]: the
        grid covers no more of the bone than that takes. By default it covers all.
    """

    slides = True

    def __init__(
        self,
        bone: int,
        points: Floats,
        triangles: Ints,
        *,
        cell: float | None = None,
        skin: float = 0.0,
        friction: float = 0.0,
        reach: Floats | None = None,
        name: str = "bone",
    ) -> None:
        super().__init__(bone, points, triangles, name)
        self._cell, self.skin, self.friction = cell, skin, friction
        self._reach = reach
        self._foreseen = True

    @property
    def settings(self) -> tuple[float | None, ...]:
        """Distance of the grid's nodes, skin and friction."""
        return self._cell, self.skin, self.friction

    def same_as(self, other: Obstacle) -> bool:
        """Return whether another obstacle is the same bone, on the same grid."""
        return (
            super().same_as(other)
            and isinstance(other, DistanceObstacle)
            and self._foreseen == other._foreseen
            and _equal(self._reach, other._reach)
        )

    @cached_property
    def region(self) -> tuple[Floats, Floats] | None:
        """Lowest and highest corner of the box along the axes that the grid covers [mm], None for all."""
        if self._reach is None or not self._foreseen:
            return None
        along = apply_transform(self.axes, self._reach)
        low, high = along.min(axis=0), along.max(axis=0)
        bulge = BULGE * float(np.linalg.norm(high - low))
        low, high = low - bulge, high + bulge
        return None if _within(*self.box_along_axes, low, high) else (low, high)

    def cover(self, low: Floats, high: Floats) -> bool:
        """Make the grid anew, for all of the bone, where a box that may meet it is not well in the region.

        Near the surface the distances stay the same; deep inside and near the border of the region they
        may not.
        """
        if self.region is None:
            return False
        from_low, to_high = self.region
        # Half of what the grid has more is for what the points do until they are looked at again.
        spare = 0.5 * BULGE / (1.0 + 2.0 * BULGE) * float(np.linalg.norm(to_high - from_low))
        bone_low, bone_high = self.box_along_axes
        low = np.maximum(low, bone_low - self.margin)
        high = np.minimum(high, bone_high + self.margin)
        # Beyond the bone's own box there is nothing to be missed.
        from_low = np.where(from_low < bone_low - self.margin, -np.inf, from_low + spare)
        to_high = np.where(to_high > bone_high + self.margin, np.inf, to_high - spare)
        if (low > high).any() or _within(low, high, from_low, to_high):
            return False
        self._foreseen = False
        for made in ("region", "grid"):
            vars(self).pop(made, None)
        return True

    @cached_property
    def cell(self) -> float:
        """Distance of the grid's nodes [mm]."""
        if self._cell is not None:
            return self._cell
        low, high = self.box_along_axes
        return float(np.linalg.norm(high - low)) / CELLS_PER_DIAGONAL

    @property
    def margin(self) -> float:
        """A cell, for what the interpolation between nodes can be wrong by, and the skin."""
        # The box in the scene is at least as long as that along the axes.
        low, high = self.box
        cell = self._cell or float(np.linalg.norm(high - low)) / CELLS_PER_DIAGONAL
        return 2.0 * cell + self.skin

    @property
    def band(self) -> float:
        """How far from the surface distances are known at least [mm]."""
        return max(BAND_CELLS * self.cell, self.skin + SKIN_CELLS * self.cell)

    @cached_property
    def grid(self) -> DistanceGrid:
        """Distances from the bone, in its own axes."""
        along = apply_transform(self.axes, self.points)
        with _named(self.name):
            return _shared_grid(along, self.triangles, self.cell, self.band, self.region, self.name)

    def take_over(self, earlier: Obstacle | None) -> None:
        """Take the grid of an obstacle that was there before, where it is the same."""
        if (
            isinstance(earlier, DistanceObstacle)
            and "grid" in vars(earlier)
            and (earlier.cell, earlier.band) == (self.cell, self.band)
            and (earlier._foreseen, self._foreseen) == (True, True)
            and _equal(earlier._reach, self._reach)
            and np.array_equal(earlier.points, self.points)
            and np.array_equal(earlier.triangles, self.triangles)
        ):
            self.grid = earlier.grid

    def allowance(self, points: Floats) -> Floats:
        """Return how deep points are in the bone, or its skin, at rest."""
        return rest_allowance(self.grid, points, skin=self.skin)

    def entered(self, points: Floats, moved: Bools) -> Bools:
        """Return the points that were moved: all that were in the bone."""
        return moved

    def begin(self, clearance: Clearance, bone: Floats, step: Floats, x: Floats) -> None:
        """Carry what is known along with the bone."""
        clearance.begin(self.grid, bone, step, x)

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
        clearance: Clearance | None = None,
    ) -> Bools:
        """Move points to the bone's surface; the bone pushes those that it moved over."""
        return resolve_distance_collisions(
            self.grid,
            now,
            step,
            x,
            p,
            free,
            skin=self.skin,
            friction=self.friction,
            allowance=allowance,
            clearance=clearance,
        )


@contextmanager
def _named(bone: str) -> Iterator[None]:
    """Say which bone it is that no grid can be made of."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{bone}: {error}") from error


_shared: WeakValueDictionary[bytes, DistanceGrid] = WeakValueDictionary()
_locks: WeakValueDictionary[bytes, _Lock] = WeakValueDictionary()
_looking = Lock()


class _Lock:
    """One thread at a time; others than the threading module's it can be referred to weakly."""

    def __init__(self) -> None:
        self.lock = Lock()


def _equal(one: Floats | None, other: Floats | None) -> bool:
    return one is other or (one is not None and other is not None and np.array_equal(one, other))


def _within(low: Floats, high: Floats, outer_low: Floats, outer_high: Floats) -> bool:
    """Return whether a box is within another."""
    return bool((low >= outer_low).all() and (high <= outer_high).all())


def _shared_grid(
    points: Floats,
    triangles: Ints,
    cell: float,
    band: float,
    region: tuple[Floats, Floats] | None,
    name: str,
) -> DistanceGrid:
    """Return the distances of a bone; muscles that are deformed side by side share one grid."""
    settings = np.concatenate([[cell, band], *(region or ())])
    key = sha256(points.tobytes() + triangles.tobytes() + settings.tobytes()).digest()
    with _looking:
        building = _locks.setdefault(key, _Lock())
    with building.lock:  # other bones are built meanwhile
        grid = _shared.get(key)
        if grid is None:
            grid = cached_distance_grid(points, triangles, cell=cell, band=band, region=region, what=name)
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
    weights = 1.0 + UNEVENNESS * uneven_weights(len(points))
    axes = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1].T
    # An eigenvector's sign is anybody's guess; the order of the points decides here, too.
    axes[(weights - weights.mean()) @ (arms @ axes.T) < 0.0] *= -1.0
    axes[2] = np.cross(axes[0], axes[1])  # a rotation, not a reflection
    transform = np.eye(4)
    transform[:3, :3] = axes
    transform[:3, 3] = -axes @ centre
    return transform
