"""Paths kept off bones: how near they are, and the rounded force that keeps them away."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.solids import FAR, Solids
from vtkmuscle.core.paths.equilibrium import add_direction
from vtkmuscle.core.taut.bone_fields import BoneFields, field_at, slope_at
from vtkmuscle.core.types import Floats, Ints, Table

#: Stiffness of a bone or ring against a point, in stiffnesses of a path's springs. A point on a bone of radius
#: R with points h apart sinks in by h^2 / (R PUSH): 0.01 mm where h is 4 mm and R 16 mm.
PUSH = 100.0

#: Stiffness that the first steps in a new pose begin with: bones that moved into a path push it out gently, ten
#: times harder in each step.
FIRST_PUSH = 10.0

#: The force of a bone begins this far before a path touches it and is fully there as far behind, in segments:
#: a point that comes and goes does so smoothly.
ROUNDING = 0.02

#: Part of the springs' stiffness that the curvature of a bone may take away, at most.
LARGEST_BEND = 0.5

#: Cells of the bones' distance fields per segment of a path.
CELLS_PER_SEGMENT = 2.0

_MISSING = 4096


class BoneContacts:
    """The bones that paths keep away from.

    Parameters
    ----------
    bones : mapping of int to (Solids, axes (4, 4))
        By their number, at rest, with the axes that their distance fields are laid along.
    standoff : (b, f, n) array
        How far each point of each path keeps away from each [mm].
    segment : float
        Mean distance of points along a path [mm].
    """

    def __init__(
        self, bones: Mapping[int, tuple[Solids, Floats]], standoff: Floats, segment: float
    ) -> None:
        self.numbers = list(bones)
        self._standoff = standoff
        self.rounding = ROUNDING * segment
        cell = segment / CELLS_PER_SEGMENT
        reach = [float(most) + 2.0 * cell for most in standoff.max(axis=(1, 2), initial=0.0)]
        self._fields = BoneFields(list(bones.values()), cell=cell, reach=reach)

    def at(self, x: Floats, transforms: Floats) -> tuple[Floats, Floats]:
        """Return the gaps (b, f, n) between paths and bones [mm], and the directions in which they grow.

        Parameters
        ----------
        x : (f, n, 3) array
            Of the paths [mm].
        transforms : (bones, 4, 4) array
            Of all bones, rest to now.
        """
        gaps, normals = np.empty(self._standoff.shape), np.zeros((*self._standoff.shape, 3))
        fields, missing = self._fields, np.zeros(_MISSING, dtype=np.int64)
        for k, number in enumerate(self.numbers):
            turn, shift = transforms[number, :3, :3], transforms[number, :3, 3]
            rest = (x.reshape(-1, 3) - shift) @ turn
            distance, direction = np.empty(len(rest)), np.zeros((len(rest), 3))
            near = self._standoff[k].reshape(-1) + self.rounding
            while True:
                lacking = _look_up(
                    rest, near, fields.to_axes[k], fields.layout[k], fields.table, fields.values,
                    distance, direction, missing,
                )  # fmt: skip
                if not lacking:
                    break
                fields.fill(missing[:lacking])
            gaps[k] = (distance - self._standoff[k].reshape(-1)).reshape(x.shape[:2])
            normals[k] = (direction @ turn.T).reshape(x.shape)
        return gaps, normals


@kernel
def _look_up(
    points: Floats,
    near: Floats,
    to_axes: Floats,
    layout: Floats,
    table: Table,
    values: Floats,
    distance: Floats,
    direction: Floats,
    missing: Ints,
) -> int:
    """Write distances, and directions where they are below ``near``; return how many blocks are missing."""
    found = 0
    for i in range(len(points)):
        p, q, r = points[i, 0], points[i, 1], points[i, 2]
        x = to_axes[0, 0] * p + to_axes[0, 1] * q + to_axes[0, 2] * r + to_axes[0, 3]
        y = to_axes[1, 0] * p + to_axes[1, 1] * q + to_axes[1, 2] * r + to_axes[1, 3]
        z = to_axes[2, 0] * p + to_axes[2, 1] * q + to_axes[2, 2] * r + to_axes[2, 3]
        distance[i], lack = field_at(layout, table, values, x, y, z)
        if lack < 0 and distance[i] < near[i] and distance[i] != FAR:
            out = direction[i]
            lack = slope_at(layout, table, values, x, y, z, out)
            x, y, z = out[0], out[1], out[2]
            for c in range(3):
                out[c] = to_axes[0, c] * x + to_axes[1, c] * y + to_axes[2, c] * z
        if lack >= 0:
            if found < len(missing):
                missing[found] = lack
            found += 1
    return min(found, len(missing))


@kernel
def add_contacts(
    x: Floats,
    gaps: Floats,
    normals: Floats,
    push: float,
    rounding: float,
    gradient: Floats,
    blocks: Floats,
    pressure: Floats,
) -> None:
    """Add the bones' forces, and write how hard they press, (b, f, n) [mm].

    Along the path a bone that curves away makes the springs less stiff, by as much as they
    press on it: with that Newton's method knows that a point that slides goes along the bone.
    """
    b, f, n = gaps.shape
    for k in range(b):
        for a in range(f):
            pressure[k, a, 0] = pressure[k, a, n - 1] = 0.0
            for i in range(1, n - 1):
                pressure[k, a, i] = pressure_at(gaps[k, a, i], push, rounding)[0]
        for a in range(f):
            for i in range(1, n - 1):
                force = pressure[k, a, i]
                if force == 0.0:
                    continue
                u, v, w = normals[k, a, i, 0], normals[k, a, i, 1], normals[k, a, i, 2]
                gradient[a, i, 0] -= force * u
                gradient[a, i, 1] -= force * v
                gradient[a, i, 2] -= force * w
                stiff = pressure_at(gaps[k, a, i], push, rounding)[1]
                add_direction(blocks[a, i], stiff, u, v, w)
                if pressure[k, a, i - 1] > 0.0 and pressure[k, a, i + 1] > 0.0:
                    _bend(x[a], normals[k, a], i, force, blocks[a, i])


@kernel
def pressure_at(gap: float, push: float, rounding: float) -> tuple[float, float]:
    """Return the force at a gap and its stiffness.

    The force is 0 from the rounding on, ``push`` times the depth from as far behind on, and a parabola
    between: it has no corner.
    """
    if gap >= rounding:
        return 0.0, 0.0
    if gap <= -rounding:
        return -push * gap, push
    return push * (rounding - gap) ** 2 / (4.0 * rounding), push * (rounding - gap) / (2.0 * rounding)


@kernel
def _bend(p: Floats, normals: Floats, i: int, force: float, block: Floats) -> None:
    """Take from a point's stiffness along the path what the bone's curvature takes away."""
    u, v, w = p[i + 1, 0] - p[i - 1, 0], p[i + 1, 1] - p[i - 1, 1], p[i + 1, 2] - p[i - 1, 2]
    length2 = u * u + v * v + w * w
    curve = (
        (normals[i + 1, 0] - normals[i - 1, 0]) * u
        + (normals[i + 1, 1] - normals[i - 1, 1]) * v
        + (normals[i + 1, 2] - normals[i - 1, 2]) * w
    )
    inward = 0.0
    for c in range(3):
        inward += normals[i, c] * (2.0 * p[i, c] - p[i - 1, c] - p[i + 1, c])
    # No more than the springs press: what else does, in a pose that is not settled, must not turn them round.
    bend = min(force, max(inward, 0.0)) * curve / length2
    bend = min(max(bend, -LARGEST_BEND), LARGEST_BEND)
    if length2 > 0.0:
        length = np.sqrt(length2)
        add_direction(block, -bend, u / length, v / length, w / length)
