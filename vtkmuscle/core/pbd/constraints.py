"""The constraints of position based dynamics on a muscle's surface: values, gradients, projections.

A projection moves points p with inverse masses w against a constraint C(p) = 0 of stiffness k by

    p_i -= k C w_i g_i / sum_j w_j |g_j|^2,    g_i = dC / dp_i

(Müller, Heidelberger, Hennix, Ratcliff 2007, *Position based dynamics*,
doi:10.1016/j.jvcir.2007.01.005, eq. 6-8). Constraints of one kind are projected one after the other in the
order given, each seeing the points that the one before it moved (Gauss-Seidel).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: A dihedral projection's denominator is at least this part of its value with all points free. Beside
#: fixed points a point with a tiny lever arm makes the denominator vanish, and the shape would explode.
DIHEDRAL_FLOOR = 0.1

#: A projection turns an edge's triangles by no more than this [rad]. It moves points along tangents of the
#: circles that they should go on, and so makes the triangles larger: thin ones, which a turn of pi would take
#: to twice their height, would grow from iteration to iteration.
LARGEST_TURN = 0.3

#: A volume projection's denominator is at least this part of its value at rest, so that a muscle crushed
#: to nothing is blown up over several iterations rather than to infinity in one.
VOLUME_FLOOR = 0.01

#: Triangles with sine of a corner below this have no normal worth speaking of.
DEGENERATE_SINE = 1e-9


def per_iteration_stiffness(stiffness: Floats | float, iterations: int) -> Floats:
    """Return the stiffness per iteration that leaves (1 - k) of an error after all of them.

    k' = 1 - (1 - k)^(1 / n), so that a setting means the same at 1 and at 100 iterations (Müller et al.
    2007, section 3.3).

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
    return 1.0 - (1.0 - np.asarray(stiffness, dtype=np.float64)) ** (1.0 / iterations)


# -------------------------------------------------------------------------------- distance


def distance_and_gradient(p1: Floats, p2: Floats, rest: float) -> tuple[float, Floats]:
    """Return C = |p1 - p2| - rest [mm] and its gradient by (p1, p2), (2, 3); P21 eq. 2-3."""
    difference = p1 - p2
    length = float(np.linalg.norm(difference))
    unit = difference / length
    return length - rest, np.array([unit, -unit])


