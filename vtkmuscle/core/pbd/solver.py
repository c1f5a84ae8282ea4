"""Position based dynamics of one muscle: state in, state out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from vtkmuscle.core.collision.contact import Barrier, Contact
from vtkmuscle.core.collision.muscle_contact import MuscleContact, Neighbour
from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.surface import edge_lengths
from vtkmuscle.core.mesh.topology import MeshTopology, mesh_topology
from vtkmuscle.core.motion.blending import blend_motions, screw_between
from vtkmuscle.core.motion.rigid import apply_transform, centred, inverse
from vtkmuscle.core.pbd.anderson import Workspace, anderson
from vtkmuscle.core.pbd.constraints import per_iteration_stiffness
from vtkmuscle.core.pbd.orders import ColourOrder, Iteration, Order, SequentialOrder, Stiffness, Volume
from vtkmuscle.core.pbd.parameters import SolverParameters
from vtkmuscle.core.pbd.rest_shape import RestShape, ShapeReport, dihedral_angles
from vtkmuscle.core.pbd.stages import StageClock, add_stages
from vtkmuscle.core.pbd.state import MuscleState
from vtkmuscle.core.taut.guidance import Guidance, Guided
from vtkmuscle.core.types import Bools, Floats, Ints

#: After the iterations, volume and bones are attended to alternately, this often at most.
SETTLING_PASSES = 6

#: What is said of a state that is not finite.
OUT_OF_RANGE = (
    "",
    "the muscle left the range of floating point numbers",
    "use a smaller external_force or dt",
)

#: Relative error of the volume that is as good as none.
VOLUME_TOLERANCE = 1e-6


class MuscleSolver:
    """Deforms a muscle's surface with the bones it is fixed to.

    Kohout and Cervenka 2021, algorithm 2, which :meth:`step` is. The solver holds what does not change (rest
    shape, constraints); :meth:`step` takes a state and gives the next, so that states can be kept and gone
    back to. It works about the muscle's rest centre, so that a scene far from the origin loses no digits.

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
        self._volume = Volume(self.topology.triangles, self._shape, self._inverse_mass)
        self._barrier = Barrier((), self.rest, self.centre, self._free, bone_push=False)
        self._order_made_from: tuple[tuple[object, ...], Floats] | None = None
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
            self._barrier = Barrier(obstacles, self.rest, self.centre, self._free, bone_push=push)
        self._guidance = guidance
        self._prepare_order(edge_stiffness)

    def _prepare_order(self, edge_stiffness: Floats | None) -> None:
        settings = self.parameters
        edges = np.ones(len(self.topology.edges)) if edge_stiffness is None else edge_stiffness
        stiffness = Stiffness(
            self._per_iteration(settings.stiffness * edges),
            float(self._per_iteration(settings.shape_stiffness)),
            float(self._per_iteration(settings.volume_stiffness)),
        )
        # The order keeps the rest lengths that the guidance gave it last.
        made_from = self._guidance, settings.projection_order, stiffness.shape, stiffness.volume
        before = self._order_made_from
        if before is not None and before[0] == made_from and np.array_equal(before[1], stiffness.edges):
            return
        self._order_made_from = made_from, stiffness.edges
        make = ColourOrder if settings.projection_order == "batched" else SequentialOrder
        self._order: Order = make(self.topology, self._shape, self._inverse_mass, stiffness)

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
        self._order.set_rest(edge_lengths(surface, topology.edges), cosines, sines)
        return guided

    def _per_iteration(self, stiffness: Floats | float) -> Floats:
        """Return a stiffness per iteration.

        A solve that runs to convergence ends where the ratios of the stiffnesses have it; if they depended on
        the number of iterations, so would the shape. Algorithm 2 as printed has them per iteration, too.
        """
        settings = self.parameters
        if settings.solver != "gauss-seidel" or settings.projection_order == "sequential":
            return np.asarray(stiffness, dtype=np.float64)
        return per_iteration_stiffness(stiffness, settings.iterations)

    @cached_property
    def _workspaces(self) -> dict[str, Workspace]:
        n = self.rest.size
        return {"anderson": Workspace(n), "gauss-seidel": Workspace(n, window=0)}

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
        """Return the state after the bones have moved on: algorithm 2, once for each substep.

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
        settings = self.parameters
        # A muscle that momentum throws at a bone may touch it with all its points.
        smooth = settings.solver == "anderson" and settings.prediction != "inertial"

        def tell(part: float) -> None:
            if progress is not None:
                progress((len(steps) + part) / settings.substeps)

        steps: list[MuscleState] = []
        for now in self._poses(state.transforms, np.array(transforms, dtype=np.float64)):
            clock = StageClock("prediction")
            guided = self._follow_fibres(state.guided, now)
            target = self._target(guided)
            with np.errstate(over="ignore", invalid="ignore"):  # refused below, in our words
                # Lines 6 to 15: where the points would go.
                p = self._predict(state, now, target)
                _check_finite(p)
                # Lines 16 to 31: what the constraints and the bones make of that.
                iteration = Iteration(
                    self._order,
                    self._contact(state, now, neighbours),
                    len(p),
                    most=settings.iterations,
                    clock=clock,
                    progress=tell,
                    drawn=None if target is None else (target, settings.guidance, self._free),
                    smooth=self.topology.edges if smooth else None,
                )
                try:
                    solved = anderson(
                        iteration,
                        p.reshape(-1),
                        max_iterations=settings.iterations,
                        tolerance=self._tolerance if target is not None else 0.0,
                        points=max(1, int(self._free.sum())),
                        unsteady=iteration.unsteady,
                        workspace=self._workspaces[settings.solver],
                    )
                except FloatingPointError as error:
                    raise InputError(*OUT_OF_RANGE) from error
                p, collided = solved.x.reshape(-1, 3), iteration.collided
                if self._order.settles:
                    clock.switch("settling")
                    collided |= self._settle(p, iteration.keep_out)
                # Lines 32 to 37: the velocities.
                velocities = (p - state.positions) / self._dt
            _check_finite(p, velocities)
            if settings.contact_velocity == "zero":
                # Section 5: a colliding point's velocity would make spikes.
                velocities[collided] = 0.0
            if solved.iterations < settings.iterations:
                tell(1.0)
            state = MuscleState(
                p,
                velocities,
                now,
                int(collided.sum()),
                solved.iterations,
                solved.residual,
                solved.residual / settings.guidance if target is not None else None,
                clock.stop(),
                guided,
            )
            steps.append(state)
        return replace(
            state,
            iterations=sum(step.iterations for step in steps),
            milliseconds=add_stages(*(step.milliseconds for step in steps)),
        )

    @property
    def _tolerance(self) -> float:
        """Residual to stop at where points are drawn to the fibres [mm].

        An iteration leaves at most 1 - guidance of an error then, so that the end is at most
        residual / guidance away.
        """
        settings = self.parameters
        return settings.tolerance * settings.guidance if settings.solver == "anderson" else 0.0

    @property
    def _dt(self) -> float:
        """Time of a substep [s]."""
        return self.parameters.dt / self.parameters.substeps

    def _poses(self, before: Floats, now: Floats) -> list[Floats]:
        """Return the bones' transforms at the end of each substep, on their screws from before to now."""
        n = self.parameters.substeps
        between = [
            np.array([screw_between(a, b, number / n) for a, b in zip(before, now, strict=True)])
            for number in range(1, n)
        ]
        return [*between, now]

    def _contact(self, state: MuscleState, transforms: Floats, neighbours: Sequence[Neighbour]) -> Contact:
        """Return what keeps points out of bones and muscles while a state goes on to where the bones are."""
        now, before = centred(transforms, self.centre), centred(state.transforms, self.centre)
        muscles = MuscleContact(neighbours, self._free, self.centre) if neighbours else None
        return Contact(self._barrier, now, before, state.positions, muscles)

    def _target(self, guided: Guided | None) -> Floats | None:
        """Return where the points are drawn to, about the centre; None where they keep their momentum."""
        if guided is None or self.parameters.prediction == "inertial" or self.parameters.guidance == 0.0:
            return None
        target: Floats = guided.carried.surface - self.centre
        return target

    def _predict(self, state: MuscleState, transforms: Floats, target: Floats | None) -> Floats:
        """Return where a step starts: algorithm 2, lines 6 to 15."""
        settings, dt = self.parameters, self._dt
        now, before = centred(transforms, self.centre), centred(state.transforms, self.centre)
        push = dt * np.asarray(settings.external_force, dtype=np.float64)
        if target is not None:
            p = target + dt * (settings.velocity_kept * push)
        elif settings.prediction == "blend" and not self._free.all():
            # The muscle follows the bones: it keeps no momentum of its own.
            bones, weights = self._blend_weights
            p = blend_motions(
                np.array([now[bone] @ inverse(before[bone]) for bone in bones]), weights, state.positions
            )
            if push.any():
                p += dt * (settings.velocity_kept * push)
        else:
            p = state.positions + dt * (settings.velocity_kept * (state.velocities + push))
        for bone, fixed in self._fixed:
            p[fixed] = apply_transform(now[bone], self.rest[fixed])
        return p

    def _settle(self, p: Floats, keep_out: Callable[[Floats], Bools]) -> Bools:
        """Take out of the bones what the last projection of the volume pushed in; return which points.

        A point left inside would be taken for one that the bone has moved over in the next step. What this
        costs of the volume goes to the other points, so that both hold in the end.
        """
        hit = np.zeros(len(p), dtype=np.bool_)
        exact = self.parameters.volume_stiffness == 1.0
        for _ in range(SETTLING_PASSES):
            new = keep_out(p) & ~hit
            hit |= new
            volume = self._volume.project(p, 1.0 if exact else 0.0, hit)
            off = abs(volume - self._volume.rest) > VOLUME_TOLERANCE * abs(self._volume.rest)
            if not (new.any() or (exact and off)):
                break
        return hit


def _check_finite(*arrays: Floats) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise InputError(*OUT_OF_RANGE)
