"""Position based dynamics of one muscle: state in, state out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.contact import Barrier, Contact
from vtkmuscle.core.collision.muscle_contact import MuscleContact, Neighbour
from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.surface import edge_lengths
from vtkmuscle.core.mesh.topology import MeshTopology, mesh_topology
from vtkmuscle.core.motion.blending import blend_motions, screw_between
from vtkmuscle.core.motion.rigid import apply_transform, centred, inverse
from vtkmuscle.core.pbd.accelerated import AcceleratedSolve
from vtkmuscle.core.pbd.anderson import Workspace
from vtkmuscle.core.pbd.batches import pack
from vtkmuscle.core.pbd.constraints import VOLUME_FLOOR, per_iteration_stiffness, project_volume
from vtkmuscle.core.pbd.convergence import root_mean_square_distance
from vtkmuscle.core.pbd.parameters import SolverParameters
from vtkmuscle.core.pbd.projection import ColourOrder, Projection, SequentialOrder
from vtkmuscle.core.pbd.rest_shape import RestShape, ShapeReport, dihedral_angles
from vtkmuscle.core.pbd.stages import StageClock, add_stages
from vtkmuscle.core.pbd.state import MuscleState
from vtkmuscle.core.taut.guidance import Guidance, Guided

__all__ = ["MuscleSolver", "MuscleState", "SolverParameters"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Positions, points that met a bone, and (iterations, residual, distance) as of :class:`MuscleState`.
_Solved = tuple[Floats, Bools, tuple[int, float, float | None]]
_KeepOut = Callable[[Floats], Bools]

#: After the iterations, volume and bones are attended to alternately, this often at most.
SETTLING_PASSES = 6

#: What is said of a state that is not finite.
OUT_OF_RANGE = (
    "the muscle left the range of floating point numbers; use a smaller external_force or another dt"
)

#: Relative error of the volume that is as good as none.
VOLUME_TOLERANCE = 1e-6


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
    guidance : Guidance, optional
        Taut strings that the rest lengths and angles follow, and that each iteration draws the points to; by
        default there are none.
    obstacles : sequence of Obstacle, optional
        Bones that free points are kept out of.
    warns : bool
        Whether to warn of bones that meet the muscle in a way that cannot come out well.

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
        guidance: Guidance | None = None,
        obstacles: Sequence[Obstacle] = (),
        warns: bool = True,
    ) -> None:
        self.topology: MeshTopology = mesh_topology(len(points), triangles)
        self.fixed_to = fixed_to
        self.centre: Floats = (points.min(axis=0) + points.max(axis=0)) / 2.0
        self.rest: Floats = points - self.centre
        self._free: Bools = fixed_to < 0
        self._inverse_mass = self._free.astype(np.float64)
        #: Points that are fixed, bone by bone.
        self._fixed = [
            (int(bone), np.flatnonzero(fixed_to == bone)) for bone in np.unique(fixed_to[fixed_to >= 0])
        ]
        self._shape = RestShape(self.rest, self.topology)
        self._warns = warns
        self._barrier = Barrier((), self.rest, self.centre, self._free, bone_push=False)
        self._target: Floats | None = None
        self._projection_made_from: tuple[tuple[object, ...], Floats] | None = None
        self._prepare(parameters, edge_stiffness, guidance, obstacles)

    def adjusted(
        self,
        parameters: SolverParameters,
        *,
        edge_stiffness: Floats | None = None,
        guidance: Guidance | None = None,
        obstacles: Sequence[Obstacle] = (),
    ) -> MuscleSolver:
        """Return a solver of the same muscle with other settings, as if it were made anew.

        What depends on the muscle alone (topology, rest shape, harmonic weights) is shared between the two,
        and so is what depends on settings that are the same.

        Parameters
        ----------
        parameters, edge_stiffness, guidance, obstacles
            As of the class.
        """
        other = copy(self)
        other._prepare(parameters, edge_stiffness, guidance, obstacles)
        return other

    def _prepare(
        self,
        parameters: SolverParameters,
        edge_stiffness: Floats | None,
        guidance: Guidance | None,
        obstacles: Sequence[Obstacle],
    ) -> None:
        """Make what depends on the settings."""
        self.parameters = parameters
        push = parameters.bone_push == "transform"
        if push != self._barrier.bone_push or tuple(obstacles) != self._barrier.obstacles:
            self._barrier = Barrier(
                obstacles, self.rest, self.centre, self._free, bone_push=push, warns=self._warns
            )
        self._prepare_volume()
        self._guidance = guidance
        self._prepare_projection(edge_stiffness)

    def _prepare_volume(self) -> None:
        squares = np.einsum("ij,ij->i", self._shape.volume_gradient, self._shape.volume_gradient)
        self._volume_floor = VOLUME_FLOOR * float((self._inverse_mass * squares).sum())
        self._volume_stiffness = float(self._per_iteration(self.parameters.volume_stiffness))
        self._gradient = np.empty_like(self.rest)

    def _prepare_projection(self, edge_stiffness: Floats | None) -> None:
        settings = self.parameters
        stiffness = np.ones(len(self.topology.edges)) if edge_stiffness is None else edge_stiffness
        stiffness = self._per_iteration(settings.stiffness * stiffness)
        shape_stiffness = float(self._per_iteration(settings.shape_stiffness))
        made_from = (
            self._guidance,
            settings.projection_order,
            settings.dtype,
            settings.threads,
            shape_stiffness,
            self._volume_stiffness,
        )
        before = self._projection_made_from
        if before is not None and before[0] == made_from and np.array_equal(before[1], stiffness):
            return
        self._projection_made_from = made_from, stiffness
        if settings.projection_order == "batched":
            packed = pack(
                self.topology,
                self.rest,
                self._inverse_mass,
                edge_stiffness=stiffness,
                shape_stiffness=shape_stiffness,
                volume_stiffness=self._volume_stiffness,
                dtype=settings.dtype,
            )
            self._projection: Projection = ColourOrder(packed, threads=settings.threads)
            return
        self._projection = SequentialOrder(
            self.topology,
            self._shape,
            self._inverse_mass,
            edge_stiffness=stiffness,
            shape_stiffness=shape_stiffness,
            volume_stiffness=self._volume_stiffness,
            volume_floor=self._volume_floor,
        )

    def _follow_fibres(self, before: Guided | None, transforms: Floats) -> Guided | None:
        """Take the edge lengths and angles of the muscle as its fibres carry it for those at rest.

        So what the constraints keep is a muscle that is longer or shorter along its fibres, thinner or
        thicker across, bent and sheared as they are; they have left to do what volume and bones ask for.
        """
        if self._guidance is None:
            return None
        guided = self._guidance.follow(None if before is None else before.state, transforms)
        surface, topology = guided.carried.surface, self.topology
        angles, defined = dihedral_angles(surface, topology.quads)
        cosines, sines = np.ones(len(topology.edges)), np.zeros(len(topology.edges))
        bent = topology.quad_edges[defined]
        cosines[bent], sines[bent] = np.cos(angles[defined]), np.sin(angles[defined])
        self._projection.set_rest(edge_lengths(surface, topology.edges), cosines, sines)
        return guided

    def _per_iteration(self, stiffness: Floats | float) -> Floats:
        """Return a stiffness per iteration.

        A solve that runs to convergence ends where the ratios of the stiffnesses have it; if they depended on
        the number of iterations, so would the shape.
        """
        if self.parameters.solver != "gauss-seidel":
            return np.asarray(stiffness, dtype=np.float64)
        return per_iteration_stiffness(stiffness, self.parameters.iterations)

    @cached_property
    def _workspace(self) -> Workspace:
        return Workspace(self.rest.size)

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

    def report(self, state: MuscleState, directions: Floats | None = None) -> ShapeReport:
        """Return how well a state keeps volume, edge lengths and angles.

        Parameters
        ----------
        state : MuscleState
            What to look at.
        directions : (k, 3) array, optional
            Unit direction of the fibres at each edge, 0 where there is none: edges along and across them are
            looked at apart.
        """
        return self._shape.compare(state.positions, directions)

    # ---------------------------------------------------------------- a step

    def step(
        self,
        state: MuscleState,
        transforms: Floats,
        *,
        neighbours: Sequence[Neighbour] = (),
        progress: Callable[[float], None] | None = None,
    ) -> MuscleState:
        """Return the state after the bones have moved on.

        Parameters
        ----------
        state : MuscleState
            Where the muscle was; not changed.
        transforms : (b, 4, 4) array
            Where the bones are now, rest to now.
        neighbours : sequence of Neighbour, optional
            Other muscles where they are now, to keep the free points out of.
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
        iterations = 0
        milliseconds: Mapping[str, float] = {}
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

            state = self._substep(state, now, neighbours, report)
            iterations += state.iterations
            milliseconds = add_stages(milliseconds, state.milliseconds)
        return replace(state, iterations=iterations, milliseconds=milliseconds)

    def _substep(
        self,
        state: MuscleState,
        transforms: Floats,
        neighbours: Sequence[Neighbour],
        progress: Callable[[float], None],
    ) -> MuscleState:
        """P21 Algorithm 2, lines 6 to 37."""
        clock = StageClock("prediction")
        guided = self._follow_fibres(state.guided, transforms)
        self._target = self._target_of(guided)
        now, before = centred(transforms, self.centre), centred(state.transforms, self.centre)
        dt = self.parameters.dt / self.parameters.substeps
        x = state.positions
        muscles = MuscleContact(neighbours, self._free, self.centre) if neighbours else None
        contact = Contact(self._barrier, now, before, x, muscles)

        def keep_out(p: Floats) -> Bools:
            stage = clock.switch("collision")
            hit = contact.keep_out(p)
            clock.switch(stage)
            return hit

        with np.errstate(over="ignore", invalid="ignore"):  # told below, in our words
            p = self._predict(state, now, before, dt)
            _check_finite(p)
            solve = self._plain if self.parameters.solver == "gauss-seidel" else self._accelerated
            clock.switch("constraints")
            try:
                p, collided, convergence = solve(p, keep_out, clock, progress)
            except FloatingPointError as error:
                raise ValueError(OUT_OF_RANGE) from error
            clock.switch("settling")
            if self._projection.settles:
                collided |= self._settle(p, keep_out)
            velocities = (p - x) / dt
        _check_finite(p, velocities)
        if self.parameters.contact_velocity == "zero":
            # P21 section 5: a colliding point's velocity would make spikes.
            velocities[collided] = 0.0
        return MuscleState(
            p,
            velocities,
            transforms,
            int(collided.sum()),
            *convergence,
            clock.stop(),
            guided=guided,
        )

    def _target_of(self, guided: Guided | None) -> Floats | None:
        """Return where the points are drawn to, about the centre; None where they keep their momentum."""
        if guided is None or self.parameters.prediction == "inertial" or self.parameters.guidance == 0.0:
            return None
        target: Floats = guided.carried.surface - self.centre
        return target

    def _draw(self, p: Floats) -> None:
        """Draw the free points towards where the fibres carry them, in place."""
        if self._target is not None:
            _draw_to(p, self._target, self._free, self.parameters.guidance)

    def _plain(
        self, p: Floats, keep_out: _KeepOut, clock: StageClock, progress: Callable[[float], None]
    ) -> _Solved:
        """Project all constraints as often as asked for."""
        n = self.parameters.iterations
        collided = np.zeros(len(p), dtype=np.bool_)
        before = p
        for iteration in range(n):
            if iteration == n - 1:
                before = p.copy()
            self._draw(p)
            collided |= self._projection.iterate(p, keep_out)
            progress((iteration + 1) / n)
        moved = root_mean_square_distance(p.reshape(-1), before.reshape(-1), len(p))
        bounded = self._target is not None and self.parameters.guidance > 0.0
        return p, collided, (n, moved, moved / self.parameters.guidance if bounded else None)

    def _accelerated(
        self, p: Floats, keep_out: _KeepOut, clock: StageClock, progress: Callable[[float], None]
    ) -> _Solved:
        """Project all constraints, the iteration accelerated, until the shape is near its end."""
        guidance = self.parameters.guidance if self._target is not None else 0.0
        solve = AcceleratedSolve(
            self._projection if self._target is None else _Drawn(self._draw, self._projection),
            keep_out,
            self.topology.edges,
            # A muscle that momentum throws at a bone may touch it with all its points.
            bones_last=self.parameters.prediction != "inertial",
            bound=1.0 / guidance if guidance > 0.0 else None,
            clock=clock,
            progress=progress,
        )
        return solve.run(
            p,
            iterations=self.parameters.iterations,
            tolerance=self.parameters.tolerance,
            movable=max(1, int(self._free.sum())),
            workspace=self._workspace,
        )

    def _predict(self, state: MuscleState, now: Floats, before: Floats, dt: float) -> Floats:
        """P21 Algorithm 2, lines 6 to 15."""
        settings = self.parameters
        push = dt * np.asarray(settings.external_force, dtype=np.float64)
        if self._target is not None:
            p = self._target + dt * (settings.velocity_kept * push)
        elif self._follows_bones:
            # The muscle follows the bones: it keeps no momentum of its own.
            p = self._blended(before, now, state.positions)
            if push.any():
                p += dt * (settings.velocity_kept * push)
        else:
            p = state.positions + dt * (settings.velocity_kept * (state.velocities + push))
        for bone, fixed in self._fixed:
            p[fixed] = apply_transform(now[bone], self.rest[fixed])
        return p

    @property
    def _follows_bones(self) -> bool:
        return self.parameters.prediction == "blend" and not self._free.all()

    def _blended(self, before: Floats, now: Floats, x: Floats) -> Floats:
        """Return points moved as the bones have moved."""
        bones, weights = self._blend_weights
        return blend_motions(np.array([now[bone] @ inverse(before[bone]) for bone in bones]), weights, x)

    def _settle(self, p: Floats, keep_out: _KeepOut) -> Bools:
        """Take out of the bones what the last projection of the volume pushed in; return which points.

        A point left inside would be taken for one that the bone has moved over in the next step. What this
        costs of the volume goes to the other points, so that both hold in the end.
        """
        hit = np.zeros(len(p), dtype=np.bool_)
        exact = self.parameters.volume_stiffness == 1.0
        for _ in range(SETTLING_PASSES):
            new = keep_out(p) & ~hit
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


class _Drawn:
    """A projection before which points are drawn to where the fibres carry them."""

    def __init__(self, draw: Callable[[Floats], None], projection: Projection) -> None:
        self._draw, self._projection = draw, projection
        self.settles, self.set_rest = projection.settles, projection.set_rest

    def iterate(self, p: Floats, keep_out: _KeepOut, *, bones_last: bool = False) -> Bools:
        """See :meth:`Projection.iterate`."""
        self._draw(p)
        return self._projection.iterate(p, keep_out, bones_last=bones_last)


@kernel
def _draw_to(p: Floats, target: Floats, free: Bools, part: float) -> None:
    """Move the free points (n, 3) a part of their way to a target, in place."""
    for i in range(len(p)):
        if free[i]:
            for k in range(3):
                p[i, k] += part * (target[i, k] - p[i, k])


def _check_finite(*arrays: Floats) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError(OUT_OF_RANGE)
