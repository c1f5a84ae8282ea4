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


@vector_kernel
def sweep_angles(p: Floats, w: Floats, quads: Ints, rest: Floats, stiffness: float) -> None:
    """Project the local shape constraint, eq. 6 and 7, of quadruples of points (q, 4) one by one.

    With psi = arccos(n1 . n2) = pi - abs(phi), C = psi - psi0 = abs(phi0) - abs(phi), and its gradient is
    that of phi, times -sign(phi): the same as eq. 7 without its cancellation beside flat pairs.

    quads : as of :class:`~vtkmuscle.core.mesh.surface.MeshTopology`;  rest : (q,) abs(phi0) [radians];
    stiffness : per iteration.
    """
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        proper, sine, cosine, ee, a2, b2, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z = hinge(
            p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2],
            p[k, 0], p[k, 1], p[k, 2], p[m, 0], p[m, 1], p[m, 2],
        )  # fmt: skip
        if not proper or sine == 0.0:
            continue
        off = math.atan2(abs(sine), cosine) - rest[q]
        a1, b1 = ee - a2, ee - b2
        g1, g2, g3, g4 = gradient_squares(cosine, ee, a1, a2, b1, b2, n11, n22)
        s = math.copysign(stiffness * off, sine * off) * math.sqrt(ee) / (g1 + g2 + g3 + g4)
        s1, s2 = s * n22, s * n11
        _turn(p, i, -w[i] * s1 * a1, n1x, n1y, n1z, -w[i] * s2 * b1, n2x, n2y, n2z)
        _turn(p, j, -w[j] * s1 * a2, n1x, n1y, n1z, -w[j] * s2 * b2, n2x, n2y, n2z)
        _turn(p, k, w[k] * s1 * ee, n1x, n1y, n1z, 0.0, n2x, n2y, n2z)
        _turn(p, m, 0.0, n1x, n1y, n1z, w[m] * s2 * ee, n2x, n2y, n2z)


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
def _turn(
    p: Floats, i: int, s1: float, x1: float, y1: float, z1: float, s2: float, x2: float, y2: float, z2: float
) -> None:
    """Add s1 (x1, y1, z1) + s2 (x2, y2, z2) to a point."""
    p[i, 0] += s1 * x1 + s2 * x2
    p[i, 1] += s1 * y1 + s2 * y2
    p[i, 2] += s1 * z1 + s2 * z2


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
