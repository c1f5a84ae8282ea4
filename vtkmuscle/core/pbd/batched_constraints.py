"""The constraints of :mod:`~vtkmuscle.core.pbd.constraints`, projected many at a time by vector instructions.

A batch of constraints that share no point (:mod:`~vtkmuscle.core.pbd.batches`) is copied into one flat
buffer, all of them are projected by a loop of constant length that the compiler turns into vector
instructions, and the points are copied back. No two of a batch touch the same point, so this is exactly the
projection of one after the other (Gauss-Seidel) in the order of the batches.

The projections read as those of a single constraint. What differs from the scalar ones: no branches, for
lanes cannot part (degenerate cases are chosen away by ``x if condition else y``), the arctangent is a
polynomial, and a * b + c may be rounded once instead of twice.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import lane, vector_kernel
from vtkmuscle.core.pbd.constraints import DEGENERATE_SINE, DIHEDRAL_FLOOR, LARGEST_TURN

Ints = NDArray[np.int64]
Offsets = NDArray[np.uint32]
Reals = NDArray[np.floating]

#: Constraints of a batch: two vectors of eight doubles, which measured best.
WIDTH = 16

#: Numbers of a point's record: x, y, z and the inverse mass.
RECORD = 4

#: Constants of an edge: rest length, stiffness, cosine and sine of the rest angle, shape stiffness.
CONSTANTS = 5

ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)

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

# Places in the buffer, each of WIDTH numbers: four records before, four after, and the constants.
_AFTER = 4 * RECORD * WIDTH
_CONSTANTS = 8 * RECORD * WIDTH

#: Numbers in the working memory of :func:`sweep_edges`.
EDGE_BUFFER = _CONSTANTS + CONSTANTS * WIDTH


# -------------------------------------------------------------------------------- one constraint


@lane
def _arctangent(t: float) -> float:
    """Return atan(t), |t| <= 1, by Estrin's scheme: short chains of operations rather than few."""
    real = type(t)
    u = t * t
    u2 = u * u
    u4 = u2 * u2
    u8 = u4 * u4
    a0 = real(ARCTANGENT[0]) + real(ARCTANGENT[1]) * u
    a1 = real(ARCTANGENT[2]) + real(ARCTANGENT[3]) * u
    a2 = real(ARCTANGENT[4]) + real(ARCTANGENT[5]) * u
    a3 = real(ARCTANGENT[6]) + real(ARCTANGENT[7]) * u
    a4 = real(ARCTANGENT[8]) + real(ARCTANGENT[9]) * u
    a5 = real(ARCTANGENT[10]) + real(ARCTANGENT[11]) * u
    a6 = real(ARCTANGENT[12]) + real(ARCTANGENT[13]) * u
    a7 = real(ARCTANGENT[14]) + real(ARCTANGENT[15]) * u
    a8 = real(ARCTANGENT[16]) + real(ARCTANGENT[17]) * u
    low = (a0 + a1 * u2) + (a2 + a3 * u2) * u4
    high = (a4 + a5 * u2) + (a6 + a7 * u2) * u4
    return t * (low + (high + a8 * u8) * u8)


@lane
def _distance(
    x1: float, y1: float, z1: float, w1: float,
    x2: float, y2: float, z2: float, w2: float,
    rest: float, stiffness: float,
) -> tuple[float, ...]:  # fmt: skip
    """Return both ends moved so that the edge keeps its length: C = |p1 - p2| - rest.

    Müller et al. 2007 (doi:10.1016/j.jvcir.2007.01.005), eq. 9-11.
    """
    real = type(x1)
    x, y, z = x1 - x2, y1 - y2, z1 - z2
    length = math.sqrt(x * x + y * y + z * z)
    weight = length * (w1 + w2)
    s = stiffness * (length - rest) / weight
    s = s if weight > real(0.0) else real(0.0)
    s1, s2 = w1 * s, w2 * s
    return x1 - s1 * x, y1 - s1 * y, z1 - s1 * z, x2 + s2 * x, y2 + s2 * y, z2 + s2 * z


