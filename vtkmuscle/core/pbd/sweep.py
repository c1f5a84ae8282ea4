"""The constraints of Kohout and Cervenka 2021, eq. 1 to 7 and 9.

doi:10.1007/978-3-030-72379-8_24. The constraints are projected row by row of edges. A projection moves points
p against a constraint C(p) = 0 of stiffness k by

    p_i -= k C g_i / sum_j |g_j|^2,    g_i = dC / dp_i    (eq. 1).

As the paper has it:

* Eq. 1 divides by the squares of the gradients of *all* points, "assuming that every point has the same
  mass". Algorithm 1 gives fixed points a mass of 1, too, and does not move them. So an iteration meets a
  constraint beside a fixed point by half, and no denominator can vanish there.
* A stiffness multiplies the correction of each iteration.

The paper's angle (eq. 6) is an arccosine, pi - abs(phi) of the signed angle phi of
:func:`~vtkmuscle.core.mesh.rest_shape.edge_geometry`. The arccosine does not tell a ridge from a groove: an
edge folded to the wrong side stays folded. The signed angle is ours, and moves corners by the chord of a turn
t, 2 sin(t / 2): moved by t along a tangent (eq. 1), corners stretch triangles that fold by nearly 180 degrees
to three times their height.

Where the paper cannot be run as printed:

* Section 3.1, "we multiply the distance constraint (see Eq. 2) with the result": eq. 1 gives the same for k C
  as for C. The correction is multiplied.
* Eq. 4 without a sixth is six times the volume, so the paper's V0, "its original volume", must be six times
  the volume, too. A sixth in value and gradient changes nothing.
* Eq. 7 divides by sqrt(1 - d^2), 0 where two triangles are in one plane: a flat edge has no direction to turn
  to, and stays flat. The signed angle has a direction.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from vtkmuscle.core.jit import LANES, kernel, lane, vector_kernel
from vtkmuscle.core.mesh.harmonic import harmonic_field, triangle_gradients
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import proper_segments, segment_distances
from vtkmuscle.core.mesh.rest_shape import edge_geometry
from vtkmuscle.core.mesh.surface import MeshTopology
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.types import ROUNDING, Bools, Floats, Indices, Ints

#: Numbers of an edge that do not change: inverse masses of its four points, stiffness and rest length,
#: stiffness of its angle, and the cosine and sine of its rest angle; the place of the rest length.
N_CONSTANTS, LENGTH = 9, 5
#: Multiple of the rest length beyond which soft edges with signed angles yield no more: angles of long
#: triangles would stretch soft edges without end. 3 changes muscles of a hip, an arm and a knee by 0.03 mm
#: (root mean square), 1.5 by 3 mm, except a muscle that fails with either.
MOST_STRETCH = 3.0
#: Coefficients of atan(x) / x in x^2, from the greatest power on, for x from 0 to 1; its error is 2e-15.
_ATAN = Chebyshev.interpolate(lambda u: np.arctan(np.sqrt(u)) / np.sqrt(u), 18, domain=[0.0, 1.0])
_A: tuple[float, ...] = tuple(_ATAN.convert(kind=Polynomial).coef[::-1].tolist())


class EdgeRows(NamedTuple):
    """The edges of a surface in solving order.

    points : (r, 4, LANES) uint32, ends of each edge and third points of its triangles; n, an extra point, for
        a missing point;
    constants : (r, N_CONSTANTS, LANES), of each edge;
    order : (k,) int, numbers of the edges in this order.
    """

    points: Indices
    constants: Floats
    order: Ints


def edge_rows(
    quads: Ints, mass: Floats, lengths: Floats, stiffness: Floats, angles: Floats, angle_stiffness: Floats
) -> EdgeRows:
    """Return the edges of a surface of n points in rows.

    quads : (k, 4) int, ends of each edge and third points of its two triangles, -1 for a missing point;
    mass : (n,), 1 for moveable points, 0 for fixed points; edges of fixed points are left out;
    lengths, stiffness : (k,), rest length [mm], and stiffness per iteration;
    angles, angle_stiffness : (k,), rest angle [radians], and stiffness per iteration, 0 without an angle.
    """
    n = len(mass)
    masses = np.append(mass, 0.0)[np.where(quads < 0, n, quads)]
    used = np.flatnonzero((masses > 0.0).any(axis=1))
    rows = rows_of_edges(quads[used], n)
    points = np.where(quads < 0, n, quads)[used]
    turned = np.cos(angles), np.sin(angles)
    constants = np.column_stack([masses, stiffness, lengths, angle_stiffness, *turned])[used]
    # Row -1 stands for no edge.
    points = np.vstack([points, np.full(4, n)])[rows].swapaxes(1, 2)
    constants = np.vstack([constants, np.zeros(N_CONSTANTS)])[rows].swapaxes(1, 2)
    order = used[rows[rows >= 0]]
    return EdgeRows(np.ascontiguousarray(points, dtype=np.uint32), np.ascontiguousarray(constants), order)


def rows_of_edges(points_of_edges: Ints, n_points: int) -> Ints:
    """Return the numbers of edges in rows.

    Rows are (r, LANES), -1 in unused places. Edges of a row share none of their points (k, 4), the ends of
    each edge and the third points of its triangles; a negative number is no point. Each edge gets the first
    colour not yet used at the edge's points; colours are cut into rows. To solve the constraints of a row at
    once equals solving the constraints in turn.
    """
    colours = np.empty(len(points_of_edges), dtype=np.int64)
    # An edge meets fewer edges at each of its points than the point with the most.
    most = 4 * int(np.bincount(points_of_edges[points_of_edges >= 0], minlength=1).max())
    _first_fit(points_of_edges, np.zeros((n_points, most), dtype=np.bool_), colours)
    order = np.argsort(colours, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(colours[order])) + 1)
    filled = [np.pad(group, (0, -len(group) % LANES), constant_values=-1) for group in groups]
    return np.concatenate(filled).reshape(-1, LANES)


@kernel
def _first_fit(points_of_edges: Ints, taken: Bools, colours: Ints) -> None:
    """Write each edge's colour; taken : (n, c), colours at each point."""
    for e in range(len(points_of_edges)):
        colour, clear = -1, False
        while not clear:
            colour, clear = colour + 1, True
            for k in range(4):
                i = points_of_edges[e, k]
                clear = clear and (i < 0 or not taken[i, colour])
        colours[e] = colour
        for k in range(4):
            if points_of_edges[e, k] >= 0:
                taken[points_of_edges[e, k], colour] = True


