"""A sheet of paths in a pose: forces on the sheet, and on the bones."""

import math
from collections import deque
from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.paths import equilibrium
from vtkmuscle.core.paths.bone_contact import PUSH, BoneContacts, Load, add_contacts
from vtkmuscle.core.paths.guides import Guides
from vtkmuscle.core.paths.levers import add_load, change_gradient, path_levers, pull_of
from vtkmuscle.core.paths.neighbours import WIDTH, NeighbourPairs, path_widths, widening
from vtkmuscle.core.paths.ring_contact import Rings, add_rings, hold_in_rings, ring_load, rings_at
from vtkmuscle.core.paths.surroundings import Surroundings
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.types import MOST_ROUNDS, Floats, Ints

#: A sheet has settled where all steps to come would lower its energy by less than this part of that of its
#: springs, as a geometric series. Lengths of three muscles of a real hip err by 0.016 mm then, at most, in
#: three motions; with 1e-8 by 0.18.
TOLERANCE = 5e-9

#: Steps of Newton's method in a pose, at most; 4 to 15 is what most take, and 80 or more where a path leaves
#: an unstable equilibrium. A supraspinatus without room takes up to 307, the most of 20 real muscles.
ITERATIONS = 400

#: Steps of Newton's method with the matrix alone. A sheet that has not settled by then swings: the matrix
#: lacks stiffness, of turning pairs or of a crease between two slopes of a bone. Further steps add the
#: stiffness that earlier steps lacked, times :data:`KEPT_STIFFNESS` for each step since. Kept whole, it makes
#: steps small. Of nine poses of a sheet in the groove of a pulley (test_creases) four do not settle without
#: it, one with it from 4 steps on, none from 10, 30, 60 or 100 on, in 487, 464, 593 and 839 steps. From 20 on
#: a supraspinatus without room takes two fifths of the steps that it takes without it, and settles in all
#: poses; 18 other real muscles take 7 % fewer.
PLAIN_STEPS, KEPT_STIFFNESS = 20, 0.95

#: Earlier points whose gradients improve a step: with 2 a quarter fewer steps are taken than with none, in 19
#: real muscles, and half as many where fibres are about to snap; 4 gain nothing more.
SECANTS = 2

#: A step of Newton's method takes no point farther than this, in segments. Without the limit moment arms of a
#: hip change by up to 2 mm.
LARGEST_STEP = 2.0

#: A step is shortened as long as the energy rises at its end by more than this part of the slope that it
#: began with: with 0.25 and 0.9 errors on phantoms are the same, and mean moment arms of a hip and a knee
#: change by at most 0.03 mm. The first steps in a pose are not: they find which points the bones press on
#: (semismooth Newton method; Hintermueller, Ito, Kunisch 2002, doi:10.1137/S1052623401383558). Shortened,
#: they stop wherever the first points come to a bone; poses 10 degrees apart take a third longer.
_RISE, _WHOLE_STEPS = 0.5, 4


class Sheet(NamedTuple):
    """A muscle's paths at rest. Bones, tissue and neighbours hold the paths.

    fibres : (f, n, 3), points at rest [mm];
    start_bones, end_bones : (f,) int, bones of the ends;
    thickness : of the muscle [mm];
    lengths : (f,), of the paths at rest [mm];
    around, contacts, neighbours : tissue and pressure, the bones, and the springs between paths;
    rings : sequence of (int, ViaRing), the bone that each via ring moves with, and the ring at rest;
    outside : (r, f), distance of each path outside of each ring at rest [mm];
    guides : Guides or None, carry the paths of other fibres; None where all paths are solved.
    """

    fibres: Floats
    start_bones: Ints
    end_bones: Ints
    thickness: float
    lengths: Floats
    around: Surroundings
    contacts: BoneContacts
    neighbours: NeighbourPairs
    rings: Sequence[tuple[int, ViaRing]]
    outside: Floats
    guides: Guides | None


