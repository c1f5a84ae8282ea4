"""Constrained Delaunay triangulations of simple polygons, with further points inside.

Ears are clipped (Meisters 1975, doi:10.2307/2319703), points inserted one by one, and edges flipped until
none is left that Delaunay's criterion forbids (Lawson 1977, doi:10.1016/B978-0-12-587260-7.50011-X). Of the
two angles opposite an inner edge the sum is then at most 180 degrees, so that its cotangent weight is not
negative. The flips come with the points and after them: a polygon of many vertices and no point inside takes
a number of flips that grows with their square, most of which the first points would undo.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.bins import extremes, sorted_into_bins
from vtkmuscle.core.types import Bools, Floats, Ints

#: Twice an area below this part of the polygon's squared size is zero but for rounding.
FLAT = 1e-14
#: Flips per point after which Lawson's algorithm is taken for a victim of rounding.
MOST_FLIPS = 100


@array_kernel
def triangulate(polygon: Floats, inner: Floats) -> tuple[Floats, Ints, Ints]:
    """Return the constrained Delaunay triangulation of a polygon and of points in it.

    Parameters
    ----------
    polygon : (n, 2) array
        Vertices of a simple polygon, counterclockwise, n >= 3, neighbours different.
    inner : (m, 2) array
        Points to insert; those outside of the polygon or on an edge are left out. The walk to a point starts
        at the one before it: it is short where these are near to each other.

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
    for i in range(n):
        points[i, 0], points[i, 1] = polygon[i, 0], polygon[i, 1]
    # Half-edge 3 t + i runs from corner i of triangle t to the next one; the other one along it, or -1.
    largest = max(n - 2 + 2 * len(inner), 1)
    corners, across = np.empty(3 * largest, dtype=np.int64), np.full(3 * largest, -1, dtype=np.int64)
    size = 0.0
    for i in range(n):
        size = max(size, abs(polygon[i, 0] - polygon[0, 0]), abs(polygon[i, 1] - polygon[0, 1]))
    flat = FLAT * size * size
    if not _clip_ears(polygon, flat, corners, across):
        return points[:n], corners[:0].copy().reshape(-1, 3), across[:0].copy().reshape(-1, 3)
    n_triangles, n_points, last = n - 2, n, 0
    stack, waiting = np.empty(3 * largest, dtype=np.int64), np.zeros(3 * largest, dtype=np.bool_)
    for i in range(len(inner)):
        points[n_points, 0], points[n_points, 1] = inner[i, 0], inner[i, 1]
        found = _locate(points, corners, across, n_triangles, n_points, last, flat)
        if found < 0:
            continue
        last = found
        first, second, third = 3 * found, 3 * n_triangles, 3 * n_triangles + 3
        a, b, c = corners[first], corners[first + 1], corners[first + 2]
        upper, left = across[first + 1], across[first + 2]
        _set_corners(corners, first, a, b, n_points)
        _set_corners(corners, second, b, c, n_points)
        _set_corners(corners, third, c, a, n_points)
        _join(across, second, upper)
        _join(across, third, left)
        _join(across, first + 1, second + 2)
        _join(across, second + 1, third + 2)
        _join(across, third + 1, first + 2)
        n_points += 1
        n_triangles += 2
        n_waiting = 0
        for half_edge in (first, second, third):
            n_waiting = _push(stack, waiting, n_waiting, half_edge)
        _legalise(points, corners, across, stack, waiting, n_waiting, flat, False)
    n_waiting = 0
    for half_edge in range(3 * n_triangles):
        if across[half_edge] > half_edge:
            n_waiting = _push(stack, waiting, n_waiting, half_edge)
    _legalise(points, corners, across, stack, waiting, n_waiting, flat, True)
    across = across[: 3 * n_triangles]
    for half_edge in range(len(across)):
        across[half_edge] = across[half_edge] // 3 if across[half_edge] >= 0 else -1
    triangles = corners[: 3 * n_triangles].copy().reshape(-1, 3)
    return points[:n_points], triangles, across.copy().reshape(-1, 3)


@kernel
def _set_corners(corners: Ints, first: int, a: int, b: int, c: int) -> None:
    corners[first], corners[first + 1], corners[first + 2] = a, b, c


@kernel
def _join(across: Ints, one: int, other: int) -> None:
    """Let two half-edges know of each other; the other one may be -1."""
    across[one] = other
    if other >= 0:
        across[other] = one


@kernel
def _next(half_edge: int) -> int:
    return half_edge - 2 if half_edge % 3 == 2 else half_edge + 1


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


