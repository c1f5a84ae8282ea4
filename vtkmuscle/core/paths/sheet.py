"""A muscle's paths as one taut sheet round bones."""

import math
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.mesh.surface import mean_thickness
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.motion.blending import screws_between
from vtkmuscle.core.motion.rigid import inverses
from vtkmuscle.core.paths.bone_contact import BoneContacts, Seen
from vtkmuscle.core.paths.guides import ALL_PATHS, Guides, with_bones
from vtkmuscle.core.paths.neighbours import neighbours_of, path_lengths
from vtkmuscle.core.paths.pose import TOLERANCE, Sheet, SheetPose, farthest_of
from vtkmuscle.core.paths.ring_contact import outside_of, rings_at
from vtkmuscle.core.paths.surroundings import surroundings_of
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.types import ROUNDING, Bools, Floats, Ints

#: Points of a path. Paths of 17 points round a cylinder of 30 mm have moment arms 1 % less than those of
#: 33 and 65, which agree within 0.1 mm.
POINTS = 33

#: Bones go from one pose to another in parts, in which they carry no end of a path farther than this, in
#: segments: a path does not jump over what lies between. A jump over 90 degrees takes 12 to 52 % less time
#: than with 4, and about as long as with 16, with which lengths of three muscles of a hip and a knee depend
#: on the way by 0.14 to 0.28 mm, not by 0.003 to 0.03.
LARGEST_MOVE = 8.0

#: Settling in a part before the last ends at this many tolerances. A move over a whole motion takes 3 to 41 %
#: fewer steps than with 1 in 20 real muscles, and lengths change by at most 0.01 mm but where several
#: equilibria are near (by 0.2 mm in one of seven samplings of a gluteus maximus); with 1 000 a supraspinatus
#: comes to another equilibrium, 10 mm off.
LOOSER = 100.0

#: Paths begin in a new pose with the drift of the pose before, in proportion to the move of their ends; with
#: none where the ends move by more than so many times as much. Without the bound levers of a hip change by up
#: to 0.1 mm.
LARGEST_DRIFT = 2.0


