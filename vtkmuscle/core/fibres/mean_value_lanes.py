"""Mean value weights of sixteen points at a time, by vector instructions.

Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular meshes*
(doi:10.1145/1073204.1073229). Seen from a point v, a triangle with corners e_i = p_i - v covers the piece of
the unit sphere whose vector area is m = sum_k g_k c_k, with c_k = e_{k+1} x e_{k-1} and
g_k = theta_k / (2 |c_k|), theta_k the angle under which its edge k is seen. Its weights solve
sum_i w_i e_i = m (section 3). With the height h = n . e over the plane of the triangle (unit normal n, double
area A, edge vectors l_k, t_k = n x l_k) c_k = b_k n + h t_k, where b_k / A are the barycentric coordinates of
the foot point, and so

    w_i = (b_i S / h + h sum_k g_k l_k . l_i) / A,   S = n . m = sum_k g_k b_k.

Unlike the paper's form by spherical trigonometry this has no pole but the triangle itself.

Most triangles are far away: their edges are seen under small angles. With u = sin^2(theta / 2), which follows
from the lengths of the edge and of the e,

    g = f(u) / (2 |e_a| |e_b|),   f(u) = asin(sqrt u) / sqrt(u (1 - u)) = sum_k 4^k (k!)^2 / (2k + 1)! u^k.

Triangles that are near, or near the plane of which the point is, are rare, and done one by one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel, lane, vector_kernel
from vtkmuscle.core.types import Floats, Ints

#: Query points that are done together.
LANES = 16
#: Largest u = sin^2(theta / 2) of an edge of a far triangle: 20 degrees; f has all digits after 11 terms.
SMALL_ANGLE = 1.0 / 32.0
#: Square of the height over a plane, as a part of that of the distance, below which S is computed otherwise:
#: rounding of S errs by its own size over the height.
LEVEL = 1e-6
#: A sum smaller than this part of its terms has lost digits to cancellation, and is computed otherwise.
CANCELLED = 1e-6
#: Square of the height over a plane, as a share of that of the distance, below which a series is exact.
FLAT = 1e-6

_TERMS = tuple(4.0**k * math.factorial(k) ** 2 / math.factorial(2 * k + 1) for k in range(11))
_F0, _F1, _F2, _F3, _F4, _F5, _F6, _F7, _F8, _F9, _F10 = _TERMS

# Rows of the buffer, LANES numbers each: the points, ...
_X, _Y, _Z = 0, LANES, 2 * LANES
# ... squared distances and their roots' inverses at three corners, the weights there before and after, ...
_D0, _D1, _D2, _R0, _R1, _R2 = (row * LANES for row in range(3, 9))
_V0, _V1, _V2, _W0, _W1, _W2 = (row * LANES for row in range(9, 15))
# ... whether a triangle is not far, the least squared distance from a vertex, sums of weights, and residuals.
_CLOSE, _LEAST, _SUM, _AX, _AY, _AZ = (row * LANES for row in range(15, 21))
_ROWS = 21


class MeshArrays(NamedTuple):
    """A mesh about its centre as the kernels take it; number i of a triangle is opposite to its corner i.

    Attributes
    ----------
    vertices, triangles : (n, 3) array, (m, 3) int array
        Positions [mm]; triangles that have an area.
    constants : (m, 16) array
        The unit normal n, l_1 x n, l_2 x n, the double area A, l_0 . l_1 / A, l_0 . l_2 / A, l_1 . l_2 / A,
        and the squared lengths of the edges.
    spread : (n, 3) array
        Spreads a residual over the vertices by the smallest change of weights that keeps their sum.
    """

    vertices: Floats
    triangles: Ints
    constants: Floats
    spread: Floats


class LaneMemory(NamedTuple):
    """Working memory of :func:`weights_of_lanes`.

    Attributes
    ----------
    buffer : array
        Rows of numbers for the point in each lane.
    squares, inverses, sums : (n * LANES,) arrays
        Of each vertex its squared distance, the inverse distance, and its weight so far.
    near : (8, 3) array
        For a near triangle.
    corners, shares : (LANES, 3) int array, (LANES, 3) array
        Of a point on the surface the vertices, -1 for others, and its barycentric coordinates.
    """

    buffer: Floats
    squares: Floats
    inverses: Floats
    sums: Floats
    near: Floats
    corners: Ints
    shares: Floats


def lane_memory(n: int) -> LaneMemory:
    """Return working memory for a mesh of n vertices."""
    squares, inverses, sums = np.empty((3, n * LANES))
    corners, shares = np.empty((LANES, 3), dtype=np.int64), np.empty((LANES, 3))
    return LaneMemory(np.zeros(_ROWS * LANES), squares, inverses, sums, np.empty((8, 3)), corners, shares)


@vector_kernel
def weights_of_lanes(
    mesh: MeshArrays,
    queries: Floats,
    tolerance: float,
    places: Ints,
    memory: LaneMemory,
    weights: Floats,
    residuals: Floats,
) -> None:
    """Compute the weights of up to :data:`LANES` points, and by how much they would miss them uncorrected.

    Points nearer than the tolerance to a vertex, an edge or a triangle get their barycentric coordinates.

    Parameters
    ----------
    mesh : MeshArrays
        The mesh.
    queries : (q, 3) array
        The points, about the same centre, 1 <= q <= LANES [mm].
    tolerance : float
        See above [mm].
    places : (n,) int array
        Which number in a row of weights each vertex has.
    memory : LaneMemory
        Overwritten.
    weights : (q, n) array
        Overwritten.
    residuals : (q,) array
        Overwritten [mm].
    """
    buffer = memory.buffer
    for k in range(LANES):
        for axis in range(3):
            buffer[axis * LANES + k] = queries[min(k, len(queries) - 1), axis]
        memory.corners[k, 0] = -1
    _see_vertices(mesh.vertices, memory, len(buffer) // _ROWS)
    memory.sums[:] = 0.0
    _see_triangles(mesh, tolerance, memory)
    _normalise(mesh, places, memory, len(buffer) // _ROWS, weights, residuals)
    for q in range(len(queries)):
        if buffer[_LEAST + q] <= tolerance * tolerance:
            nearest = 0
            while memory.squares[nearest * LANES + q] != buffer[_LEAST + q]:
                nearest += 1
            _lies_between(memory, q, nearest, nearest, nearest, 1.0, 0.0)
        if memory.corners[q, 0] >= 0:
            for i in range(len(places)):
                weights[q, i] = 0.0
            for corner in range(3):
                weights[q, places[memory.corners[q, corner]]] += memory.shares[q, corner]
            residuals[q] = 0.0


@lane
def _move(source: Floats, at: int, to: Floats, place: int) -> None:
    """Copy a row; all loads first, so that the compiler need not know that the arrays do not overlap."""
    for k in range(0, LANES, 8):
        i, j = at + k, place + k
        a, b, c, d = source[i], source[i + 1], source[i + 2], source[i + 3]
        e, f, g, h = source[i + 4], source[i + 5], source[i + 6], source[i + 7]
        to[j], to[j + 1], to[j + 2], to[j + 3] = a, b, c, d
        to[j + 4], to[j + 5], to[j + 6], to[j + 7] = e, f, g, h


@lane
def _half_f(u: float) -> float:
    """Return f(u) / 2 for u <= SMALL_ANGLE."""
    series = _F7 + u * (_F8 + u * (_F9 + u * _F10))
    series = _F4 + u * (_F5 + u * (_F6 + u * series))
    series = _F1 + u * (_F2 + u * (_F3 + u * series))
    return 0.5 * _F0 + 0.5 * u * series


@vector_kernel
def _see_vertices(vertices: Floats, memory: LaneMemory, lanes: int) -> None:
    """Write squared distances and their roots' inverses; a number of lanes that is not known stays a loop."""
    buffer = memory.buffer
    for k in range(lanes):
        buffer[_LEAST + k] = np.inf
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for k in range(lanes):
            a, b, c = x - buffer[_X + k], y - buffer[_Y + k], z - buffer[_Z + k]
            square = a * a + b * b + c * c
            buffer[_D0 + k] = square
            buffer[_R0 + k] = 1.0 / np.sqrt(square)
            buffer[_LEAST + k] = min(buffer[_LEAST + k], square)
        _move(buffer, _D0, memory.squares, i * LANES)
        _move(buffer, _R0, memory.inverses, i * LANES)


