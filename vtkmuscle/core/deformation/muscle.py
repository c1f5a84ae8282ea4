"""The model of a muscle: carried by its paths, then settled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.deformation.settling import Settling
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.neighbours import Neighbour
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.mesh.surface import MeshTopology
from vtkmuscle.core.motion.blending import blend_motions
from vtkmuscle.core.paths.lines import bones_at_ends, evenly_spread, lines_on_surface
from vtkmuscle.core.paths.sheet import MusclePaths, PathState
from vtkmuscle.core.paths.skinning import Skinning
from vtkmuscle.core.types import Floats


@dataclass(frozen=True, eq=False)
class Pose:
    """A muscle in a pose of its bones.

    Attributes
    ----------
    surface : (n, 3) array
        Points [mm].
    transforms : (b, 4, 4) array
        Of the bones, rest to now.
    colliding : int
        Number of points that bones or other muscles hold off.
    carried : (n, 3) array or None
        The points as the paths carry them, before they settle [mm]; None where it has no paths.
    fibre_points : (p, 3) array or None
        The points of the fibres likewise [mm]; None where lines stand in for them.
    paths : PathState or None
        The paths, from which those of the next pose go on.
    """

    surface: Floats
    transforms: Floats
    colliding: int
    carried: Floats | None = None
    fibre_points: Floats | None = None
    paths: PathState | None = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        fibres = 0 if self.fibre_points is None else self.fibre_points.nbytes
        paths = 0 if self.paths is None else self.paths.nbytes
        carried = 0 if self.carried is None else self.carried.nbytes
        return self.surface.nbytes + self.transforms.nbytes + fibres + paths + carried


class PathDrivenMuscle:
    """A muscle that moves with its taut paths, by skinning weights, and then settles.

    Its paths are its fibres pulled taut, or lines over its surface where it has none. A muscle that is not
    fixed to two bones has no paths: the bones' motions carry it, blended by harmonic weights.

    Parameters
    ----------
    muscle : FixedMuscle
        The muscle.
    bones : mapping of int to Bone
        Bones that paths and surface keep out of, by their index among the transforms.
    resolution : int
        Segments of a path.
    clearance : float, optional
        Distance that the surface keeps from the bones [mm].

    Attributes
    ----------
    shape : RestShape
        Its surface at rest.

    Raises
    ------
    ValueError
        If the surface is open or encloses no volume, or if no fibre has a length.
    """

    def __init__(
        self, muscle: FixedMuscle, bones: Mapping[int, Bone], resolution: int, clearance: float = 0.0
    ) -> None:
        points, fixed_to, topology = muscle.points, muscle.fixed_to, muscle.topology()
        directions = muscle.directions(topology)
        paths = _paths_of(muscle, topology, bones, resolution)
        self._paths, self._skinning = paths, None
        if paths is not None:
            self._skinning = Skinning(paths, points, fixed_to)
            if directions is None:
                directions = paths.directions_at(points[topology.edges].mean(axis=1))
        self.shape = RestShape(points, topology, directions)
        self._settling = Settling(self.shape, fixed_to, bones, clearance)
        self._fibres = None
        if self._skinning is not None and muscle.fibres is not None:
            self._fibres = self._skinning.weights_of_fibres(*muscle.fibres)
        self._weights = None
        if paths is None and (fixed_to >= 0).any():
            self._weights = harmonic_weights(points, muscle.triangles, fixed_to)

    def pose(
        self,
        before: Pose | None,
        transforms: Floats,
        *,
        rounds: int,
        neighbours: Sequence[Neighbour] = (),
        progress: Callable[[float], None] | None = None,
    ) -> Pose:
        """Return the muscle in a pose of its bones (b, 4, 4), rest to now.

        Its paths go on from the pose ``before``, None for those at rest; the other parameters are those of
        :meth:`~vtkmuscle.core.deformation.settling.Settling.settle`.
        """
        transforms = np.array(transforms, dtype=np.float64)
        paths = fibre_points = None
        if self._paths is not None and self._skinning is not None:
            last = self._paths.rest if before is None or before.paths is None else before.paths
            paths = self._paths.follow(last, transforms)
            skinned = self._skinning.at(paths)
            surface = skinned.surface
            if self._fibres is not None:
                fibre_points = skinned.points(self._fibres)
        elif self._weights is not None:
            bones, weights = self._weights
            surface = blend_motions(transforms[bones], weights, self.shape.points)
        else:
            surface = self.shape.points
        settled = self._settling.settle(
            surface, transforms, rounds=rounds, neighbours=neighbours, progress=progress
        )
        carried = None if paths is None else surface
        return Pose(settled.surface, transforms, settled.colliding, carried, fibre_points, paths)


def _paths_of(
    muscle: FixedMuscle, topology: MeshTopology, bones: Mapping[int, Bone], resolution: int
) -> MusclePaths | None:
    """Return a muscle's fibres, or lines over its surface where it has none, as paths.

    None where the muscle is not fixed to two bones: all of it goes with the one.
    """
    points, fixed_to = muscle.points, muscle.fixed_to
    if len(np.unique(fixed_to[fixed_to >= 0])) < 2:
        return None
    lines = muscle.fibres
    if lines is None:
        lines = lines_on_surface(points, topology, fixed_to)
        if lines is None:
            return None
    fibres = evenly_spread(*lines, resolution + 1)
    return MusclePaths(
        fibres,
        *bones_at_ends(fibres, points, fixed_to),
        points,
        topology.triangles,
        dict(bones),
        rings=muscle.rings,
    )
