"""Jumps of lengths over time: what a smooth curve does not explain."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints

#: Steps on either side that a step is compared with.
BESIDE = 3
#: The fewest steps to compare with: a line through two has nothing to say of a third.
FEWEST_STEPS = 3
#: A muscle that lifts off a bone changes its moment arm by half, say, from one step to the next; a line
#: through the steps beside is off by half of that then: so much of a step is no jump.
KINK = 0.25
#: The bones go on evenly where a step's velocity differs from the last one's by less than this part of it.
UNEVEN = 0.5


def length_jumps(
    lengths: Floats, times: Floats, stretches: Ints | None = None, turns: Floats | None = None
) -> Floats:
    """Return how far each step of each length is off those beside it, (f - 1, k) [mm].

    A line is fitted to the velocities of up to three steps on either side, by medians (Theil 1950; Sen 1968,
    doi:10.1080/01621459.1968.10480934), so that a jump beside does not count. A quarter of the steps' size is
    allowed, for a muscle that lifts off; and (3 a)^2 / 2 of the largest step beside, where bones turn by a
    radians in a step: a moment arm that goes as a cosine bends as much. Where there are too few steps to
    compare with, the result is 0.

    Parameters
    ----------
    lengths : (f, k) array
        Per frame [mm].
    times : (f,) array
        Ascending.
    stretches : (f - 1,) int array, optional
        Numbers of the stretches of :func:`even_stretches`; only steps of one stretch are compared. Default:
        all are one.
    turns : (f - 1,) array, optional
        Turns of the bones in each step [rad], see :func:`largest_turns`. Default: none.
    """
    count = max(len(lengths) - 1, 0)
    jumps = np.zeros((count, lengths.shape[1]))
    if count <= FEWEST_STEPS:
        return jumps
    durations, middles = np.diff(times), (times[1:] + times[:-1]) / 2.0
    steps = np.diff(lengths, axis=0)
    velocities = steps / durations[:, None]
    of = np.zeros(count, dtype=np.int64) if stretches is None else stretches
    for i in range(count):
        beside = np.array([j for j in range(i - BESIDE, i + BESIDE + 1) if 0 <= j < count and j != i])
        beside = beside[of[beside] == of[i]]
        if len(beside) < FEWEST_STEPS:
            continue
        expected = _on_line(middles[beside] - middles[i], velocities[beside])
        speeds = np.abs(velocities[beside])
        allowed = KINK * np.median(speeds, axis=0)
        if turns is not None:
            allowed += min(1.0, 0.5 * (BESIDE * turns[i]) ** 2) * speeds.max(axis=0)
        jumps[i] = np.maximum(np.abs(velocities[i] - expected) - allowed, 0.0) * durations[i]
    return jumps


def _on_line(x: Floats, values: Floats) -> Floats:
    """Return the value (k,) at 0 of lines through values (n, k) at places (n,), by medians."""
    pairs = combinations(range(len(x)), 2)
    slopes = np.median([(values[b] - values[a]) / (x[b] - x[a]) for a, b in pairs], axis=0)
    at_zero: Floats = np.median(values - x[:, None] * slopes, axis=0)
    return at_zero


def even_stretches(motion: RigidMotion) -> Ints:
    """Return the number of the stretch of even motion that each step belongs to, (k - 1,).

    A sweep that turns back, or another joint that begins to move, begins a new one.
    """
    durations = np.diff(motion.times)
    if not len(durations):
        return np.zeros(0, dtype=np.int64)
    begins = np.zeros(len(durations), dtype=np.bool_)
    for bone, table in motion.transforms.items():
        centre = motion.centre_of(bone)
        rotations = Rotation.from_matrix(table[:, :3, :3].copy())
        turned = (rotations[1:] * rotations[:-1].inv()).as_rotvec()
        shifted = np.diff(table[:, :3, :3] @ centre + table[:, :3, 3], axis=0)
        for moved in (turned, shifted):
            velocities = moved / durations[:, None]
            sizes = np.linalg.norm(velocities, axis=1)
            # What is small against the motion as a whole, rounding of a table say, is no motion.
            least = 0.02 * sizes.max()
            change = np.linalg.norm(np.diff(velocities, axis=0), axis=1)
            begins[1:] |= change > UNEVEN * np.maximum(sizes[1:], sizes[:-1]) + least
    return np.cumsum(begins)


def largest_turns(motion: RigidMotion) -> Floats:
    """Return the turn of the bone that turns most in each step, (k - 1,) [rad]."""
    turns = np.zeros(max(len(motion.times) - 1, 0))
    for table in motion.transforms.values():
        rotations = Rotation.from_matrix(table[:, :3, :3].copy())
        turns = np.maximum(turns, (rotations[1:] * rotations[:-1].inv()).magnitude())
    return turns
