"""Motion of bones by a coordinate alone.

The lever of a path about the axis of a coordinate q is -dl/dq (An et al. 1984, doi:10.1115/1.3138494; for any
coordinate Sherman, Seth, Delp 2013, doi:10.1115/DETC2013-13633), from the pose and the bones' twists per unit
of q, without a motion.
"""

from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.motion.blending import screws
from vtkmuscle.core.motion.rigid import SIX_DIGITS, RigidMotion, inverses
from vtkmuscle.core.types import SAME, TINY, Bools, Floats, Ints


class Differences(NamedTuple):
    """Poses and weights of slopes by a coordinate.

    A slope is of the parabola through a pose and two neighbours, on both sides if possible, else the next two
    on a side. With a single neighbour it is the slope of the line.

    frames : (m,) int, ascending numbers of the poses;
    neighbours : (m, 2) int, numbers of the two neighbours;
    weights : (m, 2), weights of their differences from the pose, per unit of the coordinate [1/rad or 1/mm].
    """

    frames: Ints
    neighbours: Ints
    weights: Floats

    def slopes(self, values: Floats) -> Floats:
        """Return slopes (m, ...) of values (f, ...). Values are in all f poses."""
        return self.of(values[self.neighbours] - values[self.frames][:, None])

    def of(self, differences: Floats) -> Floats:
        """Return slopes (m, ...) from differences (m, 2, ...)."""
        return np.asarray(np.einsum("md,md...->m...", self.weights, differences))


def differences_by(motion: RigidMotion, name: str, among: Sequence[str] = ()) -> Differences:
    """Return the differences by a coordinate alone.

    ``among`` names the coordinates that must be equal, by default all others of the motion. If none of them
    changes, and the joint is unknown, the poses are of :func:`frames_of_sweep`.
    """
    coordinates = motion.coordinates
    constant = [other for other in (among or coordinates) if other != name and coordinates[other].changes]
    used = np.arange(len(motion.times))
    if not constant and coordinates[name].twists is None:
        used = np.flatnonzero(frames_of_sweep(motion, name))
    own, q = _numbered(coordinates[name].values), coordinates[name].natural
    groups = np.array([own * 0, *(_numbered(coordinates[other].values) for other in constant)]).T
    neighbours, weights = np.zeros((len(own), 2), dtype=np.int64), np.zeros((len(own), 2))
    group = np.unique(groups, axis=0, return_inverse=True)[1].reshape(-1)
    order = used[np.lexsort((own[used], group[used]))]
    for members in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        values, first = np.unique(own[members], return_index=True)
        poses = np.split(members, first[1:])
        for index, frames in enumerate(poses):
            for frame in frames:
                inward = (-1, 1) if 0 < index < len(values) - 1 else (1, 2) if index == 0 else (-1, -2)
                sides = [poses[i] for i in (index + step for step in inward) if 0 <= i < len(values)]
                if adjacent := [side[np.abs(side - frame).argmin()] for side in sides]:
                    neighbours[frame] = adjacent[0], adjacent[-1]
                    weights[frame] = _weights([float(q[other] - q[frame]) for other in adjacent])
    frames = np.flatnonzero(weights[:, 0])
    return Differences(frames, neighbours[frames], weights[frames])


def _numbered(values: Floats) -> Ints:
    """Return the rank of each value among the different values."""
    order = np.argsort(values, kind="stable")
    apart = np.diff(values[order]) > SAME * max(float(np.ptp(values)), TINY)
    numbers = np.empty(len(values), dtype=np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(apart)])
    return numbers


def _weights(steps: list[float]) -> list[float]:
    """Return the weights of differences at steps. For a line or a parabola."""
    if len(steps) == 1:
        return [1.0 / steps[0], 0.0]
    a, b = steps
    return [b / (a * (b - a)), -a / (b * (b - a))]


def twists_by(motion: RigidMotion, name: str, among: Sequence[str] = ()) -> tuple[Ints, dict[str, Floats]]:
    """Return frames (m,) and bones' twists (m, 6) by a coordinate.

    For a modelled joint the twists are exact, in every frame; else they are of the screws to poses that
    differ in the coordinate alone, possibly none. Parameters as for :func:`differences_by`.
    """
    if (twists := motion.coordinates[name].twists) is not None:
        return np.arange(len(motion.times)), dict(twists)
    differences = differences_by(motion, name, among)
    at, near, result = differences.frames, differences.neighbours, dict[str, Floats]()
    first: Floats = np.eye(4)[None]  # of the first bone: a motion that all bones share has no lever
    for bone, table in motion.transforms.items():
        steps = (table[near] @ inverses(table[at])[:, None]).reshape(-1, 4, 4)
        moves = differences.of(screws(inverses(first) @ steps).reshape(-1, 2, 6))
        first = first if result else steps
        result[bone] = moves + next(iter(result.values()), np.zeros(6))
    return at, result


