"""The constraints of Kohout and Cervenka 2021 to the letter, edges one by one: eq. 1 to 7, and 9.

doi:10.1007/978-3-030-72379-8_24. A projection moves points p against a constraint C(p) = 0 of stiffness k by

    p_i -= k C g_i / sum_j |g_j|^2,    g_i = dC / dp_i    (eq. 1).

As the paper has it:

* Eq. 1 divides by the squares of the gradients of *all* points, "assuming that every point has the same
  mass", also of the fixed ones, which Algorithm 1 gives a mass of 1 and does not move. So an iteration meets
  a constraint beside a fixed point by half, and no denominator can vanish there.
* The angle of eq. 6 is an arccosine, which does not tell a ridge from a groove: an edge folded to the other
  side stays there. It is pi - abs(phi), with the signed angle phi of
  :func:`~vtkmuscle.core.mesh.rest_shape.hinge`.
* A stiffness multiplies the correction of each iteration.

Where the paper cannot be run as it reads:

* Section 3.1, "we multiply the distance constraint (see Eq. 2) with the result": eq. 1 gives the same for k C
  as for C. The correction is multiplied.
* Eq. 4 without a sixth is six times the volume, so its V0, "its original volume", must be six times that,
  too. A sixth in value and gradient alike changes nothing.
* Eq. 7 divides by sqrt(1 - d^2), which is 0 where two triangles are in one plane: such an edge has no
  direction to turn to, and stays as it is.
* Algorithm 2, line 39, puts each vertex to its x_i, which lines 33 to 36 leave unchanged at fixed points:
  these would be drawn at rest for ever. They are drawn where line 9 takes them.

In all of them p (n, 3) are positions [mm], changed in place; w (n,) is 1 for moveable points, 0 for fixed.
"""

from __future__ import annotations

import math

import numpy as np

from vtkmuscle.core.jit import lane, vector_kernel
from vtkmuscle.core.mesh.harmonic import harmonic_field, triangle_gradients
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.rest_shape import hinge, volume_and_gradient
from vtkmuscle.core.mesh.surface import MeshTopology
from vtkmuscle.core.types import Floats, Ints

#: Constraints of a batch, at most: two vectors of eight doubles; numbers that those of angles take.
WIDTH = 16
LANES = 13 * WIDTH

#: Polynomial P with |t P(t^2) - atan(t)| < 1e-15 for |t| <= 1: that of degree 17 through the values of
#: atan(sqrt(u)) / sqrt(u) at the 18 Chebyshev points of 0 <= u <= 1.
ARCTANGENT = (
    0.9999999999999988, -0.33333333333253284, 0.19999999991319195, -0.14285713910426773,
    0.11111102499422242, -0.09090787968013053, 0.07691170067941966, -0.06659119943643073,
    0.05845587712383866, -0.051278290246137094, 0.04377190010711523, -0.034874503444929254,
    0.02458916421806469, -0.014458808736889693, 0.006642618398837011, -0.0021983905110338,
    0.0004611471226395625, -4.572466752859746e-05,
)  # fmt: skip


@vector_kernel
def sweep_distances(p: Floats, w: Floats, edges: Ints, rest: Floats, stiffness: Floats) -> None:
    """Project the distance constraint, eq. 2 and 3, of edges (k, 2) one by one.

    rest : (k,) lengths at rest [mm];  stiffness : (k,) per iteration, eq. 9.
    """
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        x, y, z = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            s = stiffness[e] * (length - rest[e]) / (2.0 * length)
            si, sj = w[i] * s, w[j] * s
            p[i, 0], p[i, 1], p[i, 2] = p[i, 0] - si * x, p[i, 1] - si * y, p[i, 2] - si * z
            p[j, 0], p[j, 1], p[j, 2] = p[j, 0] + sj * x, p[j, 1] + sj * y, p[j, 2] + sj * z


