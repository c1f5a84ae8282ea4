"""The nearest point of a triangle, and the normals from which its side of a surface follows; boxes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.surface import numbered_edges
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


class Pseudonormals(NamedTuple):
    """Normals from which the side of a point follows, given its nearest point of a closed surface.

    A point is outside where its offset from the nearest point of the surface goes along the normal there,
    inside where it goes against it. At an edge that is the sum of the unit normals of its triangles; at a
    corner the sum of these times the triangles' angles at the corner: Baerentzen, Aanaes 2005,
    doi:10.1109/TVCG.2005.49.

    Attributes
    ----------
    normals : (k, 3) array
        Of triangles, edges and points, of any length.
    numbers : (m, 7) int array
        Row of ``normals`` for each triangle and region: FACE, EDGE + k and CORNER + k.
    """

    normals: Floats
    numbers: Ints

    def at(self, triangles: Ints, regions: Ints) -> Floats:
        """Return the normals (q, 3) where the nearest points are, in regions (q,) of triangles (q,)."""
        normals: Floats = self.normals[self.numbers[triangles, regions]]
        return normals


def pseudonormals(points: Floats, triangles: Ints) -> Pseudonormals:
    """Return the normals of a surface, points (n, 3) and triangles (m, 3) that face outward."""
    faces = unit_vectors(triangle_normals(points, triangles))
    corners = points[triangles]
    onward, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    # atan2 keeps small angles exact, and is 0 for triangles without area.
    sines = np.linalg.norm(np.cross(onward, back), axis=2)
    angles = np.arctan2(sines, (onward * back).sum(axis=2)).reshape(-1)
    edge_of = numbered_edges(triangles)[1]
    parts = [faces]
    for at, weights, count in (
        (edge_of, np.ones(len(angles)), int(edge_of.max(initial=-1)) + 1),
        (triangles.reshape(-1), angles, len(points)),
    ):
        sums = [np.bincount(at, weights * np.repeat(axis, 3), count) for axis in faces.T]
        parts.append(np.column_stack(sums))
    first, second = len(faces), len(faces) + len(parts[1])
    own = np.arange(len(faces))[:, None]
    return Pseudonormals(
        np.vstack(parts), np.hstack([own, first + edge_of.reshape(-1, 3), second + triangles])
    )