class MotionTwists:
    """Twists of bones by each coordinate, at any time.

    motion : RigidMotion, its coordinates count that change, or have a modelled joint.
    """

    def __init__(self, motion: RigidMotion) -> None:
        self._times = motion.times
        names = [name for name, q in motion.coordinates.items() if q.changes or q.twists]
        self._twists = {name: twists_by(motion, name, names) for name in names}

    def at(self, time: float) -> dict[str, dict[str, Floats]]:
        """Return each bone's twist (6,) by each coordinate. If known at a time."""
        times, result = self._times, {}
        after = min(int(times.searchsorted(time)), len(times) - 1)
        before = after if times[after] <= time or after == 0 else after - 1
        part = float((time - times[before]) / (times[after] - times[before])) if before < after else 0.0
        for name, (frames, twists) in self._twists.items():
            a, b = frames.searchsorted([before, after]).tolist()
            if b < len(frames) and frames[a] == before and frames[b] == after:
                result[name] = {bone: (1.0 - part) * t[a] + part * t[b] for bone, t in twists.items()}
        return result


#: Largest rotation of a bone between equal poses [degrees]. With 0.1 to 1 all of five frames from the rest
#: pose of a hip to its sweep are left out, with 2 and 4 four and three.
SAME_POSE = 1.0


def frames_of_sweep(motion: RigidMotion, coordinate: str) -> Bools:
    """Return the frames (k,) of a coordinate's sweep. There the coordinate alone turns the bones.

    They are consecutive. A motion may begin with a transition from rest to the start of the sweep, in which
    further coordinates move. Such frames are left out at the beginning, or at the end if more frames remain.
    """
    values = motion.coordinates[coordinate].values
    start, end = 0, len(values)
    for table in motion.transforms.values():
        for first, second in _conflicts(values, Rotation.from_matrix(table[:, :3, :3].copy())):
            start, end = max(start, first + 1), min(end, second)
    kept = np.zeros(len(values), dtype=np.bool_)
    kept[slice(start, None) if len(values) - start >= end else slice(0, end)] = True
    return kept


def _conflicts(values: Floats, rotations: Rotation) -> Iterator[tuple[int, int]]:
    """Yield pairs of frames that cannot both be in the sweep."""
    order = np.argsort(values, kind="stable")
    ascending = values[order]
    for i in range(len(values) - 1):
        low, high = sorted(values[i : i + 2])
        between = order[np.searchsorted(ascending, low, "left") : np.searchsorted(ascending, high, "right")]
        between = between[(between != i) & (between != i + 1)]
        step = (rotations[i].inv() * rotations[i + 1]).as_rotvec()
        allowed = np.radians(SAME_POSE)
        if low == high and np.linalg.norm(step) > allowed:
            yield i, i + 1
        if len(between):
            gone = values[between] - values[i]  # 0 if the value stays
            parts = gone / (values[i + 1] - values[i]) if low < high else gone
            expected = rotations[i] * Rotation.from_rotvec(np.outer(parts, step))
            apart = (expected.inv() * rotations[between]).magnitude() > allowed
            yield from ((min(i, j), max(i + 1, j)) for j in between[apart].tolist())


#: Steps on either side in the comparison, and fewest in all: a line through two steps predicts no third.
N_NEIGHBOURS = 3
#: Allowed part of a step. A muscle that lifts off a bone may halve its moment arm between steps, and a line
#: through the neighbouring steps deviates by half of the change.
KINK = 0.25
#: Largest change of velocity within an even stretch of motion, as a part of the velocity: a reversal changes
#: it by two. With 0.1 to 2 each of ten motions of hips, knees, ankles and arms is one stretch.
UNEVEN = 0.5