@dataclass(frozen=True, eq=False)
class PathState:
    """Paths in a pose of the bones.

    sheet : Sheet, the paths at rest;
    points : (f, n, 3), positions [mm];
    transforms : (b, 4, 4), of the bones, rest to now;
    ring_points : (r, f) int, point of each path held by each ring, 0 for no point;
    settled : whether the sheet came to rest;
    steps : steps of Newton's method since the pose that the paths began with;
    ends_moved : (2, f, 3), move of each end since the pose before, seen from the bone of the path's opposite
        end [mm];
    drift : (f, n, 3), displacement of the points from the positions after the move of the ends alone [mm];
    seen : Seen, the paths when they were looked at last, outside of all bones;
    passed : (f,) bool, paths that have passed through a bone since rest;
    forces : callable, returns the settled pose of the sheet, None when the sheet has gone on.
    """

    sheet: Sheet
    points: Floats
    transforms: Floats
    ring_points: Ints
    settled: bool
    steps: int
    ends_moved: Floats
    drift: Floats
    seen: Seen
    passed: Bools
    forces: Callable[[], SheetPose | None] = lambda: None
    #: Levers in this pose by the twists' content.
    _levers: dict[bytes, Floats] = field(default_factory=dict, init=False)

    @cached_property
    def paths(self) -> Floats:
        """Points of the paths of all fibres, (k, n, 3) [mm]."""
        guides = self.sheet.guides
        return self.points if guides is None else guides.carry(self.points, self.transforms)

    def per_fibre(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (f,) of the solved paths for all fibres, (k,), from the nearest path."""
        return values if self.sheet.guides is None else values[self.sheet.guides.nearest]

    @property
    def lengths(self) -> Floats:
        """Length of the path of each fibre, (k,) [mm]."""
        return path_lengths(self.paths)

    @cached_property
    def contacts(self) -> Ints:
        """Number of points of each path that bones or rings press on, (f,)."""
        return self._pose().contacts()

    @cached_property
    def squeezed(self) -> Floats:
        """Room that each path lacks between two bones, (f,) [mm]."""
        return self._pose().squeezed()

    @cached_property
    def sags(self) -> Floats:
        """Depth of each path's straight segments in the bones' clearance, (f,) [mm]."""
        return self._pose().sags()

    def levers(self, twists: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the lever of the path of each fibre by each coordinate.

        Levers are (k,): minus dl/dq by coordinate q, with all else in equilibrium. A coordinate moves the
        bones by twists (b, 6): velocity at the origin and angular velocity, per unit. See
        :func:`~vtkmuscle.core.paths.levers.path_levers`. Levers are computed once: computed again, the last
        digits would differ.
        """
        new = [twist for twist in twists.values() if twist.tobytes() not in self._levers]
        if new:
            levers = self._pose().levers(np.array(new), self.drift)
            self._levers.update(zip((twist.tobytes() for twist in new), levers, strict=True))
        return {name: self._levers[twist.tobytes()] for name, twist in twists.items()}

    def _pose(self) -> SheetPose:
        """Return the settled pose of the sheet."""
        pose = self.forces()
        if pose is None:
            pose = SheetPose(self.sheet, self.transforms, self.points, self.ring_points)
            pose.look_at(pose.x)
        return pose

    @property
    def nbytes(self) -> int:
        """Memory of the state [bytes]."""
        arrays = self.paths, self.transforms, self.ring_points, self.ends_moved, self.drift, *self.seen
        return sum(array.nbytes for array in arrays)


class MusclePaths:
    """Paths of a muscle, taut round moving bones.

    All paths from bone to bone form one sheet. A path begins as a fibre of the muscle at rest. A path is a
    chain of springs without length or stiffness across, and the chain's ends go with their bones: the path
    takes the shortest free way, evenly spread. From a bone a path keeps the thickness of muscle between path
    and bone at rest. Paths beside each other keep their distance, and so the muscle keeps its volume
    (:mod:`~vtkmuscle.core.paths.neighbours`). Tissue holds a path's bow at rest, and holds the path aside
    over the bones of the path's ends (:mod:`~vtkmuscle.core.paths.surroundings`). A path passes through via
    rings. The paths are in equilibrium, followed from pose to pose. Both ends are treated alike.

    fibres : (f, n, 3), points at rest, evenly spread along each fibre, n >= 3, origin to insertion [mm];
    start_bones, end_bones : (f,) int, bones of the ends;
    surface : (v, 3), (m, 3) int, the muscle at rest [mm], and its triangles, outward, closed;
    bones : mapping of int to Bone, bones at rest by number, to keep paths away from;
    rings : sequence of (int, ViaRing), the bone that each via ring moves with, and the ring at rest;
    n_paths : number of solved paths. Fewer than the fibres carry the paths of all
        (:class:`~vtkmuscle.core.paths.guides.Guides`).

    rest : PathState, at rest;
    thickness : 2 V / A of the muscle, the mean thickness of a flat muscle [mm].

    Raises a ValueError if a fibre has no length, or the muscle no volume.
    """

    def __init__(
        self, fibres: Floats, start_bones: Ints, end_bones: Ints, surface: tuple[Floats, Ints],
        bones: Mapping[int, Bone], *, rings: Sequence[tuple[int, ViaRing]] = (), n_paths: int = ALL_PATHS,
    ) -> None:  # fmt: skip
        if not (lengths := path_lengths(fibres)).all():
            raise ValueError(f"fibre {int(lengths.argmin())} has no length")
        guides = None
        if n_paths < len(fibres):
            guides = Guides(fibres, start_bones, end_bones, n_paths)
            fibres = fibres[guides.numbers]
            start_bones, end_bones = start_bones[guides.numbers], end_bones[guides.numbers]
        self.fibres: Floats = np.ascontiguousarray(fibres, dtype=np.float64)
        self.start_bones, self.end_bones = start_bones, end_bones
        lengths = path_lengths(self.fibres)
        self.thickness = mean_thickness(*surface)
        self._lengths, self._segment = lengths, float(lengths.mean()) / (self.fibres.shape[1] - 1)
        # Sums over bones are rounded in their order: that of their sizes, which no names decide. Bones of
        # one size, to nine digits, stay as they come.
        pieces = [(number, piece) for number, bone in bones.items() for piece in bone.pieces]
        pieces.sort(key=lambda numbered: float(f"{np.ptp(numbered[1].box_along_axes):.8e}"))
        rest = self.fibres, start_bones, end_bones
        around = surroundings_of(*rest, pieces, triangle_tree(*surface), self.thickness)
        last = max([*bones, int(start_bones.max()), int(end_bones.max()), *(bone for bone, _ in rings)])
        still = np.zeros((last + 1, 4, 4)) + np.eye(4)
        nothing = np.zeros((len(rings), len(self.fibres)))
        outside = np.empty_like(nothing)
        if rings:
            outside_of(rings_at(rings, still, np.zeros(3), nothing), self.fibres, outside)
        contacts = BoneContacts(pieces, around.standoff, self._segment)
        held = *rest, self.thickness, self._lengths, around, contacts, neighbours_of(self.fibres)
        self._sheet = Sheet(*held, tuple(rings), outside, guides)
        self.rest = self._settle(self.fibres, still, self._ends_moved(still, still), self.fibres)

    def follow(self, before: PathState, transforms: Floats) -> PathState:
        """Return the paths in another pose of the bones.

        The bones reach the pose along their screws. Where a sheet has one equilibrium the pose alone decides.
        Where a sheet has several, as where fibres snap, the result is the equilibrium that the paths come to
        on the way from ``before``; a different result of ``follow(rest, transforms)`` shows several
        equilibria.

        before : PathState, the paths before; not changed;
        transforms : (b, 4, 4), of the bones, rest to now.
        """
        transforms = np.array(transforms, dtype=np.float64)
        last = transforms.copy()  # a further bone has not moved
        last[: len(before.transforms)] = before.transforms[: len(last)]
        moves = transforms @ inverses(last)
        if np.ptp(moves, axis=0).max() <= ROUNDING:  # they move together
            ends = self.start_bones, self.end_bones
            points = with_bones(before.points, *ends, moves)
            drift, forces = with_bones(before.points + before.drift, *ends, moves) - points, PathState.forces
            return replace(before, points=points, transforms=transforms, steps=0, drift=drift, forces=forces)
        farthest = np.linalg.norm(self._ends_moved(last, transforms), axis=2).max()
        steps = max(math.ceil(farthest / (LARGEST_MOVE * self._segment)), 1)
        state = replace(before, transforms=last, steps=0)
        for number in range(1, steps + 1):  # the last is the pose itself
            tolerance = TOLERANCE * (LOOSER if number < steps else 1.0)
            part = screws_between(last, transforms, number / steps)
            state = self._go_to(state, part, tolerance, farthest / steps)
        return state

    def _go_to(self, before: PathState, transforms: Floats, tolerance: float, move: float) -> PathState:
        """Return the paths in a near pose. Where paths pass through a bone, the ends' move is halved."""
        state = self._go_on(before, transforms, tolerance)
        passed, looked = self._sheet.contacts.passed(before.seen, state.seen)
        if passed.any() and move > self._segment:
            middle = screws_between(before.transforms, transforms, 0.5)
            half = self._go_to(before, middle, tolerance, 0.5 * move)
            return self._go_to(half, transforms, tolerance, 0.5 * move)
        seen = before.seen.renewed(state.seen, looked) if looked.any() else before.seen
        return replace(state, seen=seen, passed=before.passed | passed)

    def _go_on(self, before: PathState, transforms: Floats, tolerance: float) -> PathState:
        """Return the paths in a near pose.

        The paths begin with the drift of the pose before, scaled by the part of the earlier move of the ends
        in the ends' present move. Where the paths settle farther from the start than the drift is long, the
        paths begin where the ends take the points.
        """
        ends_moved, last = self._ends_moved(before.transforms, transforms), before.ends_moved
        again = float(np.vdot(last, ends_moved)) / (float(np.vdot(last, last)) or math.inf)
        again = again if abs(again) <= LARGEST_DRIFT else 0.0
        moves = transforms @ inverses(before.transforms)
        ends = self.start_bones, self.end_bones
        carried = with_bones(before.points, *ends, moves)
        start = with_bones(before.points + again * before.drift, *ends, moves)
        reach = farthest_of(start - carried) or math.inf
        state = self._settle(start, transforms, ends_moved, carried, tolerance, reach)
        steps = before.steps + state.steps
        if farthest_of(state.points - start) > reach:
            state = self._settle(carried, transforms, ends_moved, carried, tolerance)
            steps += state.steps
        return replace(state, steps=steps)

    def _ends_moved(self, before: Floats, now: Floats) -> Floats:
        """Return the moves of starts and ends. Seen from the opposite end's bone, (2, f, 3) [mm]."""
        starts = self.start_bones, self.end_bones, self.fibres[:, 0]
        ends = self.end_bones, self.start_bones, self.fibres[:, -1]
        return np.array([_seen_from(now, *end) - _seen_from(before, *end) for end in (starts, ends)])

    def _settle(
        self, start: Floats, transforms: Floats, ends_moved: Floats, carried: Floats,
        tolerance: float = TOLERANCE, reach: float = math.inf,
    ) -> PathState:  # fmt: skip
        """Return the sheet in a pose near ``start``.

        The sheet is in equilibrium; the ends ``carried`` the sheet so far. The search gives up farther than
        ``reach`` from the start.
        """
        start = start.copy()
        start[:, 0] = carried_by(transforms[self.start_bones], self.fibres[:, 0])
        start[:, -1] = carried_by(transforms[self.end_bones], self.fibres[:, -1])
        pose = SheetPose(self._sheet, transforms, start)
        if self._sheet.rings:  # near the equilibrium they would never let go of the points that they hold
            pose.hold(carried)
        settled = pose.settle(self._segment, tolerance, reach)
        self._latest = pose  # alive for the levers of this state
        now = self._sheet, pose.points, transforms, pose.ring_points, settled, pose.steps
        seen = Seen(pose.near.points.astype(np.float32), pose.near.gaps.astype(np.float32))
        further = pose.points - carried, seen, np.zeros(len(start), dtype=np.bool_)
        return PathState(*now, ends_moved, *further, weakref.ref(pose))


def carried_by(transforms: Floats, points: Floats) -> Floats:
    """Return moved points (f, 3). Transforms (f, 4, 4)."""
    return np.asarray(np.einsum("fij,fj->fi", transforms[:, :3, :3], points) + transforms[:, :3, 3])


def _seen_from(transforms: Floats, mine: Ints, opposite: Ints, points: Floats) -> Floats:
    """Return points (f, 3) seen from another bone. They move with a bone of their own."""
    return carried_by((inverses(transforms)[:, None] @ transforms)[opposite, mine], points)
