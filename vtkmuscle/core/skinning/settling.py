"""A carried muscle, settled.

The settled muscle has the rest volume, is out of the bones, and is smooth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneContact, PoseContact
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.rest_shape import VOLUME_FLOOR, RestShape, project_volume
from vtkmuscle.core.mesh.surface import mean_thickness
from vtkmuscle.core.mesh.triangle_tree import Neighbour
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.skinning.diffusion import Diffusion
from vtkmuscle.core.types import Bools, Floats, Ints

#: How far a displacement spreads over the surface, the standard deviation along a line, as a part of the
#: muscle's mean thickness 2 V / A. Of four muscles of a real hip 0.2 and 0.3 leave one a tenth rougher or
#: another a tenth smoother; 0.8 is rougher, and takes all farther from where they are carried
#: (bench_settling.py).
SPREAD = 0.4

#: How far ways out of a bone spread where they would tear the muscle, likewise; and how often points go on
#: by their depth along these, at most. A gluteus maximus that is carried 11 mm into the ischium has edges 2.5
#: to 3.3 times as long as at rest with 1.2 to 2.4, 9 with 0.8 or without; with two times up to 8.7, six 3.3.
TOGETHER, MOST_STEPS = 1.6, 6

#: Times that bones and volume are attended to in turn at the end, at most, and the relative error of the
#: volume that is as good as none.
LAST_PASSES, VOLUME_TOLERANCE = 30, 1e-10


class Volume:
    """Restores the volume of a muscle.

    Parameters
    ----------
    shape : RestShape
        The muscle at rest.
    free : (n,) bool array
        Points that may be moved.
    """

    def __init__(self, shape: RestShape, free: Bools) -> None:
        self._triangles, self._rest = shape.topology.triangles, shape.volume
        self._mass: Floats = free.astype(np.float64)
        areas = np.linalg.norm(shape.volume_gradient, axis=1)
        self._floor = VOLUME_FLOOR * float(self._mass @ areas**2)
        self._gradient: Floats = np.empty_like(shape.points)

    def restore(self, points: Floats, held: Bools | None = None) -> float:
        """Move points towards the rest volume.

        Points (n, 3) that are held stay. Return the relative error of the volume before.
        """
        mass = self._mass if held is None else np.where(held, 0.0, self._mass)
        rest = self._triangles, self._rest, 1.0, self._floor
        volume = project_volume(points, mass, mass, *rest, self._gradient)
        return abs(volume / self._rest - 1.0)

    def finish(self, points: Floats, keep_out: Callable[[Floats], Bools]) -> Bools:
        """Take points out of the bones.

        The remaining points give back the lost volume; return the held points.
        """
        held = np.zeros(len(points), dtype=np.bool_)
        for _ in range(LAST_PASSES):
            new = keep_out(points) & ~held
            held |= new
            off = self.restore(points, held)
            if not (new.any() or off > VOLUME_TOLERANCE):
                break
        return held


@dataclass(frozen=True, eq=False)
class SettlingResult:
    """The points (n, 3) of a settled muscle [mm].

    The result also has the number of points that bones or other muscles hold off.
    """

    surface: Floats
    colliding: int


class Settling:
    """Moves a muscle's surface smoothly off bones.

    The surface also moves to the rest volume. The offset of a point from the carried position is the
    point's *displacement*. Volume and bones ask for displacements; in each round the displacement diffuses
    over the surface (:class:`~vtkmuscle.core.skinning.diffusion.Diffusion`), and then volume and bones ask
    again. The rounds descend the membrane energy of the displacement (Botsch, Sorkine 2008, *On linear
    variational surface deformation methods*, doi:10.1109/TVCG.2007.1054, section 3) under the constraints of
    volume and bones, for a given time; the rounds cut the time into steps. Volume and bones come last. The
    result depends on the arguments alone, not on earlier results.

    Parameters
    ----------
    shape : RestShape
        The muscle at rest.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    bones : mapping of int to Bone, optional
        Bones that free points are kept out of, by index: see
        :class:`~vtkmuscle.core.bones.contact.BoneContact`.
    clearance : float, optional
        Distance that points keep from the bones [mm].
    """

    def __init__(
        self,
        shape: RestShape,
        fixed_to: Ints,
        bones: Mapping[int, Bone] = MappingProxyType({}),
        clearance: float = 0.0,
    ) -> None:
        self._rest = shape.points
        self._free = free = fixed_to < 0
        self._fixed = [(int(bone), np.flatnonzero(fixed_to == bone)) for bone in np.unique(fixed_to[~free])]
        self._contact = BoneContact(bones, self._rest, free, clearance)
        self._diffusion = Diffusion(self._rest, shape.topology.triangles)
        self._edges = shape.topology.edges
        self._volume = Volume(shape, free)
        thickness = mean_thickness(self._rest, shape.topology.triangles)
        self._time = 0.5 * (SPREAD * thickness) ** 2 / self._diffusion.time_unit

    def settle(
        self,
        carried: Floats,
        transforms: Floats,
        *,
        rounds: int,
        neighbours: Sequence[Neighbour] = (),
        progress: Callable[[float], None] | None = None,
    ) -> SettlingResult:
        """Return the muscle settled in a pose.

        Parameters
        ----------
        carried : (n, 3) array
            The muscle's points as the paths carry the points [mm]; fixed points go with their bones.
        transforms : (b, 4, 4) array
            Of the bones, rest to now.
        rounds : int
            Steps of the diffusion, >= 1.
        neighbours : sequence of Neighbour, optional
            Other muscles now, to keep the free points out of.
        progress : callable, optional
            Called after each round with the finished part; may raise, to stop.
        """
        carried = carried.copy()
        for bone, fixed in self._fixed:
            carried[fixed] = apply_transform(transforms[bone], self._rest[fixed])
        touching = self._contact.at(transforms, neighbours)
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
            if progress is not None:
                progress((number + 1) / rounds)
        held = self._volume.finish(points, touching.keep_out)
        return SettlingResult(points, int(held.sum()))

    def _leave_bones(self, points: Floats, touching: PoseContact) -> None:
        """Move points out of the bones, in place.

        Each point goes to the nearest side of the bone. Where the nearest sides would tear a muscle carried
        across a bone in two, the ways out diffuse first among the points in the bone, and so the points go
        the same way.
        """
        out = points.copy()
        inside = touching.keep_out(out)
        way = out - points
        if _torn(points, way, inside, self._edges):
            time = (TOGETHER / SPREAD) ** 2 * self._time
            self._diffusion.spread(way, time, inside, insulated=True)
            way /= np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)[:, None]
            for _ in range(MOST_STEPS):
                _advance(points, out, way, inside)
                out[:] = points
                inside = touching.keep_out(out)
                if not inside.any():
                    break
        points[:] = out


@kernel
def _torn(points: Floats, way: Floats, inside: Bools, edges: Ints) -> bool:
    """Return whether opposite ways tear two neighbours apart.

    Ways are (n, 3), ``inside`` is (n,). Torn neighbours part by more than the length of their edge.
    """
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        if inside[i] and inside[j]:
            product, apart, length = 0.0, 0.0, 0.0
            for k in range(3):
                product += way[i, k] * way[j, k]
                apart += (way[i, k] - way[j, k]) ** 2
                length += (points[i, k] - points[j, k]) ** 2
            if product < 0.0 and apart > length:
                return True
    return False


@kernel
def _advance(points: Floats, out: Floats, direction: Floats, inside: Bools) -> None:
    """Move points along a direction, in place.

    The points inside (n,) move by their distance out of the bone.
    """
    for i in range(len(points)):
        if inside[i]:
            depth = 0.0
            for k in range(3):
                depth += (out[i, k] - points[i, k]) ** 2
            for k in range(3):
                points[i, k] += np.sqrt(depth) * direction[i, k]
