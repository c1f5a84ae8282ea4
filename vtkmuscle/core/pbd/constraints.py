"""The constraints of position based dynamics on a muscle's surface: Kohout and Cervenka 2021, section 2.

A projection moves points p with inverse masses w against a constraint C(p) = 0 of stiffness k by

    p_i -= k C w_i g_i / sum_j w_j |g_j|^2,    g_i = dC / dp_i

(Müller, Heidelberger, Hennix, Ratcliff 2007, *Position based dynamics*,
doi:10.1016/j.jvcir.2007.01.005, eq. 6-8). :func:`distance` is section 2.1, :func:`project_volume` section
2.2, :func:`dihedral` section 2.3.

These are the constraints of the default order; those of the paper, to the letter, are in
:mod:`~vtkmuscle.core.pbd.as_printed`.

The formulas of a single edge are *lanes*: functions of plain numbers without a branch, which become part of
the loop that calls them (:mod:`~vtkmuscle.core.pbd.orders`). A loop over edges that share no point is made
into vector instructions by the compiler.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vtkmuscle.core.jit import lane, vector_kernel
from vtkmuscle.core.types import Floats, Ints

#: A dihedral projection's denominator is at least this part of its value with all points free. Beside
#: fixed points a point with a tiny lever arm makes the denominator vanish, and the shape would explode.
DIHEDRAL_FLOOR = 0.1

#: A projection turns an edge's triangles by no more than this [rad]. It moves points along tangents of the
#: circles that they should go on, and so makes the triangles larger: thin ones, which a turn of pi would take
#: to twice their height, would grow from iteration to iteration.
LARGEST_TURN = 0.3

#: An angle is left alone where the squares of its gradients are this part of what they would be with
#: triangles as tall as their longest edge at rest: where these are 8 times as tall. It has all its stiffness
#: where they are four times that: 4 times as tall. An angle knows no length, and its corrections grow with
#: the triangles: where no edge holds these, as along soft fibres, both would grow together, without end.
FAR_TOO_LARGE = 1.0 / 64.0

#: A stiffness per step that differs from 1 by less is 1.
RIGID = 1e-6

#: A volume projection's denominator is at least this part of its value at rest, so that a muscle crushed
#: to nothing is blown up over several iterations rather than to infinity in one.
VOLUME_FLOOR = 0.01

#: Triangles whose corner at the edge has a tangent below this have no normal worth speaking of.
DEGENERATE_TANGENT = 1e-9

#: Polynomial P of degree 17 with |t P(t^2) - atan(t)| < 1e-15 for |t| <= 1: it has the values of
#: atan(sqrt(u)) / sqrt(u) at the 18 Chebyshev points of 0 <= u <= 1.
ARCTANGENT = (
    0.9999999999999988,
    -0.33333333333253284,
    0.19999999991319195,
    -0.14285713910426773,
    0.11111102499422242,
    -0.09090787968013053,
    0.07691170067941966,
    -0.06659119943643073,
    0.05845587712383866,
    -0.051278290246137094,
    0.04377190010711523,
    -0.034874503444929254,
    0.02458916421806469,
    -0.014458808736889693,
    0.006642618398837011,
    -0.0021983905110338,
    0.0004611471226395625,
    -4.572466752859746e-05,
)


def per_iteration_stiffness(stiffness: Floats | float, iterations: int) -> Floats:
    """Return the stiffness per iteration that leaves (1 - k) of an error after all of them.

    k' = 1 - (1 - k)^(1 / n), so that a setting means the same at 1 and at 100 iterations (Müller et al.
    2007, section 3.3). Its slope is infinite at 1: what is within :data:`RIGID` of 1 counts as 1, lest the
    rounding of a cosine that should be 0 be seen in the result.

    Parameters
    ----------
    stiffness : float or array
        k in [0, 1].
    iterations : int
        n >= 1.

    Returns
    -------
    array
        k' in [0, 1], of the shape of ``stiffness``.
    """
    left = 1.0 - np.asarray(stiffness, dtype=np.float64)
    per_iteration: Floats = 1.0 - np.where(left < RIGID, 0.0, left) ** (1.0 / iterations)
    return per_iteration


# -------------------------------------------------------------------------------- distance


@lane
def distance(
    x1: float, y1: float, z1: float, w1: float,
    x2: float, y2: float, z2: float, w2: float,
    rest: float, stiffness: float,
) -> tuple[float, ...]:  # fmt: skip
    """Return both ends of an edge moved so that it keeps its length: C = |p1 - p2| - rest.

    Kohout and Cervenka 2021, eq. 2-3; Müller et al. 2007, eq. 9-11. Two points in one place have no
    direction to part in, and stay there.
    """
    x, y, z = x1 - x2, y1 - y2, z1 - z2
    length = math.sqrt(x * x + y * y + z * z)
    weight = length * (w1 + w2)
    s = stiffness * (length - rest) / weight
    s = s if weight > 0.0 else 0.0
    s1, s2 = w1 * s, w2 * s
    return x1 - s1 * x, y1 - s1 * y, z1 - s1 * z, x2 + s2 * x, y2 + s2 * y, z2 + s2 * z


# -------------------------------------------------------------------------------- dihedral angle


@lane
def arctangent(t: float) -> float:
    """Return atan(t), |t| <= 1, by Estrin's scheme: short chains of operations rather than few."""
    u = t * t
    u2 = u * u
    u4 = u2 * u2
    u8 = u4 * u4
    a0 = ARCTANGENT[0] + ARCTANGENT[1] * u
    a1 = ARCTANGENT[2] + ARCTANGENT[3] * u
    a2 = ARCTANGENT[4] + ARCTANGENT[5] * u
    a3 = ARCTANGENT[6] + ARCTANGENT[7] * u
    a4 = ARCTANGENT[8] + ARCTANGENT[9] * u
    a5 = ARCTANGENT[10] + ARCTANGENT[11] * u
    a6 = ARCTANGENT[12] + ARCTANGENT[13] * u
    a7 = ARCTANGENT[14] + ARCTANGENT[15] * u
    a8 = ARCTANGENT[16] + ARCTANGENT[17] * u
    low = (a0 + a1 * u2) + (a2 + a3 * u2) * u4
    high = (a4 + a5 * u2) + (a6 + a7 * u2) * u4
    return t * (low + (high + a8 * u8) * u8)


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