@vector_kernel
def take_lengths(p: Floats, points: Indices, constants: Floats) -> None:
    """Write the edges' lengths at positions p (n + 1, 3) as rest lengths; arrays as of :class:`EdgeRows`."""
    for row in range(len(points)):
        for k in range(LANES):
            i, j, square = points[row, 0, k], points[row, 1, k], 0.0
            for axis in range(3):
                square += (p[i, axis] - p[j, axis]) ** 2
            constants[row, LENGTH, k] = np.sqrt(square)


@vector_kernel
def project_edges(
    p: Floats, points: Indices, constants: Floats, with_lengths: bool, with_angles: bool,
    signed: bool, buffer: Floats,
) -> None:  # fmt: skip
    """Project the lengths and angles of all edges.

    Each edge's length (eq. 2, 3) comes before the edge's angle (eq. 6, 7), row by row, in place.

    p : (n + 1, 3) positions [mm], the last a finite placeholder for missing points;  points, constants : see
    :class:`EdgeRows`;  buffer : (12 LANES,), memory.
    """
    for row in range(len(points)):
        ids, c = points[row], constants[row].reshape(-1)
        for corner in range(4):
            for k in range(LANES):
                i = ids[corner, k]
                for axis in range(3):
                    buffer[(3 * corner + axis) * LANES + k] = p[i, axis]
        if with_lengths:
            for k in range(LANES):
                _project_length(buffer, c, k, signed)
        if with_angles:
            for k in range(LANES):
                _project_angle(buffer, c, k, signed)
        for corner in range(4):
            for k in range(LANES):
                i = ids[corner, k]
                for axis in range(3):
                    p[i, axis] = buffer[(3 * corner + axis) * LANES + k]


