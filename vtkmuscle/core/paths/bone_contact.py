"""Paths kept off bones: how near they are, and the rounded force that keeps them away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.paths.equilibrium import add_direction
from vtkmuscle.core.types import Floats

#: Stiffness of a bone or ring against a point, in stiffnesses of a path's springs. A point on a bone of
#: radius R with points h apart sinks in by h^2 / (R PUSH): 0.01 mm where h is 4 mm and R 16 mm.
PUSH = 100.0

#: Stiffness that the first steps in a new pose begin with: bones that moved into a path push it out gently,
#: ten times harder in each step.
FIRST_PUSH = 10.0

#: The force of a bone begins this far before a path touches it and is fully there as far behind, in segments:
#: a point that comes and goes does so smoothly.
ROUNDING = 0.02

#: A bone's curvature counts fully at a point beside which the bone presses at least this part as hard.
LEAST_BESIDE = 0.1

#: Part of the springs' stiffness that the curvature of a bone may take away, at most.
LARGEST_BEND = 0.5


class Proximity(NamedTuple):
    """How near points are to a bone.

    Attributes
    ----------
    points : (p, 3) array
        Where they are, seen from the bone at rest [mm].
    gaps : (p,) array
        How far from where the bone keeps them, at least [mm].
    outward : (p, 3) array
        In which direction that grows, seen from the bone at rest; where they are near.
    """

    points: Floats
    gaps: Floats
    outward: Floats


class Load(NamedTuple):
    """The forces of a bone, and of the tissue that moves with it, on points.

    Attributes
    ----------
    force : (f, n, 3) array
        On the points; the gradient of their energy is less by it [mm].
    stiffness : (f, n, 3, 3) array
        By how much the force falls as a point moves [1].
    """

    force: Floats
    stiffness: Floats


class BoneContacts:
    """The bones that paths keep away from.

    Parameters
    ----------
    bones : mapping of int to Bone
        By their number, at rest.
    standoff : (b, f, n) array
        How far each point of each path keeps away from each [mm].
    segment : float
        Mean distance of points along a path [mm].

    Attributes
    ----------
    numbers : list of int
        Of the bones.
    rounding : float
        See :data:`ROUNDING` [mm].
    """

    def __init__(self, bones: Mapping[int, Bone], standoff: Floats, segment: float) -> None:
        self.numbers, self._bones = list(bones), list(bones.values())
        self._standoff = standoff
        self.rounding = ROUNDING * segment

    def at(
        self, x: Floats, transforms: Floats, before: Sequence[Proximity] = ()
    ) -> tuple[Floats, Floats, list[Proximity]]:
        """Return the gaps (b, f, n) between paths and bones [mm], and the directions in which they grow.

        Parameters
        ----------
        x : (f, n, 3) array
            Of the paths [mm].
        transforms : (bones, 4, 4) array
            Of all bones, rest to now.
        before : sequence of Proximity, optional
            What was returned for points near to these, in the same pose: of points that cannot have come near
            a bone since, gaps are what they are at least, and directions what they were.

        Returns
        -------
        gaps, normals : arrays
        near : list of Proximity
            Of each bone.
        """
        near = [self._near(k, x, transforms, before[k] if before else None) for k in range(len(self._bones))]
        gaps, normals = np.empty(self._standoff.shape), np.empty((*self._standoff.shape, 3))
        for k, (number, one) in enumerate(zip(self.numbers, near, strict=True)):
            gaps[k] = one.gaps.reshape(x.shape[:2])
            normals[k] = (one.outward @ transforms[number, :3, :3].T).reshape(x.shape)
        return gaps, normals, near

    def load(self, k: int, x: Floats, transforms: Floats, near: Proximity) -> Load:
        """Return the load of the k-th bone, which presses, on points x (f, n, 3) of known proximity.

        Normals are compared over a cell of its field: flat triangles curve as their surface does. Over a
        thousandth of that a strap on a roller has levers 1 to 4 mm off its radius in one or two of 100 poses.
        """
        bone, turn = self._bones[k], transforms[self.numbers[k], :3, :3]
        ends = np.zeros(x.shape[:2], dtype=np.bool_)
        ends[:, [0, -1]] = True
        pressed = np.flatnonzero((near.gaps < self.rounding) & ~ends.reshape(-1))
        moves = bone.cell * np.concatenate([np.eye(3), -np.eye(3)])
        sides = bone.field((near.points[pressed] + moves[:, None]).reshape(-1, 3))[1].reshape(2, 3, -1, 3)
        outward = near.outward[pressed]
        pressures = [pressure_at(gap, PUSH, self.rounding) for gap in near.gaps[pressed]]
        force, stiff = np.array(pressures).T[..., None]
        turning = ((sides[0] - sides[1]) / (2.0 * bone.cell)).transpose(1, 2, 0)
        falls = stiff[..., None] * outward[:, :, None] * outward[:, None] - force[..., None] * turning
        forces, stiffness = np.zeros((x[..., 0].size, 3)), np.zeros((x[..., 0].size, 3, 3))
        forces[pressed], stiffness[pressed] = (force * outward) @ turn.T, turn @ falls @ turn.T
        return Load(forces.reshape(x.shape), stiffness.reshape(*x.shape, 3))

    def _near(self, k: int, x: Floats, transforms: Floats, before: Proximity | None) -> Proximity:
        number, bone = self.numbers[k], self._bones[k]
        at = (x.reshape(-1, 3) - transforms[number, :3, 3]) @ transforms[number, :3, :3]
        standoff = self._standoff[k].reshape(-1)
        within = standoff + self.rounding
        if before is None:
            distance, outward = bone.field(at, within=within)
            return Proximity(at, distance - standoff, outward)
        gaps = before.gaps - np.sqrt(((at - before.points) ** 2).sum(axis=1))
        near = np.flatnonzero(gaps < self.rounding)
        outward = before.outward.copy()
        distance, outward[near] = bone.field(at[near], within=within[near])
        gaps[near] = distance - standoff[near]
        return Proximity(at, gaps, outward)


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
                # Where the bone lets go beside it, a point slides along no curve: that comes in smoothly.
                beside = min(pressure[k, a, i - 1], pressure[k, a, i + 1])
                if beside > 0.0:
                    _bend(x[a], normals[k, a], i, min(force, beside / LEAST_BESIDE), blocks[a, i])


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
    """Reduce a point's stiffness along the path by the curvature of the bone."""
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
