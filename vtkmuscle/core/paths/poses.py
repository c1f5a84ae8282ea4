"""Poses of paths, reached from the nearest computed pose."""

import numpy as np

from vtkmuscle.core.motion.rigid import inverse
from vtkmuscle.core.paths.sheet import MusclePaths, PathState, carried_by
from vtkmuscle.core.types import Floats


class KeptPoses:
    """The paths of a muscle in any pose.

    A pose begins at the nearest kept pose, and again at rest where it does not settle. Nearness is the
    distance over which the bones carry the ends of paths from pose to pose; the rest pose is always kept. A
    computed pose is the same when asked for again.
    """

    def __init__(self, paths: MusclePaths) -> None:
        self._paths, self.rest = paths, paths.rest
        self._states: dict[bytes, tuple[PathState, Floats]] = {}

    def at(self, transforms: Floats, *, memory: float) -> PathState:
        """Return the paths in a pose. Transforms (b, 4, 4) of the bones lead from rest to now.

        Poses are kept up to a ``memory`` [bytes]; the oldest are dropped first, the last is always kept.
        """
        key = transforms.tobytes()
        if key not in self._states:
            ends = self._ends(transforms)
            starts = [(self.rest, self._ends(self.rest.transforms)), *reversed(self._states.values())]
            moves = ((ends - np.array([placed for _, placed in starts])) ** 2).sum(axis=2)
            start = starts[int(moves.max(axis=1).argmin())][0]
            state = self._paths.follow(start, transforms)
            if not state.settled and start is not self.rest:  # another way may come to rest
                state = self._paths.follow(self.rest, transforms)
            self._states[key] = state, ends
            most = max(int(memory // max(state.nbytes, 1)), 1)
            for old in list(self._states)[:-most]:
                del self._states[old]
        return self._states[key][0]

    def _ends(self, transforms: Floats) -> Floats:
        """Return the ends of paths. Seen from the first bone, (2 f, 3) [mm]."""
        paths = self._paths
        seen = inverse(transforms[paths.start_bones[0]]) @ transforms
        sides = (paths.start_bones, paths.fibres[:, 0]), (paths.end_bones, paths.fibres[:, -1])
        return np.concatenate([carried_by(seen[bones], points) for bones, points in sides])