@lane
def gradient_squares(
    cosine: float, ee: float, a1: float, a2: float, b1: float, b2: float, n11: float, n22: float
) -> tuple[float, ...]:
    """Return |dphi/dp_i|^2 |e|^2 |n1|^2 |n2|^2 of the four points of a :func:`hinge`; a1 = |e|^2 - a2."""
    cross = 2.0 * cosine
    g1 = a1 * (a1 * n22 + b1 * cross) + b1 * (b1 * n11)
    g2 = a2 * (a2 * n22 + b2 * cross) + b2 * (b2 * n11)
    return g1, g2, ee * ee * n22, ee * ee * n11


@lane
def dihedral(
    x1: float, y1: float, z1: float, w1: float,
    x2: float, y2: float, z2: float, w2: float,
    x3: float, y3: float, z3: float, w3: float,
    x4: float, y4: float, z4: float, w4: float,
    cosine0: float, sine0: float, stiffness: float, squares0: float,
) -> tuple[float, ...]:  # fmt: skip
    """Return four points moved so that the angle between two triangles is as at rest: C = phi - phi0.

    Kohout and Cervenka 2021, eq. 6-7, with the signed angle of :func:`hinge`, wrapped to (-pi, pi]. The
    wrapped difference comes from products of sines and cosines, with one arctangent and no branch cut: with
    sd, cd = R sin C, R cos C it is 2 atan(sd / (R + |cd|)), or its supplement where cd < 0.

    The gradient is that of Tamstorf, Grinspun 2013, *Discrete bending forces and their Jacobians*,
    doi:10.1016/j.gmod.2013.07.001, finite at flat and at concave edges. Multiplied by |e| |n1|^2 |n2|^2,
    which leaves two divisions, it is n1 |n2|^2 |e|^2 at p3, n2 |n1|^2 |e|^2 at p4, minus their mean by
    (p3 - p1) . e and (p4 - p1) . e at p2, and at p1 what makes the sum zero. Its squares follow from |n1|^2,
    |n2|^2 and n1 . n2, without the vectors. squares0, their sum with triangles as tall as their longest edge
    at rest [1 / mm^2], is the length scale (:data:`FAR_TOO_LARGE`). Degenerate triangles move nothing: the
    correction is proportional to 1 / |gradient|, their height.
    """
    proper, sine, cosine, ee, a2, b2, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z = hinge(
        x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4
    )
    sd = sine * cosine0 - cosine * sine0
    cd = cosine * cosine0 + sine * sine0
    near = 2.0 * arctangent(sd / (math.sqrt(n11 * n22) + abs(cd)))
    far = (math.pi if sd >= 0.0 else -math.pi) - near
    c = near if cd >= 0.0 else far
    c = c if c < LARGEST_TURN else LARGEST_TURN
    c = c if c > -LARGEST_TURN else -LARGEST_TURN

    a1, b1 = ee - a2, ee - b2
    g1, g2, g3, g4 = gradient_squares(cosine, ee, a1, a2, b1, b2, n11, n22)
    weighted = w1 * g1 + w2 * g2 + w3 * g3 + w4 * g4
    squares = (g1 + g2) + (g3 + g4)
    floor = DIHEDRAL_FLOOR * squares
    weighted = weighted if weighted > floor else floor
    far = FAR_TOO_LARGE * squares0 * (ee * n11 * n22)
    part, whole = squares - far, 3.0 * far
    part = part if part > 0.0 else 0.0
    s = stiffness * c * math.sqrt(ee) * (part if part < whole else 1.0)
    s = s / (weighted * (whole if part < whole else 1.0))
    s = s if proper else 0.0
    s1, s2 = s * n22, s * n11
    u1, v1 = w1 * (s1 * a1), w1 * (s2 * b1)
    u2, v2 = w2 * (s1 * a2), w2 * (s2 * b2)
    u3, v4 = w3 * (s1 * ee), w4 * (s2 * ee)
    return (
        x1 - u1 * n1x - v1 * n2x, y1 - u1 * n1y - v1 * n2y, z1 - u1 * n1z - v1 * n2z,
        x2 - u2 * n1x - v2 * n2x, y2 - u2 * n1y - v2 * n2y, z2 - u2 * n1z - v2 * n2z,
        x3 + u3 * n1x, y3 + u3 * n1y, z3 + u3 * n1z,
        x4 + v4 * n2x, y4 + v4 * n2y, z4 + v4 * n2z,
    )  # fmt: skip


