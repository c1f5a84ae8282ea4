"""A sheet of paths in one pose of the bones: what acts on its points, and what they do to the bones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.paths.bone_contact import PUSH, BoneContacts, Proximity, add_contacts
from vtkmuscle.core.paths.equilibrium import (
    STEP_LEFT,
    add_neighbours,
    add_springs,
    newton_step,
)
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.paths.ring_contact import Rings, add_rings, hold_in_rings, ring_loads, rings_at
from vtkmuscle.core.paths.surroundings import Surroundings
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.paths.wrenches import path_wrenches
from vtkmuscle.core.types import Floats, Ints

#: How far a bone or a point is moved to see how the forces change, in thicknesses of the muscle.
SMALL_MOVE = 1e-4

#: Steps in which the response to a bone's move is solved for, and the part of the residual that conjugate
#: gradients leave in each. Of four muscles of a real hip and one of a knee, one step with 1e-3 left has mean
#: levers 0.6 to 2.9 mm off -dl/dq (rms), two with 0.03 have 0.3 to 0.9 mm, three 0.1 to 0.6 mm; with three a
#: muscle's paths take half as long again.
RESPONSES, RESPONSE_LEFT = 3, 0.03


class Sheet(NamedTuple):
    """A muscle's paths at rest, and what holds them.

    Attributes
    ----------
    fibres : (f, n, 3) array
        Points at rest [mm].
    start_bones, end_bones : (f,) int arrays
        Which bones the ends are fixed to.
    thickness : float
        Of the muscle [mm].
    widths : callable
        How much wider than at rest paths (f, n, 3) are that keep their volume, (f,).
    around, contacts, neighbours
        Tissue and pressure, the bones, and the springs between paths.
    rings : sequence of (int, ViaRing)
        The bone that each via ring moves with, and the ring at rest.
    outside : (r, f) array
        How far outside of each ring each path is at rest [mm].
    """

    fibres: Floats
    start_bones: Ints
    end_bones: Ints
    thickness: float
    widths: Callable[[Floats], Floats]
    around: Surroundings
    contacts: BoneContacts
    neighbours: Neighbours
    rings: Sequence[tuple[int, ViaRing]]
    outside: Floats


class SheetPose:
    """The forces on a sheet in one pose of the bones, their stiffness, and the paths' wrenches.

    Parameters
    ----------
    sheet : Sheet
        At rest.
    transforms : (b, 4, 4) array
        Of the bones, rest to now.
    middle : (3,) array
        What positions are about: far from the origin the springs would take the digits [mm].

    Attributes
    ----------
    gradient, way : (f, n, 3) arrays
        Of the energy where it was looked at last, and the step from there.
    """

    def __init__(self, sheet: Sheet, transforms: Floats, middle: Floats) -> None:
        around = sheet.around
        self._sheet = sheet
        self._neighbours, self._contacts = sheet.neighbours, sheet.contacts
        self._near: list[Proximity] = []
        #: Of each bone, what its tissue holds points with: stiffness (f, n, 3, 3) and pull (f, n, 3).
        self._tissue: dict[int, tuple[Floats, Floats]] = {}
        self._ring_bones = [bone for bone, _ in sheet.rings]
        self._moved = np.array(transforms)
        self._moved[:, :3, 3] -= middle
        f, n, _ = sheet.fibres.shape
        held, pull = np.zeros((f, n, 3, 3)), np.zeros((f, n, 3))
        for k, number in enumerate(around.bones):
            turn = self._moved[number, :3, :3]
            stiffness = turn @ around.stiffness[k] @ turn.T
            force = around.force[k] @ turn.T
            home = sheet.fibres @ turn.T + self._moved[number, :3, 3]
            given = np.einsum("fnij,fnj->fni", stiffness, home) + force
            held += stiffness
            pull += given
            self._tissue[number] = stiffness, given
        self._held = np.ascontiguousarray(held.reshape(f, n, 9)[:, :, [0, 1, 2, 4, 5, 8]])
        self._pull = pull
        self._rings: Rings = rings_at(sheet.rings, transforms, middle, sheet.outside)
        self.gradient, self.way = np.zeros((f, n, 3)), np.empty((f, n, 3))
        self._blocks = np.zeros((f, n, 6))
        #: Working memory of :func:`newton_step`.
        self._work = np.empty((f, n, 6)), np.empty((4, f, n, 3)), np.empty((4, 1, n, 6))
        self._directions = np.empty((len(sheet.neighbours.pairs), 2, 3))
        self._pressure = np.zeros((len(sheet.contacts.numbers), f, n))
        self._ring_points = np.zeros((len(sheet.rings), f), dtype=np.int64)
        self._ring_pressure = np.zeros((len(sheet.rings), f, n))

    def hold(self, x: Floats) -> bool:
        """Choose the points that the rings hold; return whether they are others than before."""
        before = self._ring_points.copy()
        hold_in_rings(x, self._rings, self._ring_points)
        return not np.array_equal(before, self._ring_points)

    def look_at(self, x: Floats, push: float) -> None:
        """Compute the gradient of the energy at x (f, n, 3), and its stiffness."""
        gradient, blocks = self.gradient, self._blocks
        self._hold_together(x, gradient, blocks, self._directions)
        gaps, normals, self._near = self._contacts.at(x, self._moved, self._near)
        rounding = self._contacts.rounding
        add_contacts(x, gaps, normals, push, rounding, gradient, blocks, self._pressure)
        points = self._ring_points
        add_rings(x, self._rings, points, push, rounding, gradient, blocks, self._ring_pressure)
        gradient[:, [0, -1]] = 0.0

    def _hold_together(self, x: Floats, gradient: Floats, blocks: Floats, directions: Floats) -> None:
        """Write what springs, tissue and neighbours add to the gradient and its stiffness."""
        add_springs(x, self._held, self._pull, gradient, blocks)
        x_, gradient_, blocks_ = (array.reshape(-1, array.shape[2]) for array in (x, gradient, blocks))
        add_neighbours(x_, gradient_, blocks_, self._neighbours, self._sheet.widths(x), directions)

    def step(self) -> float:
        """Compute the step of Newton's method, ``way``, and return its slope."""
        return self._solve(self.gradient, STEP_LEFT)

    def _solve(self, gradient: Floats, left_over: float) -> float:
        """Write to ``way`` what takes the stiffness from a gradient to nothing, and return its slope."""
        stiffness = self._blocks, self._neighbours, self._directions
        return float(newton_step(gradient, *stiffness, left_over, *self._work, self.way))

    def contacts(self) -> Ints:
        """Return how many points of each path bones and rings press on, (f,)."""
        presses: Ints = ((self._pressure > 0.0).any(axis=0) | (self._ring_pressure > 0.0).any(axis=0)).sum(
            axis=1
        )
        return presses

    def wrenches(self, x: Floats) -> Floats:
        """Return the wrenches of the paths at x, which was looked at last, about its origin."""
        ends = self._sheet.start_bones, self._sheet.end_bones
        moving = sorted({*ends[0].tolist(), *ends[1].tolist(), *self._tissue, *self._ring_bones})

        def change(bone: int, velocity: Floats, turn: Floats, given: Floats) -> Floats:
            return self._change_by_points(x, given) + self._change(x, bone, velocity, turn)

        def response(gradient: Floats) -> Floats:
            return self._response(x, gradient)

        return path_wrenches(x, *ends, moving, len(self._moved), change, response)

    def _response(self, x: Floats, gradient: Floats) -> Floats:
        """Return how the points at x go, so that the gradient changes by minus ``gradient``.

        By generalised conjugate residuals (Eisenstat, Elman, Schultz 1983, doi:10.1137/0720023), whose
        preconditioner is the matrix of Newton's method: that leaves out how tangents and the bones' surfaces
        turn, which the change of the gradient itself knows.
        """
        left, found = gradient.copy(), np.zeros_like(x)
        before: list[tuple[Floats, Floats, float]] = []
        for _ in range(RESPONSES):
            self._solve(left, RESPONSE_LEFT)
            way = self.way.copy()
            change = self._change_by_points(x, way)
            for other, change_by_other, size in before:
                part = float((change * change_by_other).sum()) / size
                way -= part * other
                change -= part * change_by_other
            size = float((change * change).sum())
            if size == 0.0:
                break
            part = -float((left * change).sum()) / size
            found += part * way
            left += part * change
            before.append((way, change, size))
        return found

    def _change_by_points(self, x: Floats, velocity: Floats) -> Floats:
        """Return how the gradient at x changes as the points go with velocities, 0 at the ends.

        A central difference. Where ends go, too: a path that gets longer gets narrower, and one whose end
        turns aside has another tangent, from which its neighbours are at right angles.
        """
        fastest = float(np.abs(velocity).max())
        if fastest == 0.0:
            return np.zeros_like(x)
        part = SMALL_MOVE * self._sheet.thickness / fastest
        after, before = (self._gradient_at(x + way * velocity) for way in (part, -part))
        change: Floats = (after - before) / (2.0 * part)
        return change

    def _gradient_at(self, x: Floats) -> Floats:
        """Return the gradient at points near to those that were looked at last."""
        gradient, blocks = np.zeros_like(x), np.zeros_like(self._blocks)
        self._hold_together(x, gradient, blocks, np.empty_like(self._directions))
        gaps, normals, _ = self._contacts.at(x, self._moved, self._near)
        rounding, points = self._contacts.rounding, self._ring_points
        add_contacts(x, gaps, normals, PUSH, rounding, gradient, blocks, np.empty_like(self._pressure))
        add_rings(
            x, self._rings, points, PUSH, rounding, gradient, blocks, np.empty_like(self._ring_pressure)
        )
        gradient[:, [0, -1]] = 0.0
        return gradient

    def _change(self, x: Floats, bone: int, velocity: Floats, turn: Floats) -> Floats:
        """Return how the gradient at x changes as a bone moves, beside which the ends stay."""
        change = np.zeros_like(x)
        if bone in self._tissue:
            held, given = self._tissue[bone]
            force = given - np.einsum("fnij,fnj->fni", held, x)
            change -= np.einsum("fnij,fnj->fni", held, velocity) + np.cross(turn, force)
        if bone in self._contacts.numbers:
            # The bone's surface curves: its normals where the points will be, seen from the bone.
            k, fastest = self._contacts.numbers.index(bone), float(np.abs(velocity).max())
            part = SMALL_MOVE * self._sheet.thickness / fastest if fastest > 0.0 else 1.0
            after, before = (self._push_of(k, x - way * velocity) for way in (part, -part))
            change -= (after - before) / (2.0 * part) + np.cross(turn, (after + before) / 2.0)
        for ring in np.flatnonzero(np.array(self._ring_bones) == bone):
            loads = x, self._rings, int(ring), self._ring_points[ring], self._ring_pressure[ring], PUSH
            force, held = ring_loads(*loads)
            change -= np.einsum("fnij,fnj->fni", held, velocity) + np.cross(turn, force)
        return change

    def _push_of(self, k: int, x: Floats) -> Floats:
        """Return with what forces a bone presses on points (f, n, 3)."""
        gaps, normals = self._contacts.at_bone(k, x, self._moved, self._near[k])
        pressure = np.zeros((1, *x.shape[:2]))
        add_contacts(
            x, gaps[None], normals[None], PUSH, self._contacts.rounding,
            np.zeros_like(x), np.zeros((*x.shape[:2], 6)), pressure,
        )  # fmt: skip
        force: Floats = pressure[0][..., None] * normals
        return force
