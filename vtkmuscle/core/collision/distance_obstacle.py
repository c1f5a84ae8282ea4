"""Bones as obstacles by their signed distances, on grids that muscles side by side share."""

from __future__ import annotations

from functools import cached_property
from hashlib import sha256
from threading import Lock
from weakref import WeakValueDictionary

import numpy as np

from vtkmuscle.core.collision.distance_collision import SKIN_CELLS, resolve_distance_collisions
from vtkmuscle.core.collision.distance_grid import BAND_CELLS, DistanceGrid
from vtkmuscle.core.collision.distance_lookup import rest_allowance
from vtkmuscle.core.collision.grid_cache import cached_distance_grid
from vtkmuscle.core.collision.obstacles import Approach, Obstacle
from vtkmuscle.core.errors import placed
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import Bools, Floats, Ints

#: Cells of a distance grid along the diagonal of a bone's box along its axes, where no size is given: 1.0 mm
#: on a pelvis, 1.2 mm on a femur. Measured there over hip flexion: points end at most 0.1 mm within the bone
#: with cells of 1 mm, and 0.2 mm with 2 mm.
CELLS_PER_DIAGONAL = 600.0

#: By how much a grid goes beyond where muscles are expected, as a part of that region's diagonal: they bulge.
BULGE = 0.05


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
        Points in the scene at rest, in whose convex hull, seen from the bone, muscles are expected [mm]: the
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
        self._partial = True

    @property
    def settings(self) -> tuple[float | None, ...]:
        """Distance of the grid's nodes, skin and friction."""
        return self._cell, self.skin, self.friction

    def same_as(self, other: Obstacle) -> bool:
        """Return whether another obstacle is the same bone, on the same grid."""
        return (
            super().same_as(other)
            and isinstance(other, DistanceObstacle)
            and self._partial == other._partial
            and _equal(self._reach, other._reach)
        )

    @cached_property
    def region(self) -> tuple[Floats, Floats] | None:
        """Lowest and highest corner of the box along the axes that the grid covers [mm], None for all."""
        if self._reach is None or not self._partial:
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
        self._partial = False
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
        with placed(self.name):
            return _shared_grid(along, self.triangles, self.cell, self.band, self.region, self.name)

    def take_over(self, earlier: Obstacle | None) -> None:
        """Take the grid of an obstacle that was there before, where it is the same."""
        if (
            isinstance(earlier, DistanceObstacle)
            and "grid" in vars(earlier)
            and (earlier.cell, earlier.band) == (self.cell, self.band)
            and (earlier._partial, self._partial) == (True, True)
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

    def begin(self, approach: Approach) -> None:
        """Carry what is known along with the bone."""
        approach.clearance.begin(self.grid, approach.now, approach.step, approach.x)

    def keep_out(self, approach: Approach, p: Floats) -> Bools:
        """Move points to the bone's surface; the bone pushes those that it moved over."""
        return resolve_distance_collisions(
            self.grid,
            approach.now,
            approach.step,
            approach.x,
            p,
            approach.free,
            skin=self.skin,
            friction=self.friction,
            allowance=approach.allowance,
            clearance=approach.clearance,
        )


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
            grid = cached_distance_grid((points, triangles), cell=cell, band=band, region=region, what=name)
            _shared[key] = grid
    return grid
