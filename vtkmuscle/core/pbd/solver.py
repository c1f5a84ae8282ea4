"""Algorithm 2 of Kohout and Cervenka 2021, made stable.

doi:10.1007/978-3-030-72379-8_24. As printed, free points go on with their velocities while fixed points jump
with their bones: the step is left to the edges between. By default free points go with the bones, straight or
wound round them, and have no velocities; angles have a sign, and volume and bones come last.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.spatial.distance import pdist

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneContact, PoseContact
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.jit import LANES
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.rest_shape import RestShape, Volume, project_volume
from vtkmuscle.core.mesh.surface import box_of
from vtkmuscle.core.mesh.triangle_tree import Near
from vtkmuscle.core.motion.blending import blend_motions, nearest_rotations, screws_between
from vtkmuscle.core.motion.rigid import apply_transform, centred, inverses
from vtkmuscle.core.pbd import sweep
from vtkmuscle.core.pbd.voxels import VoxelContact
from vtkmuscle.core.types import Bools, Floats, Progress, quiet

#: Two bones of a muscle turn against each other by at most this in a step without velocities [degrees];
#: larger steps are parted. Measured with bench_pbd.py stability.
LARGEST_TURN = 3.0
#: Parts of the way from straight to wound that are tried, (9, 1).
PARTS = np.linspace(0.0, 1.0, 9)[:, None]
#: Moves positions out of obstacles, and returns the moved points.
KeepOut = Callable[[Floats], Bools]


@dataclass(frozen=True)
class Parameters:
    """Settings of position based dynamics.

    :data:`PUBLISHED` are the settings of section 4 of the paper. PBDDeformer has the same settings, and takes
    the descriptions from here.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per step, >= 1.
    prediction : str
        Start of free points in a step: ``"bones"``, where the bones take the points, straight or wound round
        bones, without velocities; or ``"velocity"``, where the points' velocities do (lines 11 to 13).
    signed_angles : bool
        Whether angles tell a ridge from a groove, and move corners by the turn's chord (eq. 1: the turn).
    order : str
        ``"edge"``: length and angle of an edge after each other, then the volume; ``"kind"``: all lengths,
        the volume, all angles (lines 17 to 23).
    anisotropy : str
        Edges that are the softer the more the edges run along the fibres (section 3.1): ``"always"``, with
        the harmonic function between the muscle's ends in place of fibres for a muscle without fibres;
        ``"fibres"``, for a muscle with fibres (Algorithm 1, line 15); ``"off"``, no edges.
    stiffness : float
        Of edge lengths, per iteration, in [0, 1]; signed angles keep edges within three rest lengths.
    shape_stiffness : float
        Of the angles between triangles, per iteration, in [0, 1].
    volume_stiffness : float
        Of the muscle's volume, per iteration, in [0, 1].
    finish : bool
        Whether a step ends with bones and volume alone, until the volume is the rest volume.
    dt : float
        Time of a step [s], > 0.
    velocity_kept : float
        Part of its velocity that a point keeps from step to step, in [0, 1] (line 12).
    external_force : (3,) tuple
        Force per mass on all free points [mm/s^2] (line 11).
    bone_push : str
        Effect of voxels on points that the voxels moved over: ``"transform"``, take the points along (section
        3.2), or ``"off"``, nothing.
    contact_velocity : str
        Velocity of points that met a bone: ``"keep"``, the displacement's velocity, as the paper computes it,
        or ``"zero"``, as section 5 of the paper proposes.
    """

    iterations: int = 10
    prediction: str = "bones"
    signed_angles: bool = True
    order: str = "edge"
    anisotropy: str = "always"
    stiffness: float = 1.0
    shape_stiffness: float = 0.9
    volume_stiffness: float = 1.0
    finish: bool = True
    dt: float = 1.0
    velocity_kept: float = 0.99
    external_force: tuple[float, ...] = (0.0, 0.0, 0.0)
    bone_push: str = "transform"
    contact_velocity: str = "keep"


#: The settings with which Algorithm 2 is as printed.
PUBLISHED = MappingProxyType(
    {
        "prediction": "velocity",
        "signed_angles": False,
        "order": "kind",
        "anisotropy": "fibres",
        "finish": False,
    }
)


@dataclass(frozen=True, eq=False)
class State:
    """A muscle at one time.

    surface : (n, 3), the muscle's points [mm];
    transforms : (b, 4, 4), of the bones, rest to now;
    colliding : int, number of points that bones or other muscles hold off;
    positions : (m, 3), the solved points, relative to the centre of the muscle at rest [mm];
    velocities : (m, 3) or None, of the solved points [mm / s]; None for points without velocities.
    """

    surface: Floats
    transforms: Floats
    colliding: int
    positions: Floats
    velocities: Floats | None = None

    @property
    def nbytes(self) -> int:
        """Memory of the state [bytes]."""
        arrays = self.surface, self.transforms, self.positions, self.velocities
        return sum(array.nbytes for array in arrays if array is not None)


class PBDSolver:
    """Deforms a muscle with the bones of its attachments.

    The solver holds the constant data. :meth:`step` takes a state and gives the next: states can be kept.

    muscle : FixedMuscle, the muscle;
    parameters : Parameters, settings of the method;
    bones : mapping of int to Bone, bones that free points are kept out of, by index among the transforms;
    clearance : float, distance that points keep from the bones [mm];
    voxels : (int, int or None), number of voxels of a bone, and number along each axis. With a value, voxels
        keep points out of bones in place of the surface.

    shape : RestShape, the surface at rest;
    rest : (n, 3), the surface's points, relative to the centre of the points' box [mm].

    Raises a ValueError if the surface is open or encloses no volume, or if no fibre has a length.
    """

    def __init__(
        self, muscle: FixedMuscle, parameters: Parameters, bones: Mapping[int, Bone] = MappingProxyType({}),
        clearance: float = 0.0, voxels: tuple[int, int | None] | None = None,
    ) -> None:  # fmt: skip
        self.parameters = parameters
        points, fixed_to, topology = muscle.points, muscle.fixed_to, muscle.topology()
        directions = None
        if muscle.fibres is not None:
            directions = sweep.fibre_directions_at(points[topology.edges].mean(axis=1), *muscle.fibres)
        elif parameters.anisotropy == "always":
            directions = sweep.harmonic_directions(points, topology, fixed_to)
        self.shape = shape = RestShape(points, topology)
        self._used = np.unique(topology.edges)
        self.centre: Floats = np.mean(box_of(points[self._used]), axis=0)
        self.rest: Floats = points - self.centre
        free = fixed_to < 0
        self._mass: Floats = free.astype(np.float64)
        self._fixed = [(int(bone), np.flatnonzero(fixed_to == bone)) for bone in np.unique(fixed_to[~free])]
        free &= np.isin(np.arange(len(points)), self._used)
        self._weights = harmonic_weights(self.rest, muscle.triangles, fixed_to) if self._fixed else None
        self._contact: VoxelContact | BoneContact = BoneContact(bones, points, free, clearance)
        if voxels is not None:
            push = parameters.bone_push == "transform"
            self._contact = VoxelContact(bones, free, n_max=voxels[0], n_equal=voxels[1], bone_push=push)
        edges = topology.edges
        stiffness = np.full(len(edges), parameters.stiffness)
        if directions is not None and parameters.anisotropy != "off":
            stiffness *= sweep.edge_stiffness(points, edges, directions)
        # Quadruples are in the order of the edges; those of more than two triangles have none.
        quads = np.column_stack([edges, np.full_like(edges, -1)])
        ends = np.sort(topology.quads[:, :2], axis=1)
        with_angle = np.searchsorted(edges @ [len(points), 1], ends @ [len(points), 1])
        quads[with_angle] = topology.quads
        angles, angle_stiffness = np.zeros((2, len(edges)))
        angles[with_angle] = shape.angles if parameters.signed_angles else np.abs(shape.angles)
        angle_stiffness[with_angle] = np.where(shape.angle_defined, parameters.shape_stiffness, 0.0)
        #: Every fourth edge: which start keeps lengths is told by these alone, in a third of the time.
        self._edges = *np.ascontiguousarray(edges[::4].T), shape.lengths[::4], stiffness[::4]
        #: The edges in the order in which they are solved.
        self.rows = sweep.edge_rows(quads, self._mass, shape.lengths, stiffness, angles, angle_stiffness)
        # Eq. 1 divides by the gradients of all points.
        volume = topology.triangles, shape.volume, parameters.volume_stiffness, 0.0
        self._volume = self._mass, np.ones(len(points)), *volume, np.empty_like(self.rest)
        self._exact = Volume(shape, free)
        self._buffer = np.empty(12 * LANES)

    def at_rest(self, n_bones: int) -> State:
        """Return the muscle and all bones at rest."""
        velocities = np.zeros_like(self.rest) if self.parameters.prediction == "velocity" else None
        return State(self.rest + self.centre, np.tile(np.eye(4), (n_bones, 1, 1)), 0, self.rest, velocities)

    def step(self, state: State, transforms: Floats, near: Near = (), report: Progress = quiet) -> State:
        """Return the state after the bones have moved on.

        Transforms (b, 4, 4) lead from rest to now. Free points are kept out of near muscles, too.
        ``report`` is called after each iteration. A ValueError reports an overflowing position.
        """
        transforms = np.array(transforms, dtype=np.float64)
        if state.velocities is not None:
            return self._with_velocities(state, transforms, near, report)
        before, x, bones = state.transforms, state.positions, [bone for bone, _ in self._fixed]
        parts = _parts(transforms[bones] @ inverses(before[bones]))
        for part in range(1, parts + 1):
            now = screws_between(state.transforms, transforms, part / parts)
            keep_out = self._keep_out(now, before, x, near)
            p = self._with_fixed_points(self._start(x, before, now, keep_out), now)
            held = self._iterate(p, self.rows.constants, keep_out, report, part, parts)
            before, x = now, p[:-1]
        return self._state(x, transforms, held)

    def pose(self, start: Floats, transforms: Floats, near: Near = (), report: Progress = quiet) -> State:
        """Return the state in a pose, begun at a surface.

        The surface is (n, 3) [mm]. Edges keep their lengths on the surface, and their angles at rest. The
        remaining parameters are as of :meth:`step`.
        """
        transforms = np.array(transforms, dtype=np.float64)
        p = self._with_fixed_points(start - self.centre, transforms)
        constants = self.rows.constants.copy()
        sweep.take_lengths(p, self.rows.points, constants)
        keep_out = self._keep_out(transforms, transforms, p[:-1].copy(), near)
        held = self._iterate(p, constants, keep_out, report)
        return self._state(p[:-1], transforms, held)

    def _with_velocities(self, state: State, transforms: Floats, near: Near, report: Progress) -> State:
        """Do Algorithm 2, lines 6 to 37."""
        settings, x, v, dt = self.parameters, state.positions, state.velocities, self.parameters.dt
        assert v is not None  # the state is of this kind
        with np.errstate(over="ignore", invalid="ignore"):  # _state reports it
            start = x + dt * (settings.velocity_kept * (v + dt * np.asarray(settings.external_force)))
            p = self._with_fixed_points(start, transforms)
            keep_out = self._keep_out(transforms, state.transforms, x, near)
            held = self._iterate(p, self.rows.constants, keep_out, report)
            velocities = (p[:-1] - x) / dt
        if settings.contact_velocity == "zero":
            velocities[held] = 0.0
        return self._state(p[:-1], transforms, held, velocities)

    def _start(self, x: Floats, before: Floats, now: Floats, keep_out: KeepOut) -> Floats:
        """Return points (n, 3) moved with the bones, between straight and wound.

        Straight, the points' harmonic places among the fixed points go with these, and points turn about them
        as a whole. Wound, points go with the bones' motions, blended by harmonic weights. The start is the
        greater part of the way from straight to wound: as obstacles push a straight muscle, of the most that
        both are apart; or where edges, as stiff as they are, have about their lengths at rest.
        """
        if self._weights is None:
            return x
        bones, weights, places = self._weights
        before, now = (centred(pose, self.centre)[bones] for pose in (before, now))
        old, new = (np.einsum("ij,kj->ik", places, np.hstack(list(pose[:, :3]))) for pose in (before, now))
        motions = now @ inverses(before)
        turned = new + blend_motions(motions * [1.0, 1.0, 1.0, 0.0], weights, x - old)
        body, used = x[self._used], self._used
        turn = nearest_rotations(np.einsum("ij,ik->jk", turned[used], body - body.mean(axis=0))[None])[0]
        straight = new + np.einsum("ij,kj->ik", x - old, turn)
        kept, apart = straight.copy(), blend_motions(motions, weights, x) - straight
        keep_out(kept)
        push, most = (np.linalg.norm(way[used], axis=1).max() for way in (kept - straight, apart))
        starts, ends, lengths, stiffness = self._edges
        way, more = straight[ends] - straight[starts], apart[ends] - apart[starts]
        squares, across, more = (np.einsum("ij,ij->i", *p) for p in ((way, way), (way, more), (more, more)))
        sizes = np.sqrt(np.maximum(squares + PARTS * (2.0 * across + PARTS * more), 0.0))
        strains = np.einsum("pi,i->p", (sizes - lengths) ** 2, stiffness)
        part = max(push / (most or 1.0), PARTS[strains.argmin(), 0])
        return np.asarray(straight + min(part, 1.0) * apart)

    def _iterate(
        self, p: Floats, constants: Floats, keep_out: KeepOut, report: Progress, part: int = 1, parts: int = 1
    ) -> Bools:
        """Project all constraints of points (n + 1, 3), and finish, in place; return points held off."""
        settings, met = self.parameters, np.zeros(len(p) - 1, dtype=np.bool_)
        rows, signed, buffer = (self.rows.points, constants), settings.signed_angles, self._buffer
        by_edge = settings.order == "edge"
        for iteration in range(settings.iterations):
            sweep.project_edges(p, *rows, True, by_edge, signed, buffer)
            project_volume(p[:-1], *self._volume)
            if not by_edge:
                sweep.project_edges(p, *rows, False, True, signed, buffer)
            met |= keep_out(p[:-1])
            report((part - 1 + (iteration + 1) / settings.iterations) / parts)
        if settings.finish and part == parts:
            held = self._exact.finish(p[:-1], keep_out)
            met = met | held if settings.prediction == "velocity" else held
        return met

    def _with_fixed_points(self, points: Floats, transforms: Floats) -> Floats:
        """Return points with the fixed points on their bones, and one more: (n + 1, 3)."""
        p = np.vstack([points, np.zeros(3)])
        now = centred(transforms, self.centre)
        for bone, fixed in self._fixed:
            p[fixed] = apply_transform(now[bone], self.rest[fixed])
        return p

    def _keep_out(self, now: Floats, before: Floats, x: Floats, neighbours: Near) -> KeepOut:
        """Return the contact with bones and neighbours in a step."""
        if isinstance(self._contact, VoxelContact):
            return self._contact.at(now, neighbours, self.centre, before, x)
        return PoseContact(self._contact, now, neighbours, self.centre).keep_out

    def _state(self, p: Floats, transforms: Floats, held: Bools, velocities: Floats | None = None) -> State:
        if not (np.isfinite(p).all() and (velocities is None or np.isfinite(velocities).all())):
            problem = "the muscle left the range of floating point numbers"
            raise InputError("", problem, "use a smaller external_force or dt, or the prediction 'bones'")
        return State(p + self.centre, transforms, int(held.sum()), np.array(p), velocities)


def _parts(motions: Floats) -> int:
    """Return the number of parts of a step.

    The number is by the greatest turn of two bones against each other; motions (b, 4, 4) are of the bones.
    """
    # Of a turn by t, the squares of R - 1 sum to 8 sin^2 t/2; so do those of the difference of two turns.
    most = pdist(motions[:, :3, :3].reshape(-1, 9)).max(initial=0.0)
    turn = 2.0 * math.degrees(math.asin(min(most / math.sqrt(8.0), 1.0)))
    return max(1, math.ceil(turn / LARGEST_TURN - 1e-3))
