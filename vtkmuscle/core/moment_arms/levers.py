"""How a coordinate alone moves the bones: by the twists of a known joint, or from the poses of a motion.

The lever of a path about the axis of a coordinate q is -dl/dq (An et al. 1984, doi:10.1115/1.3138494; for any
coordinate Sherman, Seth, Delp 2013, doi:10.1115/DETC2013-13633). It takes the pose and the bones' twists per
unit of q, no motion about it.
"""

from __future__ import annotations

from collections.abc import Sequence
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


class MotionTwists:
    """How the coordinates of a motion move its bones at any time, each alone.

    Parameters
    ----------
    motion : RigidMotion
        Those of its coordinates count that change, or whose joint is known.
    """

    def __init__(self, motion: RigidMotion) -> None:
        self._times = motion.times
        names = [name for name, one in motion.coordinates.items() if one.changes or one.twists]
        self._known = {name: twists_by(motion, name, names) for name in names}

    def at(self, time: float) -> dict[str, dict[str, Floats]]:
        """Return the twist (6,) of each bone by each coordinate that is known at a time."""
        found = {}
        for name, (frames, twists) in self._known.items():
            place = place_among(frames, self._times, time)
            if place is not None:
                a, b, part = place
                found[name] = {bone: (1.0 - part) * one[a] + part * one[b] for bone, one in twists.items()}
        return found


def place_among(frames: Ints, times: Floats, time: float) -> tuple[int, int, float] | None:
    """Return where a time is among some frames (m,) of some times (f,), None where the next are not of them.

    That is the number among them of the frame before and of the one after, and the part of the way between.
    """
    after = int(np.clip(np.searchsorted(times, time), 0, len(times) - 1))
    before = after if times[after] <= time or after == 0 else after - 1
    if not np.isin([before, after], frames).all():
        return None
    a, b = np.searchsorted(frames, [before, after]).tolist()
    return a, b, float((time - times[before]) / (times[after] - times[before])) if before < after else 0.0


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
