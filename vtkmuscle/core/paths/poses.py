"""Poses of paths, reached from the nearest computed pose."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.paths.sheet import MusclePaths, PathState
from vtkmuscle.core.types import Floats, Ints


class KeptPoses:
    """The paths of a muscle in any pose.

    A pose begins at the nearest kept pose. Nearness is the distance over which the bones carry the ends of
    paths from pose to pose; the rest pose is always kept. A computed pose is the same when asked for again.
    """

    def __init__(self, paths: MusclePaths) -> None:
        self._paths, self.rest = paths, paths.rest
        ends = [(paths.start_bones, paths.fibres[:, 0]), (paths.end_bones, paths.fibres[:, -1])]
        self._bones: Ints = np.unique(np.concatenate([bones for bones, _ in ends]))
        boxes = []
        for bone in self._bones:
            points = np.concatenate([points[bones == bone] for bones, points in ends])
            low, high = points.min(axis=0), points.max(axis=0)
            boxes.append([np.where(corner, high, low) for corner in np.ndindex(2, 2, 2)])
        #: Corners of the box of the ends on each bone, (b, 8, 3) [mm].
        self._corners: Floats = np.array(boxes)
        self._states: dict[bytes, tuple[PathState, Floats]] = {}
        #: Levers in each of these poses, by coordinate and its twists.
        self._levers: dict[bytes, dict[tuple[str, bytes], Floats]] = {}

    def at(self, transforms: Floats, *, memory: float) -> PathState:
        """Return the paths in a pose. Transforms (b, 4, 4) of the bones lead from rest to now.

        Poses are kept up to a ``memory`` [bytes]; the oldest are dropped first, the last is always kept.
        """
        key = transforms.tobytes()
        if key not in self._states:
            corners, still = self._placed(transforms), np.broadcast_to(np.eye(4), transforms.shape)
            starts = [(self.rest, self._placed(still)), *reversed(self._states.values())]
            farthest_moves = [np.linalg.norm(corners - placed, axis=2).max() for _, placed in starts]
            state = self._paths.follow(starts[int(np.argmin(farthest_moves))][0], transforms)
            self._states[key] = state, corners
            self._levers[key] = {}
            most = max(int(memory // max(state.nbytes, 1)), 1)
            for old in list(self._states)[:-most]:
                del self._states[old], self._levers[old]
        return self._states[key][0]

    def levers(self, transforms: Floats, twists: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the paths' levers by each coordinate.

        The pose is the last of :meth:`at`, the twists are as of
        :meth:`~vtkmuscle.core.paths.sheet.PathState.levers`. Levers are computed once: computed again, the
        last digits would differ.
        """
        key = transforms.tobytes()
        names = {name: (name, twist.tobytes()) for name, twist in twists.items()}
        kept = self._levers[key]
        if any(name not in kept for name in names.values()):
            computed = self._states[key][0].levers(twists)
            kept.update({names[name]: levers for name, levers in computed.items()})
        return {name: kept[known] for name, known in names.items()}

    def _placed(self, transforms: Floats) -> Floats:
        """Return the corners seen from the first bone, (b, 8, 3)."""
        seen = inverse(transforms[self._bones[0]])
        boxes = zip(self._bones, self._corners, strict=True)
        return np.array([apply_transform(seen @ transforms[bone], box) for bone, box in boxes])
