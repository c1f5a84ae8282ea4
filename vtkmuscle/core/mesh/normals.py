"""Normals of triangles and points, by NumPy alone: what only draws loads no compiled kernels for them."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints


def triangle_normals(points: Floats, triangles: Ints) -> Floats:
    """Return (b - a) x (c - a) for each triangle, (m, 3): twice the area long, not normalised."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals: Floats = np.cross(b - a, c - a)
    return normals


def vertex_normals(points: Floats, triangles: Ints) -> Floats:
    """Return the unit normal of each point, area-weighted over its triangles; 0 where there is none."""
    at = triangles.T.ravel()
    normals = triangle_normals(points, triangles)
    total = [np.bincount(at, np.tile(axis, 3), minlength=len(points)) for axis in normals.T]
    return unit_vectors(np.stack(total, axis=1))


def unit_vectors(vectors: Floats) -> Floats:
    """Return vectors (..., 3) of length 1, 0 where a vector is 0."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Floats = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
    return unit
