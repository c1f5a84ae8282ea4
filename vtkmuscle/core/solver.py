"""Position based dynamics of one muscle: state in, state out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.blending import blend_motions, screw_between
from vtkmuscle.core.constraints import (
    VOLUME_FLOOR,
    per_iteration_stiffness,
    project_dihedral,
    project_distance,
    project_volume,
)
from vtkmuscle.core.harmonic import harmonic_weights
from vtkmuscle.core.obstacles import Obstacle, keep_out
from vtkmuscle.core.rest_shape import RestShape, ShapeReport
from vtkmuscle.core.rigid import apply_transform, inverse
from vtkmuscle.core.topology import MeshTopology, mesh_topology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: After the iterations, volume and bones are attended to alternately, this often at most.
SETTLING_PASSES = 6

#: Relative error of the volume that is as good as none.
VOLUME_TOLERANCE = 1e-6


@dataclass(frozen=True)
class SolverParameters:
    """Settings of :class:`MuscleSolver`.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per (sub)step, >= 1.
    substeps : int
        Parts that a step is cut into, bones moving along their screws, >= 1.
    dt : float
        Time of a step [s], > 0.
    damping : float
        Part of the velocity that is left after a (sub)step, in [0, 1].
    stiffness, shape_stiffness, volume_stiffness : float
        Of the distance, dihedral and volume constraints, in [0, 1], per (sub)step.
    external_force : (3,) tuple
        Force per mass on each free point [mm / s^2].
    start : str
        Where the solve of a step starts: ``"inertial"`` or ``"blend"``.
    bone_push : str
        What a bone does to points it moved over: ``"transform"`` or ``"off"``.
    """

    iterations: int = 10
    substeps: int = 1
    dt: float = 1.0
    damping: float = 0.99
    stiffness: float = 1.0
    shape_stiffness: float = 0.9
    volume_stiffness: float = 1.0
    external_force: tuple[float, ...] = (0.0, 0.0, 0.0)
    start: str = "blend"
    bone_push: str = "off"


@dataclass(frozen=True, eq=False)
class MuscleState:
    """A muscle at one time.

    Attributes
    ----------
    positions : (n, 3) array
        Relative to the solver's ``centre`` [mm].
    velocities : (n, 3) array
        [mm / s]; 0 at points that collided.
    transforms : (b, 4, 4) array
        Of the bones, rest to now.
    colliding : int
        Points that met a bone in the step that led here.
    """

    positions: Floats
    velocities: Floats
    transforms: Floats
    colliding: int = 0


class MuscleSolver:
    """Deforms a muscle's surface with the bones it is fixed to.

    P21 Algorithm 2. The solver holds what does not change (rest shape, constraints); :meth:`step` takes a
    state and gives the next, so that states can be kept and gone back to. It works about the muscle's rest
    centre, so that a scene far from the origin loses no digits.

    Parameters
    ----------
    points : (n, 3) array
        The muscle in the rest pose [mm].
    triangles : (m, 3) int array
        Point ids, outward oriented, a closed surface.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    parameters : SolverParameters
        Settings.
    edge_stiffness : (k,) array, optional
        Anisotropic stiffness of each edge of ``mesh_topology(n, triangles)``; 1 by default.
    obstacles : sequence of Obstacle, optional
        Bones that free points are kept out of.

    Raises
    ------
    ValueError
        If the surface is open or encloses no volume.
    """

    def __init__(
        self,
        points: Floats,
        triangles: Ints,
        fixed_to: Ints,
        parameters: SolverParameters,
        *,
        edge_stiffness: Floats | None = None,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        self.parameters = parameters
        self.topology: MeshTopology = mesh_topology(len(points), triangles)
        self.fixed_to = fixed_to
        self.centre: Floats = (points.min(axis=0) + points.max(axis=0)) / 2.0
        self.rest: Floats = points - self.centre
        self.obstacles = tuple(obstacles)
        self._free: Bools = fixed_to < 0
        self._inverse_mass = self._free.astype(np.float64)
        self._shape = RestShape(self.rest, self.topology)
        self._prepare_volume()
        self._prepare_distances(edge_stiffness)
        self._prepare_dihedrals()

    def _prepare_volume(self) -> None:
        squares = np.einsum("ij,ij->i", self._shape.volume_gradient, self._shape.volume_gradient)
        self._volume_floor = VOLUME_FLOOR * float((self._inverse_mass * squares).sum())
        self._volume_stiffness = float(
            per_iteration_stiffness(self.parameters.volume_stiffness, self.parameters.iterations)
        )
        self._gradient = np.empty_like(self.rest)

    def _prepare_distances(self, edge_stiffness: Floats | None) -> None:
        edges = self.topology.edges
        stiffness = np.ones(len(edges)) if edge_stiffness is None else edge_stiffness
        used = self._free[edges].any(axis=1)
        self._edges = np.ascontiguousarray(edges[used])
        self._lengths = self._shape.lengths[used]
        self._edge_stiffness = per_iteration_stiffness(
            self.parameters.stiffness * stiffness[used], self.parameters.iterations
        )

    def _prepare_dihedrals(self) -> None:
        quads = self.topology.quads
        used = self._shape.angle_defined & self._free[quads].any(axis=1)
        self._quads = np.ascontiguousarray(quads[used])
        self._cosines = np.cos(self._shape.angles[used])
        self._sines = np.sin(self._shape.angles[used])
        self._shape_stiffness = float(
            per_iteration_stiffness(self.parameters.shape_stiffness, self.parameters.iterations)
        )

    @cached_property
    def _blend_weights(self) -> tuple[Ints, Floats]:
        return harmonic_weights(self.rest, self.topology.triangles, self.fixed_to)

    # ---------------------------------------------------------------- states

    def rest_state(self, n_bones: int) -> MuscleState:
        """Return the muscle at rest, with all of n bones in their rest pose."""
        transforms = np.broadcast_to(np.eye(4), (n_bones, 4, 4))
        return MuscleState(self.rest, np.zeros_like(self.rest), transforms)

    def points(self, state: MuscleState) -> Floats:
        """Return the positions of a state in the scene's coordinates, (n, 3) [mm]."""
        return state.positions + self.centre

    def report(self, state: MuscleState) -> ShapeReport:
        """Return how well a state keeps volume, edge lengths and angles."""
        return self._shape.compare(state.positions)

    # ---------------------------------------------------------------- a step

    def step(
        self,
        state: MuscleState,
        transforms: Floats,
        *,
        progress: Callable[[float], None] | None = None,
    ) -> MuscleState:
        """Return the state after the bones have moved on.

        Parameters
        ----------
        state : MuscleState
            Where the muscle was; not changed.
        transforms : (b, 4, 4) array
            Where the bones are now, rest to now.
        progress : callable, optional
            Called after each iteration with the part of the step that is done; may raise, to stop.

        Returns
        -------
        MuscleState
            Where the muscle is now.

        Raises
        ------
        ValueError
            If a position left the range of floating point numbers.
        """
        substeps = self.parameters.substeps
        transforms = np.array(transforms, dtype=np.float64)
        before = state.transforms
        for number in range(1, substeps + 1):
            now = transforms
            if number < substeps:
                now = np.array(
                    [screw_between(a, b, number / substeps) for a, b in zip(before, transforms, strict=True)]
                )
            done = (number - 1) / substeps

            def report(part: float, done: float = done) -> None:
                if progress is not None:
                    progress(done + part / substeps)

            state = self._substep(state, now, report)
        return state

    def _substep(
        self, state: MuscleState, transforms: Floats, progress: Callable[[float], None]
    ) -> MuscleState:
        """P21 Algorithm 2, lines 6 to 37."""
        now, before = self._centred(transforms), self._centred(state.transforms)
        dt = self.parameters.dt / self.parameters.substeps
        x = state.positions
        with np.errstate(over="ignore", invalid="ignore"):  # told below, in our words
            p = self._predict(state, now, before, dt)
            collided = np.zeros(len(x), dtype=np.bool_)
            for iteration in range(self.parameters.iterations):
                collided |= self._iterate(x, p, now, before)
                progress((iteration + 1) / self.parameters.iterations)
            collided |= self._settle(x, p, now, before)
            velocities = (p - x) / dt
        if not (np.isfinite(p).all() and np.isfinite(velocities).all()):
            raise ValueError(
                "the muscle left the range of floating point numbers; "
                "use a smaller external_force or another dt"
            )
        # P21 section 5: a colliding point's velocity would make spikes.
        velocities[collided] = 0.0
        return MuscleState(p, velocities, transforms, int(collided.sum()))

    def _predict(self, state: MuscleState, now: Floats, before: Floats, dt: float) -> Floats:
        """P21 Algorithm 2, lines 6 to 15."""
        settings = self.parameters
        p = np.empty_like(state.positions)
        free = self._free
        push = dt * np.asarray(settings.external_force, dtype=np.float64)
        if settings.start == "blend" and not free.all():
            # The muscle follows the bones: it keeps no momentum of its own.
            bones, weights = self._blend_weights
            motions = np.array([now[bone] @ inverse(before[bone]) for bone in bones])
            p[free] = blend_motions(motions, weights[free], state.positions[free])
            p[free] += dt * (settings.damping * push)
        else:
            p[free] = state.positions[free] + dt * (settings.damping * (state.velocities[free] + push))
        for bone in np.unique(self.fixed_to[~free]):
            fixed = self.fixed_to == bone
            p[fixed] = apply_transform(now[bone], self.rest[fixed])
        return p

    def _iterate(self, x: Floats, p: Floats, now: Floats, before: Floats) -> Bools:
        """Project all constraints once, in place; return which points met a bone.

        The order is distance, shape, collision, volume. Volume comes last, as in the end only what was
        projected last holds exactly: V / V0 stays within 0.1 % where another order ends at 1.07. So that
        this does not push points back into the bones that they have just been moved out of, those take no
        part in it: the volume goes to where the muscle can give way.
        """
        project_distance(p, self._inverse_mass, self._edges, self._lengths, self._edge_stiffness)
        project_dihedral(
            p, self._inverse_mass, self._quads, self._cosines, self._sines, self._shape_stiffness
        )
        hit = self._collide(x, p, now, before)
        self._keep_volume(p, hit, self._volume_stiffness)
        return hit

    def _settle(self, x: Floats, p: Floats, now: Floats, before: Floats) -> Bools:
        """Take out of the bones what the last projection of the volume pushed in; return which points.

        A point left inside would be taken for one that the bone has moved over in the next step. What this
        costs of the volume goes to the other points, so that both hold in the end.
        """
        hit = np.zeros(len(p), dtype=np.bool_)
        exact = self.parameters.volume_stiffness == 1.0
        for _ in range(SETTLING_PASSES):
            new = self._collide(x, p, now, before) & ~hit
            hit |= new
            volume = self._keep_volume(p, hit, 1.0 if exact else 0.0)
            off = abs(volume - self._shape.volume) > VOLUME_TOLERANCE * abs(self._shape.volume)
            if not (new.any() or (exact and off)):
                break
        return hit

    def _keep_volume(self, p: Floats, hit: Bools, stiffness: float) -> float:
        return project_volume(
            p,
            np.where(hit, 0.0, self._inverse_mass),
            self.topology.triangles,
            self._shape.volume,
            self._volume_floor,
            stiffness,
            self._gradient,
        )

    def _collide(self, x: Floats, p: Floats, now: Floats, before: Floats) -> Bools:
        push = self.parameters.bone_push == "transform"
        return keep_out(self.obstacles, self.centre, now, before, x, p, self._free, bone_push=push)

    def _centred(self, transforms: Floats) -> Floats:
        """Return the bones' transforms for points given about the muscle's centre."""
        centred = np.array(transforms)
        centred[:, :3, 3] += centred[:, :3, :3] @ self.centre - self.centre
        return centred
