"""Values and gradients of the constraints in vector notation, which the projections are tested against."""

import math

import numpy as np


def distance_and_gradient(p1, p2, rest):
    """Return C = |p1 - p2| - rest [mm] and its gradient by (p1, p2), (2, 3)."""
    difference = p1 - p2
    length = float(np.linalg.norm(difference))
    unit = difference / length
    return length - rest, np.array([unit, -unit])


def dihedral_angle(p1, p2, p3, p4):
    """Return the signed angles (...) between the normals of triangles that share the edge p1 p2, (..., 3).

    phi = atan2((n1 x n2) . e / |e|, n1 . n2) with e = p2 - p1, n1 = e x (p3 - p1), n2 = (p4 - p1) x e; and
    False where one of the triangles is degenerate.
    """
    e = p2 - p1
    n1 = np.cross(e, p3 - p1)
    n2 = np.cross(p4 - p1, e)
    length = np.linalg.norm(e, axis=-1)
    sizes = [length * np.linalg.norm(p3 - p1, axis=-1), length * np.linalg.norm(p4 - p1, axis=-1)]
    defined = length > 0
    for normal, size in zip((n1, n2), sizes, strict=True):
        defined = defined & (np.linalg.norm(normal, axis=-1) > 1e-9 * size)
    unit = e / np.where(length > 0, length, 1.0)[..., None]
    sine = np.einsum("...i,...i->...", np.cross(n1, n2), unit)
    cosine = np.einsum("...i,...i->...", n1, n2)
    angle = np.where(defined, np.arctan2(sine, cosine), 0.0)
    return np.where(angle == -np.pi, np.pi, angle), defined


def dihedral_and_gradient(p1, p2, p3, p4, rest):
    """Return C = phi - rest, wrapped to (-pi, pi], and its gradient by the four points, (4, 3) [1 / mm]."""
    angle, _ = dihedral_angle(p1, p2, p3, p4)
    difference = float(angle) - rest
    difference -= 2.0 * math.pi * math.ceil((difference - math.pi) / (2.0 * math.pi))
    e = p2 - p1
    length = np.linalg.norm(e)
    n1, n2 = np.cross(e, p3 - p1), np.cross(p4 - p1, e)
    m1, m2 = n1 / (n1 @ n1), n2 / (n2 @ n2)
    gradient = np.array(
        [
            ((p2 - p3) @ e * m1 + (p2 - p4) @ e * m2) / length,
            ((p3 - p1) @ e * m1 + (p4 - p1) @ e * m2) / length,
            -length * m1,
            -length * m2,
        ]
    )
    return difference, gradient
