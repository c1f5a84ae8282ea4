"""Moment arms of paths: the levers of their pulls about the axis of a coordinate, in every pose.

A path of unit tension pulls on the bones that it is fixed to, presses on or passes through. Where a
coordinate q moves bone b by the twist s_b per unit, the pull does the work sum_b w_b . s_b, w_b its wrench on
that bone; and since a taut path does no other work than to shorten, that is -dl/dq (principle of virtual
work; An et al. 1984, doi:10.1115/1.3138494; for any coordinate Sherman, Seth, Delp 2013,
doi:10.1115/DETC2013-13633). It takes the pose alone, no motion about it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vtkmuscle.core.motion.blending import screws
from vtkmuscle.core.motion.rigid import RigidMotion, inverses
from vtkmuscle.core.types import Bools, Floats, Ints

#: Values of a coordinate that differ by less than this part of its range are the same one.
SAME_VALUE = 1e-6


@dataclass(frozen=True, eq=False)
class Differences:
    """The poses and weights from which slopes by a coordinate are taken, for m poses.

    The slope is that of the parabola through a pose and two others: one on either side where there are some,
    else the next two on the same side. Where there is one other pose only, it is that of the line.

    Attributes
    ----------
    frames : (m,) int array
        Numbers of the poses, ascending.
    beside : (m, 2) int array
        Numbers of the two others.
    weights : (m, 2) array
        Of their differences from the pose, per unit of the coordinate [1 / rad or 1 / mm].
    """

    frames: Ints
    beside: Ints
    weights: Floats

    def slopes(self, values: Floats) -> Floats:
        """Return the slopes (m, ...) of values (f, ...) in all f poses."""
        return self.of(values[self.beside] - values[self.frames][:, None])

    def of(self, differences: Floats) -> Floats:
        """Return the slopes (m, ...) of differences (m, 2, ...) between the two others and each pose."""
        found: Floats = np.einsum("md,md...->m...", self.weights, differences)
        return found


def differences_by(motion: RigidMotion, name: str, among: Sequence[str] = ()) -> Differences:
    """Return how slopes by a coordinate are taken in all poses from which others differ in it alone.

    ``among`` names the coordinates that have to be the same, by default all others of the motion. Where none
    of them changes, and the joint is not known, the poses are those of :func:`frames_of_sweep`.
    """
    known = motion.coordinates
    others = [one for one in (among or known) if one != name and known[one].changes]
    used = np.arange(len(motion.times))
    if not others and known[name].twists is None:
        used = np.flatnonzero(frames_of_sweep(motion, name))
    own = _numbered(known[name].values)
    groups = np.array([own * 0, *(_numbered(known[one].values) for one in others)]).T
    q = known[name].natural
    frames, beside, weights = [], [], []
    _, group = np.unique(groups, axis=0, return_inverse=True)
    order = used[np.lexsort((own[used], group.reshape(-1)[used]))]
    for mine in np.split(order, np.flatnonzero(np.diff(group.reshape(-1)[order])) + 1):
        places, first = np.unique(own[mine], return_index=True)
        alike = np.split(mine, first[1:])
        for place, poses in enumerate(alike):
            near = _beside(place, len(places))
            for frame in poses:
                two = [int(alike[one][np.abs(alike[one] - frame).argmin()]) for one in near]
                if not two:
                    continue
                steps = [float(q[one] - q[frame]) for one in two]
                frames.append(int(frame))
                beside.append([two[0], two[-1]])
                weights.append(_weights(steps))
    ascending = np.argsort(frames)
    return Differences(
        np.array(frames, dtype=np.int64)[ascending],
        np.array(beside, dtype=np.int64).reshape(-1, 2)[ascending],
        np.array(weights, dtype=np.float64).reshape(-1, 2)[ascending],
    )


def _numbered(values: Floats) -> Ints:
    """Return the number of each value among the different ones, ascending."""
    order = np.argsort(values, kind="stable")
    apart = np.diff(values[order]) > SAME_VALUE * max(float(np.ptp(values)), np.finfo(float).tiny)
    numbers = np.empty(len(values), dtype=np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(apart)])
    return numbers


def _beside(place: int, count: int) -> list[int]:
    """Return the positions of the one or two values, of ``count`` in a row, from which a slope is taken."""
    if 0 < place < count - 1:
        return [place - 1, place + 1]
    inward = (1, 2) if place == 0 else (-1, -2)
    return [place + step for step in inward if 0 <= place + step < count]


def _weights(steps: list[float]) -> tuple[float, float]:
    if len(steps) == 1:
        return 1.0 / steps[0], 0.0
    a, b = steps
    return b / (a * (b - a)), -a / (b * (b - a))


def levers(wrenches: Mapping[str, Floats], twists: Mapping[str, Floats]) -> Floats:
    """Return the moment arms (f, k) of k paths by a coordinate [mm by an angle, 1 by a slide].

    They are positive where the pull drives the coordinate up.

    Parameters
    ----------
    wrenches : mapping of str to (f, k, 6) array
        On each bone in each pose: force [1] and moment about the origin [mm] of paths of unit tension.
    twists : mapping of str to (f, 6) array
        Of each bone that moves: velocity at the origin and angular velocity, per unit of the coordinate.
    """
    shape = next(iter(wrenches.values())).shape[:2]
    parts = (np.einsum("fki,fi->fk", wrenches[bone], one) for bone, one in twists.items() if bone in wrenches)
    return sum(parts, np.zeros(shape))


def twists_by(motion: RigidMotion, name: str, among: Sequence[str] = ()) -> tuple[Ints, dict[str, Floats]]:
    """Return how a coordinate moves the bones, the others held: frames (m,), and twists (m, 6) by bone.

    Where the joint is known, that is exact and in every frame; else it is by the screws to the poses that
    differ in the coordinate alone, which there may be none of. Parameters as of :func:`differences_by`.
    """
    known = motion.coordinates[name].twists
    if known is not None:
        return np.arange(len(motion.times)), dict(known)
    near = differences_by(motion, name, among)
    return near.frames, {bone: _by_screws(table, near) for bone, table in motion.transforms.items()}


def _by_screws(table: Floats, near: Differences) -> Floats:
    """Return the twist (m, 6) of a bone from its transforms (f, 4, 4)."""
    back = inverses(table[near.frames])
    ways = (screws(table[near.beside[:, side]] @ back) for side in range(2))
    return near.of(np.stack(list(ways), axis=1))


#: Two poses of the same value are the same pose up to this rotation of a bone [degrees], and up to this part
#: of the rotation from one frame to the next, for between frames poses are interpolated.
SAME_POSE = 1.0
SAME_POSE_PART = 0.1


def frames_of_sweep(motion: RigidMotion, coordinate: str) -> Bools:
    """Return the frames (k,), one stretch, in which a coordinate alone decides the rotation of the bones.

    A motion may begin with a way from rest to the start of the sweep, on which other things move as well:
    there a change of length is not by the coordinate alone. Such frames are left out at the beginning, or at
    the end where that leaves more.
    """
    values = motion.coordinates[coordinate].values
    start, end = 0, len(values)
    for table in motion.transforms.values():
        rotations = Rotation.from_matrix(table[:, :3, :3].copy())
        for first, second in _conflicts(values, rotations):
            start, end = max(start, first + 1), min(end, second)
    kept = np.zeros(len(values), dtype=np.bool_)
    kept[slice(start, None) if len(values) - start >= end else slice(0, end)] = True
    return kept


def _conflicts(values: Floats, rotations: Rotation) -> list[tuple[int, int]]:
    """Return pairs of frames, the earlier first, of which only one can belong to the sweep."""
    order = np.argsort(values, kind="stable")
    ascending = values[order]
    found = []
    for i in range(len(values) - 1):
        low, high = sorted(values[i : i + 2])
        between = order[np.searchsorted(ascending, low, "left") : np.searchsorted(ascending, high, "right")]
        between = between[(between != i) & (between != i + 1)]
        step = float((rotations[i].inv() * rotations[i + 1]).magnitude())
        allowed = np.radians(SAME_POSE) + SAME_POSE_PART * step
        if low == high:
            if step > allowed:
                found.append((i, i + 1))
            there = rotations[[i] * len(between)]
        elif len(between):
            parts = (values[between] - values[i]) / (values[i + 1] - values[i])
            there = Slerp([0.0, 1.0], rotations[i : i + 2])(parts)
        if len(between):
            apart = (there.inv() * rotations[between]).magnitude() > allowed
            found += [(min(i, int(j)), max(i + 1, int(j))) for j in between[apart]]
    return found
