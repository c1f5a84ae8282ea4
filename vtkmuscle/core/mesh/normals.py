"""Normals of triangles and points, without compiled kernels."""

import numpy as np

from vtkmuscle.core.types import Floats, Ints


def triangle_normals(points: Floats, triangles: Ints) -> Floats:
    """Return normals (b - a) x (c - a) of triangles (m, 3), as long as twice the area."""
    a, b, c = np.take(points, triangles, axis=0).swapaxes(0, 1)
    return np.cross(b - a, c - a)


def vertex_normals(points: Floats, triangles: Ints) -> Floats:
    """Return area-weighted unit normals of points, 0 without triangles."""
    at, normals = triangles.T.ravel(), triangle_normals(points, triangles)
    total = [np.bincount(at, np.tile(axis, 3), minlength=len(points)) for axis in normals.T]
    return unit_vectors(np.stack(total, axis=1))


def unit_vectors(vectors: Floats) -> Floats:
    """Return vectors (..., 3) of length 1. 0 for a zero vector."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0))


def angles_between(first: Floats, second: Floats) -> Floats:
    """Return angles (...) between vectors (..., 3) [degrees]. 0 for a zero vector."""
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.asarray(np.degrees(np.arctan2(across, (first * second).sum(axis=-1))))


def perpendiculars(axis: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors (3,) that complete a right-handed frame with the axis as its third."""
    first = np.cross(np.eye(3)[int(np.abs(axis).argmin())], axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)