@vector_kernel
def _see_triangles(mesh: MeshArrays, tolerance: float, memory: LaneMemory) -> None:
    """Add up the weights of all triangles, as at the top of this file.

    The l_k add up to 0: sum_k g_k l_k . l_0 = l_0 . l_1 (g_1 - g_0) + l_0 . l_2 (g_2 - g_0), and so on.
    """
    buffer, squares, inverses, sums = memory.buffer, memory.squares, memory.inverses, memory.sums
    for t in range(len(mesh.triangles)):
        i0, i1, i2 = mesh.triangles[t, 0], mesh.triangles[t, 1], mesh.triangles[t, 2]
        px, py, pz = mesh.vertices[i0, 0], mesh.vertices[i0, 1], mesh.vertices[i0, 2]
        i0, i1, i2 = i0 * LANES, i1 * LANES, i2 * LANES
        _move(squares, i0, buffer, _D0)
        _move(squares, i1, buffer, _D1)
        _move(squares, i2, buffer, _D2)
        _move(inverses, i0, buffer, _R0)
        _move(inverses, i1, buffer, _R1)
        _move(inverses, i2, buffer, _R2)
        _move(sums, i0, buffer, _V0)
        _move(sums, i1, buffer, _V1)
        _move(sums, i2, buffer, _V2)
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
            close = (max(u0, u1, u2) > SMALL_ANGLE) | (h * h <= LEVEL * d0)
            n_close += 1 if close else 0
            buffer[_CLOSE + k] = 1.0 if close else 0.0
            buffer[_W0 + k] = buffer[_V0 + k] + (0.0 if close else b0 * s + h * (a + b))
            buffer[_W1 + k] = buffer[_V1 + k] + (0.0 if close else b1 * s + h * (c - a))
            buffer[_W2 + k] = buffer[_V2 + k] + (0.0 if close else b2 * s - h * (b + c))
        _move(buffer, _W0, sums, i0)
        _move(buffer, _W1, sums, i1)
        _move(buffer, _W2, sums, i2)
        if n_close > 0:
            for k in range(LANES):
                if buffer[_CLOSE + k] > 0.0:
                    _see_one(mesh, t, k, tolerance, memory)