class SheetPose:
    """The forces on a sheet in a pose. Also their stiffness, and the paths' levers.

    sheet : Sheet, at rest;
    transforms : (b, 4, 4), of the bones, rest to now;
    points : (f, n, 3), points near the sheet's equilibrium [mm]: positions are about the middle of two ends,
        for far from the origin the springs would take the digits;
    ring_points : (r, f) int, optional, point of each path held by each ring, 0 for no point; default: no
        point. :meth:`hold` changes it.

    x : (f, n, 3), points about the middle, as given to :meth:`look_at` last [mm];
    near : Proximity, of x;
    gradient, move : (f, n, 3), gradient of the energy at x, and the step from x;
    steps : steps of Newton's method so far.
    """

    def __init__(
        self, sheet: Sheet, transforms: Floats, points: Floats, ring_points: Ints | None = None
    ) -> None:
        around, shape = sheet.around, sheet.fibres.shape
        f, n, _ = shape
        self._sheet, self._middle = sheet, 0.5 * (points[0, 0] + points[-1, -1])
        self.x = points - self._middle
        #: Each bone, with the stiffness (f, n, 3, 3) and pull (f, n, 3) of its tissue.
        self._tissue: list[tuple[int, Floats, Floats]] = []
        self._moved = np.array(transforms)
        self._moved[:, :3, 3] -= self._middle
        self.near = sheet.contacts.proximity(self._moved)
        held, self._pull = np.zeros((f, n, 3, 3)), np.zeros(shape)
        for k, number in enumerate(around.bones):
            turn, pull = self._moved[number, :3, :3], np.zeros(shape)
            stiffness = (around.stiffness[k].reshape(-1, 9) @ np.kron(turn, turn).T).reshape(held.shape)
            add_load(stiffness, around.force[k], sheet.fibres, self._moved[number], pull)
            held += stiffness
            self._pull += pull
            self._tissue.append((number, stiffness, pull))
        self._held = held.reshape(f, n, 9).take([0, 1, 2, 4, 5, 8], axis=2)
        self._rings: Rings = rings_at(sheet.rings, transforms, self._middle, sheet.outside)
        nothing = np.zeros((len(sheet.rings), f), dtype=np.int64)
        self.ring_points = nothing if ring_points is None else ring_points.copy()
        self.gradient, self.move, self.steps = np.zeros(shape), np.empty(shape), 0
        self._blocks, self._sums = np.zeros((f, n, 6)), np.empty((f * n, 6))
        pairs = sheet.neighbours.pairs
        self._springs = np.empty((len(pairs), 6, WIDTH))
        self._rows, self._lanes = np.empty((f * n, 8)), np.empty(14 * WIDTH)
        self._matrix = self._blocks, pairs, self._springs
        self._inverses, self._work = np.empty((f + 1, n, 6)), np.empty((4, f + 1, n, 3))
        self._pressure = np.zeros((len(sheet.contacts.numbers), f, n))
        self._ring_pressure = np.zeros((len(sheet.rings), f, n))

    def hold(self, points: Floats) -> bool:
        """Choose the points held by rings. Of (f, n, 3); return whether the choice changed."""
        before = self.ring_points.copy()
        hold_in_rings(points - self._middle, self._rings, self.ring_points)
        return not np.array_equal(before, self.ring_points)

    def look_at(self, x: Floats) -> None:
        """Compute the energy's gradient and stiffness. Positions x (f, n, 3) are about the middle."""
        self.x, gradient, blocks, near = x, self.gradient, self._blocks, self.near
        equilibrium.add_springs(x, self._held, self._pull, gradient, blocks)
        sheet, widths = self._sheet, path_widths(x, self._sheet.lengths)
        work = self._rows, self._lanes, gradient.reshape(-1, 3), self._springs
        equilibrium.add_neighbours(x, sheet.neighbours, widths, *work)
        contacts, shape = sheet.contacts, self._pressure.shape
        contacts.update(x, near)
        gaps, normals = near.gaps.reshape(shape), near.normals.reshape(*shape, 3)
        rounded = PUSH, contacts.rounding
        add_contacts(x, gaps, normals, *rounded, gradient, blocks, self._pressure)
        if sheet.rings:
            add_rings(x, self._rings, self.ring_points, *rounded, gradient, blocks, self._ring_pressure)

    def settle(self, segment: float, tolerance: float, reach: float) -> bool:
        """Bring the sheet to rest by Newton's method. Return whether it came to rest.

        The matrix leaves out the turning of tangents, so that steps get shorter by a ratio only. ``segment``
        is the mean distance of points along a path at rest [mm], ``tolerance`` as :data:`TOLERANCE`. The
        method gives up where a point is farther than ``reach`` from its start [mm].
        """
        start = x = self.x
        enough = tolerance * x.shape[0] * x.shape[1] * segment**2
        longest = LARGEST_STEP * segment
        lacking, product = np.zeros_like(self._blocks), np.empty_like(x)
        before: list[Floats] = []
        slopes: deque[float] = deque(maxlen=3)
        self.look_at(x)
        for number in range(ITERATIONS):
            if number > PLAIN_STEPS:
                self._blocks += lacking
            plain = slope = self.step()
            now = np.array([x, self.gradient, self.move])
            if len(before) == SECANTS:
                move = accelerated(now, before)
                if (improved := float(np.vdot(self.gradient, move))) < 0.0:
                    self.move, slope = move, improved
            before = [now, *before][:SECANTS]
            part = longest / max(farthest_of(self.move), longest)
            if number >= PLAIN_STEPS:
                equilibrium.multiply(*self._matrix, self.move, product)
            for _ in range(MOST_ROUNDS):
                self.look_at(x + part * self.move)
                after = float(np.vdot(self.gradient, self.move))
                if after <= -_RISE * slope or number < _WHOLE_STEPS:
                    break
                part *= max(0.1, min(0.7, slope / (slope - after)))
            x = self.x
            if number >= PLAIN_STEPS:
                lacking *= KEPT_STIFFNESS
                equilibrium.add_lacking(x - now[0], self.gradient - now[1] - part * product, lacking)
            if number >= _WHOLE_STEPS and farthest_of(x - start) > reach:
                return False
            if self._sheet.rings and self.hold(self.points):
                self.look_at(x)
                before = []
                continue
            if part < 1.0:
                before = []
            slopes.append(plain)
            rate, energy = _rate(list(slopes))
            if energy * (rate / (1.0 - rate)) ** 2 < enough:
                return True
        return False

    def step(self) -> float:
        """Compute Newton's step, ``move``, and return its slope."""
        self.steps += 1
        equilibrium.prepare_solve(*self._matrix, self._sums, self._inverses)
        return self._solve(self.gradient)

    def _solve(self, gradient: Floats) -> float:
        """Write to ``move`` the step of a gradient. Return the step's slope."""
        return equilibrium.newton_step(
            gradient, *self._matrix, self._inverses, equilibrium.STEP_LEFT, self._work, self.move
        )

    def contacts(self) -> Ints:
        """Return the number of pressed points per path. Bones and rings press."""
        pressed = (self._pressure > 0.0).any(axis=0) | (self._ring_pressure > 0.0).any(axis=0)
        return np.asarray(np.count_nonzero(pressed, axis=1))

    def squeezed(self) -> Floats:
        """Return the lack of room of paths between bones.

        Two bones that press on a path from opposite sides sink into the path. The sum of the depths, at the
        point of the greatest lack, is the result, (f,) [mm].
        """
        shape = self._pressure.shape[1:]
        lacking = np.zeros(shape)
        depths = np.maximum(-self.near.gaps, 0.0)
        for first, second in combinations(np.flatnonzero(self._pressure.any(axis=(1, 2))), 2):
            against = -np.einsum("pi,pi->p", self.near.normals[first], self.near.normals[second])
            lacks = (against * (depths[first] + depths[second])).reshape(shape)
            pressed = (self._pressure[first] > 0.0) & (self._pressure[second] > 0.0)
            np.maximum(lacking, lacks, out=lacking, where=pressed)
        return np.asarray(lacking.max(axis=1))

    def sags(self) -> Floats:
        """Return :meth:`~vtkmuscle.core.paths.bone_contact.BoneContacts.sags` of segments, (f,) [mm]."""
        return self._sheet.contacts.sags(self.x, self.near)

    @property
    def points(self) -> Floats:
        """Points that were looked at last, (f, n, 3) [mm]."""
        return np.asarray(self.x + self._middle)

    def levers(self, twists: Floats, drift: Floats) -> Floats:
        """Return the levers of the paths looked at last.

        Levers are (v, k) of k fibres, as twists (v, b, 6) about the origin move the bones. See
        :func:`~vtkmuscle.core.paths.levers.path_levers`.
        """
        x, sheet, loads = self.x, self._sheet, self._loads()
        held = np.zeros((*x.shape, 3)) + sum(load.stiffness for _, load in loads)
        wider, going = -widening(x, sheet.lengths)[:, None, None] * pull_of(x), np.empty_like(self._rows)
        equilibrium.prepare_solve(*self._matrix, self._sums, self._inverses)

        def change(velocity: Floats) -> Floats:
            rates, result = np.einsum("fni,fni->f", wider, velocity), np.empty_like(velocity)
            change_gradient(velocity, rates, held, sheet.neighbours, self._rows, going, self._lanes, result)
            return result

        def step(gradient: Floats) -> Floats:
            self._solve(gradient)
            return self.move.copy()

        def resist(velocity: Floats) -> Floats:
            result = np.empty_like(velocity)
            equilibrium.multiply(*self._matrix, velocity, result)
            return result

        about = np.array(twists, dtype=np.float64)
        about[..., :3] += np.cross(about[..., 3:], self._middle)
        ends = sheet.start_bones, sheet.end_bones
        carried = None if sheet.guides is None else (sheet.guides, self._moved)
        return path_levers(x, ends, loads, about, drift, (change, step, resist), carried)

    def _loads(self) -> list[tuple[int, Load]]:
        """Return the loads on the points, each with the number of its bone."""
        x, contacts = self.x, self._sheet.contacts
        loads = [
            (number, Load(pull - np.einsum("fnij,fnj->fni", held, x), held))
            for number, held, pull in self._tissue
        ]
        for k, number in enumerate(contacts.numbers):
            if self._pressure[k].any():
                loads.append((number, contacts.load(k, self.near, self._pressure[k])))
        for k, (number, _) in enumerate(self._sheet.rings):
            if (points := self.ring_points[k]).any():
                loads.append((number, ring_load(x, self._rings, k, points, contacts.rounding)))
        return loads


