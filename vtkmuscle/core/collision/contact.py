"""A muscle and the bones that it may meet: which points are tested against which bone."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.collision.distance_collision import Clearance
from vtkmuscle.core.collision.obstacles import Approach, MuscleContact, Obstacle, VoxelObstacle
from vtkmuscle.core.motion.rigid import apply_transform, inverse, inverses
from vtkmuscle.core.types import Bools, Floats, Ints

#: A bone that does not move.
_STILL = np.eye(4)

#: A muscle with more than this part of its free points in a bone is taken to be swallowed by it.
SWALLOWED = 0.9


class Barrier:
    """The bones that the free points of one muscle are kept out of.

    The muscle at rest (n, 3) is given relative to a centre (3,) in the scene [mm]; ``bone_push`` is that of
    :class:`~vtkmuscle.core.collision.obstacles.Approach`.
    """

    def __init__(
        self, obstacles: Sequence[Obstacle], rest: Floats, centre: Floats, free: Bools, *, bone_push: bool
    ) -> None:
        self.obstacles = tuple(obstacles)
        self.free, self.bone_push = free, bone_push
        self._rest = rest
        self._about_centre = np.eye(4)
        self._about_centre[:3, 3] = -centre
        #: Index of each obstacle among the bones' transforms.
        self.bones: Ints = np.array([obstacle.bone for obstacle in self.obstacles], dtype=np.int64)
        boxes = [
            (obstacle.box[0] - obstacle.margin - centre, obstacle.box[1] + obstacle.margin - centre)
            for obstacle in self.obstacles
        ]
        #: Middle and half the sides of each obstacle's box at rest, relative to the centre.
        self.boxes: Floats = np.array([((low + high) / 2, (high - low) / 2) for low, high in boxes])
        self._met: dict[int, tuple[Floats | None, Floats, Clearance]] = {}
        self._warned: set[tuple[int, str]] = set()

    def from_axes(self, number: int) -> Floats:
        """Return the transform from an obstacle's axes to the scene at rest, relative to the centre."""
        return self._about_centre @ inverse(self.obstacles[number].axes)

    def known(self, number: int) -> bool:
        """Return whether the muscle came near an obstacle before."""
        return number in self._met

    def met(self, number: int) -> tuple[Floats | None, Floats, Clearance]:
        """Return how deep points may be in an obstacle, and room for their positions and clearances.

        All are made when the muscle first comes near the obstacle.
        """
        if number not in self._met:
            obstacle = self.obstacles[number]
            allowance = obstacle.allowance(apply_transform(inverse(self.from_axes(number)), self._rest))
            self._met[number] = allowance, np.empty_like(self._rest), Clearance(len(self._rest))
            inside = 0 if allowance is None else int((allowance[self.free] > obstacle.skin).sum())
            if inside > SWALLOWED * self.free.sum():
                self.warn(
                    number,
                    "swallowed",
                    f"{inside} of the muscle's {self.free.sum()} free points are in it at rest and may "
                    "stay as deep; check that bone and muscle are in the same frame and unit",
                )
        return self._met[number]

    def warn(self, number: int, kind: str, what: str) -> None:
        """Warn of irregular motion at an obstacle, once for each kind."""
        if (number, kind) not in self._warned:
            self._warned.add((number, kind))
            warnings.warn(f"{self.obstacles[number].name}: {what}", stacklevel=2)


