"""Bones that a muscle's points are kept out of."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.rigid import apply_transform, inverse
from vtkmuscle.core.voxels import VoxelGrid, build_voxel_grid, resolve_collisions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: By how much the weights of a bone's points differ.
UNEVENNESS = 1e-3


class Obstacle:
    """A bone that points are kept out of; its voxels are made when a muscle first comes near.

    Parameters
    ----------
    bone : int
        Index among the bones' transforms.
    points : (n, 3) array
        Of the bone in the rest pose [mm].
    triangles : (m, 3) int array
        Point ids.
    n_max : int
        Largest number of voxels.
    """

    def __init__(self, bone: int, points: Floats, triangles: Ints, *, n_max: int) -> None:
        self.bone = bone
        self.points = points
        self.triangles = triangles
        self.n_max = n_max
        #: From the scene at rest to the axes along which the voxels are laid.
        self.axes: Floats = bone_axes(points)
        along = apply_transform(self.axes, points)
        low, high = along.min(axis=0), along.max(axis=0)
        # A voxel may reach over the bone's box; the largest is about this long.
        margin = 2.0 * float(np.linalg.norm(high - low)) / max(n_max, 1) ** (1.0 / 3.0)
        self._corners = np.array(np.meshgrid(*zip(low - margin, high + margin, strict=True))).reshape(3, -1).T

    @cached_property
    def grid(self) -> VoxelGrid:
        """The bone's voxels, in its own axes."""
        return build_voxel_grid(apply_transform(self.axes, self.points), self.triangles, n_max=self.n_max)

    def same_as(self, other: Obstacle) -> bool:
        """Return whether another obstacle is the same bone, to be divided into as many voxels."""
        return (
            (self.bone, self.n_max) == (other.bone, other.n_max)
            and np.array_equal(self.points, other.points)
            and np.array_equal(self.triangles, other.triangles)
        )

    def meets(self, transform: Floats, low: Floats, high: Floats) -> bool:
        """Return False where the bone, moved from its own axes, is outside a box for sure."""
        corners = apply_transform(transform, self._corners)
        return bool((corners.max(axis=0) >= low).all() and (corners.min(axis=0) <= high).all())


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
    axes[0] *= np.linalg.det(axes)  # a rotation, not a reflection
    transform = np.eye(4)
    transform[:3, :3] = axes
    transform[:3, 3] = -axes @ centre
    return transform


def keep_out(
    obstacles: Sequence[Obstacle],
    centre: Floats,
    now: Floats,
    before: Floats,
    x: Floats,
    p: Floats,
    free: Bools,
    *,
    bone_push: bool,
) -> Bools:
    """Move predicted positions out of the bones that they can have met.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        Bones, in scene coordinates at rest.
    centre : (3,) array
        Where the points' origin is in the scene at rest [mm].
    now, before : (b, 4, 4) arrays
        Transforms of all bones, rest to now and rest to the previous frame, of points about the centre.
    x, p : (n, 3) arrays
        Previous and predicted positions about the centre [mm]; p is changed in place.
    free : (n,) bool array
        Points that may be moved.
    bone_push : bool
        See :func:`~vtkmuscle.core.voxels.resolve_collisions`.

    Returns
    -------
    (n,) bool array
        Points that were moved.
    """
    hit = np.zeros(len(p), dtype=np.bool_)
    if not obstacles:
        return hit
    # Column by column: numpy is ten times slower along the first axis.
    low = np.array([min(x[:, k].min(), p[:, k].min()) for k in range(3)])
    high = np.array([max(x[:, k].max(), p[:, k].max()) for k in range(3)])
    about_centre = np.eye(4)
    about_centre[:3, 3] = -centre
    for obstacle in obstacles:
        bone_now = now[obstacle.bone] @ about_centre @ inverse(obstacle.axes)
        if obstacle.meets(bone_now, low, high):
            motion = now[obstacle.bone] @ inverse(before[obstacle.bone])
            hit |= resolve_collisions(obstacle.grid, bone_now, motion, x, p, free, bone_push=bone_push)
    return hit