def length_jumps(
    lengths: Floats, times: Floats, stretches: Ints | None = None, turns: Floats | None = None
) -> Floats:
    """Return the jump in each step (f - 1, k) [mm].

    The jump is the deviation from a line through the velocities of up to three steps on either side, fitted
    by medians (Theil 1950; Sen 1968, doi:10.1080/01621459.1968.10480934), which ignores a neighbouring jump.
    Allowed are a quarter of the steps' size, for a muscle that lifts off, and (3 a)^2 / 2 of the largest
    neighbouring step for bones that turn by a radians in a step, as the cosine of a moment arm bends. NaN
    where a step has fewer than three steps beside it.

    lengths : (f, k), per frame [mm];
    times : (f,), ascending, or see :func:`distances_moved`;
    stretches : (f - 1,), stretch of each step, see :func:`even_stretches`; only steps of a stretch are
        compared. Default: a single stretch;
    turns : (f - 1,), turns of the bones in each step [rad], see :func:`largest_turns`. Default: 0.
    """
    count = max(len(lengths) - 1, 0)
    jumps = np.full((count, lengths.shape[1]), np.nan)
    durations, middles = np.diff(times), (times[1:] + times[:-1]) / 2.0
    velocities = np.diff(lengths, axis=0) / durations[:, None]
    stretch = np.zeros(count, dtype=np.int64) if stretches is None else stretches
    for i in range(count):
        window = np.arange(max(i - N_NEIGHBOURS, 0), min(i + N_NEIGHBOURS + 1, count))
        neighbours = window[window != i]
        neighbours = neighbours[stretch[neighbours] == stretch[i]]
        if len(neighbours) < N_NEIGHBOURS:
            continue
        x, values = middles[neighbours] - middles[i], velocities[neighbours]
        pairs = combinations(range(len(x)), 2)
        slopes = np.median([(values[b] - values[a]) / (x[b] - x[a]) for a, b in pairs], axis=0)
        expected = np.median(values - x[:, None] * slopes, axis=0)
        speeds = np.abs(values)
        allowed = KINK * np.median(speeds, axis=0)
        if turns is not None:
            allowed += min(1.0, 0.5 * (N_NEIGHBOURS * turns[i]) ** 2) * speeds.max(axis=0)
        jumps[i] = np.maximum(np.abs(velocities[i] - expected) - allowed, 0.0) * durations[i]
    return jumps


def even_stretches(motion: RigidMotion) -> Ints:
    """Return the stretch of even motion per step, (k - 1,).

    A reversal, or a further joint that begins to move, begins a new stretch. Steps of like speeds are even,
    and so are steps of like sizes at any times.
    """
    steps = np.diff(motion.times)
    begins = np.zeros((2, len(steps)), dtype=np.bool_)
    for durations, uneven in zip((steps, np.ones(len(steps))), begins, strict=True) if len(steps) else ():
        unsure = 2.0 * SIX_DIGITS / durations
        for moved in chain(*_moves(motion)):
            velocities = moved / durations[:, None]
            sizes = np.linalg.norm(velocities, axis=1)
            # Velocities far below the largest, or within rounding, are from a table's last digits.
            least = 0.02 * sizes.max() + unsure[1:] + unsure[:-1]
            change = np.linalg.norm(np.diff(velocities, axis=0), axis=1)
            uneven[1:] |= change > UNEVEN * np.maximum(sizes[1:], sizes[:-1]) + least
    return np.cumsum(begins.all(axis=0))


def distances_moved(motion: RigidMotion) -> Floats:
    """Return the motion of bones up to each frame, (k,).

    A still step counts as a hundredth of the largest.
    """
    sizes = [np.linalg.norm(moved, axis=1) for moved in chain(*_moves(motion))]
    steps = np.sum([np.zeros(len(motion.times) - 1), *sizes], axis=0)
    return np.cumsum([0.0, *np.maximum(steps, 0.01 * steps.max(initial=0.0) or 1.0)])


def _moves(motion: RigidMotion) -> Iterator[tuple[Floats, Floats]]:
    """Yield turns [rad] and shifts (k - 1, 3) of each bone. Shifts are parts of the largest coordinate."""
    for bone, table in motion.transforms.items():
        centre, rotations = motion.centre_of(bone), Rotation.from_matrix(table[:, :3, :3].copy())
        shifted = np.diff(table[:, :3, :3] @ centre + table[:, :3, 3], axis=0)
        size = np.abs(centre).max() + np.abs(table[:, :3, 3]).max()
        yield (rotations[1:] * rotations[:-1].inv()).as_rotvec(), shifted / max(size, TINY)


def largest_turns(motion: RigidMotion) -> Floats:
    """Return the largest bone turn per step, (k - 1,) [rad]."""
    turns = np.zeros(max(len(motion.times) - 1, 0))
    for turned, _ in _moves(motion):
        turns = np.maximum(turns, np.linalg.norm(turned, axis=1))
    return turns
