"""The geometry of two triangles that share an edge, and the signed angle between them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vtkmuscle.core.jit import lane, vector_kernel
from vtkmuscle.core.types import Bools, Floats, Ints

#: Triangles whose corner at the edge has a tangent below this have no normal worth speaking of.
DEGENERATE_TANGENT = 1e-9


@lane
def hinge(
    x1: float, y1: float, z1: float,
    x2: float, y2: float, z2: float,
    x3: float, y3: float, z3: float,
    x4: float, y4: float, z4: float,
) -> tuple[Any, ...]:  # fmt: skip
    """Return the geometry of two triangles (p1, p2, p3) and (p2, p1, p4) that share the edge e = p2 - p1.

    The signed angle phi between their normals n1 = e x (p3 - p1) and n2 = (p4 - p1) x e has
    sin phi = (n1 x n2) . e / (|e| |n1| |n2|) and cos phi = n1 . n2 / (|n1| |n2|): it is 0 where flat,
    positive where convex. As n1 is normal to e, (n1 x n2) . e = -|e|^2 n1 . (p4 - p1).

    Returns
    -------
    proper : bool
        Whether both triangles have a normal, of which the tangent of the corner at p1 decides.
    sine, cosine : float
        Both times |n1| |n2|.
    ee, ae, be : float
        |e|^2, (p3 - p1) . e, (p4 - p1) . e.
    n11, n22 : float
        |n1|^2, |n2|^2.
    n1x, n1y, n1z, n2x, n2y, n2z : float
        The normals.
    """
    ex, ey, ez = x2 - x1, y2 - y1, z2 - z1
    ax, ay, az = x3 - x1, y3 - y1, z3 - z1
    bx, by, bz = x4 - x1, y4 - y1, z4 - z1
    n1x, n1y, n1z = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    n2x, n2y, n2z = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
    ee = ex * ex + ey * ey + ez * ez
    ae = ax * ex + ay * ey + az * ez
    be = bx * ex + by * ey + bz * ez
    n11 = n1x * n1x + n1y * n1y + n1z * n1z
    n22 = n2x * n2x + n2y * n2y + n2z * n2z
    least = DEGENERATE_TANGENT * DEGENERATE_TANGENT
    proper = (n11 > least * (ae * ae)) & (n22 > least * (be * be)) & (n11 * n22 > 0.0)
    sine = -math.sqrt(ee) * (n1x * bx + n1y * by + n1z * bz)
    cosine = n1x * n2x + n1y * n2y + n1z * n2z
    return proper, sine, cosine, ee, ae, be, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z


def dihedral_angles(points: Floats, quads: Ints) -> tuple[Floats, Bools]:
    """Return the signed angles (q,) between neighbouring triangles, and False where one is not defined, (q,).

    0 where flat, positive where convex, in (-pi, pi]; see :func:`hinge`.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    quads : (q, 4) int array
        As in :class:`~vtkmuscle.core.mesh.topology.MeshTopology`.

    Returns
    -------
    angles : (q,) array
        Radians; 0 where the angle is not defined.
    defined : (q,) bool array
        False where one of the triangles is degenerate.
    """
    angles, defined = np.zeros(len(quads)), np.zeros(len(quads), dtype=np.bool_)
    _hinges(points, quads, angles, defined)
    return angles, defined


@vector_kernel
def _hinges(p: Floats, quads: Ints, angles: Floats, defined: Bools) -> None:
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        found = hinge(
            p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2],
            p[k, 0], p[k, 1], p[k, 2], p[m, 0], p[m, 1], p[m, 2],
        )  # fmt: skip
        proper, sine, cosine = found[0], found[1], found[2]
        if proper:
            angle = math.atan2(sine, cosine)
            angles[q], defined[q] = angle if angle > -math.pi else math.pi, True