def _rate(slopes: Sequence[float]) -> tuple[float, float]:
    """Return the ratio of steps, as a geometric series, and the last square.

    Slopes are minus squares of steps. The larger of the last two ratios counts, but all steps to come are no
    longer than :data:`ITERATIONS` last ones: steps that are rounding have any ratio.
    """
    slowest = ITERATIONS / (ITERATIONS + 1.0)
    ratios = [slowest, *(math.sqrt(after / before) for before, after in pairwise(slopes))]
    return min(max(ratios[-2:]), slowest), -slopes[-1]


def accelerated(now: Floats, before: Sequence[Floats]) -> Floats:
    """Return a step improved by earlier points.

    The step is (f, n, 3). Each point has positions, a gradient and Newton's step. On the plane through the
    points gradients and steps are interpolated; the result leads by the step from the point of the least
    gradient, in the norm of the inverse matrix (Anderson 1965, doi:10.1145/321296.321305; Walker, Ni 2011,
    doi:10.1137/10078356X).
    """
    x, gradient, moves = (now - np.array(before)).reshape(len(before), 3, -1).swapaxes(0, 1)
    products = gradient @ moves.T
    right = gradient @ now[2].reshape(-1) + moves @ now[1].reshape(-1)
    parts = np.linalg.lstsq(products + products.T, right)[0]
    return np.asarray(now[2] - (parts @ (x + moves)).reshape(now[2].shape))


@kernel
def farthest_of(ways: Floats) -> float:
    """Return the length of the longest of ways (f, n, 3)."""
    most = 0.0
    for a in range(len(ways)):
        for i in range(ways.shape[1]):
            u, v, w = ways[a, i, 0], ways[a, i, 1], ways[a, i, 2]
            most = max(most, u * u + v * v + w * w)
    return math.sqrt(most)
