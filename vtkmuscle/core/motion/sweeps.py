"""Which poses of a motion belong to the sweep of a coordinate."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Bools, Floats

#: Two poses of the same value are the same pose up to this rotation of a bone [degrees], and up to this part
#: of the rotation from one frame to the next, for between frames poses are interpolated.
SAME_POSE = 1.0
SAME_POSE_PART = 0.1


def frames_of_sweep(motion: RigidMotion, coordinate: str) -> Bools:
    """Return the frames (k,) in which the bones' rotation depends on nothing but one coordinate.

    A motion may begin with a way from rest to where the sweep starts, on which other things move as well: at
    a value of the coordinate that the sweep has too, the pose is another one, and the change of a length
    is not by the coordinate alone. Such frames are left out at the beginning, or at the end where that
    leaves more.

    Parameters
    ----------
    motion : RigidMotion
        With the coordinate.
    coordinate : str
        Its name.

    Returns
    -------
    (k,) bool array
        True for one stretch of frames.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.motion.rigid import hinge
    >>> from vtkmuscle.core.motion.sweeps import frames_of_sweep
    >>> frames_of_sweep(hinge("tibia", (0, 0, 0), (1, 0, 0), [0, 10, 20], coordinate="knee"), "knee")
    array([ True,  True,  True])
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
