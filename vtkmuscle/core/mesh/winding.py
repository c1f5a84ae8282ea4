"""Winding numbers of closed surfaces, by rays through a tree of triangles."""

from __future__ import annotations

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Bools, Floats, Ints


@kernel
def wind(
    queries: Floats, corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, stack: Ints,
    inside: Bools,
) -> None:  # fmt: skip
    """Write whether the winding number of each query (q, 3) is not 0. stack : (64,), working memory.

    The winding number is the sum of triangles above a point, with opposite signs for both sides. Seen along
    the rays, each point of an edge belongs to exactly one of both triangles, so no ray slips through.
    """
    n_leaves = len(leaves) - 1
    u, v = (along + 1) % 3, (along + 2) % 3
    for q in range(len(queries)):
        x, y, z = queries[q, u], queries[q, v], queries[q, along]
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
            for i in range(leaves[leaf], leaves[leaf + 1]):
                winding += _side_below(queries[q], corners[i, 0], corners[i, 1], corners[i, 2], along)
        inside[q] = winding != 0


@kernel
def _side_below(query: Floats, a: Floats, b: Floats, c: Floats, along: int) -> int:
    """Return 1 or -1 for a triangle above a point, by its side, else 0. An edge belongs to one side."""
    u, v = (along + 1) % 3, (along + 2) % 3
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