# -------------------------------------------------------------------------------- volume


@vector_kernel
def volume_and_gradient(p: Floats, triangles: Ints, gradient: Floats) -> float:
    """Return the volume inside a closed surface, and write its gradient.

    V = sum p1 . (p2 x p3) / 6 over the triangles. Of dV/dp1 = sum p2 x p3 / 6 the triangles around a point
    leave sum (p2 - p1) x (p3 - p1) / 6, as the surface is closed: the same vector for all three corners,
    which does not depend on the origin. V is homogeneous of degree 3, so that V = sum p . dV/dp / 3.

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm].
    triangles : (m, 3) int array
        Point ids of a closed surface.
    gradient : (n, 3) array
        Overwritten with dV/dp [mm^2].

    Returns
    -------
    float
        Volume [mm^3].
    """
    gradient[:] = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = p[i, 0], p[i, 1], p[i, 2]
        bx, by, bz = p[j, 0] - ax, p[j, 1] - ay, p[j, 2] - az
        cx, cy, cz = p[k, 0] - ax, p[k, 1] - ay, p[k, 2] - az
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        gradient[i, 0] += x
        gradient[i, 1] += y
        gradient[i, 2] += z
        gradient[j, 0] += x
        gradient[j, 1] += y
        gradient[j, 2] += z
        gradient[k, 0] += x
        gradient[k, 1] += y
        gradient[k, 2] += z
    total = 0.0
    for i in range(len(p)):  # about a point of the muscle: one far from the origin loses no digits
        for c in range(3):
            gradient[i, c] /= 6.0
            total += (p[i, c] - p[0, c]) * gradient[i, c]
    return total / 3.0


@vector_kernel
def project_volume(
    p: Floats, w: Floats, triangles: Ints, rest: float, floor: float, stiffness: float, gradient: Floats
) -> float:
    """Move all points along the volume's gradient so that the volume is as at rest.

    C = V - V0 (Kohout and Cervenka 2021, eq. 4-5, with the 1/6 in value and gradient alike).

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm], changed in place.
    w : (n,) array
        Inverse masses: 1 free, 0 fixed.
    triangles : (m, 3) int array
        Point ids of a closed surface.
    rest : float
        Rest volume V0 [mm^3].
    floor : float
        Least value of the denominator sum(w |g|^2) [mm^4]; see :data:`VOLUME_FLOOR`.
    stiffness : float
        Stiffness per iteration, in [0, 1].
    gradient : (n, 3) array
        Working memory, overwritten.

    Returns
    -------
    float
        The volume before the projection [mm^3].
    """
    volume = volume_and_gradient(p, triangles, gradient)
    weighted = 0.0
    for i in range(len(p)):
        x, y, z = gradient[i, 0], gradient[i, 1], gradient[i, 2]
        weighted += w[i] * (x * x + y * y + z * z)
    if weighted > 0.0:
        s = stiffness * (volume - rest) / max(weighted, floor)
        for i in range(len(p)):
            p[i, 0] -= s * w[i] * gradient[i, 0]
            p[i, 1] -= s * w[i] * gradient[i, 1]
            p[i, 2] -= s * w[i] * gradient[i, 2]
    return volume
