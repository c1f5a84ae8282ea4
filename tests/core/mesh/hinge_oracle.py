"""Dihedral angles in vector notation, which those of the kernels are tested against."""

import numpy as np


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
