"""Moment arms of paths over points, by differences of their lengths."""

from dataclasses import replace

from vtkmuscle.core.motion.muscle_paths import PointPath

#: Step of the central difference [radians, or units of length].
STEP = 1e-4


def moment_arm(path, tree, values, coordinate):
    """Return the moment arm -dl/dq (f,) of a path by a coordinate, what it couples following.

    Conditional points count as they do at the first of the values.
    """
    full = tree.completed(values)
    if isinstance(path, PointPath):
        counted = [replace(point, only_in=None) for point in path.points if point.counts(full, 1)[0]]
        path = replace(path, points=counted)
    low, high = (path.lengths(tree, full | {coordinate: full[coordinate] + step}) for step in (-STEP, STEP))
    return (low - high) / (2.0 * STEP)
