"""Algorithm 2 of Kohout and Cervenka 2021: settings, state in, state out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from vtkmuscle.core.algorithm_2.constraints import (
    edge_stiffness,
    harmonic_directions,
    project_volume,
    sweep_angles,
    sweep_distances,
)
from vtkmuscle.core.algorithm_2.voxels import VoxelContact
from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneContact
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.neighbours import Neighbour
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.motion.rigid import apply_transform, centred
from vtkmuscle.core.types import Floats


@dataclass(frozen=True)
class Parameters:
    """Settings of Algorithm 2; the defaults are those of section 4 of the paper.

    PBDDeformer has the same settings, and takes their descriptions from here.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per step, >= 1; it differs between the paper's experiments.
    dt : float
        Time of a step [s], > 0.
    velocity_kept : float
        Part of its velocity that a point keeps from step to step, in [0, 1] (line 8).
    stiffness : float
        Of edge lengths, per iteration, in [0, 1].
    shape_stiffness : float
        Of the angles between triangles, per iteration, in [0, 1].
    volume_stiffness : float
        Of the muscle's volume, per iteration, in [0, 1].
    anisotropy : bool
        Whether edges are the softer the more they run along the fibres (section 3.1).
    external_force : (3,) tuple
        Force per mass on all free points [mm/s^2] (line 7).
    bone_push : str
        What a bone does to points that it moved over: ``"transform"``, take them with it (section 3.2), or
        ``"off"``, nothing.
    contact_velocity : str
        Velocity of points that met a bone: ``"keep"``, that of their displacement, as the paper computes it,
        or ``"zero"``, as its section 5 proposes.
    """

    iterations: int = 30
    dt: float = 1.0
    velocity_kept: float = 0.99
    stiffness: float = 1.0
    shape_stiffness: float = 0.9
    volume_stiffness: float = 1.0
    anisotropy: bool = True
    external_force: tuple[float, ...] = (0.0, 0.0, 0.0)
    bone_push: str = "transform"
    contact_velocity: str = "keep"


@dataclass(frozen=True, eq=False)
class State:
    """A muscle at one time."""

    surface: Floats  # (n, 3), its points [mm]
    velocities: Floats  # (n, 3) [mm / s]
    transforms: Floats  # (b, 4, 4), of the bones, rest to now
    colliding: int  # number of points that met a bone in the step that led here
    positions: Floats  # (n, 3), relative to the centre of the muscle at rest [mm]: loses no digits far away

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return sum(array.nbytes for array in (self.surface, self.velocities, self.transforms, self.positions))


class Algorithm2:
    """Deforms a muscle with the bones it is fixed to: :meth:`step` is Algorithm 2 as printed.

    The solver holds what does not change. :meth:`step` takes a state and gives the next, so that states can
    be kept and gone back to. Edges are soft along the muscle's fibres, or, where it has none, along the
    harmonic function between its ends. A ValueError says that the surface is open or encloses no volume, or
    that no fibre has a length.
    """

    def __init__(
        self,
        muscle: FixedMuscle,
        parameters: Parameters,
        bones: Mapping[int, Bone] = MappingProxyType({}),
        voxels: tuple[int, int | None] | None = None,
    ) -> None:
        self.parameters = parameters
        points, fixed_to, topology = muscle.points, muscle.fixed_to, muscle.topology()
        directions = muscle.directions(topology) if parameters.anisotropy else None
        if parameters.anisotropy and directions is None:
            directions = harmonic_directions(points, topology, fixed_to)
        #: The surface at rest.
        self.shape = shape = RestShape(points, topology, directions)
        self.centre: Floats = (points.min(axis=0) + points.max(axis=0)) / 2.0
        self.rest: Floats = points - self.centre
        self._free = free = fixed_to < 0
        self._fixed = [(int(bone), np.flatnonzero(fixed_to == bone)) for bone in np.unique(fixed_to[~free])]
        push = parameters.bone_push == "transform"
        self._contact: VoxelContact | BoneContact = BoneContact(bones, points, free)
        if voxels is not None:
            n_max, n_equal = voxels
            self._contact = VoxelContact(bones, free, n_max=n_max, n_equal=n_equal, bone_push=push)

        self._mass = mass = free.astype(np.float64)
        edges, quads = topology.edges, topology.quads
        stiffness = np.full(len(edges), parameters.stiffness)
        if directions is not None:
            stiffness *= edge_stiffness(points, edges, directions)
        used = (mass[edges] > 0).any(axis=1)
        self._distances = np.ascontiguousarray(edges[used]), shape.lengths[used], stiffness[used]
        self._volume = topology.triangles, shape.volume, parameters.volume_stiffness, np.empty_like(self.rest)
        used = shape.angle_defined & (mass[quads] > 0).any(axis=1)
        angles = np.abs(shape.angles[used])
        self._angles = np.ascontiguousarray(quads[used]), angles, parameters.shape_stiffness

    def at_rest(self, n_bones: int) -> State:
        """Return the muscle at rest, with all bones in their rest pose."""
        still, transforms = np.zeros_like(self.rest), np.broadcast_to(np.eye(4), (n_bones, 4, 4))
        return State(self.rest + self.centre, still, transforms, 0, self.rest)

    def step(
        self,
        state: State,
        transforms: Floats,
        *,
        neighbours: Sequence[Neighbour] = (),
        progress: Callable[[float], None] | None = None,
    ) -> State:
        """Return the state after the bones have moved on; raise a ValueError if a position overflows.

        The transforms (b, 4, 4) lead from rest to now. Free points are kept out of the neighbours, too.
        ``progress`` is called after each iteration with the part of the step that is done; it may raise, to
        stop.
        """
        settings = self.parameters
        x, v, dt = state.positions, state.velocities, settings.dt
        now = centred(transforms, self.centre)
        if isinstance(self._contact, VoxelContact):
            keep_out = self._contact.at(transforms, neighbours, self.centre, state.transforms, x)
        else:
            keep_out = self._contact.at(transforms, neighbours, self.centre).keep_out
        collided = np.zeros(len(x), dtype=np.bool_)
        with np.errstate(over="ignore", invalid="ignore"):  # _check_finite reports it
            # Lines 6 to 15: fixed points go with their bones, free ones where their velocity takes them.
            force = np.asarray(settings.external_force, dtype=np.float64)
            p = x + dt * (settings.velocity_kept * (v + dt * force))
            for bone, fixed in self._fixed:
                p[fixed] = apply_transform(now[bone], self.rest[fixed])
            _check_finite(p)
            # Lines 16 to 31: the constraints, and the bones.
            for iteration in range(settings.iterations):
                sweep_distances(p, self._mass, *self._distances)
                project_volume(p, self._mass, *self._volume)
                sweep_angles(p, self._mass, *self._angles)
                collided |= keep_out(p)
                _check_finite(p)
                if progress is not None:
                    progress((iteration + 1) / settings.iterations)
            # Lines 32 to 37: the velocities.
            v = (p - x) / dt
        _check_finite(v)
        if settings.contact_velocity == "zero":
            v[collided] = 0.0
        return State(p + self.centre, v, np.array(transforms), int(collided.sum()), p)


def _check_finite(array: Floats) -> None:
    if not np.isfinite(array).all():
        problem = "the muscle left the range of floating point numbers"
        raise InputError("", problem, "use a smaller external_force or dt")
