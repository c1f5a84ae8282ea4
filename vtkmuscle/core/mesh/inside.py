"""Which points are inside of a closed surface, whatever of it is nearest: it may touch itself."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.types import Bools, Floats, Ints

#: Boxes are larger by this part of the coordinates, so that rounding hides no triangle from a ray.
_ROUNDING = 1e-14


def points_inside(queries: Floats, tree: TriangleTree) -> Bools:
    """Return which points are inside of a closed surface, by the number of triangles beyond them.

    Rays run along the axis that the points are least spread along: across a long muscle, where few of its
    boxes are in line. Seen along the rays, of two triangles that share an edge exactly one has a place on it:
    no ray slips through.

    Parameters
    ----------
    queries : (k, 3) array
        Points.
    tree : TriangleTree
        Of the surface; closed, whichever way its triangles face.

    Returns
    -------
    (k,) bool array
        True inside; on the surface either.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.inside import points_inside
    >>> from vtkmuscle.core.mesh.triangle_tree import triangle_tree
    >>> corners = np.vstack([np.zeros(3), np.eye(3)])
    >>> tree = triangle_tree(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> points_inside(np.array([[0.2, 0.2, 0.2], [0.4, 0.4, 0.4]]), tree).tolist()
    [True, False]
    """
    inside = np.zeros(len(queries), dtype=np.bool_)
    if len(queries):
        along = int(np.ptp(queries, axis=0).argmin())
        slack = _ROUNDING * float(np.abs(tree.boxes[0]).max())
        stack = np.empty(64, dtype=np.int64)
        _count(np.ascontiguousarray(queries), tree.corners, tree.boxes, along, slack, stack, inside)
    return inside


@kernel
def _count(
    queries: Floats, corners: Floats, boxes: Floats, along: int, slack: float, stack: Ints, inside: Bools
) -> None:
    """Write whether the triangles above each point are odd in number; stack is working memory."""
    n, n_leaves = len(corners), (len(boxes) + 1) // 2
    one, two = (along + 1) % 3, (along + 2) % 3
    for q in range(len(queries)):
        x, y, z = queries[q, one], queries[q, two], queries[q, along]
        stack[0], size, odd = 0, 1, False
        while size:
            size -= 1
            node = stack[size]
            if x + slack < boxes[node, one] or x - slack > boxes[node, 3 + one]:
                continue
            if y + slack < boxes[node, two] or y - slack > boxes[node, 3 + two]:
                continue
            if z - slack > boxes[node, 3 + along]:
                continue
            if node < n_leaves - 1:
                stack[size], stack[size + 1] = 2 * node + 1, 2 * node + 2
                size += 2
                continue
            leaf = node - (n_leaves - 1)
            for i in range(leaf * n // n_leaves, (leaf + 1) * n // n_leaves):
                if _is_below(queries[q], corners[i, 0], corners[i, 1], corners[i, 2], along):
                    odd = not odd
        inside[q] = odd


@kernel
def _is_below(query: Floats, a: Floats, b: Floats, c: Floats, along: int) -> bool:
    """Return True where a triangle is above a point, seen along an axis; an edge is of one of its sides."""
    one, two = (along + 1) % 3, (along + 2) % 3
    x, y = query[one], query[two]
    ax, ay, bx, by, cx, cy = a[one], a[two], b[one], b[two], c[one], c[two]
    within = _crosses(x, y, ax, ay, bx, by) != _crosses(x, y, bx, by, cx, cy)
    if within == _crosses(x, y, cx, cy, ax, ay):
        return False
    ux, uy, uz = bx - ax, by - ay, b[along] - a[along]
    vx, vy, vz = cx - ax, cy - ay, c[along] - a[along]
    area = ux * vy - uy * vx
    if area == 0.0:
        return False
    first = ((x - ax) * vy - (y - ay) * vx) / area
    second = (ux * (y - ay) - uy * (x - ax)) / area
    return bool(a[along] + first * uz + second * vz > query[along])


@kernel
def _crosses(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return True where an edge crosses the ray from a place towards greater x, whichever way it runs."""
    if (ay > y) == (by > y):
        return False
    # From the lower end on, so that the edge's other triangle gets the same answer to the last digit.
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return bool(ax + (y - ay) / (by - ay) * (bx - ax) > x)
