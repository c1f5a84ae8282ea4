"""Constrained Delaunay triangulations of simple polygons, with further points inside.

Ears are clipped (Meisters 1975, doi:10.2307/2319703), edges flipped until none is left that Delaunay's
criterion forbids, and points inserted one by one (Lawson 1977, doi:10.1016/B978-0-12-587260-7.50011-X). Of
the two angles opposite an inner edge the sum is then at most 180 degrees, so that its cotangent weight is not
negative.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Twice an area below this part of the polygon's squared size is zero but for rounding.
FLAT = 1e-14
#: Flips per triangle after which Lawson's algorithm is taken for a victim of rounding.
MOST_FLIPS = 100


@kernel
def triangulate(polygon: Floats, inner: Floats) -> tuple[Floats, Ints, Ints]:
    """Return the constrained Delaunay triangulation of a polygon and of points in it.

    Parameters
    ----------
    polygon : (n, 2) array
        Vertices of a simple polygon, counterclockwise, n >= 3, neighbours different.
    inner : (m, 2) array
        Points to insert; those outside of the polygon or on an edge are left out.

    Returns
    -------
    points : (n + k, 2) array
        The polygon's vertices, then the points that were inserted.
    triangles : (t, 3) int array
        Point ids, counterclockwise; none where the polygon is not simple.
    neighbours : (t, 3) int array
        The triangle across the edge from corner i to the next one, -1 on the boundary.
    """
    n = len(polygon)
    points = np.empty((n + len(inner), 2))
    points[:n] = polygon
    largest = n - 2 + 2 * len(inner)
    triangles = np.empty((largest, 3), dtype=np.int64)
    neighbours = np.full((largest, 3), -1, dtype=np.int64)
    size = 0.0
    for i in range(n):
        size = max(size, abs(polygon[i, 0] - polygon[0, 0]), abs(polygon[i, 1] - polygon[0, 1]))
    flat = FLAT * size * size
    if not _clip_ears(polygon, flat, triangles, neighbours):
        return points[:n], triangles[:0], neighbours[:0]
    n_triangles, n_points, last = n - 2, n, 0
    stack = np.empty((64, 2), dtype=np.int64)
    for t in range(n_triangles):
        for side in range(3):
            stack = _legalise(points, triangles, neighbours, t, side, flat, stack)
    for i in range(len(inner)):
        points[n_points] = inner[i]
        found = _locate(points, triangles[:n_triangles], neighbours, n_points, last, flat)
        if found < 0:
            continue
        last = found
        a, b, c = triangles[found]
        right, upper, left = neighbours[found]
        second, third = n_triangles, n_triangles + 1
        triangles[found] = (a, b, n_points)
        triangles[second] = (b, c, n_points)
        triangles[third] = (c, a, n_points)
        neighbours[found] = (right, second, third)
        neighbours[second] = (upper, third, found)
        neighbours[third] = (left, found, second)
        _replace_neighbour(neighbours, upper, found, second)
        _replace_neighbour(neighbours, left, found, third)
        n_points += 1
        n_triangles += 2
        for t in (found, second, third):
            stack = _legalise(points, triangles, neighbours, t, 0, flat, stack)
    return points[:n_points], triangles[:n_triangles], neighbours[:n_triangles]


@kernel
def _doubled_area(points: Floats, a: int, b: int, c: int) -> float:
    """Return twice the signed area of a triangle, positive where it runs counterclockwise."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vx, vy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    return float(ux * vy - uy * vx)


@kernel
def _product(points: Floats, a: int, b: int, c: int) -> float:
    """Return the scalar product of the vectors from c to a and to b."""
    x = (points[a, 0] - points[c, 0]) * (points[b, 0] - points[c, 0])
    return float(x + (points[a, 1] - points[c, 1]) * (points[b, 1] - points[c, 1]))


