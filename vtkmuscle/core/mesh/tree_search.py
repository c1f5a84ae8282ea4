"""Nearest triangles of points, by a bounding volume hierarchy."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.surface import numbered_edges
from vtkmuscle.core.types import Floats, Ints

#: Regions of a triangle: its face, the edge from corner k to the next, or corner k.
FACE, EDGE, CORNER = 0, 1, 4


@kernel
def nearest_on_triangle(  # noqa: PLR0911 -- a return for each region
    px: float, py: float, pz: float, a: Floats, b: Floats, c: Floats
) -> tuple[float, float, float, int]:
    """Return the point and region of a triangle nearest to p.

    Voronoi regions of corners, edges and face, Ericson 2005, *Real-time collision detection*, 5.1.5. a, b, c
    : (3,). The region is FACE, EDGE + k (from corner k to the next) or CORNER + k.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = px - a[0], py - a[1], pz - a[2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return a[0], a[1], a[2], CORNER
    bpx, bpy, bpz = px - b[0], py - b[1], pz - b[2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return b[0], b[1], b[2], CORNER + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return a[0] + t * abx, a[1] + t * aby, a[2] + t * abz, EDGE
    cpx, cpy, cpz = px - c[0], py - c[1], pz - c[2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return c[0], c[1], c[2], CORNER + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return a[0] + t * acx, a[1] + t * acy, a[2] + t * acz, EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return b[0] + t * (c[0] - b[0]), b[1] + t * (c[1] - b[1]), b[2] + t * (c[2] - b[2]), EDGE + 1
    scale = 1.0 / (va + vb + vc)
    v, w = vb * scale, vc * scale
    return a[0] + v * abx + w * acx, a[1] + v * aby + w * acy, a[2] + v * abz + w * acz, FACE


@kernel
def distance2_to_box(box: Floats, x: float, y: float, z: float) -> float:
    """Return the squared distance from a box. The box has corners (6,); 0 inside."""
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    distance2: float = dx * dx + dy * dy + dz * dz
    return distance2


def pseudonormals(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return normals (k, 3) for sides, and their rows (m, 7).

    A point is outside if its offset from the nearest surface point goes along the normal there. The normal of
    an edge is the sum of its triangles' unit normals; the normal of a corner weights them by the triangles'
    angles: Baerentzen, Aanaes 2005, doi:10.1109/TVCG.2005.49. Rows are of each triangle's regions FACE, EDGE
    + k and CORNER + k; triangles face outward.
    """
    normals = triangle_normals(points, triangles)
    faces = unit_vectors(normals)
    onward = points[triangles[:, [1, 2, 0]]] - points[triangles]
    # atan2 keeps small angles exact, and is 0 for triangles without area.
    sines, cosines = np.linalg.norm(normals, axis=1), -np.einsum("mki,mki->mk", onward, onward[:, [2, 0, 1]])
    angles = np.arctan2(sines[:, None], cosines).reshape(-1)
    edge_of = numbered_edges(triangles)[1]
    parts = [faces]
    for at, weights, count in (
        (edge_of, np.ones(len(angles)), int(edge_of.max(initial=-1)) + 1),
        (triangles.reshape(-1), angles, len(points)),
    ):
        sums = [np.bincount(at, weights * np.repeat(axis, 3), count) for axis in faces.T]
        parts.append(np.column_stack(sums))
    first, second = len(faces), len(faces) + len(parts[1])
    own = np.arange(len(faces))[:, None]
    return np.vstack(parts), np.hstack([own, first + edge_of.reshape(-1, 3), second + triangles])


@kernel
def _foot(corners: Floats, query: Floats, foot: Floats) -> float:
    """Write the foot of a perpendicular; return its length. Foot (3,), onto a triangle's plane.

    More digits than by barycentric coordinates, for needle triangles.
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
    corners: Floats, queries: Floats, nearest: Ints, closest: Floats, distances: Floats, regions: Ints
) -> None:
    """Write nearest points, distances and regions. Points (q, 3) on triangles, distances and regions (q,)."""
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        at = corners[nearest[q]]
        cx, cy, cz, regions[q] = nearest_on_triangle(x, y, z, at[0], at[1], at[2])
        closest[q, 0], closest[q, 1], closest[q, 2] = cx, cy, cz
        distances[q] = np.sqrt((cx - x) ** 2 + (cy - y) ** 2 + (cz - z) ** 2)
        if regions[q] == FACE:
            distances[q] = _foot(at, queries[q], closest[q])


@kernel
def search_tree(
    corners: Floats, boxes: Floats, queries: Floats, nearest: Ints, stack: Ints, near: Floats
) -> None:
    """Write the nearest triangle to each query.

    corners, boxes : of a :class:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree`; queries : (q, 3); nearest
    : (q,), in the tree's order; stack, near : (64,), working memory, as deep as the tree.
    """
    n, n_leaves = len(corners), (len(boxes) + 1) // 2
    guess = 0  # the last query's triangle: consecutive queries are neighbours along a fibre
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        best = _distance2(corners[guess], x, y, z)
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
            for i in range(leaf * n // n_leaves, (leaf + 1) * n // n_leaves):
                distance2 = _distance2(corners[i], x, y, z)
                if distance2 < best:
                    best, guess = distance2, i
        nearest[q] = guess


@kernel
def _distance2(corners: Floats, x: float, y: float, z: float) -> float:
    px, py, pz, _ = nearest_on_triangle(x, y, z, corners[0], corners[1], corners[2])
    return (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