@lane
def _dihedral(
    x1: float, y1: float, z1: float, w1: float,
    x2: float, y2: float, z2: float, w2: float,
    x3: float, y3: float, z3: float, w3: float,
    x4: float, y4: float, z4: float, w4: float,
    cosine0: float, sine0: float, stiffness: float,
) -> tuple[float, ...]:  # fmt: skip
    """Return the four points moved so that the angle between two triangles is as at rest: C = phi - phi0.

    The formulas are those of :func:`~vtkmuscle.core.pbd.constraints.project_dihedral`, multiplied through so
    that two divisions are left. With the feet a = A / |e|^2 and b = B / |e|^2 of p3 and p4 on the edge, the
    gradients times |e| |n1|^2 |n2|^2 are n1 |n2|^2 |e|^2 at p3, n2 |n1|^2 |e|^2 at p4, minus their mean by A
    and B at p2, and at p1 what makes the sum zero. Their squares follow from |n1|^2, |n2|^2 and n1 . n2,
    without the vectors.
    """
    real = type(x1)
    zero, two = real(0.0), real(2.0)
    ex, ey, ez = x2 - x1, y2 - y1, z2 - z1
    ax, ay, az = x3 - x1, y3 - y1, z3 - z1
    bx, by, bz = x4 - x1, y4 - y1, z4 - z1
    n1x, n1y, n1z = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    n2x, n2y, n2z = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
    ee = ex * ex + ey * ey + ez * ez
    a2 = ax * ex + ay * ey + az * ez
    b2 = bx * ex + by * ey + bz * ez
    n11 = n1x * n1x + n1y * n1y + n1z * n1z
    n22 = n2x * n2x + n2y * n2y + n2z * n2z
    n12 = n1x * n2x + n1y * n2y + n1z * n2z
    # Degenerate where the sine of the corner at p1 vanishes; its tangent is |n1| / (a . e).
    least = real(DEGENERATE_SINE * DEGENERATE_SINE)
    n1122 = n11 * n22
    proper = (n11 > least * (a2 * a2)) & (n22 > least * (b2 * b2)) & (n1122 > zero)
    length = math.sqrt(ee)

    sine = -length * (n1x * bx + n1y * by + n1z * bz)
    sd = sine * cosine0 - n12 * sine0
    cd = n12 * cosine0 + sine * sine0
    near = two * _arctangent(sd / (math.sqrt(n1122) + abs(cd)))
    far = (real(math.pi) if sd >= zero else real(-math.pi)) - near
    c = near if cd >= zero else far
    most = real(LARGEST_TURN)
    c = c if c < most else most
    c = c if c > -most else -most

    a1, b1 = ee - a2, ee - b2
    cross = two * n12
    g1 = a1 * (a1 * n22 + b1 * cross) + b1 * (b1 * n11)
    g2 = a2 * (a2 * n22 + b2 * cross) + b2 * (b2 * n11)
    g3, g4 = ee * ee * n22, ee * ee * n11
    weighted = w1 * g1 + w2 * g2 + w3 * g3 + w4 * g4
    floor = real(DIHEDRAL_FLOOR) * ((g1 + g2) + (g3 + g4))
    s = stiffness * c * length / (weighted if weighted > floor else floor)
    s = s if proper else zero
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


# -------------------------------------------------------------------------------- a batch


@lane
def gather(p: Reals, offsets: Offsets, first: int, count: int, buffer: Reals, place: int) -> None:
    """Copy records into the buffer, one after the other: all loads first, which makes them one move."""
    for i in range(count):
        at = offsets[first + i]
        x, y, z, w = p[at], p[at + ONE], p[at + TWO], p[at + THREE]
        to = place + RECORD * i
        buffer[to] = x
        buffer[to + 1] = y
        buffer[to + 2] = z
        buffer[to + 3] = w


@lane
def scatter(p: Reals, offsets: Offsets, first: int, count: int, buffer: Reals, place: int) -> None:
    """Copy records back from the buffer."""
    for i in range(count):
        at = offsets[first + i]
        to = place + RECORD * i
        x, y, z, w = buffer[to], buffer[to + 1], buffer[to + 2], buffer[to + 3]
        p[at] = x
        p[at + ONE] = y
        p[at + TWO] = z
        p[at + THREE] = w


@vector_kernel
def sweep_edges(p: Reals, edge_at: Offsets, constants: Reals, first: int, last: int, buffer: Reals) -> None:
    """Project the distance and then the dihedral constraint of each edge, batch by batch.

    Parameters
    ----------
    p : (4 (n + 1),) array
        Records, changed in place.
    edge_at, constants : arrays
        As in :class:`~vtkmuscle.core.pbd.batches.PackedMuscle`.
    first, last : int
        The batches from the first on, the last excluded.
    buffer : array
        Working memory of :data:`EDGE_BUFFER` numbers.
    """
    corner = RECORD * WIDTH
    # Slices, for a loop that starts at an unknown number is not made into vector instructions.
    edge_at = edge_at[4 * WIDTH * first : 4 * WIDTH * last]
    constants = constants[CONSTANTS * WIDTH * first : CONSTANTS * WIDTH * last]
    for batch in range(len(edge_at) // (4 * WIDTH)):
        gather(p, edge_at, 4 * WIDTH * batch, 4 * WIDTH, buffer, 0)
        # Constants are loaded four at a time and then stored, so that the compiler need not know that the
        # arrays do not overlap; it would not make vectors of a loop over two arrays.
        for i in range(CONSTANTS * WIDTH // 4):
            at = CONSTANTS * WIDTH * batch + 4 * i
            k0, k1, k2, k3 = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
            buffer[_CONSTANTS + 4 * i] = k0
            buffer[_CONSTANTS + 4 * i + 1] = k1
            buffer[_CONSTANTS + 4 * i + 2] = k2
            buffer[_CONSTANTS + 4 * i + 3] = k3
        for i in range(WIDTH):
            at = RECORD * i
            x1, y1, z1, w1 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = RECORD * i + corner
            x2, y2, z2, w2 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = RECORD * i + 2 * corner
            x3, y3, z3, w3 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = RECORD * i + 3 * corner
            x4, y4, z4, w4 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = _CONSTANTS + i
            x1, y1, z1, x2, y2, z2 = _distance(x1, y1, z1, w1, x2, y2, z2, w2, buffer[at], buffer[at + WIDTH])
            x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4 = _dihedral(
                x1, y1, z1, w1, x2, y2, z2, w2, x3, y3, z3, w3, x4, y4, z4, w4,
                buffer[at + 2 * WIDTH], buffer[at + 3 * WIDTH], buffer[at + 4 * WIDTH],
            )  # fmt: skip
            # To other places than they came from: whole records are stored, masses too, by plain moves.
            at = _AFTER + RECORD * i
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x1, y1, z1, w1
            at = _AFTER + RECORD * i + corner
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x2, y2, z2, w2
            at = _AFTER + RECORD * i + 2 * corner
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x3, y3, z3, w3
            at = _AFTER + RECORD * i + 3 * corner
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x4, y4, z4, w4
        scatter(p, edge_at, 4 * WIDTH * batch, 4 * WIDTH, buffer, _AFTER)
