"""The nearest triangles of points, searched for in a tree of boxes one point after another."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.triangle_distance import FACE, distance2_to_box, nearest_on_triangle
from vtkmuscle.core.types import Floats, Ints


@kernel
def along_disc(disc: Floats, x: float, y: float, z: float) -> tuple[float, float]:
    """Return how far a point is from a disc's centre, along its axis and across it."""
    dx, dy, dz = x - disc[0], y - disc[1], z - disc[2]
    up = dx * disc[3] + dy * disc[4] + dz * disc[5]
    ax, ay, az = dx - up * disc[3], dy - up * disc[4], dz - up * disc[5]
    return up, np.sqrt(ax * ax + ay * ay + az * az)


@kernel
def _foot(corners: Floats, query: Floats, foot: Floats) -> float:
    """Put the foot of the perpendicular onto a triangle's plane into foot (3,); return its length.

    For needles of triangles it has more digits than barycentric coordinates give.
    """
    a, b, c = corners[0], corners[1], corners[2]
    nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
    ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
    nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    double_area2 = nx * nx + ny * ny + nz * nz
    rise = (query[0] - a[0]) * nx + (query[1] - a[1]) * ny + (query[2] - a[2]) * nz
    foot[0] = query[0] - nx * rise / double_area2
    foot[1] = query[1] - ny * rise / double_area2
    foot[2] = query[2] - nz * rise / double_area2
    length: float = abs(rise) / np.sqrt(double_area2)
    return length


@kernel
def measure_nearest(
    corners: Floats, queries: Floats, places: Ints, closest: Floats, distances: Floats, regions: Ints
) -> None:
    """Write the nearest points of the nearest triangles, (q, 3), their distances and regions, (q,)."""
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        at = corners[places[q]]
        cx, cy, cz, regions[q] = nearest_on_triangle(x, y, z, at[0], at[1], at[2])
        closest[q, 0], closest[q, 1], closest[q, 2] = cx, cy, cz
        distances[q] = np.sqrt((cx - x) ** 2 + (cy - y) ** 2 + (cz - z) ** 2)
        if regions[q] == FACE:
            distances[q] = _foot(at, queries[q], closest[q])


@kernel
def search_tree(
    corners: Floats, boxes: Floats, discs: Floats, queries: Floats, places: Ints, stack: Ints, near: Floats
) -> None:
    """Write which triangle is nearest to each point.

    Parameters
    ----------
    corners, boxes, discs, queries, places
        As of :func:`~vtkmuscle.core.mesh.packet_search.search_in_packets`.
    stack, near : (64,) arrays
        Working memory, as deep as the tree.
    """
    n, n_leaves = len(corners), (len(boxes) + 1) // 2
    place = 0  # the last query's answer is a good guess: neighbours follow each other along a fibre
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        best = _distance2(corners[place], x, y, z)
        if not best >= 0.0:  # a triangle without area: its neighbours have its edges too
            best = np.inf
        stack[0], near[0], size = 0, 0.0, 1
        while size:
            size -= 1
            node = stack[size]
            if near[size] >= best:
                continue
            if node < n_leaves - 1:
                left, right = 2 * node + 1, 2 * node + 2
                to_left = distance2_to_box(boxes[left], x, y, z)
                to_right = distance2_to_box(boxes[right], x, y, z)
                if to_left < to_right:
                    left, right, to_left, to_right = right, left, to_right, to_left
                stack[size], near[size] = left, to_left
                stack[size + 1], near[size + 1] = right, to_right
                size += 2
                continue
            leaf = node - (n_leaves - 1)
            up, aside = along_disc(discs[leaf], x, y, z)
            up, aside = max(abs(up) - discs[leaf, 7], 0.0), max(aside - discs[leaf, 6], 0.0)
            if up * up + aside * aside >= best:
                continue
            for i in range(leaf * n // n_leaves, (leaf + 1) * n // n_leaves):
                distance2 = _distance2(corners[i], x, y, z)
                if distance2 < best:
                    best, place = distance2, i
        places[q] = place


@kernel
def _distance2(corners: Floats, x: float, y: float, z: float) -> float:
    px, py, pz, _ = nearest_on_triangle(x, y, z, corners[0], corners[1], corners[2])
    distance2: float = (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
    return distance2