@kernel
def _see_one(mesh: MeshArrays, t: int, k: int, tolerance: float, memory: LaneMemory) -> None:
    """Add the weights of one triangle to those of the point in one lane, however near it is.

    Where the point is on it, or on an edge of it, that is remembered instead.
    """
    normal, area, corners = mesh.constants[t, :3], mesh.constants[t, 9], mesh.triangles[t]
    e, sides, b, g = memory.near[:3], memory.near[3:6], memory.near[6], memory.near[7]
    for axis in range(3):
        for i in range(3):
            e[i, axis] = mesh.vertices[corners[i], axis] - memory.buffer[axis * LANES + k]
            one, two = corners[(i + 1) % 3], corners[(i + 2) % 3]
            sides[i, axis] = mesh.vertices[two, axis] - mesh.vertices[one, axis]
    for i in range(3):
        one, two = (i + 1) % 3, (i + 2) % 3
        ax, ay, az = e[one, 0], e[one, 1], e[one, 2]
        vx, vy, vz = sides[i, 0], sides[i, 1], sides[i, 2]
        # a x (b - a) rather than a x b: the error is that of a small vector.
        cx, cy, cz = ay * vz - az * vy, az * vx - ax * vz, ax * vy - ay * vx
        dot = ax * e[two, 0] + ay * e[two, 1] + az * e[two, 2]
        cross, length2 = np.sqrt(cx * cx + cy * cy + cz * cz), vx * vx + vy * vy + vz * vz
        if dot < 0.0 and cross * cross <= tolerance * tolerance * length2:
            share = -(ax * vx + ay * vy + az * vz) / length2
            _lies_between(memory, k, corners[one], corners[two], corners[one], 1.0 - share, share)
            return
        g[i] = 0.5 * np.arctan2(cross, dot) / cross if cross > 0.0 else 0.5 / dot
        b[i] = normal[0] * cx + normal[1] * cy + normal[2] * cz
    h = normal[0] * e[0, 0] + normal[1] * e[0, 1] + normal[2] * e[0, 2]
    if abs(h) <= tolerance and b[0] > 0.0 and b[1] > 0.0 and b[2] > 0.0:
        whole = b[0] + b[1] + b[2]
        _lies_between(memory, k, corners[0], corners[1], corners[2], b[0] / whole, b[1] / whole)
        return
    if h == 0.0:
        return
    s, terms = 0.0, 0.0
    for i in range(3):
        s += g[i] * b[i]
        terms += abs(g[i] * b[i])
    if abs(s) <= CANCELLED * terms:
        s = 0.0
        for i in range(3):
            s -= 0.5 * _flat_excess(h, b[i], g[i], sides[i], e[(i + 1) % 3], e[(i + 2) % 3])
    s /= h * area
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3):
        x, y, z = x + g[i] * sides[i, 0], y + g[i] * sides[i, 1], z + g[i] * sides[i, 2]
    for i in range(3):
        along = x * sides[i, 0] + y * sides[i, 1] + z * sides[i, 2]
        memory.sums[corners[i] * LANES + k] += b[i] * s + h / area * along