@kernel
def _clip_ears(polygon: Floats, flat: float, triangles: Ints, neighbours: Ints) -> bool:
    """Triangulate a polygon by clipping ears; return False where there is none though corners are left."""
    n = len(polygon)
    after, before = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    # The half-edge of a triangle on the other side of the edge from each corner to the next: 3 t + side.
    across = np.full(n, -1, dtype=np.int64)
    for i in range(n):
        after[i] = i + 1 if i + 1 < n else 0
        before[i] = i - 1 if i > 0 else n - 1
    left, here, tried, n_triangles = n, 0, 0, 0
    while left > 2:
        a, c = before[here], after[here]
        if left > 3 and not _is_ear(polygon, after, a, here, c, flat):
            here = c
            tried += 1
            if tried > left:
                return False
            continue
        if left == 3 and _doubled_area(polygon, a, here, c) < -flat:
            return False
        t = n_triangles
        triangles[t] = (a, here, c)
        for side, corner in ((0, a), (1, here), (2, c)):
            other = across[corner] if side < 2 or left == 3 else -1
            if other >= 0:
                neighbours[t, side] = other // 3
                neighbours[other // 3, other % 3] = t
        across[a] = 3 * t + 2
        after[a], before[c] = c, a
        n_triangles += 1
        left -= 1
        tried = 0
        here = after[c]  # not next to this ear, or they would all share a corner
    return True


@kernel
def _is_ear(polygon: Floats, after: Ints, a: int, b: int, c: int, flat: float) -> bool:
    """Return True where the corner b is convex and no other corner is in the triangle (a, b, c)."""
    if _doubled_area(polygon, a, b, c) <= flat:
        return False
    low_x = min(polygon[a, 0], polygon[b, 0], polygon[c, 0])
    high_x = max(polygon[a, 0], polygon[b, 0], polygon[c, 0])
    low_y = min(polygon[a, 1], polygon[b, 1], polygon[c, 1])
    high_y = max(polygon[a, 1], polygon[b, 1], polygon[c, 1])
    other = after[c]
    while other != a:
        x, y = polygon[other, 0], polygon[other, 1]
        if (
            low_x <= x <= high_x
            and low_y <= y <= high_y
            and _doubled_area(polygon, a, b, other) >= -flat
            and _doubled_area(polygon, b, c, other) >= -flat
            and _doubled_area(polygon, c, a, other) >= -flat
        ):
            return False
        other = after[other]
    return True


@kernel
def _replace_neighbour(neighbours: Ints, t: int, old: int, new: int) -> None:
    if t >= 0:
        for side in range(3):
            if neighbours[t, side] == old:
                neighbours[t, side] = new


@kernel
def _legalise(
    points: Floats, triangles: Ints, neighbours: Ints, t: int, side: int, flat: float, stack: Ints
) -> Ints:
    """Flip the edge of a triangle if the angles opposite it exceed 180 degrees, and then those around it.

    Parameters
    ----------
    points, triangles, neighbours : arrays
        The triangulation, changed in place.
    t, side : int
        The edge.
    flat : float
        Twice the area of a triangle that is flat but for rounding.
    stack : (k, 2) int array
        Room for edges still to look at.

    Returns
    -------
    (k, 2) int array
        The room, more of it if need be.
    """
    stack[0, 0], stack[0, 1] = t, side
    n, flips = 1, 0
    while n > 0 and flips < MOST_FLIPS * len(triangles):
        n -= 1
        t, i = stack[n]
        u = neighbours[t, i]
        if u < 0:
            continue
        j = 0
        while neighbours[u, j] != t:
            j += 1
        a, b, c = triangles[t, i], triangles[t, (i + 1) % 3], triangles[t, (i + 2) % 3]
        d = triangles[u, (j + 2) % 3]
        cosine_c, cosine_d = _product(points, a, b, c), _product(points, a, b, d)
        sine_c, sine_d = _doubled_area(points, a, b, c), _doubled_area(points, b, a, d)
        # sin(c + d) < 0, but for rounding.
        scale = np.sqrt((cosine_c**2 + sine_c**2) * (cosine_d**2 + sine_d**2))
        if sine_c * cosine_d + cosine_c * sine_d >= -1e-12 * scale:
            continue
        if _doubled_area(points, c, a, d) <= flat or _doubled_area(points, c, d, b) <= flat:
            continue
        bc, ca = neighbours[t, (i + 1) % 3], neighbours[t, (i + 2) % 3]
        ad, db = neighbours[u, (j + 1) % 3], neighbours[u, (j + 2) % 3]
        triangles[t, 0], triangles[t, 1], triangles[t, 2] = c, a, d
        neighbours[t, 0], neighbours[t, 1], neighbours[t, 2] = ca, ad, u
        triangles[u, 0], triangles[u, 1], triangles[u, 2] = c, d, b
        neighbours[u, 0], neighbours[u, 1], neighbours[u, 2] = t, db, bc
        _replace_neighbour(neighbours, ad, u, t)
        _replace_neighbour(neighbours, bc, t, u)
        flips += 1
        if n + 4 > len(stack):
            longer = np.empty((2 * len(stack), 2), dtype=np.int64)
            longer[:n] = stack[:n]
            stack = longer
        stack[n, 0], stack[n, 1] = t, 0
        stack[n + 1, 0], stack[n + 1, 1] = t, 1
        stack[n + 2, 0], stack[n + 2, 1] = u, 1
        stack[n + 3, 0], stack[n + 3, 1] = u, 2
        n += 4
    return stack


@kernel
def _locate(points: Floats, triangles: Ints, neighbours: Ints, point: int, start: int, flat: float) -> int:
    """Return the triangle that has a point strictly inside, -1 if none has.

    The walk from triangle to triangle ends at once in most cases; where the boundary stops it, all are tried.
    """
    t = start
    for _ in range(len(triangles)):
        worst, least = -1, flat
        for side in range(3):
            area = _doubled_area(points, triangles[t, side], triangles[t, (side + 1) % 3], point)
            if area < least or (worst < 0 and area <= least):
                worst, least = side, area
        if worst < 0:
            return t
        if neighbours[t, worst] < 0:
            break
        t = neighbours[t, worst]
    for other in range(len(triangles)):
        inside = True
        for side in range(3):
            end = triangles[other, (side + 1) % 3]
            inside = inside and _doubled_area(points, triangles[other, side], end, point) > flat
        if inside:
            return other
    return -1
