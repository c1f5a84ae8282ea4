"""The nearest point of a triangle, and the normals from which its side of a surface follows."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.closed_shells import edge_numbers
from vtkmuscle.core.types import Floats, Ints

#: Where on a triangle a point is: in its face, on the edge from corner k to the next, or at corner k.
FACE, EDGE, CORNER = 0, 1, 4


@kernel
def nearest_on_triangle(  # noqa: PLR0911 -- one for each region
    px: float, py: float, pz: float, a: Floats, b: Floats, c: Floats
) -> tuple[float, float, float, int]:
    """Return the point of triangle abc that is nearest to p, and where on the triangle it is.

    Voronoi regions of the corners, edges and face, Ericson 2005, *Real-time collision detection*, 5.1.5.
    a, b, c : (3,).  The last number is FACE, EDGE + k (from corner k to the next) or CORNER + k.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = px - a[0], py - a[1], pz - a[2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return a[0], a[1], a[2], CORNER
    bpx, bpy, bpz = px - b[0], py - b[1], pz - b[2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return b[0], b[1], b[2], CORNER + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return a[0] + t * abx, a[1] + t * aby, a[2] + t * abz, EDGE
    cpx, cpy, cpz = px - c[0], py - c[1], pz - c[2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return c[0], c[1], c[2], CORNER + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return a[0] + t * acx, a[1] + t * acy, a[2] + t * acz, EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return b[0] + t * (c[0] - b[0]), b[1] + t * (c[1] - b[1]), b[2] + t * (c[2] - b[2]), EDGE + 1
    scale = 1.0 / (va + vb + vc)
    v, w = vb * scale, vc * scale
    return a[0] + v * abx + w * acx, a[1] + v * aby + w * acy, a[2] + v * abz + w * acz, FACE


def pseudonormals(points: Floats, triangles: Ints) -> Floats:
    """Return the normals from which the side of a point follows, given its nearest point of the surface.

    A point is outside a closed surface where its offset from the nearest point of the surface goes along
    the normal there, inside where it goes against it. At an edge that is the sum of the normals of its
    triangles; at a corner the sum of the triangles' unit normals times their angles at the corner:
    Baerentzen, Aanaes 2005, doi:10.1109/TVCG.2005.49.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions; point ids, outward oriented.

    Returns
    -------
    (m, 7, 3) array
        Of the face, the three edges and the three corners of each triangle, in the order of FACE, EDGE + k
        and CORNER + k; of any length.
    """
    edges = edge_numbers(triangles)
    of_edges = np.zeros((int(edges.max(initial=-1)) + 1, 3))
    of_points = np.zeros((len(points), 3))
    result = np.empty((len(triangles), 7, 3))
    _add_normals(points, triangles, edges, of_edges, of_points, result)
    result[:, EDGE:CORNER], result[:, CORNER:] = of_edges[edges], of_points[triangles]
    return result


@kernel
def _add_normals(
    points: Floats, triangles: Ints, edges: Ints, of_edges: Floats, of_points: Floats, result: Floats
) -> None:
    """Write the normals of triangles, and add them to those of their edges and, by their angles, points."""
    for t in range(len(triangles)):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        x, y, z = _across(b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - b[0], c[1] - b[1], c[2] - b[2])
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            x, y, z = x / length, y / length, z / length
        else:
            x, y, z = 0.0, 0.0, 0.0
        result[t, FACE, 0], result[t, FACE, 1], result[t, FACE, 2] = x, y, z
        for k in range(3):
            at, onward, back = (
                points[triangles[t, k]],
                points[triangles[t, (k + 1) % 3]],
                points[triangles[t, k - 1]],
            )
            ux, uy, uz = onward[0] - at[0], onward[1] - at[1], onward[2] - at[2]
            vx, vy, vz = back[0] - at[0], back[1] - at[1], back[2] - at[2]
            nx, ny, nz = _across(ux, uy, uz, vx, vy, vz)
            # atan2 keeps small angles exact, and is 0 for triangles without area.
            angle = np.arctan2(np.sqrt(nx * nx + ny * ny + nz * nz), ux * vx + uy * vy + uz * vz)
            edge, point = of_edges[edges[t, k]], of_points[triangles[t, k]]
            edge[0], edge[1], edge[2] = edge[0] + x, edge[1] + y, edge[2] + z
            point[0], point[1], point[2] = point[0] + angle * x, point[1] + angle * y, point[2] + angle * z


@kernel
def _across(ux: float, uy: float, uz: float, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Return the cross product of u and v."""
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def winding_number(points: Floats, triangles: Ints, position: Floats) -> float:
    """Return how often a surface winds round a position (3,): 1 inside, 0 outside a closed shell.

    The sum of the triangles' solid angles over 4 pi, van Oosterom, Strackee 1983,
    doi:10.1109/TBME.1983.325207.
    """
    return _half_solid_angles(points, triangles, position) / (2.0 * np.pi)


@kernel
def _half_solid_angles(points: Floats, triangles: Ints, position: Floats) -> float:
    """Return half the sum of the signed solid angles under which triangles are seen from a position (3,)."""
    total = 0.0
    for triangle in range(len(triangles)):
        i, j, k = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
        ax, ay, az = points[i, 0] - position[0], points[i, 1] - position[1], points[i, 2] - position[2]
        bx, by, bz = points[j, 0] - position[0], points[j, 1] - position[1], points[j, 2] - position[2]
        cx, cy, cz = points[k, 0] - position[0], points[k, 1] - position[1], points[k, 2] - position[2]
        a = np.sqrt(ax * ax + ay * ay + az * az)
        b = np.sqrt(bx * bx + by * by + bz * bz)
        c = np.sqrt(cx * cx + cy * cy + cz * cz)
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        total += np.arctan2(
            volume,
            a * b * c
            + (ax * bx + ay * by + az * bz) * c
            + (bx * cx + by * cy + bz * cz) * a
            + (cx * ax + cy * ay + cz * az) * b,
        )
    return total
