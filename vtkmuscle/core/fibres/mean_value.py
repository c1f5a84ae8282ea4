"""Mean value coordinates of points in a closed triangle mesh."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.surface import numbered_edges
from vtkmuscle.core.types import Floats, Ints

T = TypeVar("T")

#: A query point nearer than this to a vertex, an edge or a triangle lies on it; share of the mesh's diagonal.
ON_SURFACE = 1e-13
#: A sum smaller than this share of its terms has lost digits to cancellation, and is computed otherwise.
CANCELLED = 1e-6
#: Square of the height over a plane, as a share of that of the distance, below which a series is exact.
FLAT = 1e-6
#: Weights that miss their own point by more than this share of the diagonal come from an open surface.
LARGEST_RESIDUAL = 1e-6
#: Query points per task of a thread: enough to make the task's overhead vanish.
CHUNK = 16


def mean_value_coordinates(points: Floats, triangles: Ints, queries: Floats, *, threads: int = 0) -> Floats:
    """Return the weights that express points by the vertices of a closed triangle mesh.

    Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular meshes*
    (doi:10.1145/1073204.1073229). The weights of a point sum to 1 and reproduce linear functions; they are
    barycentric on the surface and defined outside of it as well. What several triangles have in common
    (directions to the vertices, angles under which edges are seen) is computed once per query point.

    Parameters
    ----------
    points : (n, 3) array
        Vertices of the mesh [mm].
    triangles : (m, 3) int array
        Point ids. Triangles without area contribute nothing; which side is out does not matter.
    queries : (q, 3) array
        Where to evaluate, inside or outside of the mesh [mm].
    threads : int, optional
        Number of threads, 0 for one per processor. The result does not depend on it.

    Returns
    -------
    (q, n) array
        A row of weights per query point [1].

    Raises
    ------
    ValueError
        If the weights of a point do not reproduce it: the surface is not closed, its triangles are not
        oriented alike, or the point is too far away.
    """
    mesh = coordinate_mesh(points, triangles)
    weights = np.empty((len(queries), len(points)))

    def keep(rows: slice, part: Floats) -> None:
        weights[rows] = part

    in_chunks(mesh, queries, keep, threads)
    return weights


class MeshArrays(NamedTuple):
    """A mesh about its centre as the kernels take it; number i of a triangle is opposite to its corner i."""

    vertices: Floats
    triangles: Ints
    edges: Ints
    opposite: Ints
    edge_vectors: Floats
    normals: Floats
    double_areas: Floats
    #: Spreads a residual over the vertices by the smallest change of weights that keeps their sum.
    spread: Floats


@dataclass(frozen=True, eq=False)
class CoordinateMesh:
    """What all query points need of a mesh."""

    centre: Floats
    diagonal: float
    arrays: MeshArrays


def coordinate_mesh(points: Floats, triangles: Ints) -> CoordinateMesh:
    """Return what all query points need of a mesh."""
    centre = points.mean(axis=0) if len(points) else np.zeros(3)
    vertices = points - centre
    corners = vertices[triangles]
    edge_vectors = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]  # number i is opposite to corner i
    normals = np.cross(edge_vectors[:, 0], edge_vectors[:, 1])
    double_areas = np.linalg.norm(normals, axis=1)
    longest = (edge_vectors**2).sum(axis=2).max(axis=1, initial=0.0)
    proper = double_areas > np.finfo(np.float64).eps * longest
    triangles, edge_vectors, double_areas = triangles[proper], edge_vectors[proper], double_areas[proper]
    normals = normals[proper] / double_areas[:, None]
    edges, edge_of = numbered_edges(triangles)
    opposite = edge_of.reshape(-1, 3)[:, [1, 2, 0]]  # half-edges are opposite to the corners 2, 0, 1
    used = vertices[np.unique(triangles)]
    if not len(used):
        raise InputError("mean value coordinates", "the mesh has no triangle with an area")
    diagonal = float(np.linalg.norm(np.ptp(used, axis=0)))
    arrays = MeshArrays(
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(triangles, dtype=np.int64),
        np.ascontiguousarray(edges, dtype=np.int64),
        np.ascontiguousarray(opposite),
        edge_vectors,
        normals,
        double_areas,
        vertices @ np.linalg.pinv(vertices.T @ vertices),
    )
    return CoordinateMesh(centre, diagonal, arrays)


def in_chunks(
    mesh: CoordinateMesh, queries: Floats, keep: Callable[[slice, Floats], T], threads: int
) -> list[T]:
    """Compute the weights of some points at a time, in threads, and return what `keep` makes of each part."""
    centred = np.ascontiguousarray(queries - mesh.centre)
    residuals = np.empty(len(queries))

    def work(first: int) -> T:
        rows = slice(first, min(first + CHUNK, len(queries)))
        weights = np.empty((rows.stop - first, len(mesh.arrays.vertices)))
        tolerance = mesh.diagonal * ON_SURFACE
        _weights_of_chunk(mesh.arrays, centred[rows], tolerance, weights, residuals[rows])
        return keep(rows, weights)

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        parts = list(pool.map(work, range(0, len(queries), CHUNK)))
    bad = np.flatnonzero(~(residuals <= LARGEST_RESIDUAL * mesh.diagonal))
    if len(bad):
        raise InputError(
            "mean value coordinates",
            f"{len(bad)} point(s), the first is number {bad[0]}, are not reproduced by their weights",
            "the surface must be closed and its triangles oriented alike, and the points must not be many "
            "times its size away from it",
        )
    return parts


def transport(weights: Floats, points: Floats) -> Floats:
    """Return the points that weights make of vertices, v_i = sum_j w_ij p_j.

    Kohout, Cervenka 2021, eq. 8 (doi:10.1007/978-3-030-72379-8_24). Taken about the centre of the vertices,
    so that a mesh far from the origin loses no digits.

    Parameters
    ----------
    weights : (q, n) array
        Rows that sum to 1.
    points : (n, 3) array
        Vertices, as many as when the weights were computed [mm].

    Returns
    -------
    (q, 3) array
        Positions [mm].
    """
    centre = points.mean(axis=0)
    moved: Floats = weights @ (points - centre) + centre
    return moved


@array_kernel
def _weights_of_chunk(
    mesh: MeshArrays, queries: Floats, tolerance: float, weights: Floats, residuals: Floats
) -> None:
    """Compute the weights of some query points, and by how much they would miss them uncorrected.

    Points nearer than the tolerance to a vertex, an edge or a triangle get their barycentric coordinates.
    """
    vertices = mesh.vertices
    e = np.empty_like(vertices)
    d = np.empty(len(vertices))
    g = np.empty(len(mesh.edges))
    for q in range(len(queries)):
        w = weights[q]
        w[:] = 0.0
        residuals[q] = 0.0
        for i in range(len(vertices)):
            for axis in range(3):
                e[i, axis] = vertices[i, axis] - queries[q, axis]
            d[i] = np.sqrt(e[i, 0] ** 2 + e[i, 1] ** 2 + e[i, 2] ** 2)
        nearest = np.argmin(d)
        if d[nearest] <= tolerance:
            w[nearest] = 1.0
            continue
        if _see_edges(e, d, mesh.edges, tolerance, g, w):
            continue
        if _see_triangles(e, g, mesh, tolerance, w):
            continue
        residuals[q] = _normalise(e, mesh.spread, w)


@kernel
def _see_edges(e: Floats, d: Floats, edges: Ints, tolerance: float, g: Floats, w: Floats) -> bool:
    """Compute g = theta / (2 |a x b|) for each edge from a to b, seen under the angle theta.

    Returns True, with the weights done, where the query point is on an edge.

    Most angles are small: there theta = asin(s) by its series, (2k)! / (4^k (k!)^2 (2k + 1)) s^(2k + 1),
    which for s < 1/8 has all digits after nine terms, and is several times faster than the arc tangent.
    """
    for j in range(len(edges)):
        a, b = edges[j, 0], edges[j, 1]
        ax, ay, az = e[a, 0], e[a, 1], e[a, 2]
        vx, vy, vz = e[b, 0] - ax, e[b, 1] - ay, e[b, 2] - az
        # a x (b - a) rather than a x b: the error is that of a small vector.
        cx, cy, cz = ay * vz - az * vy, az * vx - ax * vz, ax * vy - ay * vx
        dot = ax * e[b, 0] + ay * e[b, 1] + az * e[b, 2]
        cross2 = cx * cx + cy * cy + cz * cz
        product = d[a] * d[b]
        s2 = cross2 / (product * product)
        if dot > 0.0 and s2 < 1.0 / 64.0:
            series = 231.0 / 13312.0 + s2 * (143.0 / 10240.0 + s2 * (6435.0 / 557056.0))
            series = 35.0 / 1152.0 + s2 * (63.0 / 2816.0 + s2 * series)
            series = 3.0 / 40.0 + s2 * (5.0 / 112.0 + s2 * series)
            g[j] = 0.5 * (1.0 + s2 * (1.0 / 6.0 + s2 * series)) / product
            continue
        length2 = vx * vx + vy * vy + vz * vz
        if dot < 0.0 and cross2 <= tolerance * tolerance * length2:
            w[b] = -(ax * vx + ay * vy + az * vz) / length2
            w[a] = 1.0 - w[b]
            return True
        cross = np.sqrt(cross2)
        g[j] = 0.5 * np.arctan2(cross, dot) / cross if cross > 0.0 else 0.5 / product
    return False


@kernel
def _see_triangles(e: Floats, g: Floats, mesh: MeshArrays, tolerance: float, w: Floats) -> bool:
    """Add up the weights of all triangles; True, with the weights done, where the point is in a triangle.

    Seen from v, a triangle with corners e_i = p_i - v covers the piece of the unit sphere whose vector area
    is m = sum_k g_k c_k, with c_k = e_{k+1} x e_{k-1} and g_k = theta_k / (2 |c_k|), theta_k the angle under
    which its edge k is seen (g_k is shared by the triangles at an edge). Its weights solve
    sum_i w_i e_i = m (Ju et al., section 3). With the height h = n . e over the plane of the triangle (unit
    normal n, double area A, edge vectors l_k, t_k = n x l_k) c_k = b_k n + h t_k, where b_k / A are the
    barycentric coordinates of the foot point, and so

        w_i = (b_i S / h + h sum_k g_k l_k . l_i) / A,   S = n . m = sum_k g_k b_k.

    Unlike the paper's form by spherical trigonometry this has no pole but the triangle itself, and needs no
    threshold: near the plane of a triangle, outside of it, S is h^2 small and computed as such.
    """
    triangles, opposite, double_areas = mesh.triangles, mesh.opposite, mesh.double_areas
    for t in range(len(triangles)):
        normal, sides = mesh.normals[t], mesh.edge_vectors[t]
        i0, i1, i2 = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        g0, g1, g2 = g[opposite[t, 0]], g[opposite[t, 1]], g[opposite[t, 2]]
        h = normal[0] * e[i0, 0] + normal[1] * e[i0, 1] + normal[2] * e[i0, 2]
        b0, b1, b2 = (
            _triple(normal, e[i1], sides[0]),
            _triple(normal, e[i2], sides[1]),
            _triple(normal, e[i0], sides[2]),
        )
        s0, s1, s2 = g0 * b0, g1 * b1, g2 * b2
        s = s0 + s1 + s2
        if abs(h) <= tolerance and b0 > 0.0 and b1 > 0.0 and b2 > 0.0:
            w[:] = 0.0
            w[i0], w[i1], w[i2] = b0 / (b0 + b1 + b2), b1 / (b0 + b1 + b2), b2 / (b0 + b1 + b2)
            return True
        if h == 0.0:
            continue
        if abs(s) <= CANCELLED * (abs(s0) + abs(s1) + abs(s2)):
            s = _flat_excess(h, b0, g0, sides[0], e[i1], e[i2])
            s += _flat_excess(h, b1, g1, sides[1], e[i2], e[i0])
            s += _flat_excess(h, b2, g2, sides[2], e[i0], e[i1])
            s *= -0.5
        s /= h * double_areas[t]
        h /= double_areas[t]
        x = h * (g0 * sides[0, 0] + g1 * sides[1, 0] + g2 * sides[2, 0])
        y = h * (g0 * sides[0, 1] + g1 * sides[1, 1] + g2 * sides[2, 1])
        z = h * (g0 * sides[0, 2] + g1 * sides[1, 2] + g2 * sides[2, 2])
        w[i0] += b0 * s + x * sides[0, 0] + y * sides[0, 1] + z * sides[0, 2]
        w[i1] += b1 * s + x * sides[1, 0] + y * sides[1, 1] + z * sides[1, 2]
        w[i2] += b2 * s + x * sides[2, 0] + y * sides[2, 1] + z * sides[2, 2]
    return False


@kernel
def _normalise(e: Floats, spread: Floats, w: Floats) -> float:
    """Make weights sum to 1 and reproduce their point exactly; return by how much they missed it [mm]."""
    total = w.sum()
    rx, ry, rz = 0.0, 0.0, 0.0
    for i in range(len(w)):
        w[i] /= total
        rx += w[i] * e[i, 0]
        ry += w[i] * e[i, 1]
        rz += w[i] * e[i, 2]
    for i in range(len(w)):
        w[i] -= spread[i, 0] * rx + spread[i, 1] * ry + spread[i, 2] * rz
    missed: float = np.sqrt(rx * rx + ry * ry + rz * rz)
    return missed


@kernel
def _flat_excess(h: float, b: float, g: float, side: Floats, ea: Floats, eb: Floats) -> float:
    """Return phi - theta cos(beta) of an edge: how far the angle seen from the foot point exceeds its share.

    phi is the angle under which the foot point sees the edge from a to b, theta that from the height h above,
    beta the angle between the planes; over the edges of a triangle that the foot point is outside of, the
    phi sum to 0, so that S of :func:`_see_triangles` is -1/2 the sum of these excesses. With the distance
    delta = b / length of the foot point from the edge's line, and s along it, the excess is

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


@kernel
def _triple(a: Floats, b: Floats, c: Floats) -> float:
    """Return a . (b x c)."""
    product: float = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    return product
