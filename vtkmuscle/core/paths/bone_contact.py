"""Paths kept off bones by a rounded force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.lookup import STEEPEST, Field, least_distance_at, look_at
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.motion.rigid import apply_transform, inverses
from vtkmuscle.core.paths.equilibrium import add_direction
from vtkmuscle.core.types import Bools, Floats, Ints

#: Stiffness of a bone or ring against a point, in stiffnesses of a path's springs. A point on a bone of
#: radius R with points h apart sinks in by h^2 / (R PUSH): 0.01 mm where h is 4 mm and R 16 mm.
PUSH = 100.0

#: The force of a bone begins this far before a path touches it and is fully there as far behind, in segments:
#: a point that comes and goes does so smoothly.
ROUNDING = 0.02

#: A bone's curvature counts fully at a point beside which the bone presses at least this part as hard. With
#: half and twice of it phantoms take 1 % more steps, with 1 4 %; errors are the same.
LEAST_BESIDE = 0.1


#: Places on a segment from which ways to the path before are looked at, and places on a way, as parts.
PLACES, WAY = (np.arange(4) + 0.5) / 4.0, np.linspace(0.0, 1.0, 33)
#: Depth of a way through a bone, as a part of its length inside, at least. Through the middle of a round bone
#: it is a half; real muscles that slide over bones had up to 0.18.
LEAST_DEPTH = 0.25


class Proximity(NamedTuple):
    """Distances of p points from b bones.

    :meth:`BoneContacts.update` changes a proximity in place.

    to_axes : (b, 4, 4), from the scene to the axes of each bone in its pose;
    points : (b, p, 3), positions of the points along the axes of each bone [mm];
    gaps : (b, p), lower bounds of the distances from each bone beyond the standoff [mm];
    normals : (b, p, 3), slopes of the gaps, shorter than 1 in a crease; valid for points near a bone.
    """

    to_axes: Floats
    points: Floats
    gaps: Floats
    normals: Floats


class Seen(NamedTuple):
    """Points and gaps of a :class:`Proximity`, in single precision: every kept pose has them."""

    points: NDArray[np.float32]
    gaps: NDArray[np.float32]

    def renewed(self, now: Seen, chosen: Bools) -> Seen:
        """Return those of now for chosen paths (f,), and these for all others."""
        rows = np.repeat(chosen, self.gaps.shape[1] // len(chosen))
        points = np.where(rows[:, None], now.points, self.points)
        return Seen(points, np.where(rows, now.gaps, self.gaps))


class Load(NamedTuple):
    """The forces of a bone and its tissue. On points.

    force : (f, n, 3), force on each point; the force lowers the gradient of the energy [mm];
    stiffness : (f, n, 3, 3), fall of the force as the point moves [1].
    """

    force: Floats
    stiffness: Floats


class BoneContacts:
    """The pieces of bones that paths keep away from.

    pieces : sequence of (int, Bone), the bone that each piece belongs to, and the piece at rest;
    standoff : (b, f, n), distance that each point of each path keeps from each piece [mm];
    segment : mean distance of points along a path [mm].

    numbers : list of int, number of the bone of each piece;
    rounding : see :data:`ROUNDING` [mm].
    """

    def __init__(self, pieces: Sequence[tuple[int, Bone]], standoff: Floats, segment: float) -> None:
        self.numbers, self._bones = [number for number, _ in pieces], [piece for _, piece in pieces]
        self._pieces, self._segment, self._standoff = pieces, segment, standoff
        self.rounding = ROUNDING * segment
        reaches = (float(kept.max(initial=0.0)) + self.rounding for kept in self._standoff)
        self._fields = [bone.look_up(reach) for bone, reach in zip(self._bones, reaches, strict=True)]

    def of_paths(self, paths: Ints) -> BoneContacts:
        """Return the contacts of some paths."""
        return BoneContacts(self._pieces, self._standoff.take(paths, axis=1), self._segment)

    def proximity(self, transforms: Floats) -> Proximity:
        """Return a proximity in a pose of the bones (b, 4, 4), with no points looked up."""
        axes = np.reshape([bone.axes for bone in self._bones], (-1, 4, 4))
        shape = len(axes), math.prod(self._standoff.shape[1:])
        nothing = np.zeros((*shape, 3)), np.full(shape, -np.inf), np.zeros((*shape, 3))
        return Proximity(axes @ inverses(transforms[self.numbers]), *nothing)

    def update(self, x: Floats, near: Proximity) -> None:
        """Write the gaps of paths x to the bones.

        Paths are (f, n, 3); the bones stay in their pose. Points too far to have come near a bone are not
        looked up: their gaps are lower bounds of what a look-up gives. A point that were near by its look-up
        and far by its bound would not come to rest.
        """
        for k, (bone, field) in enumerate(zip(self._bones, self._fields, strict=True)):
            standoff, (to_axes, *seen) = self._standoff[k].reshape(-1), (part[k] for part in near)
            looked_at = to_axes, x.reshape(-1, 3), standoff, self.rounding, *seen
            while True:
                beyond = _look_up(field, *looked_at)
                if not bone.fill(field):
                    break
            if beyond:
                points, gaps, normals = seen
                far = np.flatnonzero(np.isnan(gaps))
                distance, outward = bone.solids.exact(apply_transform(bone.from_axes, points[far]))
                turn = to_axes[:3, :3].T @ bone.axes[:3, :3]
                gaps[far], normals[far] = distance - standoff[far], outward @ turn.T

    def sags(self, x: Floats, near: Proximity) -> Floats:
        """Return how much nearer to bones the segments of paths x are than their points, (f,) [mm].

        The paths (f, n, 3) have a known proximity. The middle of each segment is compared with the nearer
        end's distance from the bone, up to the distance that is kept; of a path the deepest counts. Straight
        segments of length s round a bone of radius R sag by R - sqrt(R^2 - s^2 / 4), and have levers between
        R and R less the sag.
        """
        f, n, _ = x.shape
        sags, reach = np.zeros((f, n - 1)), 0.5 * np.linalg.norm(x[:, 1:] - x[:, :-1], axis=2)
        gaps, points = near.gaps.reshape(-1, f, n), near.points.reshape(-1, f, n, 3)
        clear = self._standoff + np.minimum(gaps, 0.0)
        # A middle is no deeper than the nearer point's gap and half a segment allow.
        may = np.maximum(gaps[..., 1:], gaps[..., :-1]) < reach
        for k in np.flatnonzero(may.any(axis=(1, 2))):
            bone, (a, i) = self._bones[k], np.nonzero(may[k])
            kept = np.minimum(clear[k, a, i], clear[k, a, i + 1])
            middles = 0.5 * (points[k, a, i] + points[k, a, i + 1])
            distance = bone.field(apply_transform(bone.from_axes, middles), within=kept)[0]
            sags[a, i] = np.maximum(sags[a, i], kept - distance)
        return np.asarray(sags.max(axis=1))

    def passed(self, seen: Seen, now: Seen) -> tuple[Bools, Bools]:
        """Return which paths (f,) have passed through a bone, and which were looked at.

        A path may slip between its points over a thin bone. Then the way from a place on the path to the
        nearest place on the path before leads through the bone, and both places are outside. A path that
        slides along itself has no way to go. A path is looked at where it has moved and is outside of all
        bones. Bones thinner than a quarter of a segment are not seen.
        """
        _, f, n = self._standoff.shape
        passed, looked, within = np.zeros((3, f), dtype=np.bool_)
        may = np.empty((f, n - 1), dtype=np.bool_)
        for k, bone in enumerate(self._bones):
            start, end = (near.points[k].reshape(f, n, 3) for near in (seen, now))
            clear = 2.0 * self._standoff[k] + (seen.gaps[k] + now.gaps[k]).reshape(f, n)
            _find_ways(start, end, clear, self._segment, may)
            a, i = np.nonzero(may)
            if not len(a):
                continue
            places = end[a, i, None] + PLACES[:, None] * (end[a, i + 1] - end[a, i])[:, None]
            ways = nearest_on_lines(places, start[a]) - places
            line = (places[:, :, None] + WAY[:, None] * ways[:, :, None]).reshape(-1, 3)
            distance = bone.field(apply_transform(bone.from_axes, line), within=0.0)[0]
            distance = distance.reshape(len(a), len(PLACES), len(WAY))
            inside = np.linalg.norm(ways, axis=2) * (distance < 0.0).mean(axis=2)
            deep = distance.min(axis=2) < -LEAST_DEPTH * inside
            through = deep & (distance[..., 0] > 0.0) & (distance[..., -1] > 0.0)
            passed[a[through.any(axis=1)]] = True
            within[a[(distance[..., 0] <= 0.0).any(axis=1)]] = True
            looked[a] = True
        return passed, looked & ~within

    def load(self, k: int, near: Proximity, pressure: Floats) -> Load:
        """Return the load of the k-th piece on paths.

        The paths have a known proximity, and the bone has a pressure (f, n) on the paths. Normals are
        compared over a cell of the bone's field: flat triangles curve as the bone's surface does. Over a
        thousandth of a cell a strap on a roller has levers 1 to 4 mm off its radius in 1 or 2 of 100 poses.
        """
        bone, turn = self._bones[k], near.to_axes[k, :3, :3].T @ self._bones[k].axes[:3, :3]
        pressed, shape = np.flatnonzero(pressure), pressure.shape
        moves = bone.cell * np.concatenate([np.eye(3), -np.eye(3)])
        points = apply_transform(bone.from_axes, near.points[k, pressed])
        first, second = bone.field((points + moves[:, None]).reshape(-1, 3))[1].reshape(2, 3, -1, 3) @ turn.T
        normals = near.normals[k, pressed]
        force, gaps = pressure.reshape(-1)[pressed, None], near.gaps[k, pressed, None]
        stiff = PUSH * np.minimum(0.5 - 0.5 * gaps / self.rounding, 1.0)  # as of pressure_at
        turning = (turn @ (first - second).reshape(3, -1)).reshape(3, -1, 3).transpose(1, 2, 0)
        forces, stiffness = np.zeros((*shape, 3)), np.zeros((*shape, 3, 3))
        forces.reshape(-1, 3)[pressed] = force * normals
        pushing = stiff[..., None] * normals[:, :, None] * normals[:, None]
        stiffness.reshape(-1, 3, 3)[pressed] = pushing - (0.5 / bone.cell * force)[..., None] * turning
        return Load(forces, stiffness)


@kernel
def _find_ways(start: Floats, end: Floats, clear: Floats, segment: float, may: Bools) -> None:
    """Write which segments (f, n - 1) of paths may have passed through a bone.

    A point goes across its path from ``start`` to ``end`` (f, n, 3). No bone is in the way within the sum of
    the distances of both from the bone, ``clear`` (f, n); a place is up to half a segment off a point.
    """
    f, n, _ = end.shape
    for a in range(f):
        for i in range(n - 1):
            may[a, i] = False
        for i in range(1, n - 1):
            square, along, length2 = 0.0, 0.0, 0.0
            for c in range(3):
                move, ahead = end[a, i, c] - start[a, i, c], end[a, i + 1, c] - end[a, i - 1, c]
                square, along, length2 = square + move * move, along + move * ahead, length2 + ahead * ahead
            across = math.sqrt(max(square - along * along / length2, 0.0)) if length2 > 0.0 else 0.0
            if across > 0.25 * segment and across + 0.5 * segment > clear[a, i]:
                may[a, i - 1] = may[a, i] = True


def nearest_on_lines(places: Floats, lines: Floats) -> Floats:
    """Return the nearest places on polylines (m, n, 3). Places are (m, k, 3), k for each line."""
    starts, segments = lines[:, None, :-1], np.diff(lines, axis=1)[:, None]
    squares = np.maximum((segments**2).sum(axis=3), np.finfo(float).tiny)
    parts = (((places[:, :, None] - starts) * segments).sum(axis=3) / squares).clip(0.0, 1.0)
    feet = starts + parts[..., None] * segments
    nearest = ((feet - places[:, :, None]) ** 2).sum(axis=3).argmin(axis=2)
    return np.asarray(np.take_along_axis(feet, nearest[..., None, None], axis=2)[:, :, 0])


@kernel
def _look_up(
    field: Field, to_axes: Floats, x: Floats, standoff: Floats, rounding: float, points: Floats, gaps: Floats,
    normals: Floats,
) -> int:  # fmt: skip
    """Do the work of :meth:`BoneContacts.update` for a bone; return the number of points beyond its field.

    x, points, normals : (p, 3), standoff, gaps : (p,). Gaps of unknown nodes, and beyond the field, are NaN.
    """
    beyond = 0
    for p in range(len(x)):
        u, v, w, at, moved = x[p, 0], x[p, 1], x[p, 2], points[p], 0.0
        for c in range(3):
            along = to_axes[c, 0] * u + to_axes[c, 1] * v + to_axes[c, 2] * w + to_axes[c, 3]
            moved, at[c] = moved + (along - at[c]) ** 2, along
        gaps[p] -= STEEPEST * np.sqrt(moved)
        if gaps[p] >= rounding:
            continue
        before, within = field.lacking[0], max(standoff[p] + rounding, 0.0)
        least = least_distance_at(field, at[0], at[1], at[2], within)
        if least > within:
            gaps[p] = least - standoff[p]
            continue
        if field.lacking[0] > before:
            gaps[p] = np.nan
            continue
        distance, u, v, w = look_at(field, at[0], at[1], at[2])
        gaps[p], u, v, w = distance - standoff[p], field.per_mm * u, field.per_mm * v, field.per_mm * w
        for c in range(3):
            normals[p, c] = to_axes[0, c] * u + to_axes[1, c] * v + to_axes[2, c] * w
        if np.isnan(gaps[p]) and field.lacking[0] == before:
            beyond += 1
    return beyond


@kernel
def add_contacts(
    x: Floats, gaps: Floats, normals: Floats, push: float, rounding: float, gradient: Floats, blocks: Floats,
    pressure: Floats,
) -> None:  # fmt: skip
    """Add the bones' forces and write their pressures.

    Pressures are (b, f, n) [mm]. Along the path a bone that curves away makes the springs less stiff, in
    proportion to the bone's pressure: with the reduced stiffness Newton's method lets a sliding point go
    along the bone.
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
                adjacent = min(pressure[k, a, i - 1], pressure[k, a, i + 1])
                if adjacent > 0.0:
                    _bend(x[a], normals[k, a], i, min(force, adjacent / LEAST_BESIDE), blocks[a, i])


