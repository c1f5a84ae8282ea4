"""A muscle of fewer triangles that is solved in place of the full one, which is carried along with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.contact import Barrier, Contact
from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.motion.rigid import apply_transform, centred
from vtkmuscle.core.pbd.coarse import Prolongation, coarse_muscle
from vtkmuscle.core.pbd.constraints import VOLUME_FLOOR, project_volume
from vtkmuscle.core.pbd.rest_shape import RestShape, ShapeReport

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Rounds of taking points out of the bones and projecting the volume. The latter is a Newton step, and the
#: first begins within a percent or so.
_SETTLING_STEPS = 4


class ReducedMuscle:
    """A decimated muscle, and the way from its deformation to that of the full one.

    Each point of the full muscle keeps its place in the frames of the reduced points nearest to it, which
    turn with the rings around them (:class:`~vtkmuscle.core.pbd.coarse.Prolongation`); fixed points follow
    their bones exactly; then the free ones are taken out of the bones and moved along the gradient of the
    volume until the full muscle has its own volume again.

    Parameters
    ----------
    points : (n, 3) array
        The full muscle at rest [mm].
    triangles : (m, 3) int array
        Point ids of a closed surface.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    max_triangles : int
        Most triangles of the reduced muscle.

    Attributes
    ----------
    points, triangles, fixed_to : arrays
        Of the reduced muscle, likewise.

    Raises
    ------
    ValueError
        If the surface cannot be reduced so far and stay closed.
    ModuleNotFoundError
        If fast-simplification is not installed.
    """

    def __init__(self, points: Floats, triangles: Ints, fixed_to: Ints, max_triangles: int) -> None:
        # A closed surface has two triangles per point, about.
        self.points, self.triangles, self.fixed_to = coarse_muscle(
            points, triangles, fixed_to, max_triangles // 2, hold=True
        )
        self._full, self._triangles, self._full_fixed_to = points, triangles, fixed_to
        self._prolongation = Prolongation(self.points, self.triangles, points)
        self._centre = points.mean(axis=0)
        self._barrier: Barrier | None = None
        self._free = fixed_to < 0
        self._shape = RestShape(points - self._centre, mesh_topology(len(points), triangles))
        self._floor = VOLUME_FLOOR * float((self._shape.volume_gradient[self._free] ** 2).sum())

    def carry(self, positions: Floats, transforms: Floats, obstacles: Sequence[Obstacle] = ()) -> Floats:
        """Return the full muscle.

        Parameters
        ----------
        positions : (c, 3) array
            The reduced muscle now [mm].
        transforms : (b, 4, 4) array
            Of the bones, rest to now.
        obstacles : sequence of Obstacle, optional
            Bones that free points are kept out of.

        Returns
        -------
        (n, 3) array
            [mm].
        """
        moved = self._prolongation.prolong(self.points, positions, self._full)
        for bone in np.unique(self._full_fixed_to[~self._free]):
            fixed = self._full_fixed_to == bone
            moved[fixed] = apply_transform(transforms[bone], self._full[fixed])
        moved -= self._centre
        self._settle(moved, centred(transforms, self._centre), obstacles)
        carried: Floats = moved + self._centre
        return carried

    def _settle(self, p: Floats, now: Floats, obstacles: Sequence[Obstacle]) -> None:
        """Take points (n, 3) out of the bones, and give the muscle its volume, by the others."""
        if self._barrier is None or tuple(obstacles) != self._barrier.obstacles:
            rest = self._full - self._centre
            # The reduced muscle's solver warns of what is odd at a bone.
            self._barrier = Barrier(obstacles, rest, self._centre, self._free, bone_push=False, warns=False)
        contact = Contact(self._barrier, now, now, p.copy())
        hit = np.zeros(len(p), dtype=np.bool_)
        gradient = np.empty_like(p)
        for _ in range(_SETTLING_STEPS):
            hit |= contact.keep_out(p)
            weights = (self._free & ~hit).astype(np.float64)
            project_volume(p, weights, self._triangles, self._shape.volume, self._floor, 1.0, gradient)

    def report(self, points: Floats) -> ShapeReport:
        """Return how well the full muscle (n, 3) keeps volume, edge lengths and angles."""
        return self._shape.compare(points - self._centre)

    def carry_vectors(self, vectors: Floats) -> Floats:
        """Return vectors (n, 3) of the full muscle's points from those of the reduced one (c, 3)."""
        near, weights = self._prolongation.binding.neighbours, self._prolongation.binding.weights
        carried: Floats = np.einsum("nk,nkj->nj", weights, vectors[near])
        return carried
