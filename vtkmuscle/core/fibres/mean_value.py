"""Mean value coordinates in a closed triangle mesh, by SIMD lanes.

Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular meshes*
(doi:10.1145/1073204.1073229). Seen from a point v, a triangle with corners e_i = p_i - v covers a piece of
the unit sphere with the vector area m = sum_k g_k c_k, where c_k = e_{k+1} x e_{k-1}, g_k = theta_k / (2
|c_k|), and theta_k is the visual angle of edge k. The weights solve sum_i w_i e_i = m (section 3). With the
height h = n . e over the triangle's plane (unit normal n, double area A, edge vectors l_k, t_k = n x l_k) c_k
= b_k n + h t_k, where b_k / A are the barycentric coordinates of the foot point, and so

    w_i = (b_i S / h + h sum_k g_k l_k . l_i) / A,   S = n . m = sum_k g_k b_k.

Unlike the paper's spherical trigonometry, this form is singular on the triangle alone.

Most triangles are far away, with edges under small visual angles. With u = sin^2(theta / 2), from the lengths
of the edge and of the e,

    g = f(u) / (2 |e_a| |e_b|),   f(u) = asin(sqrt u) / sqrt(u (1 - u)) = sum_k 4^k (k!)^2 / (2k + 1)! u^k.

The few triangles near the point, or with a plane near the point, are computed separately.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import LANES, lane, vector_kernel
from vtkmuscle.core.machine import processors
from vtkmuscle.core.mesh.surface import diagonal
from vtkmuscle.core.types import SAME, Bools, Floats, Ints

#: Distance below which a query point lies on a vertex, edge or triangle; part of the mesh's diagonal, 450
#: times the rounding of a number.
ON_SURFACE = 1e-13
#: Largest u = sin^2(theta / 2) of an edge of a far triangle: 20 degrees; f has all digits after 11 terms.
SMALL_ANGLE = 1.0 / 32.0
#: Squared height over squared distance, and a sum over its terms, below which rounding has cost digits of S;
#: there the series of the excess is exact.
FLAT = 1e-6
#: Coefficients of f in u, from the greatest power on.
_TERMS = tuple(4.0**k * math.factorial(k) ** 2 / math.factorial(2 * k + 1) for k in reversed(range(11)))
# Rows of the buffer, LANES numbers each: squared distances and their roots' inverses at three corners, ...
_D0, _D1, _D2, _R0, _R1, _R2 = (row * LANES for row in range(6))
# ... the weights there before and after, whether a triangle is not far, and the points.
_V0, _V1, _V2, _W0, _W1, _W2, _CLOSE, _X, _Y, _Z = (row * LANES for row in range(6, 16))


def mean_value_coordinates(points: Floats, triangles: Ints, queries: Floats) -> Floats:
    """Return mean value coordinates (q, n) of query points.

    The weights of a point sum to 1 and reproduce linear functions; on the surface they are barycentric, and
    they extend outside.

    points, triangles : (n, 3), (m, 3), the closed mesh [mm], facing either side. Triangles without area
        contribute nothing;
    queries : (q, 3), query points, inside or outside of the mesh [mm].

    Raises a ValueError if weights do not reproduce their point: the surface is open, its triangles disagree
    about the outside, or the point is too far away.
    """
    return weights_of(coordinate_mesh(points, triangles), queries)


class CoordinateMesh(NamedTuple):
    """Mesh about its `centre`, as the kernel's input. Edge i is opposite corner i.

    Vertices (n, 3) [mm] and triangles with an area (m, 3). Constants (m, 16) are the unit normal n, l_1 x n,
    l_2 x n, the double area A, l_0 . l_1 / A, l_0 . l_2 / A, l_1 . l_2 / A, and the squared edge lengths.
    `spread` (n, 3) distributes a residual over the vertices by the least change of weights with a constant
    sum; `diagonal` is the diagonal of the box [mm].
    """

    vertices: Floats
    triangles: Ints
    constants: Floats
    spread: Floats
    centre: Floats
    diagonal: float


def coordinate_mesh(points: Floats, triangles: Ints) -> CoordinateMesh:
    """Return the mesh data common to all query points. From points (n, 3) and triangles (m, 3)."""
    centre = points.mean(axis=0) if len(points) else np.zeros(3)
    vertices = points - centre
    corners = vertices[triangles]
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]  # number i is opposite to corner i
    normals = np.cross(sides[:, 0], sides[:, 1])
    double_areas = np.linalg.norm(normals, axis=1)
    squares = (sides**2).sum(axis=2)
    proper = double_areas > np.finfo(np.float64).eps * squares.max(axis=1, initial=0.0)
    arrays = triangles, sides, normals, double_areas, squares
    triangles, sides, normals, double_areas, squares = (array[proper] for array in arrays)
    normals = normals / double_areas[:, None]
    used = vertices[np.unique(triangles)]
    if not len(used):
        raise InputError("mean value coordinates", "the mesh has no triangle with an area")
    l0, l1, l2 = sides[:, 0], sides[:, 1], sides[:, 2]
    products = np.stack([(a * b).sum(axis=1) for a, b in ((l0, l1), (l0, l2), (l1, l2))], axis=1)
    crosses = np.cross(l1, normals), np.cross(l2, normals)
    constants = [normals, *crosses, double_areas, products / double_areas[:, None], squares]
    spread = vertices @ np.linalg.pinv(vertices.T @ vertices)
    mesh = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(triangles, np.int64)
    return CoordinateMesh(*mesh, np.column_stack(constants), spread, centre, diagonal(used))


def weights_of(mesh: CoordinateMesh, queries: Floats, *, first: int = 0) -> Floats:
    """Return the weights (q, n) of points, in threads. Errors count points from `first`."""
    centred = queries - mesh.centre
    weights, residuals = np.empty((len(queries), len(mesh.vertices))), np.empty(len(queries))

    def work(begin: int) -> None:
        rows = slice(begin, begin + LANES)
        weights[rows], residuals[rows] = weights_of_lanes(mesh, centred[rows], mesh.diagonal * ON_SURFACE)

    with ThreadPoolExecutor(processors()) as pool:
        list(pool.map(work, range(0, len(queries), LANES)))
    bad = np.flatnonzero(~(residuals <= SAME * mesh.diagonal))
    if len(bad):
        problem = f"the weights of {len(bad)} point(s), first point {first + bad[0]}, do not reproduce them"
        remedy = "close the surface, orient its triangles alike, and keep points within a few times its size"
        raise InputError("mean value coordinates", problem, remedy)
    return weights


def transport(weights: Floats, points: Floats) -> Floats:
    """Return weighted means of vertices (q, 3), v_i = sum_j w_ij p_j.

    Kohout, Cervenka 2021, eq. 8 (doi:10.1007/978-3-030-72379-8_24). Sums are about the vertices' centre, so a
    mesh far from the origin loses no digits.

    weights : (q, n), rows that sum to 1;
    points : (n, 3), new positions of the vertices [mm].
    """
    centre = points.mean(axis=0)
    return np.asarray(weights @ (points - centre) + centre)


def weights_of_lanes(mesh: CoordinateMesh, queries: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """Return weights (q, n) and uncorrected residuals (q,) [mm].

    The points are (q, 3), about the mesh's centre, 1 <= q <= LANES. Points nearer than the tolerance [mm] to
    a vertex, an edge or a triangle get barycentric coordinates.
    """
    points = queries[np.minimum(np.arange(LANES), len(queries) - 1)]
    squares = cdist(mesh.vertices, points, "sqeuclidean")
    sums, close = np.zeros(squares.shape), np.zeros((len(mesh.triangles), LANES), dtype=np.bool_)
    buffer = np.concatenate([np.empty(_X), points.T.reshape(-1)])
    inverses = np.sqrt(squares)
    with np.errstate(divide="ignore", invalid="ignore"):  # at a vertex; an open surface may have no weight
        np.divide(1.0, inverses, out=inverses)
        _see_far(mesh, squares.reshape(-1), inverses.reshape(-1), buffer, sums.reshape(-1), close)
        hits = np.flatnonzero(close)
        corners, shares, on = _see_near(mesh, points, tolerance, hits // LANES, hits % LANES, sums)
        sums /= np.einsum("nk->k", sums)  # a quarter of the time of sum()
    missed = mesh.vertices.T @ sums - points.T
    sums -= mesh.spread @ missed
    weights, residuals = sums.T, np.linalg.norm(missed, axis=0)

    vertices, lanes = np.divmod(np.flatnonzero(squares <= tolerance**2), LANES)
    at_vertex, first = np.unique(lanes, return_index=True)
    on_surface = np.append(on, at_vertex)
    weights[on_surface], residuals[on_surface] = 0.0, 0.0
    weights[on[:, None], corners] = shares
    weights[at_vertex] = 0.0
    weights[at_vertex, vertices[first]] = 1.0
    return weights[: len(queries)], residuals[: len(queries)]


@lane
def _move(source: Floats, at: int, to: Floats, target: int) -> None:
    """Copy a row."""
    for k in range(LANES):
        to[target + k] = source[at + k]


@lane
def _half_f(u: float) -> float:
    """Return f(u) / 2 for u <= SMALL_ANGLE."""
    series = 0.0
    for term in _TERMS:
        series = series * u + term
    return 0.5 * series


@vector_kernel
def _see_far(
    mesh: CoordinateMesh, squares: Floats, inverses: Floats, buffer: Floats, sums: Floats, close: Bools
) -> None:
    """Add the weights of far triangles, and mark close triangles.

    The l_k add up to 0: sum_k g_k l_k . l_0 = l_0 . l_1 (g_1 - g_0) + l_0 . l_2 (g_2 - g_0), and so on.
    Arrays of (n * LANES,) have squared distance, inverse distance and weight of each vertex; `close` (m,
    LANES) becomes True for close triangles.
    """
    for t in range(len(mesh.triangles)):
        first = mesh.triangles[t, 0]
        px, py, pz = mesh.vertices[first, 0], mesh.vertices[first, 1], mesh.vertices[first, 2]
        for corner in range(3):  # a row that is no constant: one compilation serves all
            at, row = mesh.triangles[t, corner] * LANES, corner * LANES
            _move(squares, at, buffer, _D0 + row)
            _move(inverses, at, buffer, _R0 + row)
            _move(sums, at, buffer, _V0 + row)
        own = mesh.constants[t]
        nx, ny, nz, ux, uy, uz, vx, vy, vz = (
            own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7], own[8],
        )  # fmt: skip
        area, l01, l02, l12, l0, l1, l2 = own[9], own[10], own[11], own[12], own[13], own[14], own[15]
        n_close = 0
        for k in range(LANES):
            x, y, z = px - buffer[_X + k], py - buffer[_Y + k], pz - buffer[_Z + k]
            d0, d1, d2 = buffer[_D0 + k], buffer[_D1 + k], buffer[_D2 + k]
            r0, r1, r2 = buffer[_R0 + k], buffer[_R1 + k], buffer[_R2 + k]
            h = x * nx + y * ny + z * nz
            b1, b2 = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz
            b0 = area - b1 - b2
            r12, r20, r01 = r1 * r2, r2 * r0, r0 * r1
            u0 = 0.5 - 0.25 * (d1 + d2 - l0) * r12
            u1 = 0.5 - 0.25 * (d2 + d0 - l1) * r20
            u2 = 0.5 - 0.25 * (d0 + d1 - l2) * r01
            g0, g1, g2 = r12 * _half_f(u0), r20 * _half_f(u1), r01 * _half_f(u2)
            s = (g0 * b0 + g1 * b1 + g2 * b2) / (h * area)
            a, b, c = l01 * (g1 - g0), l02 * (g2 - g0), l12 * (g2 - g1)
            is_close = (max(u0, u1, u2) > SMALL_ANGLE) | (h * h <= FLAT * d0)
            n_close += 1 if is_close else 0
            buffer[_CLOSE + k] = 1.0 if is_close else 0.0
            buffer[_W0 + k] = buffer[_V0 + k] + (0.0 if is_close else b0 * s + h * (a + b))
            buffer[_W1 + k] = buffer[_V1 + k] + (0.0 if is_close else b1 * s + h * (c - a))
            buffer[_W2 + k] = buffer[_V2 + k] + (0.0 if is_close else b2 * s - h * (b + c))
        for corner in range(3):
            _move(buffer, _W0 + corner * LANES, sums, mesh.triangles[t, corner] * LANES)
        if n_close > 0:
            for k in range(LANES):
                close[t, k] = buffer[_CLOSE + k] > 0.0


def _see_near(
    mesh: CoordinateMesh, points: Floats, tolerance: float, triangle: Ints, lane_of: Ints, sums: Floats
) -> tuple[Ints, Floats, Ints]:
    """Add weights of close triangles to the sums (n, LANES).

    Returns, for points on a triangle or an edge, vertices (s, 3), barycentric coordinates (s, 3), and lanes
    (s,).
    """
    # Arrays (..., p) of all pairs, vectors (3, ..., p): each operation runs along them.
    corners, constants = mesh.triangles[triangle].T, mesh.constants[triangle].T
    normals, areas = constants[:3], constants[9]
    at = np.ascontiguousarray(mesh.vertices.take(corners, axis=0).transpose(2, 0, 1))
    e, sides = at - points[lane_of].T[:, None], at[:, [2, 0, 1]] - at[:, [1, 2, 0]]
    firsts, seconds = e[:, [1, 2, 0]], e[:, [2, 0, 1]]
    # a x (b - a) rather than a x b: the error is that of a small vector.
    crosses = np.cross(firsts, sides, axis=0)
    cross, length2 = np.sqrt(_dot(crosses, crosses)), _dot(sides, sides)
    dots, b, h = _dot(firsts, seconds), _dot(normals[:, None], crosses), _dot(normals, e[:, 0])
    g = np.where(cross > 0.0, 0.5 * np.arctan2(cross, dots) / cross, 0.5 / dots)
    s, terms = _dot(g, b), _dot(g, abs(b))
    lost = abs(s) <= FLAT * terms
    s[lost] = -0.5 * _flat_excess(h[lost], *(some[..., lost] for some in (b, g, sides, firsts, seconds)))
    added = b * (s / (h * areas)) + (h / areas) * _dot((g * sides).sum(axis=1)[:, None], sides)
    on_edge = (dots < 0.0) & (cross**2 <= tolerance**2 * length2)
    on = on_edge.any(axis=0) | ((abs(h) <= tolerance) & (b > 0.0).all(axis=0))
    counts = ~on & (h != 0.0)
    np.add.at(sums.reshape(-1), corners[:, counts] * LANES + lane_of[counts], added[:, counts])

    shares, edge = (b[:, on] / b[:, on].sum(axis=0)).T, np.flatnonzero(on_edge[:, on].any(axis=0))
    opposite = on_edge[:, on][:, edge].argmax(axis=0)
    start, end = (opposite + 1) % 3, (opposite + 2) % 3
    number = np.flatnonzero(on)[edge]
    share = -_dot(firsts[:, opposite, number], sides[:, opposite, number]) / length2[opposite, number]
    shares[edge] = 0.0
    shares[edge, start], shares[edge, end] = 1.0 - share, share
    return corners[:, on].T, shares, lane_of[on]


def _dot(a: Floats, b: Floats) -> Floats:
    """Return dot products of vectors (3, ...)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _flat_excess(h: Floats, b: Floats, g: Floats, sides: Floats, ea: Floats, eb: Floats) -> Floats:
    """Return the excess phi - theta cos(beta), summed over edges.

    The sum is the excess of the angle at the foot point: phi is the visual angle of the edge from a to b at
    the foot point, theta at the height h above, beta the angle between the planes. Over the edges of a
    triangle the phi sum to 0 for an outer foot point, so S is -1/2 the sum of the excesses. With the distance
    delta = b / length of the foot point from the edge's line, and s along the line, the excess is

        h^2 integral delta ds / ((delta^2 + s^2) (delta^2 + s^2 + h^2)),

    and for h much smaller than delta, with y = delta^2 + h^2 / 2, h^2 integral delta ds / (y + s^2)^2.
    """
    length = np.sqrt(_dot(sides, sides))
    delta = b / length
    sa, sb = _dot(ea, sides) / length, _dot(eb, sides) / length
    y = delta * delta + 0.5 * h * h
    x = np.sqrt(y)
    bracket = np.arctan2(x * length, y + sa * sb) / x + sb / (y + sb * sb) - sa / (y + sa * sa)
    series = 0.5 * h * h * delta / y * bracket
    plain = np.arctan2(delta * length, delta * delta + sa * sb) - 2.0 * g * b
    return np.asarray(np.where(h * h < FLAT * delta * delta, series, plain).sum(axis=0))
