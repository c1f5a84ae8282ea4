"""Bones as obstacles by their fields of signed distances."""

from __future__ import annotations

import warnings
from functools import cached_property

import numpy as np

from vtkmuscle.core.bones.bone import CELLS_PER_DIAGONAL, Bone
from vtkmuscle.core.collision.distance_collision import resolve_distance_collisions
from vtkmuscle.core.collision.obstacles import Approach, Obstacle
from vtkmuscle.core.errors import placed
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Bools, Floats, Ints


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
        """A cell, for what the interpolation between nodes can be wrong by, and the skin."""
        # The box in the scene is at least as long as that along the axes.
        diagonal = float(np.linalg.norm(self.box[1] - self.box[0]))
        return 2.0 * diagonal / CELLS_PER_DIAGONAL + self.skin

    @cached_property
    def shape(self) -> Bone:
        """The bone at rest, shared by all muscles that meet it; warns of what is wrong with its surface."""
        with placed(self.name):
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
        allowance: Floats = np.maximum(0.0, self.skin - distance)
        return allowance

    def entered(self, points: Floats, moved: Bools) -> Bools:
        """Return the points that were moved: all that were in the bone."""
        return moved

    def begin(self, approach: Approach) -> None:
        """Carry what is known along with the bone."""
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
