"""Searches of a tree of triangles: the nearest triangle, and the winding number."""

import math

import numpy as np

from vtkmuscle.core.jit import LANES, kernel, lane, vector_kernel
from vtkmuscle.core.types import ROUNDING, TINY, Bools, Floats, Ints


@kernel
def nearest_on_triangle(  # noqa: PLR0911 -- a return for each region
    px: float, py: float, pz: float, corners: Floats
) -> tuple[float, float, float]:
    """Return the point of a triangle nearest to p. Corners (9,).

    Voronoi regions of corners, edges and face, Ericson 2005, *Real-time collision detection*, 5.1.5.
    """
    a, b, c = corners[:3], corners[3:6], corners[6:]
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = px - a[0], py - a[1], pz - a[2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return a[0], a[1], a[2]
    bpx, bpy, bpz = px - b[0], py - b[1], pz - b[2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return b[0], b[1], b[2]
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0 and d1 > d3:  # not if a and b are at the same place
        t = d1 / (d1 - d3)
        return a[0] + t * abx, a[1] + t * aby, a[2] + t * abz
    cpx, cpy, cpz = px - c[0], py - c[1], pz - c[2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return c[0], c[1], c[2]
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return a[0] + t * acx, a[1] + t * acy, a[2] + t * acz
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return b[0] + t * (c[0] - b[0]), b[1] + t * (c[1] - b[1]), b[2] + t * (c[2] - b[2])
    # The foot on the plane, exact for needles.
    nx, ny, nz = aby * acz - abz * acy, abz * acx - abx * acz, abx * acy - aby * acx
    rise = (apx * nx + apy * ny + apz * nz) / (nx * nx + ny * ny + nz * nz)
    return px - rise * nx, py - rise * ny, pz - rise * nz


@kernel
def distance2_to_box(box: Floats, x: float, y: float, z: float) -> float:
    """Return the squared distance from a box. The box has corners (6,); 0 inside."""
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    return float(dx * dx + dy * dy + dz * dz)


@kernel
def search_tree(
    corners: Floats, boxes: Floats, leaves: Ints, queries: Floats, nearest: Ints, closest: Floats,
    distances: Floats, stack: Ints, to_box: Floats, apart: Floats,
) -> None:  # fmt: skip
    """Write the nearest triangle to each query, with its nearest point and distance.

    corners, boxes, leaves : of a :class:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree`;
    queries, closest : (q, 3); nearest, distances : (q,), triangles in the tree's order;
    stack, to_box, apart : working memory, (64,), (64,), (LANES,).
    """
    leaf = 0  # the last query's: consecutive queries are neighbours along a fibre
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        leaf, k, square = _nearest_triangle(corners, boxes, leaves, x, y, z, leaf, stack, to_box, apart)
        nearest[q] = leaves[leaf] + k  # not of the last one's copies: the first of equals
        cx, cy, cz = nearest_on_triangle(x, y, z, corners[leaf, :, k])
        closest[q, 0], closest[q, 1], closest[q, 2] = cx, cy, cz
        distances[q] = math.sqrt(square)  # of equally near triangles each has the same


@kernel
def lower_distances(
    corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, unsigned: bool, queries: Floats,
    distances: Floats, stack: Ints, to_box: Floats, apart: Floats,
) -> None:  # fmt: skip
    """Lower distances (q,) to the signed distances from a tree's surface, where these are less.

    Arrays are as of :func:`search_tree`, ``along`` and ``slack`` as of :func:`is_inside`. ``unsigned``
    distances are of a surface without an inside.
    """
    leaf, last, distance, inside = 0, 0, -1.0, False
    for q in range(len(queries)):
        x, y, z, best = queries[q, 0], queries[q, 1], queries[q, 2], distances[q]
        if math.sqrt(distance2_to_box(boxes[0], x, y, z)) > max(best, 0.0):
            continue
        leaf, _, square = _nearest_triangle(corners, boxes, leaves, x, y, z, leaf, stack, to_box, apart)
        x, y, z = x - queries[last, 0], y - queries[last, 1], z - queries[last, 2]
        # No surface is between two points that are nearer to each other than to the surface.
        if not (unsigned or math.sqrt(x * x + y * y + z * z) < distance):
            inside = is_inside(queries[q], corners, boxes, leaves, along, slack, stack, apart)
        last, distance = q, math.sqrt(square)
        distances[q] = min(-distance if inside else distance, best)


@kernel
def _nearest_triangle(
    corners: Floats, boxes: Floats, leaves: Ints, x: float, y: float, z: float, guess: int, stack: Ints,
    to_box: Floats, apart: Floats,
) -> tuple[int, int, float]:  # fmt: skip
    """Return the leaf of the triangle nearest to a position, its number there, and its squared distance.

    The search begins with the leaf ``guess``.
    """
    n_leaves = len(leaves) - 1
    stack[0], stack[1], to_box[0], to_box[1], size = 0, n_leaves - 1 + guess, 0.0, 0.0, 2
    nearest, number, best = guess, 0, np.inf
    while size:
        size -= 1
        node = stack[size]
        if to_box[size] >= best:
            continue
        if node < n_leaves - 1:
            left, right = 2 * node + 1, 2 * node + 2
            to_left = distance2_to_box(boxes[left], x, y, z)
            to_right = distance2_to_box(boxes[right], x, y, z)
            if to_left < to_right:
                left, right, to_left, to_right = right, left, to_right, to_left
            stack[size], to_box[size] = left, to_left
            stack[size + 1], to_box[size + 1] = right, to_right
            size += 2
            continue
        leaf = node - (n_leaves - 1)
        _squares(corners[leaf].reshape(-1), x, y, z, apart)
        for k in range(LANES):
            if apart[k] < best:
                nearest, number, best = leaf, k, apart[k]
    return nearest, number, best


@vector_kernel
def _squares(corners: Floats, x: float, y: float, z: float, apart: Floats) -> None:
    """Write the squared distances of a position from a leaf's triangles."""
    for k in range(LANES):
        apart[k] = _square(corners, x, y, z, k)


@lane
def _square(corners: Floats, x: float, y: float, z: float, k: int) -> float:
    """Return the squared distance from the k-th triangle: its plane's above it, else its edges'."""
    a, b, c = corners[k], corners[LANES + k], corners[2 * LANES + k]
    px, py, pz = x - a, y - b, z - c
    ux, uy, uz = corners[3 * LANES + k] - a, corners[4 * LANES + k] - b, corners[5 * LANES + k] - c
    vx, vy, vz = corners[6 * LANES + k] - a, corners[7 * LANES + k] - b, corners[8 * LANES + k] - c
    uu, vv, uv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
    pu, pv = px * ux + py * uy + pz * uz, px * vx + py * vy + pz * vz
    to_edges = min(_square_from(px, py, pz, ux, uy, uz, uu, pu), _square_from(px, py, pz, vx, vy, vz, vv, pv))
    qx, qy, qz, wx, wy, wz = px - ux, py - uy, pz - uz, vx - ux, vy - uy, vz - uz
    ww, qw = wx * wx + wy * wy + wz * wz, qx * wx + qy * wy + qz * wz
    to_edges = min(to_edges, _square_from(qx, qy, qz, wx, wy, wz, ww, qw))
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    nn, height = nx * nx + ny * ny + nz * nz, px * nx + py * ny + pz * nz
    by_u, by_v = vv * pu - uv * pv, uu * pv - uv * pu
    above = (by_u > 0.0) & (by_v > 0.0) & (by_u + by_v < nn) & (nn > ROUNDING * ROUNDING * uu * vv)
    return height * height / (nn + TINY) if above else to_edges


@lane
def _square_from(
    x: float, y: float, z: float, u: float, v: float, w: float, square: float, along: float
) -> float:
    """Return the squared distance from an edge (u, v, w), of a position from the edge's start."""
    part = min(max(along / (square + TINY), 0.0), 1.0)
    x, y, z = x - part * u, y - part * v, z - part * w
    return x * x + y * y + z * z


@kernel
def find_inside(
    queries: Floats, corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, stack: Ints,
    sides: Floats, inside: Bools,
) -> None:  # fmt: skip
    """Write :func:`is_inside` of each query (q, 3)."""
    for q in range(len(queries)):
        inside[q] = is_inside(queries[q], corners, boxes, leaves, along, slack, stack, sides)


@kernel
def is_inside(
    query: Floats, corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, stack: Ints,
    sides: Floats,
) -> bool:  # fmt: skip
    """Return whether the winding number of a query (3,) is not 0.

    The winding number is the sum of triangles above a point along an axis, signed by their sides. Seen along
    the ray, each point of an edge belongs to exactly one of both triangles, so no ray slips through.

    corners, boxes, leaves : of a :class:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree`;
    slack : of boxes, for rounding;
    stack, sides : working memory, (64,), (LANES,).
    """
    n_leaves = len(leaves) - 1
    u, v = (along + 1) % 3, (along + 2) % 3
    x, y, z = query[u], query[v], query[along]
    stack[0], size, winding = 0, 1, 0.0
    while size:
        size -= 1
        node = stack[size]
        if x + slack < boxes[node, u] or x - slack > boxes[node, 3 + u]:
            continue
        if y + slack < boxes[node, v] or y - slack > boxes[node, 3 + v]:
            continue
        if z - slack > boxes[node, 3 + along]:
            continue
        if node < n_leaves - 1:
            stack[size], stack[size + 1] = 2 * node + 1, 2 * node + 2
            size += 2
            continue
        leaf = node - (n_leaves - 1)
        _find_sides(corners[leaf], u, v, along, x, y, z, sides)
        for k in range(leaves[leaf + 1] - leaves[leaf]):
            winding += sides[k]
    return winding != 0.0


@kernel
def _find_sides(
    corners: Floats, u: int, v: int, along: int, x: float, y: float, z: float, sides: Floats
) -> None:
    """Write the sides of triangles above a point. 1 or -1, else 0."""
    for k in range(LANES):
        ax, bx, cx = corners[u, k], corners[3 + u, k], corners[6 + u, k]
        ay, by, cy = corners[v, k], corners[3 + v, k], corners[6 + v, k]
        az, bz, cz = corners[along, k], corners[3 + along, k], corners[6 + along, k]
        ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
        area = ux * vy - uy * vx
        first, second = ((x - ax) * vy - (y - ay) * vx) / area, (ux * (y - ay) - uy * (x - ax)) / area
        # An edge belongs to one side.
        odd = _crosses(x, y, ax, ay, bx, by) ^ _crosses(x, y, bx, by, cx, cy) ^ _crosses(x, y, cx, cy, ax, ay)
        above = odd & (az + first * (bz - az) + second * (cz - az) > z)
        sides[k] = (1.0 if above & (area > 0.0) else 0.0) - (1.0 if above & (area < 0.0) else 0.0)


@lane
def _crosses(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return True if an edge crosses a ray. From (x, y) towards greater x."""
    # From the lower end, so that both triangles of the edge get the same bits.
    px, qx = (bx if ay > by else ax), (ax if ay > by else bx)
    low, high = min(ay, by), max(ay, by)
    return ((ay > y) != (by > y)) & (px + (y - low) / (high - low) * (qx - px) > x)
