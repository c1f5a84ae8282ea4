"""A muscle's surface carried by paths, then settled.

Bones carry a muscle without paths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.mesh.surface import mean_thickness
from vtkmuscle.core.mesh.triangle_tree import Neighbour
from vtkmuscle.core.motion.blending import blend_motions
from vtkmuscle.core.paths.lines import bones_at_ends
from vtkmuscle.core.skinning.settling import Settling
from vtkmuscle.core.skinning.skinning import SkinnedMuscle, Skinning
from vtkmuscle.core.types import Floats


@dataclass(frozen=True, eq=False)
class CarriedPose:
    """A muscle in a pose of its bones.

    Attributes
    ----------
    surface : (n, 3) array
        Points of the settled muscle [mm].
    carried : (n, 3) array
        The points where paths or bones carry the muscle, before it settles [mm].
    colliding : int
        Number of points that bones or other muscles hold off.
    skinned : SkinnedMuscle or None
        The skinned muscle; None without paths.
    """

    surface: Floats
    carried: Floats
    colliding: int
    skinned: SkinnedMuscle | None


class CarriedMuscle:
    """A muscle that moves with paths, then settles.

    Skinning moves the muscle with the paths. A muscle without paths is carried by the motions of the muscle's
    bones, blended by harmonic weights.

    Parameters
    ----------
    muscle : FixedMuscle
        The muscle at rest.
    paths : (f, n, 3) array or None
        The muscle's paths at rest [mm].
    bones : mapping of int to Bone
        Bones that the surface is kept out of, by index among the transforms.
    clearance : float, optional
        Distance that the surface keeps from the bones [mm].

    Raises
    ------
    ValueError
        If the surface is open or encloses no volume.
    """

    def __init__(
        self, muscle: FixedMuscle, paths: Floats | None, bones: Mapping[int, Bone], clearance: float = 0.0
    ) -> None:
        points, fixed_to, topology = muscle.points, muscle.fixed_to, muscle.topology()
        self._points, self._fibre_weights = points, None
        self._skinning = self._weights = None
        if paths is not None:
            ends, thickness = bones_at_ends(paths, points, fixed_to), mean_thickness(points, muscle.triangles)
            self._skinning = Skinning(paths, ends, points, fixed_to, thickness)
            if muscle.fibres is not None:
                self._fibre_weights = self._skinning.weights_of_fibres(*muscle.fibres)
        elif (fixed_to >= 0).any():
            self._weights = harmonic_weights(points, muscle.triangles, fixed_to)
        self.shape = RestShape(points, topology)
        self._settling = Settling(self.shape, fixed_to, bones, clearance)

    def pose(
        self,
        paths: Floats | None,
        transforms: Floats,
        *,
        rounds: int,
        neighbours: Sequence[Neighbour] = (),
        progress: Callable[[float], None] | None = None,
    ) -> CarriedPose:
        """Return the muscle in a pose.

        Parameters
        ----------
        paths : (f, n, 3) array or None
            The paths in the pose [mm].
        transforms : (b, 4, 4) array
            Of the bones, rest to now.
        rounds, neighbours, progress
            See :meth:`~vtkmuscle.core.skinning.settling.Settling.settle`.
        """
        skinned = None
        carried = self._points
        if self._skinning is not None and paths is not None:
            skinned = self._skinning.at(paths, transforms)
            carried = skinned.surface
        elif self._weights is not None:
            carriers, weights = self._weights
            carried = blend_motions(transforms[carriers], weights, self._points)
        settled = self._settling.settle(
            carried, transforms, rounds=rounds, neighbours=neighbours, progress=progress
        )
        return CarriedPose(settled.surface, carried, settled.colliding, skinned)

    def fibre_points(self, pose: CarriedPose) -> Floats:
        """Return the points of the muscle's fibres before the muscle settles.

        Points are (p, 3) [mm]; each fibre goes with the fibre's path.
        """
        assert pose.skinned is not None
        assert self._fibre_weights is not None
        return pose.skinned.points(self._fibre_weights)
