"""A taut string round circles in a plane, by a convex hull: an oracle for phantoms with known lengths."""

import numpy as np
from scipy.spatial import ConvexHull


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