@array_kernel
def _clip_ears(polygon: Floats, flat: float, corners: Ints, across: Ints) -> bool:
    """Triangulate a polygon by clipping ears; return False where there is none though corners are left."""
    n = len(polygon)
    after, before = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    # The half-edge of a triangle on the other side of the edge from each corner to the next.
    beyond = np.full(n, -1, dtype=np.int64)
    for i in range(n):
        after[i] = i + 1 if i + 1 < n else 0
        before[i] = i - 1 if i > 0 else n - 1
    low, cell, side, order, starts = _sorted_into_cells(polygon)
    # In rounds, in which no ear is next to another, or they would all share a corner. A corner that is no ear
    # can become one only when a neighbour is clipped.
    waiting, n_waiting = np.empty(n, dtype=np.int64), n
    touched, changed = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for i in range(n):
        waiting[i], changed[i] = i, -1
    left, first, this_round = n, 0, 0
    while left > 3:
        n_touched, n_left = 0, left
        for i in range(n_waiting):
            b = waiting[i]
            if after[b] < 0 or changed[b] == this_round or left == 3:
                continue
            a, c = before[b], after[b]
            if not _is_ear(polygon, after, (a, b, c), left, flat, low, cell, side, order, starts):
                continue
            _set_corners(corners, first, a, b, c)
            _join(across, first, beyond[a])
            _join(across, first + 1, beyond[b])
            beyond[a] = first + 2
            after[a], before[c], after[b] = c, a, -1
            for end in (a, c):
                if changed[end] != this_round:
                    changed[end] = this_round
                    touched[n_touched] = end
                    n_touched += 1
            first += 3
            left -= 1
        waiting, touched, n_waiting = touched, waiting, n_touched
        if left == n_left:  # all were tried
            if flat == 0.0:
                return False
            flat = 0.0  # where sides are straight but for rounding, an allowance may hide the last ears
            n_waiting = _corners_left(after, waiting)
        this_round += 1
    _corners_left(after, waiting)
    b = waiting[0]
    a, c = before[b], after[b]
    if _doubled_area(polygon, a, b, c) < -flat:
        return False
    _set_corners(corners, first, a, b, c)
    _join(across, first, beyond[a])
    _join(across, first + 1, beyond[b])
    _join(across, first + 2, beyond[c])
    return True


@kernel
def _corners_left(after: Ints, corners: Ints) -> int:
    """Write which corners of a polygon are left; return how many."""
    n = 0
    for i in range(len(after)):
        if after[i] >= 0:
            corners[n] = i
            n += 1
    return n


@array_kernel
def _sorted_into_cells(polygon: Floats) -> tuple[Floats, Floats, int, Ints, Ints]:
    """Return a grid's lowest corner, cells' size and number along a side, and the vertices cell by cell."""
    n = len(polygon)
    side = max(int(np.sqrt(n)), 1)
    low, cell = np.empty(2), np.empty(2)
    for axis in range(2):
        low[axis], high = extremes(polygon, axis)
        cell[axis] = max((high - low[axis]) / side, 1e-300)
    cells = np.empty(n, dtype=np.int64)
    for i in range(n):
        column = min(int((polygon[i, 0] - low[0]) / cell[0]), side - 1)
        cells[i] = min(int((polygon[i, 1] - low[1]) / cell[1]), side - 1) * side + column
    order, starts = sorted_into_bins(cells, side * side)
    return low, cell, side, order, starts


@kernel
def _is_ear(
    polygon: Floats,
    after: Ints,
    ear: tuple[int, int, int],
    left: int,
    flat: float,
    low: Floats,
    cell: Floats,
    side: int,
    order: Ints,
    starts: Ints,
) -> bool:
    """Return True where the corner b of an ear (a, b, c) is convex and no other corner left is in it.

    Corners are looked for in the cells around the ear, or one after the other where few of them are left.
    """
    a, b, c = ear
    if _doubled_area(polygon, a, b, c) <= flat:
        return False
    low_x = min(polygon[a, 0], polygon[b, 0], polygon[c, 0])
    high_x = max(polygon[a, 0], polygon[b, 0], polygon[c, 0])
    low_y = min(polygon[a, 1], polygon[b, 1], polygon[c, 1])
    high_y = max(polygon[a, 1], polygon[b, 1], polygon[c, 1])
    first, last = int((low_x - low[0]) / cell[0]), min(int((high_x - low[0]) / cell[0]), side - 1)
    bottom, top = int((low_y - low[1]) / cell[1]), min(int((high_y - low[1]) / cell[1]), side - 1)
    first, bottom = min(first, side - 1), min(bottom, side - 1)
    if 2 * (top - bottom + 1) * (last - first + 1) > left:
        other = after[c]
        while other != a:
            x, y = polygon[other, 0], polygon[other, 1]
            if low_x <= x <= high_x and low_y <= y <= high_y and _has(polygon, a, b, c, other, flat):
                return False
            other = after[other]
        return True
    for line in range(bottom, top + 1):
        for k in range(starts[line * side + first], starts[line * side + last + 1]):
            other = order[k]
            x, y = polygon[other, 0], polygon[other, 1]
            if (
                low_x <= x <= high_x
                and low_y <= y <= high_y
                and after[other] >= 0
                and other not in (a, b, c)
                and _has(polygon, a, b, c, other, flat)
            ):
                return False
    return True


