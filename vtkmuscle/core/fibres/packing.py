"""How much room fibres have beside each other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.polylines import segment_distances
from vtkmuscle.core.types import Floats, Ints

#: Neighbours that are looked at first, of which a fibre's own points are some.
_FIRST_NEIGHBOURS = 12


def filling_radius(volume: float, total_length: float) -> float:
    """Return the radius [mm] of tubes in hexagonal packing, whose cells of 2 sqrt(3) r^2 fill a volume.

    Parameters
    ----------
    volume : float
        Of the muscle [mm^3].
    total_length : float
        Of all fibres, > 0 [mm].
    """
    return float(np.sqrt(volume / (2.0 * np.sqrt(3.0) * total_length)))


def room_between(points: Floats, offsets: Ints) -> Floats:
    """Return the distance of each point of polylines from the nearest other polyline.

    Of the other lines' points the nearest one is found, and the distance is that to the segments on its two
    sides; infinite where there is one line only. Points are (n, 3), offsets the first point of each line, and
    n; the distances (n,), in the unit of the points.
    """
    line_of = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    nearest = np.full(len(points), -1, dtype=np.int64)
    if len(offsets) > 2:
        tree = cKDTree(points)
        open_ = np.arange(len(points))
        count = _FIRST_NEIGHBOURS
        while len(open_):
            count = min(count, len(points))
            found = tree.query(points[open_], k=[*range(1, count + 1)])[1]
            foreign = line_of[found] != line_of[open_, None]
            some = foreign.any(axis=1)
            nearest[open_[some]] = found[some, foreign[some].argmax(axis=1)]
            open_ = open_[~some]
            count *= 4
    room = np.full(len(points), np.inf)
    known = nearest >= 0
    for step in (-1, 1):
        other = np.clip(nearest[known] + step, 0, len(points) - 1)
        other = np.where(line_of[other] == line_of[nearest[known]], other, nearest[known])
        distances = segment_distances(points[known], points[nearest[known]], points[other])
        room[known] = np.minimum(room[known], distances)
    return room
