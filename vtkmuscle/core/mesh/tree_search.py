"""The nearest triangles of points, searched for in a tree of boxes: one by one, or side by side."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel, vector_kernel
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.surface import numbered_edges
from vtkmuscle.core.types import Floats, Ints

#: Regions of a triangle: its face, the edge from corner k to the next, or corner k.
FACE, EDGE, CORNER = 0, 1, 4


@kernel
def nearest_on_triangle(  # noqa: PLR0911 -- one for each region
    px: float, py: float, pz: float, a: Floats, b: Floats, c: Floats
) -> tuple[float, float, float, int]:
    """Return the point of triangle abc that is nearest to p, and where on the triangle it is.

    Voronoi regions of the corners, edges and face, Ericson 2005, *Real-time collision detection*, 5.1.5.
    a, b, c : (3,).  The last number is FACE, EDGE + k (from corner k to the next) or CORNER + k.
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
    """Return the squared distance of a point from a box, its low and high corner (6,); 0 inside."""
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    distance2: float = dx * dx + dy * dy + dz * dz
    return distance2


def pseudonormals(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return the normals (k, 3) by which a point's side of a surface follows, and their rows (m, 7).

    A point is outside where its offset from the nearest point of the surface goes along the normal there,
    inside where it goes against it. At an edge that is the sum of the unit normals of its triangles; at a
    corner the sum of these times the triangles' angles at the corner: Baerentzen, Aanaes 2005,
    doi:10.1109/TVCG.2005.49. The rows are those of each triangle's regions FACE, EDGE + k and CORNER + k;
    triangles face outward.
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
    """Write the place of the nearest triangle to each point; arguments as of :func:`search_in_packets`.

    stack, near : (64,), working memory, as deep as the tree.
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
    return (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2


#: Points of a packet. Processors compute four or eight at a time, for which loops of 8 are too short.
LANES = 16
#: The point by which a packet chooses the box to enter first.
MIDDLE = LANES // 2


@vector_kernel
def search_in_packets(
    corners: Floats,
    boxes: Floats,
    discs: Floats,
    queries: Floats,
    run: int,
    places: Ints,
    stack: Ints,
    near: Floats,
    lanes: Floats,
) -> None:
    """Write the place of the nearest triangle to each point, :data:`LANES` points at a time.

    A packet goes through the tree as one: into each box that may be nearest to any of its points. Points on a
    lattice need nearly the same boxes, and a packet takes a third of the time of its points; points far apart
    take many times as long. What is written for a run of ``run`` points does not depend on the runs before
    it, to the last digit.

    corners, boxes, discs : of a :class:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree`; queries : (q, 3);
    places : (q,), written: places in the tree's order; stack, near : (64,), lanes : (5, LANES), memory.
    """
    n_leaves = (len(boxes) + 1) // 2
    x, y, z, best, bound = lanes[0], lanes[1], lanes[2], lanes[3], lanes[4]
    packets = (run + LANES - 1) // LANES  # of a run
    for number in range((len(queries) + run - 1) // run * packets):
        begin = number // packets * run
        first = begin + number % packets * LANES
        last = min(first + LANES, begin + run, len(queries))
        if first >= last:
            continue
        _begin(corners, queries, places, places[first - 1] if first > begin else 0, first, last, lanes)
        mx, my, mz = x[MIDDLE], y[MIDDLE], z[MIDDLE]
        stack[0], near[0], size = 0, 0.0, 1
        while size:
            size -= 1
            node = stack[size]
            # Near the middle is near enough, and known.
            if near[size] >= best[MIDDLE] and not _box_is_near(boxes[node], x, y, z, best):
                continue
            if node < n_leaves - 1:
                left, right = 2 * node + 1, 2 * node + 2
                to_left = distance2_to_box(boxes[left], mx, my, mz)
                to_right = distance2_to_box(boxes[right], mx, my, mz)
                if to_left < to_right:
                    left, right, to_left, to_right = right, left, to_right, to_left
                stack[size], near[size] = left, to_left
                stack[size + 1], near[size + 1] = right, to_right
                size += 2
                continue
            leaf = node - (n_leaves - 1)
            if not _disc_is_near(discs[leaf], x, y, z, best):
                continue
            for i in range(leaf * len(corners) // n_leaves, (leaf + 1) * len(corners) // n_leaves):
                _distances2(corners[i, 0], corners[i, 1], corners[i, 2], x, y, z, bound)
                for lane in range(last - first):
                    if bound[lane] < best[lane]:
                        best[lane], places[first + lane] = bound[lane], i


@kernel
def _begin(
    corners: Floats, queries: Floats, places: Ints, place: int, first: int, last: int, lanes: Floats
) -> None:
    """Write a packet's points, and their distances from the triangle to begin with.

    That is the one nearest to the last point of the packet before. Lanes without a point ask for nothing.
    """
    a, b, c = corners[place, 0], corners[place, 1], corners[place, 2]
    for lane in range(LANES):
        q = min(first + lane, last - 1)
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        cx, cy, cz, _ = nearest_on_triangle(x, y, z, a, b, c)
        best = (cx - x) ** 2 + (cy - y) ** 2 + (cz - z) ** 2
        lanes[0, lane], lanes[1, lane], lanes[2, lane] = x, y, z
        lanes[3, lane] = best if best >= 0.0 else np.inf  # of a triangle without area
        if first + lane >= last:
            lanes[3, lane] = 0.0  # nothing is nearer
        places[q] = place


@vector_kernel
def _box_is_near(box: Floats, x: Floats, y: Floats, z: Floats, best: Floats) -> bool:
    """Return whether a box is nearer to any point of a packet than the nearest triangle so far."""
    low_x, low_y, low_z, high_x, high_y, high_z = box[0], box[1], box[2], box[3], box[4], box[5]
    nearer = 0
    for lane in range(LANES):
        dx = max(low_x - x[lane], x[lane] - high_x, 0.0)
        dy = max(low_y - y[lane], y[lane] - high_y, 0.0)
        dz = max(low_z - z[lane], z[lane] - high_z, 0.0)
        nearer += dx * dx + dy * dy + dz * dz < best[lane]
    return nearer > 0


@vector_kernel
def _disc_is_near(disc: Floats, x: Floats, y: Floats, z: Floats, best: Floats) -> bool:
    """Return the same of the cylinder around a leaf's triangles."""
    mx, my, mz, ax, ay, az, radius, half = (
        disc[0], disc[1], disc[2], disc[3], disc[4], disc[5], disc[6], disc[7]
    )  # fmt: skip
    nearer = 0
    for lane in range(LANES):
        dx, dy, dz = x[lane] - mx, y[lane] - my, z[lane] - mz
        up = dx * ax + dy * ay + dz * az
        dx, dy, dz = dx - up * ax, dy - up * ay, dz - up * az
        aside = max(np.sqrt(dx * dx + dy * dy + dz * dz) - radius, 0.0)
        up = max(abs(up) - half, 0.0)
        nearer += up * up + aside * aside < best[lane]
    return nearer > 0


@vector_kernel
def _distances2(a: Floats, b: Floats, c: Floats, x: Floats, y: Floats, z: Floats, out: Floats) -> None:
    """Write squared distances from a triangle: from its plane over its face, from the nearest side elsewhere.

    Without branches, so that points are computed side by side. NaN where the triangle has no area: its
    neighbours have its sides too.
    """
    ox, oy, oz = a[0], a[1], a[2]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = vx - ux, vy - uy, vz - uz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    by_u, by_v = 1.0 / (ux * ux + uy * uy + uz * uz), 1.0 / (vx * vx + vy * vy + vz * vz)
    by_w, by_n = 1.0 / (wx * wx + wy * wy + wz * wz), 1.0 / (nx * nx + ny * ny + nz * nz)
    # Inward from each side, in the plane.
    iux, iuy, iuz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    ivx, ivy, ivz = vy * nz - vz * ny, vz * nx - vx * nz, vx * ny - vy * nx
    iwx, iwy, iwz = ny * wz - nz * wy, nz * wx - nx * wz, nx * wy - ny * wx
    for lane in range(LANES):
        px, py, pz = x[lane] - ox, y[lane] - oy, z[lane] - oz
        qx, qy, qz = px - ux, py - uy, pz - uz
        t = min(max((ux * px + uy * py + uz * pz) * by_u, 0.0), 1.0)
        dx, dy, dz = px - t * ux, py - t * uy, pz - t * uz
        side = dx * dx + dy * dy + dz * dz
        t = min(max((vx * px + vy * py + vz * pz) * by_v, 0.0), 1.0)
        dx, dy, dz = px - t * vx, py - t * vy, pz - t * vz
        side = min(side, dx * dx + dy * dy + dz * dz)
        t = min(max((wx * qx + wy * qy + wz * qz) * by_w, 0.0), 1.0)
        dx, dy, dz = qx - t * wx, qy - t * wy, qz - t * wz
        side = min(side, dx * dx + dy * dy + dz * dz)
        of_u = iux * px + iuy * py + iuz * pz
        of_v = ivx * px + ivy * py + ivz * pz
        of_w = iwx * qx + iwy * qy + iwz * qz
        up = px * nx + py * ny + pz * nz
        out[lane] = up * up * by_n if min(of_u, of_v, of_w) >= 0.0 else side