@kernel
def _lies_between(memory: LaneMemory, k: int, a: int, b: int, c: int, at_a: float, at_b: float) -> None:
    """Remember that the point in a lane is on a triangle, an edge or a vertex."""
    memory.corners[k, 0], memory.corners[k, 1], memory.corners[k, 2] = a, b, c
    memory.shares[k, 0], memory.shares[k, 1], memory.shares[k, 2] = at_a, at_b, 1.0 - at_a - at_b


@kernel
def _flat_excess(h: float, b: float, g: float, side: Floats, ea: Floats, eb: Floats) -> float:
    """Return phi - theta cos(beta) of an edge: how far the angle seen from the foot point exceeds its share.

    phi is the angle under which the foot point sees the edge from a to b, theta that from the height h above,
    beta the angle between the planes; over the edges of a triangle that the foot point is outside of, the
    phi sum to 0, so that S is -1/2 the sum of these excesses. With the distance delta = b / length of the
    foot point from the edge's line, and s along it, the excess is

        h^2 integral delta ds / ((delta^2 + s^2) (delta^2 + s^2 + h^2)),

    and for h much smaller than delta, with y = delta^2 + h^2 / 2, h^2 integral delta ds / (y + s^2)^2.
    """
    length = np.sqrt(side[0] ** 2 + side[1] ** 2 + side[2] ** 2)
    delta = b / length
    sa = (ea[0] * side[0] + ea[1] * side[1] + ea[2] * side[2]) / length
    sb = (eb[0] * side[0] + eb[1] * side[1] + eb[2] * side[2]) / length
    excess: float
    if h * h < FLAT * delta * delta:
        y = delta * delta + 0.5 * h * h
        x = np.sqrt(y)
        bracket = np.arctan2(x * length, y + sa * sb) / x + sb / (y + sb * sb) - sa / (y + sa * sa)
        excess = 0.5 * h * h * delta / y * bracket
    else:
        excess = np.arctan2(delta * length, delta * delta + sa * sb) - 2.0 * g * b
    return excess


@vector_kernel
def _normalise(
    mesh: MeshArrays, places: Ints, memory: LaneMemory, lanes: int, weights: Floats, residuals: Floats
) -> None:
    """Make weights sum to 1 and reproduce their points exactly; write by how much they missed them [mm]."""
    buffer, vertices, spread = memory.buffer, mesh.vertices, mesh.spread
    for k in range(4 * LANES):
        buffer[_SUM + k] = 0.0
    for i in range(len(vertices)):
        _move(memory.sums, i * LANES, buffer, _V0)
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for k in range(lanes):
            w = buffer[_V0 + k]
            buffer[_SUM + k] += w
            buffer[_AX + k] += w * (x - buffer[_X + k])
            buffer[_AY + k] += w * (y - buffer[_Y + k])
            buffer[_AZ + k] += w * (z - buffer[_Z + k])
    for k in range(LANES):
        buffer[_SUM + k] = 1.0 / buffer[_SUM + k]
        for row in (_AX, _AY, _AZ):
            buffer[row + k] *= buffer[_SUM + k]
    for q in range(len(weights)):
        residuals[q] = np.sqrt(buffer[_AX + q] ** 2 + buffer[_AY + q] ** 2 + buffer[_AZ + q] ** 2)
    for i in range(len(vertices)):
        _move(memory.sums, i * LANES, buffer, _V0)
        x, y, z, place = spread[i, 0], spread[i, 1], spread[i, 2], places[i]
        for k in range(lanes):
            made_up = x * buffer[_AX + k] + y * buffer[_AY + k] + z * buffer[_AZ + k]
            buffer[_W0 + k] = buffer[_V0 + k] * buffer[_SUM + k] - made_up
        for q in range(len(weights)):
            weights[q, place] = buffer[_W0 + q]
