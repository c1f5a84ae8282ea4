"""The nearest point of a triangle, and the normals from which its side of a surface follows; boxes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.surface import sorted_into_bins
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


@kernel
def distance2_to_box(box: Floats, x: float, y: float, z: float) -> float:
    """Return the squared distance of a point from a box, its low and high corner (6,); 0 inside."""
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    distance2: float = dx * dx + dy * dy + dz * dz
    return distance2


class Sides(NamedTuple):
    """A surface and which triangles are at each of its points, from which the sides of it follow.

    Attributes
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions; point ids, outward oriented.
    starts, around : (n + 1,) int array, (3 m,) int array
        The triangles at point i are ``around[starts[i] : starts[i + 1]]``, ascending.
    """

    points: Floats
    triangles: Ints
    starts: Ints
    around: Ints


def sides_of(points: Floats, triangles: Ints) -> Sides:
    """Return what :func:`pseudonormal_at` asks of a surface, points (n, 3) and triangles (m, 3)."""
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    corners, starts = sorted_into_bins(triangles.reshape(-1), len(points))
    return Sides(np.ascontiguousarray(points, dtype=np.float64), triangles, starts, corners // 3)


@kernel
def pseudonormal_at(sides: Sides, triangle: int, region: int) -> tuple[float, float, float]:
    """Return the normal from which the side of a point follows, given its nearest point of the surface.

    A point is outside a closed surface where its offset from the nearest point of the surface goes along
    the normal there, inside where it goes against it. At an edge that is the sum of the normals of its
    triangles; at a corner the sum of the triangles' unit normals times their angles at the corner:
    Baerentzen, Aanaes 2005, doi:10.1109/TVCG.2005.49.

    Parameters
    ----------
    sides : Sides
        The surface.
    triangle, region : int
        The nearest triangle, and where on it the nearest point is: FACE, EDGE + k or CORNER + k.

    Returns
    -------
    tuple of float
        The normal, of any length.
    """
    points, triangles = sides.points, sides.triangles
    if region == FACE:
        return _unit_normal(points, triangles, triangle)
    corner = region - CORNER if region >= CORNER else region - EDGE
    point = triangles[triangle, corner]
    far = -1 if region >= CORNER else triangles[triangle, (corner + 1) % 3]
    x, y, z = 0.0, 0.0, 0.0
    for place in range(sides.starts[point], sides.starts[point + 1]):
        t = sides.around[place]
        if far >= 0 and triangles[t, 0] != far and triangles[t, 1] != far and triangles[t, 2] != far:
            continue
        weight = 1.0 if far >= 0 else _angle(points, triangles, t, point)
        nx, ny, nz = _unit_normal(points, triangles, t)
        x, y, z = x + weight * nx, y + weight * ny, z + weight * nz
    return x, y, z


@kernel
def _unit_normal(points: Floats, triangles: Ints, t: int) -> tuple[float, float, float]:
    """Return the unit normal of a triangle, 0 for one without area."""
    a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
    x, y, z = _across(b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - b[0], c[1] - b[1], c[2] - b[2])
    length = np.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        return x / length, y / length, z / length
    return 0.0, 0.0, 0.0


@kernel
def _angle(points: Floats, triangles: Ints, t: int, point: int) -> float:
    """Return the angle of a triangle at one of its points."""
    k = 0 if triangles[t, 0] == point else 1 if triangles[t, 1] == point else 2
    at, onward, back = points[point], points[triangles[t, (k + 1) % 3]], points[triangles[t, (k + 2) % 3]]
    ux, uy, uz = onward[0] - at[0], onward[1] - at[1], onward[2] - at[2]
    vx, vy, vz = back[0] - at[0], back[1] - at[1], back[2] - at[2]
    nx, ny, nz = _across(ux, uy, uz, vx, vy, vz)
    # atan2 keeps small angles exact, and is 0 for triangles without area.
    angle: float = np.arctan2(np.sqrt(nx * nx + ny * ny + nz * nz), ux * vx + uy * vy + uz * vz)
    return angle


@kernel
def _across(ux: float, uy: float, uz: float, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Return the cross product of u and v."""
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
