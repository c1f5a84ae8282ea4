"""Normals of surfaces that do not jump, and angles to surfaces."""

import math

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.types import SAME, TINY, Floats, Ints

#: Cosines of turns between triangles that meet in a crease, 45 and 75 degrees. From the first to the second
#: the weight of a neighbour falls to 0, so a normal does not jump as a body bends. With 22 or 90 degrees mean
#: pennations of four muscles of a hip and a knee change by at most 0.3 and 0.7 degrees.
_TOGETHER, _APART = math.cos(math.radians(45.0)), math.cos(math.radians(75.0))


@array_kernel
def smooth_normals(points: Floats, triangles: Ints, faces: Ints, positions: Floats) -> Floats:
    """Return unit normals (k, 3), continuous except at creases.

    At a corner the normal is the area-weighted mean over the triangles there, without triangles turned by
    more than a crease; within a triangle the normal is linear between corners (Phong 1975,
    doi:10.1145/360825.360839). Positions (k, 3) are on the triangles ``faces`` (k,), with an area.
    """
    fans, normals = _fans(points, triangles), np.empty((len(faces), 3))
    for i in range(len(faces)):
        normals[i] = _smooth_normal(points, triangles, fans, faces[i], positions[i])
    return normals


@array_kernel
def surface_angles(points: Floats, triangles: Ints, faces: Ints, feet: Floats, directions: Floats) -> Floats:
    """Return the angles (k,) of directions to a surface [degrees].

    Unit directions (k, 3) begin at feet (k, 3) on faces (k,) with an area. On an edge or a corner the angle
    is the mean over the triangles there, weighted by area: rounding does not decide.
    """
    fans, angles = _fans(points, triangles), np.empty(len(faces))
    for i in range(len(faces)):
        own, at, total, area = triangles[faces[i]], feet[i], 0.0, 0.0
        least = SAME * _normal(points[own[0]], points[own[1]], points[own[2]])[3]
        on = [point for c, point in enumerate(own) if _share(points, own, c, at) > least]
        corner = fans[0][on[0]]
        while corner >= 0:
            face, corner = corner // 3, fans[1][corner]
            a, b, c = triangles[face]
            size = _normal(points[a], points[b], points[c])[3]
            if [point in (a, b, c) for point in on].count(True) == len(on):
                u, v, w = _smooth_normal(points, triangles, fans, face, at)
                sine = abs(u * directions[i, 0] + v * directions[i, 1] + w * directions[i, 2])
                total, area = total + size * math.degrees(math.asin(min(sine, 1.0))), area + size
        angles[i] = total / area
    return angles


@array_kernel
def _fans(points: Floats, triangles: Ints) -> tuple[Ints, Ints]:
    """Return first corners of points, and next corners there. -1 for none."""
    corners, following = triangles.reshape(-1), np.empty(triangles.size, np.int64)
    first = np.full(len(points), -1)
    for corner in range(len(corners) - 1, -1, -1):
        following[corner], first[corners[corner]] = first[corners[corner]], corner
    return first, following


@kernel
def _normal(a: Floats, b: Floats, c: Floats) -> tuple[float, float, float, float]:
    """Return a triangle's unit normal and twice its area; 0 without an area."""
    u0, u1, u2, v0, v1, v2 = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    size = math.sqrt(x * x + y * y + z * z)
    part = 1.0 / max(size, TINY)
    return part * x, part * y, part * z, size


@kernel
def _share(points: Floats, triangle: Ints, c: int, at: Floats) -> float:
    """Return a barycentric coordinate of a position (3,), times twice the area."""
    x, y, z, _ = _normal(points[triangle[0]], points[triangle[1]], points[triangle[2]])
    u, v, w, size = _normal(at, points[triangle[(c + 1) % 3]], points[triangle[(c + 2) % 3]])
    return max(size * (x * u + y * v + z * w), 0.0)


@kernel
def _smooth_normal(
    points: Floats, triangles: Ints, fans: tuple[Ints, Ints], face: int, at: Floats
) -> tuple[float, float, float]:
    triangle, x, y, z = triangles[face], 0.0, 0.0, 0.0
    p, q, r, _ = _normal(points[triangle[0]], points[triangle[1]], points[triangle[2]])
    for c in range(3):
        u, v, w, corner = 0.0, 0.0, 0.0, fans[0][triangle[c]]
        while corner >= 0:
            other, corner = triangles[corner // 3], fans[1][corner]
            d, e, f, size = _normal(points[other[0]], points[other[1]], points[other[2]])
            part = size * min(max((d * p + e * q + f * r - _APART) / (_TOGETHER - _APART), 0.0), 1.0)
            u, v, w = u + part * d, v + part * e, w + part * f
        part = _share(points, triangle, c, at) / math.sqrt(max(u * u + v * v + w * w, TINY))
        x, y, z = x + part * u, y + part * v, z + part * w
    part = 1.0 / math.sqrt(max(x * x + y * y + z * z, TINY))
    return part * x, part * y, part * z
