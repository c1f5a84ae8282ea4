"""The nearest triangles of points that lie close together, searched for side by side."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel, vector_kernel
from vtkmuscle.core.mesh.triangle_distance import distance2_to_box, nearest_on_triangle
from vtkmuscle.core.types import Floats, Ints

#: Points of a packet. Processors compute four or eight at a time; with 8 the loops are too short for it.
LANES = 16
#: The point by which a packet decides into which box it goes first.
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
    lanes: Floats,
) -> None:
    """Write which triangle is nearest to each point, :data:`LANES` points at a time.

    A packet goes through the tree as one: into each box that may hold what is nearest to any of its points.
    Of points on a lattice the boxes are nearly the same ones, and a packet takes a third of the time of its
    points; of points far apart it takes many times as long.

    Parameters
    ----------
    corners, boxes, discs : (m, 3, 3), (2^k - 1, 6), (2^(k - 1), 8) arrays
        Of a :class:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree`.
    queries : (q, 3) array
        Positions; those of a packet follow each other.
    run : int
        Points of a run, >= 1: what is written for one does not depend on what comes before it, to the last
        digit.
    places : (q,) int array
        Written: places in the tree's order.
    stack, lanes : (64,) int array, (5, LANES) array
        Working memory.
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
        stack[0], size = 0, 1
        while size:
            size -= 1
            node = stack[size]
            if not _box_is_near(boxes[node], x, y, z, best):
                continue
            if node < n_leaves - 1:
                left, right = 2 * node + 1, 2 * node + 2
                mx, my, mz = x[MIDDLE], y[MIDDLE], z[MIDDLE]
                if distance2_to_box(boxes[left], mx, my, mz) < distance2_to_box(boxes[right], mx, my, mz):
                    left, right = right, left
                stack[size], stack[size + 1] = left, right
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

    That is what is nearest to the last point of the packet before. Lanes without a point of their own have
    the last one's.
    """
    a, b, c = corners[place, 0], corners[place, 1], corners[place, 2]
    for lane in range(LANES):
        q = min(first + lane, last - 1)
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        cx, cy, cz, _ = nearest_on_triangle(x, y, z, a, b, c)
        best = (cx - x) ** 2 + (cy - y) ** 2 + (cz - z) ** 2
        lanes[0, lane], lanes[1, lane], lanes[2, lane] = x, y, z
        lanes[3, lane] = best if best >= 0.0 else np.inf  # of a triangle without area
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
        # Inward of which sides the foot of the perpendicular is.
        of_u = (uy * pz - uz * py) * nx + (uz * px - ux * pz) * ny + (ux * py - uy * px) * nz
        of_v = (py * vz - pz * vy) * nx + (pz * vx - px * vz) * ny + (px * vy - py * vx) * nz
        of_w = (wy * qz - wz * qy) * nx + (wz * qx - wx * qz) * ny + (wx * qy - wy * qx) * nz
        up = px * nx + py * ny + pz * nz
        out[lane] = up * up * by_n if min(of_u, of_v, of_w) >= 0.0 else side
