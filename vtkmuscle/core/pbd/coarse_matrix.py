"""The matrix that a muscle's constraints have for nodes which carry its points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.pbd.constraints import DEGENERATE_SINE, DIHEDRAL_FLOOR

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Stiffness, beside that of a constraint, by which a node holds every point: bounds the correction of what no
#: constraint resists.
HOLD = 1e-4


@kernel
def assemble(  # noqa: PLR0912 -- one loop for each kind of constraint
    x: Floats,
    mass: Floats,
    edges: Ints,
    edge_stiffness: Floats,
    quads: Ints,
    shape_stiffness: float,
    neighbours: Ints,
    weights: Floats,
    centres: Floats,
    reach: float,
    matrix: Floats,
) -> None:
    """Add to the lower triangle of a matrix (6 c, 6 c) what constraints of points x (n, 3) are to c nodes.

    Parameters
    ----------
    x : (n, 3) array
        Points at rest [mm].
    mass : (n,) array
        Inverse masses: 1 free, 0 fixed.
    edges, edge_stiffness : (k, 2) int and (k,) arrays
        Distance constraints.
    quads, shape_stiffness : (q, 4) int array and float
        Dihedral constraints.
    neighbours, weights : (n, m) arrays
        Nodes that each point follows, and how much.
    centres : (c, 3) array
        Of the nodes [mm].
    reach : float
        Distance at which a node's turn is measured [mm].
    matrix : (6 c, 6 c) array
        Added to.
    """
    width = neighbours.shape[1]
    seen, row = np.empty(4 * width, dtype=np.int64), np.empty(24 * width)
    gradient = np.zeros((4, 3))
    for i in range(len(x)):  # what holds each point
        for c in range(3):
            if mass[i] > 0.0:
                gradient[0] = 0.0
                gradient[0, c] = 1.0
                used = _add_point(x[i], gradient[0], neighbours[i], weights[i], centres, reach, seen, row, 0)
                _add_square(seen, row, used, HOLD, matrix)
    for e in range(len(edges)):
        i, j = edges[e]
        both = mass[i] + mass[j]
        along = x[i] - x[j]
        length = np.sqrt((along**2).sum())
        if both == 0.0 or length == 0.0 or edge_stiffness[e] == 0.0:
            continue
        used = 0
        for number, point in enumerate((i, j)):
            sign = 1.0 - 2.0 * number
            gradient[number] = along * (sign * mass[point] / (length * np.sqrt(both)))
            if mass[point] > 0.0:
                used = _add_point(
                    x[point],
                    gradient[number],
                    neighbours[point],
                    weights[point],
                    centres,
                    reach,
                    seen,
                    row,
                    used,
                )
        _add_square(seen, row, used, edge_stiffness[e], matrix)
    if shape_stiffness == 0.0:
        return
    for q in range(len(quads)):
        quad = quads[q]
        if not _bending(x[quad[0]], x[quad[1]], x[quad[2]], x[quad[3]], gradient):
            continue
        whole, moving = 0.0, 0.0
        for corner in range(4):
            square = (gradient[corner] ** 2).sum()
            whole += square
            moving += mass[quad[corner]] * square
        if moving == 0.0:
            continue
        length = np.sqrt(max(moving, DIHEDRAL_FLOOR * whole))
        used = 0
        for corner in range(4):
            point = quad[corner]
            if mass[point] > 0.0:
                used = _add_point(
                    x[point],
                    gradient[corner] / length,
                    neighbours[point],
                    weights[point],
                    centres,
                    reach,
                    seen,
                    row,
                    used,
                )
        _add_square(seen, row, used, shape_stiffness, matrix)


@kernel
def _add_point(
    point: Floats,
    gradient: Floats,
    nodes: Ints,
    weights: Floats,
    centres: Floats,
    reach: float,
    seen: Ints,
    row: Floats,
    count: int,
) -> int:
    """Add a point's part g to a constraint's row over the nodes seen so far; return their number."""
    gx, gy, gz = gradient[0], gradient[1], gradient[2]
    for n in range(len(nodes)):
        j, w = nodes[n], weights[n]
        if w == 0.0:
            continue
        at = 0
        while at < count and seen[at] != j:
            at += 1
        if at == count:
            seen[at] = j
            row[6 * at : 6 * at + 6] = 0.0
            count += 1
        x, y, z = point[0] - centres[j, 0], point[1] - centres[j, 1], point[2] - centres[j, 2]
        row[6 * at] += w * gx
        row[6 * at + 1] += w * gy
        row[6 * at + 2] += w * gz
        row[6 * at + 3] += w * (y * gz - z * gy) / reach
        row[6 * at + 4] += w * (z * gx - x * gz) / reach
        row[6 * at + 5] += w * (x * gy - y * gx) / reach
    return count


@kernel
def _add_square(seen: Ints, row: Floats, count: int, stiffness: float, matrix: Floats) -> None:
    """Add k a a' to the matrix."""
    for m in range(count):
        for n in range(count):
            if seen[n] > seen[m]:
                continue  # the lower triangle is enough
            for a in range(6):
                part = stiffness * row[6 * m + a]
                into = matrix[6 * seen[m] + a, 6 * seen[n] : 6 * seen[n] + 6]
                for b in range(6):
                    into[b] += part * row[6 * n + b]


@kernel
def _bending(pi: Floats, pj: Floats, pk: Floats, pm: Floats, gradient: Floats) -> bool:
    """Write the gradient (4, 3) of the dihedral angle at the edge ij; return whether there is one."""
    e, a, b = pj - pi, pk - pi, pm - pi
    n1, n2 = np.cross(e, a), np.cross(b, e)
    ee, n11, n22 = (e**2).sum(), (n1**2).sum(), (n2**2).sum()
    least = DEGENERATE_SINE * DEGENERATE_SINE * ee
    if not (ee > 0.0 and n11 > least * (a**2).sum() and n22 > least * (b**2).sum()):
        return False
    length = np.sqrt(ee)
    s, t = (a * e).sum() / ee, (b * e).sum() / ee
    gradient[2] = n1 * (length / n11)
    gradient[3] = n2 * (length / n22)
    gradient[0] = -(1.0 - s) * gradient[2] - (1.0 - t) * gradient[3]
    gradient[1] = -s * gradient[2] - t * gradient[3]
    return True
