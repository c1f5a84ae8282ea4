"""Winding numbers of closed surfaces, by rays through a tree of triangles."""

from __future__ import annotations

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Bools, Floats, Ints


@kernel
def find_inside(
    queries: Floats, corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, stack: Ints,
    inside: Bools,
) -> None:  # fmt: skip
    """Write :func:`is_inside` of each query (q, 3)."""
    for q in range(len(queries)):
        inside[q] = is_inside(queries[q], corners, boxes, leaves, along, slack, stack)


@kernel
def is_inside(
    query: Floats, corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, stack: Ints
) -> bool:
    """Return whether the winding number of a query (3,) is not 0.

    The winding number is the sum of triangles above a point along an axis, with opposite signs for both
    sides. Seen along the ray, each point of an edge belongs to exactly one of both triangles, so no ray slips
    through.

    corners, boxes, leaves : of a :class:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree`;
    slack : of boxes, for rounding;
    stack : (64,), working memory.
    """
    n_leaves = len(leaves) - 1
    u, v = (along + 1) % 3, (along + 2) % 3
    x, y, z = query[u], query[v], query[along]
    stack[0], size, winding = 0, 1, 0
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
        for k in range(leaves[leaf + 1] - leaves[leaf]):
            winding += _side_below(query, corners[leaf, :, k], along)
    return winding != 0


@kernel
def _side_below(query: Floats, corners: Floats, along: int) -> int:
    """Return 1 or -1 for a triangle (9,) above a point, by its side, else 0. An edge belongs to one side."""
    u, v, a, b, c = (along + 1) % 3, (along + 2) % 3, corners[:3], corners[3:6], corners[6:]
    x, y = query[u], query[v]
    ax, ay, bx, by, cx, cy = a[u], a[v], b[u], b[v], c[u], c[v]
    within = _crosses(x, y, ax, ay, bx, by) != _crosses(x, y, bx, by, cx, cy)
    if within == _crosses(x, y, cx, cy, ax, ay):
        return 0
    ux, uy, uz = bx - ax, by - ay, b[along] - a[along]
    vx, vy, vz = cx - ax, cy - ay, c[along] - a[along]
    area = ux * vy - uy * vx
    if area == 0.0:
        return 0
    first = ((x - ax) * vy - (y - ay) * vx) / area
    second = (ux * (y - ay) - uy * (x - ax)) / area
    above = a[along] + first * uz + second * vz > query[along]
    return (1 if area > 0.0 else -1) if above else 0


@kernel
def _crosses(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return True if an edge crosses a ray. From (x, y) towards greater x."""
    if (ay > y) == (by > y):
        return False
    # From the lower end, so that both triangles of the edge get the same bits.
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return bool(ax + (y - ay) / (by - ay) * (bx - ax) > x)
