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
    """Return the deviation of each step of each length from the extrapolation of its neighbours.

    A line is fitted to the velocities of up to three steps on either side, by medians (Theil 1950, Sen
    1968), so that a jump beside does not count; a quarter of the steps' size is allowed for a muscle that
    lifts off. Where bones turn far from frame to frame, a moment arm that goes as a cosine bends as much as a
    jump would: (3 a)^2 / 2 of the largest step beside is allowed for steps of a radians.

    Parameters
    ----------
    lengths : (f, k) array
        Per frame [mm].
    times : (f,) array
        Ascending.
    stretches : (f - 1,) int array, optional
        Number of the stretch that a step belongs to, within which the bones move evenly; steps of other
        stretches are not compared with. Default: one for all.
    turns : (f - 1,) array, optional
        By how much bones turn in each step [rad], see :func:`largest_turns`. Default: hardly.

    Returns
    -------
    (f - 1, k) array
        From each frame to the next [mm], >= 0; 0 where there are too few steps to compare with.

    References
    ----------
    Sen 1968, *Estimates of the regression coefficient based on Kendall's tau*,
    doi:10.1080/01621459.1968.10480934.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.length_jumps import length_jumps
    >>> times = np.arange(9.0)
    >>> lengths = 100.0 + times**2 + np.where(times > 4, 5.0, 0.0)
    >>> length_jumps(lengths[:, None], times).round()[:, 0]
    array([0., 0., 0., 0., 3., 0., 0., 0.])
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
    """Return the stretch of even motion that each step of a motion belongs to, (k - 1,).

    A sweep that turns back, or another joint that begins to move, begins a new one.

    Parameters
    ----------
    motion : RigidMotion
        Of k times.
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
    """Return by how much the bone that turns most turns in each step of a motion, (k - 1,) [rad]."""
    turns = np.zeros(max(len(motion.times) - 1, 0))
    for table in motion.transforms.values():
        rotations = Rotation.from_matrix(table[:, :3, :3].copy())
        turns = np.maximum(turns, (rotations[1:] * rotations[:-1].inv()).magnitude())
    return turns