def in_batches(constraints: Ints, n_points: int) -> tuple[Ints, Ints]:
    """Return an order of constraints on points (k, c), and the first of each batch of it, and k, (b + 1,).

    No two of a batch, of :data:`WIDTH` at most, share a point, and those that do stay in their order: to
    project them batch by batch is to project them one by one as given.
    """
    levels, last = np.empty(len(constraints), dtype=np.int64), np.zeros(n_points, dtype=np.int64)
    for number, points in enumerate(constraints):
        levels[number] = level = last[points].max()
        last[points] = level + 1
    order = np.argsort(levels, kind="stable")
    within = np.arange(len(order)) - np.searchsorted(levels[order], levels[order])
    return order, np.append(np.flatnonzero(within % WIDTH == 0), len(order))


@vector_kernel
def sweep_angles(
    p: Floats, w: Floats, quads: Ints, rest: Floats, stiffness: float, batches: Ints, lanes: Floats
) -> None:
    """Project the local shape constraint, eq. 6 and 7, of quadruples of points (q, 4), a batch at a time.

    With psi = arccos(n1 . n2) = pi - abs(phi), C = psi - psi0 = abs(phi0) - abs(phi), and its gradient is
    that of phi, times -sign(phi): the same as eq. 7 without its cancellation beside flat pairs.

    quads : as of :class:`~vtkmuscle.core.mesh.surface.MeshTopology`;  rest : (q,) abs(phi0) [radians];
    stiffness : per iteration;  batches : of :func:`in_batches`;  lanes : (LANES,) working memory.
    """
    for batch in range(len(batches) - 1):
        first, count = batches[batch], batches[batch + 1] - batches[batch]
        for q in range(count):
            for c in range(4):
                i = quads[first + q, c]
                for k in range(3):
                    lanes[WIDTH * (3 * c + k) + q] = p[i, k]
            lanes[WIDTH * 12 + q] = rest[first + q]
        for q in range(WIDTH):  # of constant length and without branches: by vector instructions
            proper, sine, cosine, ee, a2, b2, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z = hinge(
                lanes[q], lanes[WIDTH + q], lanes[WIDTH * 2 + q],
                lanes[WIDTH * 3 + q], lanes[WIDTH * 4 + q], lanes[WIDTH * 5 + q],
                lanes[WIDTH * 6 + q], lanes[WIDTH * 7 + q], lanes[WIDTH * 8 + q],
                lanes[WIDTH * 9 + q], lanes[WIDTH * 10 + q], lanes[WIDTH * 11 + q],
            )  # fmt: skip
            off = angle_of(abs(sine), cosine) - lanes[WIDTH * 12 + q]
            a1, b1 = ee - a2, ee - b2
            g1, g2, g3, g4 = gradient_squares(cosine, ee, a1, a2, b1, b2, n11, n22)
            s = math.copysign(stiffness * off, sine * off) * math.sqrt(ee) / (g1 + g2 + g3 + g4)
            s = s if proper & (sine != 0.0) else 0.0
            s1, s2 = s * n22, s * n11
            _turn(lanes, q, -s1 * a1, n1x, n1y, n1z, -s2 * b1, n2x, n2y, n2z)
            _turn(lanes, WIDTH * 3 + q, -s1 * a2, n1x, n1y, n1z, -s2 * b2, n2x, n2y, n2z)
            _turn(lanes, WIDTH * 6 + q, s1 * ee, n1x, n1y, n1z, 0.0, n2x, n2y, n2z)
            _turn(lanes, WIDTH * 9 + q, 0.0, n1x, n1y, n1z, s2 * ee, n2x, n2y, n2z)
        for q in range(count):
            for c in range(4):
                i = quads[first + q, c]
                for k in range(3):
                    p[i, k] += w[i] * lanes[WIDTH * (3 * c + k) + q]


@lane
def _turn(
    way: Floats,
    q: int,
    s1: float,
    x1: float,
    y1: float,
    z1: float,
    s2: float,
    x2: float,
    y2: float,
    z2: float,
) -> None:
    """Write the way s1 (x1, y1, z1) + s2 (x2, y2, z2) of a point."""
    way[q], way[WIDTH + q], way[WIDTH * 2 + q] = s1 * x1 + s2 * x2, s1 * y1 + s2 * y2, s1 * z1 + s2 * z2