@lane
def _project_length(b: Floats, c: Floats, k: int, limited: bool) -> None:
    x, y, z = b[k] - b[3 * LANES + k], b[LANES + k] - b[4 * LANES + k], b[2 * LANES + k] - b[5 * LANES + k]
    length = math.sqrt(x * x + y * y + z * z)
    soft = c[4 * LANES + k] * (length - c[5 * LANES + k])
    off = max(soft, length - MOST_STRETCH * c[5 * LANES + k]) if limited else soft
    s = off / (2.0 * length) if length > 0.0 else 0.0
    for axis, apart in enumerate((x, y, z)):
        b[axis * LANES + k] -= c[k] * s * apart
        b[(3 + axis) * LANES + k] += c[LANES + k] * s * apart


@lane
def _project_angle(b: Floats, c: Floats, k: int, signed: bool) -> None:
    """Project the angle of an edge.

    The gradients are from Tamstorf, Grinspun 2013, *Discrete bending forces and their Jacobians*,
    doi:10.1016/j.gmod.2013.07.001, and finite at flat and at concave edges.
    """
    proper, sine, cosine, ee, a2, b2, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z = edge_geometry(
        b[k], b[LANES + k], b[2 * LANES + k],
        b[3 * LANES + k], b[4 * LANES + k], b[5 * LANES + k],
        b[6 * LANES + k], b[7 * LANES + k], b[8 * LANES + k],
        b[9 * LANES + k], b[10 * LANES + k], b[11 * LANES + k],
    )  # fmt: skip
    if signed:
        off = chord_from(sine, cosine, n11 * n22, c[7 * LANES + k], c[8 * LANES + k])
    else:  # the unsigned angle is that of a ridge, and turns the other way in a groove
        turn = turn_from(abs(sine), cosine, n11 * n22, c[7 * LANES + k], c[8 * LANES + k])
        off = turn if sine > 0.0 else (-turn if sine < 0.0 else 0.0)
    a1, b1 = ee - a2, ee - b2
    cross = 2.0 * cosine
    # |dphi/dp_i|^2 |e|^2 |n1|^2 |n2|^2 of the four points.
    g1 = a1 * (a1 * n22 + b1 * cross) + b1 * (b1 * n11)
    g2 = a2 * (a2 * n22 + b2 * cross) + b2 * (b2 * n11)
    squares = g1 + g2 + ee * ee * n22 + ee * ee * n11
    s = c[6 * LANES + k] * off * math.sqrt(ee) / squares
    s = s if proper & (squares > 0.0) else 0.0
    s1, s2 = s * n22, s * n11
    for axis, (n1, n2) in enumerate(((n1x, n2x), (n1y, n2y), (n1z, n2z))):
        at = axis * LANES + k
        b[at] -= c[k] * (s1 * a1 * n1 + s2 * b1 * n2)
        b[3 * LANES + at] -= c[LANES + k] * (s1 * a2 * n1 + s2 * b2 * n2)
        b[6 * LANES + at] += c[2 * LANES + k] * s1 * ee * n1
        b[9 * LANES + at] += c[3 * LANES + k] * s2 * ee * n2


