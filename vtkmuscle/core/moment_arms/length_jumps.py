"""Jumps of lengths over time, as deviations from a smooth curve."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints

#: Steps on either side in the comparison.
N_NEIGHBOURS = 3
#: Fewest steps in a comparison: a line through two steps predicts no third.
FEWEST_STEPS = 3
#: Allowed part of a step. A muscle that lifts off a bone may halve its moment arm between steps, and a line
#: through the neighbouring steps deviates by half of the change.
KINK = 0.25
#: Largest change of velocity within an even stretch of motion, as a part of the velocity.
UNEVEN = 0.5


def length_jumps(
    lengths: Floats, times: Floats, stretches: Ints | None = None, turns: Floats | None = None
) -> Floats:
    """Return the jump in each step (f - 1, k) [mm].

    The jump is the deviation from a line through the velocities of up to three steps on either side, fitted
    by medians (Theil 1950; Sen 1968, doi:10.1080/01621459.1968.10480934), which ignores a neighbouring jump.
    Allowed are a quarter of the steps' size, for a muscle that lifts off, and (3 a)^2 / 2 of the largest
    neighbouring step for bones that turn by a radians in a step, as the cosine of a moment arm bends. Without
    enough steps the result is 0.

    Parameters
    ----------
    lengths : (f, k) array
        Per frame [mm].
    times : (f,) array
        Ascending.
    stretches : (f - 1,) int array, optional
        Stretch of each step, see :func:`even_stretches`; only steps of a stretch are compared. Default: a
        single stretch.
    turns : (f - 1,) array, optional
        Turns of the bones in each step [rad], see :func:`largest_turns`. Default: 0.
    """
    count = max(len(lengths) - 1, 0)
    jumps = np.zeros((count, lengths.shape[1]))
    if count <= FEWEST_STEPS:
        return jumps
    durations, middles = np.diff(times), (times[1:] + times[:-1]) / 2.0
    steps = np.diff(lengths, axis=0)
    velocities = steps / durations[:, None]
    stretch = np.zeros(count, dtype=np.int64) if stretches is None else stretches
    for i in range(count):
        neighbours = np.array(
            [j for j in range(i - N_NEIGHBOURS, i + N_NEIGHBOURS + 1) if 0 <= j < count and j != i]
        )
        neighbours = neighbours[stretch[neighbours] == stretch[i]]
        if len(neighbours) < FEWEST_STEPS:
            continue
        expected = _on_line(middles[neighbours] - middles[i], velocities[neighbours])
        speeds = np.abs(velocities[neighbours])
        allowed = KINK * np.median(speeds, axis=0)
        if turns is not None:
            allowed += min(1.0, 0.5 * (N_NEIGHBOURS * turns[i]) ** 2) * speeds.max(axis=0)
        jumps[i] = np.maximum(np.abs(velocities[i] - expected) - allowed, 0.0) * durations[i]
    return jumps


def _on_line(x: Floats, values: Floats) -> Floats:
    """Return values (k,) at 0 of median lines. Through values (n, k) at x (n,)."""
    pairs = combinations(range(len(x)), 2)
    slopes = np.median([(values[b] - values[a]) / (x[b] - x[a]) for a, b in pairs], axis=0)
    at_zero: Floats = np.median(values - x[:, None] * slopes, axis=0)
    return at_zero


def even_stretches(motion: RigidMotion) -> Ints:
    """Return the stretch of even motion per step, (k - 1,).

    A reversal, or a further joint that begins to move, begins a new stretch.
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
            # Velocities far below the largest are rounding of a table.
            least = 0.02 * sizes.max()
            change = np.linalg.norm(np.diff(velocities, axis=0), axis=1)
            begins[1:] |= change > UNEVEN * np.maximum(sizes[1:], sizes[:-1]) + least
    return np.cumsum(begins)


def largest_turns(motion: RigidMotion) -> Floats:
    """Return the largest bone turn per step, (k - 1,) [rad]."""
    turns = np.zeros(max(len(motion.times) - 1, 0))
    for table in motion.transforms.values():
        rotations = Rotation.from_matrix(table[:, :3, :3].copy())
        turns = np.maximum(turns, (rotations[1:] * rotations[:-1].inv()).magnitude())
    return turns
