"""A muscle's surface carried by paths or bones, then settled."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneContact, PoseContact
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.rest_shape import RestShape, Volume
from vtkmuscle.core.mesh.surface import mean_thickness
from vtkmuscle.core.mesh.triangle_tree import Near
from vtkmuscle.core.motion.blending import blend_motions
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.paths.lines import bones_at_ends
from vtkmuscle.core.skinning.diffusion import Diffusion
from vtkmuscle.core.skinning.skinning import SkinnedMuscle, Skinning
from vtkmuscle.core.types import TINY, Bools, Floats, Ints, Progress, quiet

#: How far a displacement spreads over the surface, the standard deviation along a line, as a part of the
#: muscle's mean thickness 2 V / A. Of four muscles of a real hip 0.2 and 0.3 leave one a tenth rougher or
#: another a tenth smoother; 0.8 is rougher, and takes all farther from where they are carried
#: (bench_settling.py).
SPREAD = 0.4
#: How far ways out of a bone spread where they would tear the muscle, likewise; and how often points go on
#: by their depth along these, at most. A gluteus maximus that is carried 11 mm into the ischium has edges 2.5
#: to 3.3 times as long as at rest with 1.2 to 2.4, 9 with 0.8 or without; with two times up to 8.7, six 3.3.
TOGETHER, MOST_STEPS = 1.6, 6


@dataclass(frozen=True, eq=False)
class CarriedPose:
    """A muscle in a pose of its bones.

    surface : (n, 3), points of the settled muscle [mm];
    carried : (n, 3), the points where paths or bones carry the muscle, before it settles [mm];
    colliding : int, number of points that bones or other muscles hold off;
    skinned : SkinnedMuscle or None, the skinned muscle; None without paths.
    """

    surface: Floats
    carried: Floats
    colliding: int
    skinned: SkinnedMuscle | None = None


class Settling:
    """Moves a muscle's surface smoothly off bones.

    The surface also moves to the rest volume. The offset of a point from the carried position is the
    point's *displacement*. Volume and bones ask for displacements; in each round the displacement diffuses
    over the surface (:class:`~vtkmuscle.core.skinning.diffusion.Diffusion`), and then volume and bones ask
    again. The rounds descend the membrane energy of the displacement (Botsch, Sorkine 2008, *On linear
    variational surface deformation methods*, doi:10.1109/TVCG.2007.1054, section 3) under the constraints of
    volume and bones, for a given time; the rounds cut the time into steps. Volume and bones come last. The
    result depends on the arguments alone, not on earlier results.

    shape : RestShape, the muscle at rest;
    fixed_to : (n,) int, index of the bone each point is fixed to, -1 for free points;
    bones : mapping of int to Bone, bones that free points are kept out of, by index: see
        :class:`~vtkmuscle.core.bones.contact.BoneContact`;
    gap : float, distance that points keep from the bones [mm].
    """

    def __init__(self, shape: RestShape, fixed_to: Ints, bones: Mapping[int, Bone], gap: float = 0.0) -> None:
        self._rest = shape.points
        self._free = free = fixed_to < 0
        self._fixed = [(int(bone), np.flatnonzero(fixed_to == bone)) for bone in np.unique(fixed_to[~free])]
        self._contact = BoneContact(bones, self._rest, free, gap)
        self._diffusion = Diffusion(self._rest, shape.topology.triangles)
        self._edges = shape.topology.edges
        self._volume = Volume(shape, free)
        thickness = mean_thickness(self._rest, shape.topology.triangles)
        self._time = 0.5 * (SPREAD * thickness) ** 2 / self._diffusion.time_unit

    def settle(
        self, carried: Floats, transforms: Floats, rounds: int, near: Near = (), progress: Progress = quiet
    ) -> CarriedPose:
        """Return the muscle settled in a pose.

        carried : (n, 3), the muscle's points as the paths carry the points [mm]; fixed points go with their
            bones;
        transforms : (b, 4, 4), of the bones, rest to now;
        rounds : int, steps of the diffusion, >= 1;
        near : sequence of Neighbour, other muscles now, to keep the free points out of;
        progress : callable, called after each round.
        """
        before, carried = carried, carried.copy()
        for bone, fixed in self._fixed:
            carried[fixed] = apply_transform(transforms[bone], self._rest[fixed])
        touching = PoseContact(self._contact, transforms, near, np.zeros(3))
        points = carried.copy()
        self._leave_bones(points, touching)
        displacement = np.empty_like(points)
        for number in range(rounds):
            if number:
                touching.keep_out(points)
            self._volume.restore(points)
            np.subtract(points, carried, out=displacement)
            self._diffusion.spread(displacement, self._time / rounds, self._free)
            np.add(carried, displacement, out=points)
            progress((number + 1) / rounds)
        held = self._volume.finish(points, touching.keep_out)
        return CarriedPose(points, before, int(held.sum()))

    def _leave_bones(self, points: Floats, touching: PoseContact) -> None:
        """Move points out of the bones, in place.

        Each point goes to the nearest side of the bone. Where the nearest sides would tear a muscle carried
        across a bone in two, ways out diffuse first among the points in the bone, to go the same way.
        """
        out = points.copy()
        inside = touching.keep_out(out)
        moves = out - points
        if inside.any() and _torn(points, moves, inside, self._edges):
            time = (TOGETHER / SPREAD) ** 2 * self._time
            self._diffusion.spread(moves, time, inside, insulated=True)
            moves /= np.maximum(np.linalg.norm(moves, axis=1), TINY)[:, None]
            for _ in range(MOST_STEPS):  # on along the way, by the distance out of the bone
                depths = np.linalg.norm(out[inside] - points[inside], axis=1)
                points[inside] += depths[:, None] * moves[inside]
                out[:] = points
                inside = touching.keep_out(out)
                if not inside.any():
                    break
        points[:] = out


def _torn(points: Floats, moves: Floats, inside: Bools, edges: Ints) -> bool:
    """Return whether opposite ways tear two neighbours apart.

    Ways are (n, 3), ``inside`` is (n,). Torn neighbours part by more than the length of their edge.
    """
    first, second = edges[inside[edges[:, 0]] & inside[edges[:, 1]]].T
    opposite = (moves[first] * moves[second]).sum(axis=1) < 0.0
    apart, lengths = (np.linalg.norm(x[first] - x[second], axis=1) for x in (moves, points))
    return bool((opposite & (apart > lengths)).any())


class CarriedMuscle:
    """A muscle that moves with paths, then settles.

    Skinning moves the muscle with the paths. A muscle without paths is carried by the motions of the muscle's
    bones, blended by harmonic weights.

    muscle : FixedMuscle, the muscle at rest;
    paths : (f, n, 3) or None, the muscle's paths at rest [mm];
    bones : mapping of int to Bone, bones that the surface is kept out of, by index among the transforms;
    clearance : float, distance that the surface keeps from the bones [mm].

    Raises a ValueError if the surface is open or encloses no volume, or if no path at rest is in it.
    """

    def __init__(
        self, muscle: FixedMuscle, paths: Floats | None, bones: Mapping[int, Bone], clearance: float = 0.0
    ) -> None:
        points, fixed_to, topology = muscle.points, muscle.fixed_to, muscle.topology()
        self._points, self._fibre_weights = points, None
        self._skinning = self._weights = None
        if paths is not None:
            muscle.check_lines(paths)
            ends, thickness = bones_at_ends(paths, points, fixed_to), mean_thickness(points, muscle.triangles)
            self._skinning = Skinning(paths, ends, points, fixed_to, thickness)
            if muscle.fibres is not None:
                self._fibre_weights = self._skinning.weights_of_fibres(*muscle.fibres)
        elif (fixed_to >= 0).any():
            self._weights = harmonic_weights(points, muscle.triangles, fixed_to)[:2]
        self.shape = RestShape(points, topology)
        self._settling = Settling(self.shape, fixed_to, bones, clearance)

    def pose(self, paths: Floats | None, transforms: Floats, **settling: Any) -> CarriedPose:
        """Return the muscle in a pose.

        paths : (f, n, 3) or None, the paths in the pose [mm];
        transforms : (b, 4, 4), of the bones, rest to now;
        settling : ``rounds``, ``near`` and ``progress`` of :meth:`Settling.settle`.
        """
        skinned, carried = None, self._points
        if self._skinning is not None and paths is not None:
            skinned = self._skinning.at(paths, transforms)
            carried = skinned.surface
        elif self._weights is not None:
            carriers, weights = self._weights
            carried = blend_motions(transforms[carriers], weights, self._points)
        return replace(self._settling.settle(carried, transforms, **settling), skinned=skinned)

    def fibre_points(self, pose: CarriedPose) -> Floats:
        """Return the points of the muscle's fibres before the muscle settles.

        Points are (p, 3) [mm]; each fibre goes with the fibre's path.
        """
        assert pose.skinned is not None
        assert self._fibre_weights is not None
        return pose.skinned.points(self._fibre_weights)
