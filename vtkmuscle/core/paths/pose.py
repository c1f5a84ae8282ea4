"""A sheet of paths in one pose of the bones: what acts on its points, and what they do to the bones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.paths.bone_contact import BoneContacts, Load, Proximity, add_contacts
from vtkmuscle.core.paths.change_of_gradient import change_gradient
from vtkmuscle.core.paths.equilibrium import (
    STEP_LEFT,
    add_neighbours,
    add_springs,
    newton_step,
    prepare_solve,
)
from vtkmuscle.core.paths.neighbours import Neighbours, path_widths, widening
from vtkmuscle.core.paths.ring_contact import Rings, add_rings, hold_in_rings, ring_load, rings_at
from vtkmuscle.core.paths.surroundings import Surroundings
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.paths.wrenches import path_wrenches
from vtkmuscle.core.types import Floats, Ints

#: How far a bone or a point is moved to see how the forces change, in thicknesses of the muscle.
SMALL_MOVE = 1e-4


class Sheet(NamedTuple):
    """A muscle's paths at rest, and the bones, tissue and neighbours that hold them.

    Attributes
    ----------
    fibres : (f, n, 3) array
        Points at rest [mm].
    start_bones, end_bones : (f,) int arrays
        Which bones the ends are fixed to.
    thickness : float
        Of the muscle [mm].
    lengths : (f,) array
        Of the paths at rest [mm].
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
    lengths: Floats
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
        self._sheet, self._middle = sheet, middle
        self._x = sheet.fibres
        self._neighbours, self._contacts = sheet.neighbours, sheet.contacts
        self._near: list[Proximity] = []
        #: Of each bone, what its tissue holds points with: stiffness (f, n, 3, 3) and pull (f, n, 3).
        self._tissue: dict[int, tuple[Floats, Floats]] = {}
        self._ring_bones = [bone for bone, _ in sheet.rings]
        self._moved = np.array(transforms)
        self._moved[:, :3, 3] -= middle
        f, n, _ = sheet.fibres.shape
        held, self._pull = np.zeros((f, n, 3, 3)), np.zeros((f, n, 3))
        for k, number in enumerate(around.bones):
            turn = self._moved[number, :3, :3]
            stiffness = turn @ around.stiffness[k] @ turn.T
            force = around.force[k] @ turn.T
            home = sheet.fibres @ turn.T + self._moved[number, :3, 3]
            given = np.einsum("fnij,fnj->fni", stiffness, home) + force
            held += stiffness
            self._pull += given
            self._tissue[number] = stiffness, given
        self._held = np.ascontiguousarray(held.reshape(f, n, 9)[:, :, [0, 1, 2, 4, 5, 8]])
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
        self._x, gradient, blocks = x, self.gradient, self._blocks
        add_springs(x, self._held, self._pull, gradient, blocks)
        x_, gradient_, blocks_ = (array.reshape(-1, array.shape[2]) for array in (x, gradient, blocks))
        widths = path_widths(x, self._sheet.lengths)
        add_neighbours(x_, gradient_, blocks_, self._neighbours, widths, self._directions)
        gaps, normals, self._near = self._contacts.at(x, self._moved, self._near)
        rounding = self._contacts.rounding
        add_contacts(x, gaps, normals, push, rounding, gradient, blocks, self._pressure)
        add_rings(x, self._rings, self._ring_points, push, rounding, gradient, blocks, self._ring_pressure)
        gradient[:, [0, -1]] = 0.0

    def step(self) -> float:
        """Compute the step of Newton's method, ``way``, and return its slope."""
        self._prepare_solve(as_one=False)
        return self._solve(self.gradient, as_one=False)

    def _prepare_solve(self, *, as_one: bool) -> None:
        inverses, _, sheet = self._work
        prepare_solve(self._blocks, self._neighbours, self._directions, as_one, inverses, sheet)

    def _solve(self, gradient: Floats, *, as_one: bool) -> float:
        """Write to ``way`` the step that brings a gradient to zero, and return its slope."""
        stiffness = self._blocks, self._neighbours, self._directions
        return float(newton_step(gradient, *stiffness, as_one, STEP_LEFT, *self._work, self.way))

    def contacts(self) -> Ints:
        """Return how many points of each path bones and rings press on, (f,)."""
        pressed = (self._pressure > 0.0).any(axis=0) | (self._ring_pressure > 0.0).any(axis=0)
        n_pressed: Ints = np.count_nonzero(pressed, axis=1)
        return n_pressed

    def squeezed(self) -> Floats:
        """Return by how much two bones that press on a path from opposite sides sink into it, (f,) [mm].

        That is the room that it lacks between them, at the point where it lacks most.
        """
        f, n, _ = self._x.shape
        lacking = np.zeros((f, n))
        pressing = [
            (
                pressure > 0.0,
                np.maximum(-near.gaps, 0.0).reshape(f, n),
                near.outward @ self._moved[number, :3, :3].T,
            )
            for number, pressure, near in zip(self._contacts.numbers, self._pressure, self._near, strict=True)
        ]
        for one, other in combinations(pressing, 2):
            against = -np.einsum("pi,pi->p", one[2], other[2]).reshape(f, n)
            np.maximum(lacking, against * (one[1] + other[1]), out=lacking, where=one[0] & other[0])
        most: Floats = lacking.max(axis=1)
        return most

    @property
    def points(self) -> Floats:
        """Points that were looked at last, (f, n, 3) [mm]."""
        return self._x + self._middle

    def wrenches(self) -> Floats:
        """Return the wrenches of the paths that were looked at last, about the origin, (f, b, 6)."""
        x, sheet, loads = self._x, self._sheet, self._loads()
        held = sum((load.stiffness for load in loads.values()), np.zeros((*x.shape, 3)))
        widths = path_widths(x, sheet.lengths), widening(x, sheet.lengths)
        self._prepare_solve(as_one=True)

        def change(velocity: Floats) -> Floats:
            wider, result = np.empty((len(x), velocity.shape[3])), np.empty_like(velocity)
            turning = np.empty_like(velocity)
            change_gradient(x, velocity, held, self._neighbours, *widths, wider, turning, result)
            return result

        def step(gradients: Floats) -> Floats:
            result = np.empty_like(gradients)
            for way in range(gradients.shape[3]):
                self._solve(np.ascontiguousarray(gradients[..., way]), as_one=True)
                result[..., way] = self.way
            return result

        ends = sheet.start_bones, sheet.end_bones
        wrenches = path_wrenches(x, *ends, loads, len(self._moved), change, step)
        wrenches[:, :, 3:] += np.cross(self._middle, wrenches[:, :, :3])
        return wrenches

    def _loads(self) -> dict[int, Load]:
        """Return the loads of the bones on the points."""
        x = self._x
        loads = [
            (number, Load(given - np.einsum("fnij,fnj->fni", held, x), held))
            for number, (held, given) in self._tissue.items()
        ]
        contacts, move = self._contacts, SMALL_MOVE * self._sheet.thickness
        for k, number in enumerate(contacts.numbers):
            if self._pressure[k].any():
                loads.append((number, contacts.load(k, x, self._moved, self._near[k])))
        for k, number in enumerate(self._ring_bones):
            if (points := self._ring_points[k]).any():
                loads.append((number, ring_load(x, self._rings, k, points, contacts.rounding, move)))
        together: dict[int, Load] = {}
        for number, load in loads:
            both = [one for one in (together.get(number), load) if one is not None]
            together[number] = Load(*(sum(parts) for parts in zip(*both, strict=True)))
        return together
