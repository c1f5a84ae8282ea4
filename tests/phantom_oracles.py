"""What phantoms with known paths are tested against: a taut string by a convex hull, moved ends, slopes."""

import numpy as np
from scipy.spatial import ConvexHull

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.attachments import attachments_of


def taut_length(start, end, circles, outward, samples=20000):
    """Return the length of a string from start to end, held by circles that it bends round one way.

    Such a string is a part of the boundary of the convex hull of its ends and all of the circles that keep
    it from the straight line; the hull's other part closes it.

    start, end : (2,);  circles : list of (centre, radius);  outward : (2,), a direction in which every
    point of the string lies farther than all that it is wrapped round.
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    turn = 2.0 * np.pi * np.arange(samples) / samples
    rim = np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.vstack([start, end, *(np.asarray(centre) + radius * rim for centre, radius in circles)])
    order = ConvexHull(points).vertices
    ways = []
    if 0 in order and 1 in order:
        order = np.roll(order, -int(np.flatnonzero(order == 0)[0]))
        last = int(np.flatnonzero(order == 1)[0])
        ways = [points[order[: last + 1]], points[np.append(order[last:], 0)]]
    # The way that lies outward of the other; a straight way holds no point of a circle.
    way = max(ways, key=lambda way: (way @ np.asarray(outward)).mean())
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def moved_centres(phantom, time):
    """Return (y, z) of the centres of the origin and the insertion landmarks at a time, origin first."""
    (areas,) = phantom.attachments.values()
    transforms = phantom.motion.at(time)
    return [
        apply_transform(transforms.get(area.bone, np.eye(4)), area.landmarks).mean(axis=0)[1:]
        for area in attachments_of(areas, "test")
        if area.role != "via"
    ]


def slope(length, angle, step=1e-4):
    """Return dl/dq [mm] of a function of an angle [degrees], by central differences."""
    return (length(angle + step) - length(angle - step)) / (2.0 * np.radians(step))