@lane
def angle_of(sine: float, cosine: float) -> float:
    """Return the angle (0 to pi) of a sine >= 0 and a cosine, both times a length: twice atan of its half."""
    t = sine / (math.sqrt(sine * sine + cosine * cosine) + abs(cosine))
    u = t * t
    value = ARCTANGENT[17]
    for k in range(16, -1, -1):
        value = value * u + ARCTANGENT[k]
    near = 2.0 * t * value
    return near if cosine >= 0.0 else math.pi - near


@lane
def gradient_squares(
    cosine: float, ee: float, a1: float, a2: float, b1: float, b2: float, n11: float, n22: float
) -> tuple[float, ...]:
    """Return |dphi/dp_i|^2 |e|^2 |n1|^2 |n2|^2 of the four points of a hinge; a1 = |e|^2 - a2.

    Of the gradients of Tamstorf, Grinspun 2013, *Discrete bending forces and their Jacobians*,
    doi:10.1016/j.gmod.2013.07.001, finite at flat and at concave edges, without the vectors.
    """
    cross = 2.0 * cosine
    g1 = a1 * (a1 * n22 + b1 * cross) + b1 * (b1 * n11)
    g2 = a2 * (a2 * n22 + b2 * cross) + b2 * (b2 * n11)
    return g1, g2, ee * ee * n22, ee * ee * n11


@vector_kernel
def project_volume(
    p: Floats, w: Floats, triangles: Ints, rest: float, stiffness: float, gradient: Floats
) -> None:
    """Project the volume constraint, eq. 4 and 5.

    triangles : (m, 3) point ids of a closed surface;  rest : its volume at rest [mm^3];
    stiffness : per iteration;  gradient : (n, 3) working memory, overwritten.
    """
    volume = volume_and_gradient(p, triangles, gradient)
    squares = 0.0
    for i in range(len(p)):
        for c in range(3):
            squares += gradient[i, c] * gradient[i, c]
    if squares > 0.0:
        s = stiffness * (volume - rest) / squares
        for i in range(len(p)):
            for c in range(3):
                p[i, c] -= s * w[i] * gradient[i, c]


def edge_stiffness(points: Floats, edges: Ints, directions: Floats) -> Floats:
    """Return k = 1 - |u . v| for each edge (k, 2), (k,): 1 across the fibres, 0 along them.

    Kohout and Cervenka 2021, eq. 9, reads k = 1 - u . v. An edge has no sign, so that gives 0 or 2 by the
    order in which its ends are named; "if both vectors are collinear, the result will be zero" calls for the
    absolute value. The directions v (k, 3) of the fibres are unit vectors, 0 where there is none.
    """
    difference = points[edges[:, 1]] - points[edges[:, 0]]
    lengths = np.linalg.norm(difference, axis=1)
    along = np.abs(np.einsum("ij,ij->i", difference, directions))
    cosines = np.divide(along, lengths, out=np.zeros(len(edges)), where=lengths > 0)
    stiffness: Floats = 1.0 - np.clip(cosines, 0.0, 1.0)
    return stiffness


def harmonic_directions(points: Floats, topology: MeshTopology, fixed_to: Ints) -> Floats | None:
    """Return the unit direction (k, 3) from one end of a muscle to the other at each edge, without fibres.

    It is the mean of the unit gradients, in the edge's two triangles, of
    :func:`~vtkmuscle.core.mesh.harmonic.harmonic_field`; 0 where that is constant (inside an attachment).
    None where fewer than two bones have fixed points.
    """
    field = harmonic_field(points, topology.triangles, fixed_to)
    if field is None:
        return None
    gradients = unit_vectors(triangle_gradients(points, topology.triangles, field))
    gradients = np.vstack([gradients, np.zeros(3)])  # row -1: no triangle
    return unit_vectors(gradients[topology.edge_triangles].sum(axis=1))
