"""The boundary of a patch of a muscle, as landmarks."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.surface import half_edges
from vtkmuscle.core.types import Floats, Ints

#: Landmarks of an outline, at most: so the patches inside of them are 0.9 to 1.0 of the patches outlined.
MOST_LANDMARKS = 40


def outline(points: Floats, triangles: Ints, patch: Ints) -> tuple[Floats, bool]:
    """Return points of the muscle along the boundary of a patch, in order.

    The patch has to be connected. Holes in it are left out.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        The muscle [mm]; point ids.
    patch : (k,) int array
        Point ids.

    Returns
    -------
    landmarks : (j, 3) array
        [mm]
    closed : bool
        True for a ring; False where the patch has no triangle, and its points are the landmarks.
    """
    edges = half_edges(triangles)
    held = np.isin(edges, patch).all(axis=1)
    inside = {(b, a) for a, b in edges[np.repeat(held.reshape(-1, 3).all(axis=1), 3)].tolist()}
    following: dict[int, list[int]] = {}
    for a, b in sorted({(a, b) for a, b in edges[held].tolist()} - inside):  # both ways between islands
        following.setdefault(a, []).append(b)
    if not inside:
        spread = points[patch] - points[patch].mean(axis=0)
        along = spread @ np.linalg.svd(spread, full_matrices=False)[2][0]
        return points[patch[np.argsort(along, kind="stable")]], False
    rings = []
    for start in following:  # Hierholzer 1873, doi:10.1007/BF01442866: once along each edge
        path, ring = [start], []
        while path:
            if following.get(path[-1]):
                path.append(following[path[-1]].pop())
            else:
                ring.append(path.pop())
        rings.append(ring)
    longest = max(rings, key=len)
    return points[longest[: -1 : -(-(len(longest) - 1) // MOST_LANDMARKS)]], True
