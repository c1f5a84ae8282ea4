"""Slopes by one coordinate from the poses beside each pose that differ from it in nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.motion.sweeps import frames_of_sweep
from vtkmuscle.core.types import Floats, Ints

#: Values of a coordinate that differ by less than this part of its range are the same one.
SAME_VALUE = 1e-6


@dataclass(frozen=True, eq=False)
class Differences:
    """What the slope of anything by a coordinate is taken from, in each of some poses.

    The parabola through a pose and two beside it: one on either side where there are some, else the two next
    on the same side; the line to the only other one where there are no two.

    Attributes
    ----------
    frames : (m,) int array
        Numbers of the poses, ascending.
    beside : (m, 2) int array
        Numbers of those beside each.
    weights : (m, 2) array
        Of their differences from the pose, per unit of the coordinate [1 / rad or 1 / mm].
    """

    frames: Ints
    beside: Ints
    weights: Floats

    def slopes(self, values: Floats) -> Floats:
        """Return the slopes (m, ...) of values (f, ...) that are known in all poses."""
        return self.of(values[self.beside] - values[self.frames][:, None])

    def of(self, differences: Floats) -> Floats:
        """Return the slopes (m, ...) of differences (m, 2, ...) of the poses beside from each pose."""
        found: Floats = np.einsum("md,md...->m...", self.weights, differences)
        return found


def differences_by(motion: RigidMotion, name: str, among: Sequence[str] = ()) -> Differences:
    """Return how slopes by a coordinate are taken, in all poses that others differ from in it alone.

    Parameters
    ----------
    motion : RigidMotion
        With the coordinate.
    name : str
        Its name.
    among : sequence of str, optional
        Coordinates that have to be the same; default all others of the motion. Where none of them changes and
        it is not known how the coordinate moves bones, the poses are those of its sweep,
        :func:`~vtkmuscle.core.motion.sweeps.frames_of_sweep`.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.differences import differences_by
    >>> from vtkmuscle.core.motion.rigid import hinge
    >>> knee = hinge("tibia", (0, 0, 0), (1, 0, 0), [0, 10, 30], coordinate="knee")
    >>> differences_by(knee, "knee").slopes(np.radians(knee.times) ** 2).round(3)  # 2 q
    array([0.   , 0.349, 1.047])
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
    """Return the number of each value among those that differ, from the least on."""
    order = np.argsort(values, kind="stable")
    apart = np.diff(values[order]) > SAME_VALUE * max(float(np.ptp(values)), np.finfo(float).tiny)
    numbers = np.empty(len(values), dtype=np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(apart)])
    return numbers


def _beside(place: int, count: int) -> list[int]:
    """Return the places of the one or two values that a slope is taken from, of so many in a row."""
    if 0 < place < count - 1:
        return [place - 1, place + 1]
    inward = (1, 2) if place == 0 else (-1, -2)
    return [place + step for step in inward if 0 <= place + step < count]


def _weights(steps: list[float]) -> tuple[float, float]:
    if len(steps) == 1:
        return 1.0 / steps[0], 0.0
    a, b = steps
    return b / (a * (b - a)), -a / (b * (b - a))
