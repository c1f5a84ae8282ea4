"""Places on an attachment area that are nearest to the ends of fibres."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import array_kernel
from vtkmuscle.core.mesh.triangle_distance import nearest_on_triangle
from vtkmuscle.core.types import Floats, Ints

#: Triangles of an area, those with the nearest centres, on which the place nearest to a fibre's end is
#: sought.
N_NEAR = 12


class AttachedArea:
    """Points of a surface, and the triangles between them, to find the places on these nearest to others.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Of the surface [mm].
    area : (k,) int array
        Which points; where there are no triangles between them the points themselves are the area.
    """

    def __init__(self, points: Floats, triangles: Ints, area: Ints) -> None:
        member = np.zeros(len(points), dtype=np.bool_)
        member[area] = True
        first, second, third = triangles.T
        self._points, self._area = points, points[area]
        self._faces = triangles[member[first] & member[second] & member[third]]
        self._tree = None
        if len(self._area):
            about = points[self._faces].mean(axis=1) if len(self._faces) else self._area
            self._tree = cKDTree(about)

    def nearest(self, ends: Floats) -> Floats:
        """Return the places on the area that are nearest to points (j, 3); the points where there is none."""
        if not len(ends) or self._tree is None:
            return ends
        if not len(self._faces):
            on_points: Floats = self._area[self._tree.query(ends)[1]]
            return on_points
        near = self._tree.query(ends, min(N_NEAR, len(self._faces)))[1]
        places: Floats = _nearest_of(ends, self._points, self._faces[near.reshape(len(ends), -1)])
        return places


@array_kernel
def _nearest_of(ends: Floats, points: Floats, candidates: Ints) -> Floats:
    """Return for each point the nearest place on its candidates, (n, k, 3) point ids."""
    result = np.empty((len(ends), 3))
    for i in range(len(ends)):
        least = np.inf
        for k in range(candidates.shape[1]):
            a, b, c = candidates[i, k]
            x, y, z, _ = nearest_on_triangle(
                ends[i, 0], ends[i, 1], ends[i, 2], points[a], points[b], points[c]
            )
            square = (x - ends[i, 0]) ** 2 + (y - ends[i, 1]) ** 2 + (z - ends[i, 2]) ** 2
            if square < least:
                least = square
                result[i, 0], result[i, 1], result[i, 2] = x, y, z
    return result