@kernel
def pressure_at(gap: float, push: float, rounding: float) -> tuple[float, float]:
    """Return the force at a gap and its stiffness.

    The force is 0 from the rounding on. From the rounding behind the surface on, the force is ``push`` times
    the depth. Between, the force is a parabola, without a corner.
    """
    if gap >= rounding:
        return 0.0, 0.0
    if gap <= -rounding:
        return -push * gap, push
    return push * (rounding - gap) ** 2 / (4.0 * rounding), push * (rounding - gap) / (2.0 * rounding)


@kernel
def _bend(p: Floats, normals: Floats, i: int, force: float, block: Floats) -> None:
    """Reduce a point's stiffness. Along the path, by the bone's curvature."""
    u, v, w = p[i + 1, 0] - p[i - 1, 0], p[i + 1, 1] - p[i - 1, 1], p[i + 1, 2] - p[i - 1, 2]
    length2 = u * u + v * v + w * w
    curve, inward = 0.0, 0.0
    for c in range(3):
        curve += (normals[i + 1, c] - normals[i - 1, c]) * (p[i + 1, c] - p[i - 1, c])
        inward += normals[i, c] * (2.0 * p[i, c] - p[i - 1, c] - p[i + 1, c])
    # No more than the springs press: what else does, in a pose that is not settled, must not turn them round.
    bend = min(force, max(inward, 0.0)) * curve / length2
    bend = min(max(bend, -1.0), 1.0)  # of the two springs' stiffness one is left, at least
    if length2 > 0.0:
        length = np.sqrt(length2)
        add_direction(block, -bend, u / length, v / length, w / length)