class Contact:
    """A muscle and the bones during one step, and other muscles; a bone wins against these.

    The boxes of all bones are first compared with that of the free points' path, so that far bones cost next
    to nothing. Where points slide along the bones, their path is followed from one call to the next. A point
    that is known to be away from a bone is not tested again before it has moved that far.

    now, before : (b, 4, 4), transforms of all bones, rest to now and to the previous frame, of points
    relative to the centre;  x : (n, 3), positions of the previous frame, relative to the centre [mm].
    """

    def __init__(
        self, barrier: Barrier, now: Floats, before: Floats, x: Floats, muscles: MuscleContact | None = None
    ) -> None:
        self._barrier = barrier
        self._muscles = muscles
        self._idle = not (barrier.obstacles and barrier.free.any())
        if self._idle:
            return
        self._now = now[barrier.bones]
        self._steps = self._now @ inverses(before[barrier.bones])
        self._x = x
        self._box = low, high = _box(x, barrier.free)
        #: Bounding boxes of the bones now, and of the points before the step in the frame of each bone.
        self._low, self._high = _moved_boxes(self._now, barrier.boxes[:, 0], barrier.boxes[:, 1])
        self._from_low, self._from_high = _moved_boxes(self._steps, (low + high) / 2, (high - low) / 2)
        self._followed: dict[int, Approach] = {}

    def keep_out(self, p: Floats) -> Bools:
        """Move predicted positions (n, 3) out of the bones, in place; return which were moved, (n,)."""
        hit = np.zeros(len(p), dtype=np.bool_)
        if self._muscles is not None:
            hit |= self._muscles.keep_out(p)
        if self._idle:
            return hit
        waiting = self._in_reach(p, 0)
        while waiting:
            number = waiting.pop(0)
            obstacle = self._barrier.obstacles[number]
            first = number not in self._followed
            if first and not self._begin(number, p):
                continue
            approach = self._followed[number]
            last = self._barrier.met(number)[1]
            moved = obstacle.keep_out(approach, p)
            if first:
                self._check_step(number, approach, last, moved)
            if moved.any():
                hit |= moved
                waiting = self._in_reach(p, number + 1)
            if obstacle.slides:
                last[:] = p
                approach.x, approach.step = last, _STILL
                self._from_low[number], self._from_high[number] = self._box
        return hit

    def _begin(self, number: int, p: Floats) -> bool:
        """Return whether the points may meet an obstacle for the first time in the step; follow it then."""
        barrier = self._barrier
        now, step = self._now[number] @ barrier.from_axes(number), self._steps[number]
        # Of one that was met before, its clearance tells as soon.
        if not (barrier.known(number) or self._may_touch(number, inverse(now), p)):
            return False
        allowance, last, clearance = barrier.met(number)
        last[:] = p
        clearance.begin(now, step, self._x)
        self._followed[number] = Approach(
            now, step, self._x, barrier.free, allowance, barrier.bone_push, clearance
        )
        return True

    def _check_step(self, number: int, approach: Approach, predicted: Floats, moved: Bools) -> None:
        """Warn where a step began with more in a bone, or farther through it, than can come out well."""
        barrier, obstacle = self._barrier, self._barrier.obstacles[number]
        if obstacle.slides and not moved.any():
            return
        # Those that slide along a bone were in it if they were moved.
        ids = np.flatnonzero(barrier.free & moved if obstacle.slides else barrier.free)
        to_axes = inverse(approach.now)
        start = apply_transform(to_axes @ approach.step, approach.x[ids])
        end = apply_transform(to_axes, predicted[ids])
        low, high = obstacle.box_along_axes
        inside = met = moved[ids]
        if isinstance(obstacle, VoxelObstacle):
            inside = obstacle.grid.contains(end)
            # Voxels do not show which points went through the bone: the boxes of their paths must do.
            apart = (np.maximum(start, end) < low) | (np.minimum(start, end) > high)
            met = np.logical_not(apart.any(axis=1))
        if not met.any():
            return
        ways = np.linalg.norm(end[met] - start[met], axis=1)
        farthest, way = ids[met][ways.argmax()], float(ways.max())
        thickness = float((high - low).min())
        if way > thickness:
            came_from = approach.x[[farthest]]
            carried = float(np.linalg.norm(apply_transform(approach.step, came_from) - came_from))
            if carried > 0.5 * way:
                barrier.warn(
                    number,
                    "jumped",
                    f"it moved {way:.4g} mm against the muscle in one step, but is {thickness:.4g} mm thick; "
                    "give the motion more frames",
                )
            else:
                barrier.warn(
                    number,
                    "flung",
                    f"a point of the muscle moved {way:.4g} mm against it in one step by its own velocity, "
                    f"but it is {thickness:.4g} mm thick; use more iterations, or a quality in which points "
                    "have no velocity",
                )
        if inside.sum() > SWALLOWED * barrier.free.sum():
            barrier.warn(
                number,
                "swallowed",
                f"{inside.sum()} of the muscle's {barrier.free.sum()} free points were in it at the "
                "beginning of a step; give the motion more frames",
            )

    def _in_reach(self, p: Floats, first: int) -> list[int]:
        """Return the obstacles, from the first on, whose boxes the box of the path to p meets.

        Where all are followed already, their clearances say more than the boxes, and all are returned.
        """
        if len(self._followed) == len(self._barrier.obstacles):
            return list(range(first, len(self._followed)))
        self._box = low, high = _box(p, self._barrier.free)
        before = np.maximum(self._from_high, high) < self._low
        beyond = np.minimum(self._from_low, low) > self._high
        numbers: list[int] = np.flatnonzero(~(before | beyond).any(axis=1)).tolist()
        return [number for number in numbers if number >= first]

    def _may_touch(self, number: int, to_axes: Floats, p: Floats) -> bool:
        """Return whether the path of the points may meet an obstacle's box along its own axes."""
        obstacle, free = self._barrier.obstacles[number], self._barrier.free
        starts = _box(apply_transform(to_axes @ self._steps[number], self._x), free)
        ends = _box(apply_transform(to_axes, p), free)
        low, high = obstacle.box_along_axes
        lowest, highest = np.minimum(starts[0], ends[0]), np.maximum(starts[1], ends[1])
        return not ((highest < low - obstacle.margin) | (lowest > high + obstacle.margin)).any()


def _moved_boxes(transforms: Floats, middles: Floats, halves: Floats) -> tuple[Floats, Floats]:
    """Return the boxes of moved boxes, (k, 3) each: transforms (k, 4, 4), middles, halves (k, 3) or (3,)."""
    turned = transforms[:, :3, :3]
    centres = np.einsum("bij,bj->bi", turned, np.broadcast_to(middles, (len(turned), 3)))
    centres += transforms[:, :3, 3]
    reach = np.einsum("bij,bj->bi", np.abs(turned), np.broadcast_to(halves, (len(turned), 3)))
    # A path or a box that has no extent must not be missed for a rounding error.
    reach += 1e-9 * (np.abs(centres) + reach)
    return centres - reach, centres + reach


def _box(points: Floats, free: Bools) -> tuple[Floats, Floats]:
    """Return the least and the greatest coordinates (3,) of the free points (n, 3), infinite of none."""
    mine = points.T.compress(free, axis=1)  # of long rows they are found ten times as fast
    return mine.min(axis=1, initial=np.inf), mine.max(axis=1, initial=-np.inf)
