"""Poses of paths, reached from the nearest computed pose."""

import numpy as np

from vtkmuscle.core.motion.rigid import inverse
from vtkmuscle.core.paths.sheet import MusclePaths, PathState
from vtkmuscle.core.types import Floats, Ints


class KeptPoses:
    """The paths of a muscle in any pose.

    A pose begins at the nearest kept pose, and again at rest where it does not settle. Nearness is the
    distance over which the bones carry the ends of paths from pose to pose; the rest pose is always kept. A
    computed pose is the same when asked for again.
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

    def at(self, transforms: Floats, *, memory: float) -> PathState:
        """Return the paths in a pose. Transforms (b, 4, 4) of the bones lead from rest to now.

        Poses are kept up to a ``memory`` [bytes]; the oldest are dropped first, the last is always kept.
        """
        key = transforms.tobytes()
        if key not in self._states:
            seen = inverse(transforms[self._bones[0]]) @ transforms[self._bones]  # from the first bone
            corners = self._corners @ seen[:, :3, :3].swapaxes(1, 2) + seen[:, None, :3, 3]
            starts = [(self.rest, self._corners), *reversed(self._states.values())]
            moves = ((corners - np.array([placed for _, placed in starts])) ** 2).sum(axis=3)
            start = starts[int(moves.max(axis=(1, 2)).argmin())][0]
            state = self._paths.follow(start, transforms)
            if not state.settled and start is not self.rest:  # another way may come to rest
                state = self._paths.follow(self.rest, transforms)
            self._states[key] = state, corners
            most = max(int(memory // max(state.nbytes, 1)), 1)
            for old in list(self._states)[:-most]:
                del self._states[old]
        return self._states[key][0]