@kernel
def project_distance(p: Floats, w: Floats, edges: Ints, rest: Floats, stiffness: Floats) -> None:
    """Move the end points of edges so that each edge keeps its rest length.

    C = |p1 - p2| - d (Müller et al. 2007, eq. 9-11).

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm], changed in place.
    w : (n,) array
        Inverse masses: 1 free, 0 fixed.
    edges : (k, 2) int array
        Point ids, at least one of them free.
    rest : (k,) array
        Rest lengths d [mm].
    stiffness : (k,) array
        Stiffness per iteration, in [0, 1].
    """
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        x = p[i, 0] - p[j, 0]
        y = p[i, 1] - p[j, 1]
        z = p[i, 2] - p[j, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:  # two points in one place have no direction to part in
            s = stiffness[e] * (length - rest[e]) / (length * (w[i] + w[j]))
            si = s * w[i]
            sj = s * w[j]
            p[i, 0] -= si * x
            p[i, 1] -= si * y
            p[i, 2] -= si * z
            p[j, 0] += sj * x
            p[j, 1] += sj * y
            p[j, 2] += sj * z


# -------------------------------------------------------------------------------- dihedral angle


def dihedral_angle(p1: Floats, p2: Floats, p3: Floats, p4: Floats) -> tuple[Floats, Bools]:
    """Return the signed angle between the normals of two triangles that share the edge p1 p2.

    phi = atan2((n1 x n2) . e / |e|, n1 . n2) with e = p2 - p1, n1 = e x (p3 - p1), n2 = (p4 - p1) x e:
    0 where flat, positive where convex, in (-pi, pi].

    Parameters
    ----------
    p1, p2, p3, p4 : (..., 3) arrays
        Edge and opposite points [mm], as in :class:`~vtkmuscle.core.mesh.topology.MeshTopology`.

    Returns
    -------
    angle : (...) array
        Radians; 0 where the angle is not defined.
    defined : (...) bool array
        False where one of the triangles is degenerate.
    """
    e = p2 - p1
    n1 = np.cross(e, p3 - p1)
    n2 = np.cross(p4 - p1, e)
    length = np.linalg.norm(e, axis=-1)
    sizes = [length * np.linalg.norm(p3 - p1, axis=-1), length * np.linalg.norm(p4 - p1, axis=-1)]
    defined = length > 0
    for normal, size in zip((n1, n2), sizes, strict=True):
        defined = defined & (np.linalg.norm(normal, axis=-1) > DEGENERATE_SINE * size)
    unit = e / np.where(length > 0, length, 1.0)[..., None]
    sine = np.einsum("...i,...i->...", np.cross(n1, n2), unit)
    cosine = np.einsum("...i,...i->...", n1, n2)
    angle = np.where(defined, np.arctan2(sine, cosine), 0.0)
    return np.where(angle == -np.pi, np.pi, angle), defined


def dihedral_and_gradient(
    p1: Floats, p2: Floats, p3: Floats, p4: Floats, rest: float
) -> tuple[float, Floats]:
    """Return C = phi - rest, wrapped to (-pi, pi], and its gradient by the four points, (4, 3) [1 / mm].

    The gradient is that of Tamstorf, Grinspun 2013, *Discrete bending forces and their Jacobians*,
    doi:10.1016/j.gmod.2013.07.001; it is finite at flat and at concave edges.
    """
    angle, _ = dihedral_angle(p1, p2, p3, p4)
    difference = float(angle) - rest
    difference -= 2.0 * math.pi * math.ceil((difference - math.pi) / (2.0 * math.pi))
    e = p2 - p1
    length = np.linalg.norm(e)
    n1, n2 = np.cross(e, p3 - p1), np.cross(p4 - p1, e)
    m1, m2 = n1 / (n1 @ n1), n2 / (n2 @ n2)
    gradient = np.array(
        [
            ((p2 - p3) @ e * m1 + (p2 - p4) @ e * m2) / length,
            ((p3 - p1) @ e * m1 + (p4 - p1) @ e * m2) / length,
            -length * m1,
            -length * m2,
        ]
    )
    return difference, gradient


@kernel
def project_dihedral(  # noqa: PLR0915 -- scalars stay in registers, small arrays do not
    p: Floats, w: Floats, quads: Ints, cosines: Floats, sines: Floats, stiffness: float
) -> None:
    """Move the points of two neighbouring triangles so that the angle between them is as at rest.

    C = phi - phi0 with the signed angle of :func:`dihedral_angle`, wrapped to (-pi, pi]. The wrapped
    difference comes from products of sines and cosines, with one arctangent and no branch cut: with
    sd, cd = R sin C, R cos C it is 2 atan(sd / (R + |cd|)), or its supplement where cd < 0.
    Degenerate triangles move nothing: the correction is proportional to 1 / |gradient|, their height.

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm], changed in place.
    w : (n,) array
        Inverse masses: 1 free, 0 fixed.
    quads : (q, 4) int array
        Point ids (p1, p2, p3, p4), at least one of them free.
    cosines, sines : (q,) arrays
        Of the rest angles phi0.
    stiffness : float
        Stiffness per iteration, in [0, 1].
    """
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        ex = p[j, 0] - p[i, 0]
        ey = p[j, 1] - p[i, 1]
        ez = p[j, 2] - p[i, 2]
        ax = p[k, 0] - p[i, 0]
        ay = p[k, 1] - p[i, 1]
        az = p[k, 2] - p[i, 2]
        bx = p[m, 0] - p[i, 0]
        by = p[m, 1] - p[i, 1]
        bz = p[m, 2] - p[i, 2]
        n1x = ey * az - ez * ay
        n1y = ez * ax - ex * az
        n1z = ex * ay - ey * ax
        n2x = by * ez - bz * ey
        n2y = bz * ex - bx * ez
        n2z = bx * ey - by * ex
        ee = ex * ex + ey * ey + ez * ez
        aa = ax * ax + ay * ay + az * az
        bb = bx * bx + by * by + bz * bz
        n11 = n1x * n1x + n1y * n1y + n1z * n1z
        n22 = n2x * n2x + n2y * n2y + n2z * n2z
        if not (n11 > DEGENERATE_SINE**2 * ee * aa and n22 > DEGENERATE_SINE**2 * ee * bb):
            continue
        length = math.sqrt(ee)
        # (e x a) x (b x e) = -e (n1 . b), as n1 is normal to e.
        sine = -length * (n1x * bx + n1y * by + n1z * bz)
        cosine = n1x * n2x + n1y * n2y + n1z * n2z
        sd = sine * cosines[q] - cosine * sines[q]
        cd = cosine * cosines[q] + sine * sines[q]
        c = 2.0 * math.atan(sd / (math.sqrt(n11 * n22) + abs(cd)))
        if cd < 0.0:
            c = math.copysign(math.pi, sd) - c
        c = min(max(c, -LARGEST_TURN), LARGEST_TURN)
        # Gradients: u_i n1 + v_i n2 at the edge's ends, -|e| n1 / |n1|^2 and -|e| n2 / |n2|^2 opposite.
        ae = (ax * ex + ay * ey + az * ez) / ee
        be = (bx * ex + by * ey + bz * ez) / ee
        r1 = length / n11
        r2 = length / n22
        gix = (1.0 - ae) * r1 * n1x + (1.0 - be) * r2 * n2x
        giy = (1.0 - ae) * r1 * n1y + (1.0 - be) * r2 * n2y
        giz = (1.0 - ae) * r1 * n1z + (1.0 - be) * r2 * n2z
        gjx = ae * r1 * n1x + be * r2 * n2x
        gjy = ae * r1 * n1y + be * r2 * n2y
        gjz = ae * r1 * n1z + be * r2 * n2z
        gi = gix * gix + giy * giy + giz * giz
        gj = gjx * gjx + gjy * gjy + gjz * gjz
        gk = r1 * r1 * n11
        gm = r2 * r2 * n22
        weighted = w[i] * gi + w[j] * gj + w[k] * gk + w[m] * gm
        s = stiffness * c / max(weighted, DIHEDRAL_FLOOR * (gi + gj + gk + gm))
        si = s * w[i]
        sj = s * w[j]
        sk = s * w[k] * r1
        sm = s * w[m] * r2
        p[i, 0] -= si * gix
        p[i, 1] -= si * giy
        p[i, 2] -= si * giz
        p[j, 0] -= sj * gjx
        p[j, 1] -= sj * gjy
        p[j, 2] -= sj * gjz
        p[k, 0] += sk * n1x
        p[k, 1] += sk * n1y
        p[k, 2] += sk * n1z
        p[m, 0] += sm * n2x
        p[m, 1] += sm * n2y
        p[m, 2] += sm * n2z


# -------------------------------------------------------------------------------- volume


@kernel
def volume_and_gradient(p: Floats, triangles: Ints, gradient: Floats) -> float:
    """Return the volume inside a closed surface, and write its gradient.

    V = sum p1 . (p2 x p3) / 6 and dV/dp1 = sum p2 x p3 / 6, about the mean of the points: neither depends
    on the origin for a closed surface, and a muscle far from it loses no digits.

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm].
    triangles : (m, 3) int array
        Point ids.
    gradient : (n, 3) array
        Overwritten with dV/dp [mm^2].

    Returns
    -------
    float
        Volume [mm^3].
    """
    x0 = 0.0
    y0 = 0.0
    z0 = 0.0
    for i in range(len(p)):
        x0 += p[i, 0]
        y0 += p[i, 1]
        z0 += p[i, 2]
        gradient[i, 0] = 0.0
        gradient[i, 1] = 0.0
        gradient[i, 2] = 0.0
    x0 /= len(p)
    y0 /= len(p)
    z0 /= len(p)
    total = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = p[i, 0] - x0, p[i, 1] - y0, p[i, 2] - z0
        bx, by, bz = p[j, 0] - x0, p[j, 1] - y0, p[j, 2] - z0
        cx, cy, cz = p[k, 0] - x0, p[k, 1] - y0, p[k, 2] - z0
        gx = by * cz - bz * cy
        gy = bz * cx - bx * cz
        gz = bx * cy - by * cx
        total += ax * gx + ay * gy + az * gz
        gradient[i, 0] += gx / 6.0
        gradient[i, 1] += gy / 6.0
        gradient[i, 2] += gz / 6.0
        gradient[j, 0] += (cy * az - cz * ay) / 6.0
        gradient[j, 1] += (cz * ax - cx * az) / 6.0
        gradient[j, 2] += (cx * ay - cy * ax) / 6.0
        gradient[k, 0] += (ay * bz - az * by) / 6.0
        gradient[k, 1] += (az * bx - ax * bz) / 6.0
        gradient[k, 2] += (ax * by - ay * bx) / 6.0
    return total / 6.0


@kernel
def project_volume(
    p: Floats,
    w: Floats,
    triangles: Ints,
    rest: float,
    floor: float,
    stiffness: float,
    gradient: Floats,
) -> float:
    """Move all points along the volume's gradient so that the volume is as at rest.

    C = V - V0 (P21 eq. 4-5, with the 1/6 in value and gradient alike).

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