@kernel
def _has(polygon: Floats, a: int, b: int, c: int, other: int, flat: float) -> bool:
    """Return True where a corner is in a triangle or, but for rounding, on its border."""
    return bool(
        _doubled_area(polygon, a, b, other) >= -flat
        and _doubled_area(polygon, b, c, other) >= -flat
        and _doubled_area(polygon, c, a, other) >= -flat
    )


@kernel
def _push(stack: Ints, waiting: Bools, n: int, half_edge: int) -> int:
    """Put a half-edge on a stack of n, unless it waits there; return how many there are."""
    if waiting[half_edge]:
        return n
    waiting[half_edge] = True
    stack[n] = half_edge
    return n + 1


@kernel
def _legalise(
    points: Floats,
    corners: Ints,
    across: Ints,
    stack: Ints,
    waiting: Bools,
    n: int,
    flat: float,
    around: bool,
) -> None:
    """Flip edges whose opposite angles exceed 180 degrees together, and then those around them.

    Parameters
    ----------
    points, corners, across : arrays
        The triangulation, changed in place.
    stack : (k,) int array
        The edges, and room for all others.
    waiting : (k,) bool array
        Which edges are on the stack; none, in the end.
    n : int
        Number of edges.
    flat : float
        Twice the area of a triangle that is flat but for rounding.
    around : bool
        True to look at all four edges around a flipped one; False where the edges are those opposite a
        new point, which is in the third corner: then the two that have become opposite to it suffice.
    """
    flips = 0
    while n > 0:
        n -= 1
        one = stack[n]
        waiting[one] = False
        other = across[one]
        if other < 0 or flips >= MOST_FLIPS * len(points):
            continue
        one_next, other_next = _next(one), _next(other)
        one_last, other_last = _next(one_next), _next(other_next)
        a, b, c, d = corners[one], corners[one_next], corners[one_last], corners[other_last]
        cosine_c, cosine_d = _product(points, a, b, c), _product(points, a, b, d)
        sine_c, sine_d = _doubled_area(points, a, b, c), _doubled_area(points, b, a, d)
        sine = sine_c * cosine_d + cosine_c * sine_d  # of c + d
        if sine >= 0.0:
            continue
        scale = np.sqrt((cosine_c**2 + sine_c**2) * (cosine_d**2 + sine_d**2))
        if sine >= -1e-12 * scale:  # but for rounding
            continue
        if _doubled_area(points, c, a, d) <= flat or _doubled_area(points, c, d, b) <= flat:
            continue
        bc, ca, ad, db = across[one_next], across[one_last], across[other_next], across[other_last]
        t, u = one - one % 3, other - other % 3
        _set_corners(corners, t, a, d, c)
        _set_corners(corners, u, d, b, c)
        _join(across, t, ad)
        _join(across, t + 1, u + 2)
        _join(across, t + 2, ca)
        _join(across, u, db)
        _join(across, u + 1, bc)
        flips += 1
        n = _push(stack, waiting, _push(stack, waiting, n, t), u)
        if around:
            n = _push(stack, waiting, _push(stack, waiting, n, t + 2), u + 1)


@kernel
def _locate(
    points: Floats, corners: Ints, across: Ints, n_triangles: int, point: int, start: int, flat: float
) -> int:
    """Return the triangle that has a point strictly inside, -1 if none has.

    The walk from triangle to triangle ends at once in most cases; where the boundary stops it, all are tried.
    """
    t = start
    for _ in range(n_triangles):
        worst, least = -1, flat
        for side in range(3):
            half_edge = 3 * t + side
            area = _doubled_area(points, corners[half_edge], corners[_next(half_edge)], point)
            if area < least or (worst < 0 and area <= least):
                worst, least = half_edge, area
        if worst < 0:
            return t
        if across[worst] < 0:
            break
        t = across[worst] // 3
    for other in range(n_triangles):
        inside = True
        for side in range(3):
            half_edge = 3 * other + side
            end = corners[_next(half_edge)]
            inside = inside and _doubled_area(points, corners[half_edge], end, point) > flat
        if inside:
            return other
    return -1