@lane
def turn_from(sine: float, cosine: float, square: float, cosine0: float, sine0: float) -> float:
    """Return the turn phi - phi0 in [-pi, pi].

    Sine and cosine of phi are scaled; sine0 and cosine0 belong to phi0. ``square`` is the sum of the squares
    of sine and cosine. With sine and cosine of the turn, the turn is twice an arctangent of at most 45
    degrees.
    """
    across = sine * cosine0 - cosine * sine0
    along = cosine * cosine0 + sine * sine0
    x = across / (math.sqrt(square) + abs(along))
    u = x * x
    u2 = u * u
    u4 = u2 * u2
    low = (_A[18] + _A[17] * u) + (_A[16] + _A[15] * u) * u2
    second = (_A[14] + _A[13] * u) + (_A[12] + _A[11] * u) * u2
    third = (_A[10] + _A[9] * u) + (_A[8] + _A[7] * u) * u2
    fourth = (_A[6] + _A[5] * u) + (_A[4] + _A[3] * u) * u2
    last = _A[2] + _A[1] * u + _A[0] * u2
    value = low + u4 * (second + u4 * (third + u4 * (fourth + u4 * last)))
    turn = 2.0 * x * value
    return turn if along >= 0.0 else math.copysign(math.pi, across) - turn


@lane
def chord_from(sine: float, cosine: float, square: float, cosine0: float, sine0: float) -> float:
    """Return the chord of a turn. 2 sin(t / 2) of :func:`turn_from`'s turn t."""
    across = sine * cosine0 - cosine * sine0
    along = cosine * cosine0 + sine * sine0
    radius = math.sqrt(square)
    far = radius + abs(along)
    scale = math.sqrt(2.0 / (radius * far))
    return scale * (across if along >= 0.0 else math.copysign(far, across))


def edge_stiffness(points: Floats, edges: Ints, directions: Floats) -> Floats:
    """Return k = 1 - abs(u . v) for each edge.

    The unit vectors u are along the edges (k, 2), and k (k,) is 1 across the fibres and 0 along the fibres.
    Kohout and Cervenka 2021, eq. 9, reads k = 1 - u . v. An edge has no sign, so that eq. 9 gives 0 or 2 by
    the order of the edge's ends; "if both vectors are collinear, the result will be zero" calls for the
    absolute value. The directions v (k, 3) of the fibres are unit vectors, 0 at edges without a direction.
    """
    along = unit_vectors(points[edges[:, 1]] - points[edges[:, 0]])
    return np.asarray(1.0 - np.minimum(np.abs(np.einsum("ij,ij->i", along, directions)), 1.0))


def fibre_directions_at(queries: Floats, fibre_points: Floats, offsets: Ints) -> Floats:
    """Return directions of the nearest fibre segments. Unit vectors (q, 3) at positions (q, 3)."""
    starts, steps, lengths = proper_segments(fibre_points, offsets)
    a, b = fibre_points[starts], fibre_points[starts + 1]
    ends = np.stack([a, b], axis=1).reshape(-1, 3)
    # Each segment as a triangle without area.
    triangles = 2 * np.arange(len(a))[:, None] + np.array([0, 1, 1])
    nearest, _, distances = triangle_tree(ends, triangles).nearest(queries)
    _, first, point = np.unique(ends, axis=0, return_index=True, return_inverse=True)
    first, limit = first[point.reshape(-1, 2)] // 2, distances + ROUNDING * lengths.max()
    for end in (0, 1):  # of equally near segments with a common end the first counts
        other = first[nearest, end]
        equal = segment_distances(queries, a[other], b[other]) <= limit
        nearest = np.where(equal, other, nearest)
    return steps[nearest] / lengths[nearest, None]


def harmonic_directions(points: Floats, topology: MeshTopology, fixed_to: Ints) -> Floats | None:
    """Return the unit direction along a muscle at each edge.

    The directions (k, 3) lead from one end of a muscle without fibres to the other end. A direction is the
    mean of the unit gradients, in the edge's two triangles, of
    :func:`~vtkmuscle.core.mesh.harmonic.harmonic_field`; 0 where the field is constant (inside an
    attachment). None where fewer than two bones have fixed points.
    """
    field = harmonic_field(points, topology.triangles, fixed_to)
    if field is None:
        return None
    # Row -1: no triangle.
    gradients = np.vstack([unit_vectors(triangle_gradients(points, topology.triangles, field)), np.zeros(3)])
    return unit_vectors(gradients[topology.edge_triangles].sum(axis=1))
