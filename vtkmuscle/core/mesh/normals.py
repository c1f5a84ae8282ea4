"""Normals of triangles and points, by NumPy alone: drawing loads no compiled kernels for them."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Triangles turned from each other by more than this meet in a crease [degrees]: two faces of a body.
CREASE = 60.0


def triangle_normals(points: Floats, triangles: Ints) -> Floats:
    """Return (b - a) x (c - a) for each triangle, (m, 3): twice the area long, not normalised."""
    a, b, c = np.take(points, triangles, axis=0).swapaxes(0, 1)
    return np.cross(b - a, c - a)


def vertex_normals(points: Floats, triangles: Ints) -> Floats:
    """Return the unit normal of each point, area-weighted over its triangles; 0 for a point without any."""
    return mean_normals(triangle_normals(points, triangles), triangles, len(points))


def mean_normals(normals: Floats, triangles: Ints, n: int) -> Floats:
    """Return :func:`vertex_normals` of n points from :func:`triangle_normals` (m, 3)."""
    at = triangles.T.ravel()
    total = [np.bincount(at, np.tile(axis, 3), minlength=n) for axis in normals.T]
    return unit_vectors(np.stack(total, axis=1))


def smooth_normals(points: Floats, triangles: Ints, faces: Ints, places: Floats) -> Floats:
    """Return the unit normals (k, 3) of a surface at places (k, 3) on it, continuous but for its creases.

    At a corner of a triangle the normal is the mean, by area, of those of the triangles there, without those
    that are turned from it by more than :data:`CREASE`; within it is linear between the corners (Phong 1975,
    doi:10.1145/360825.360839). A triangle's own normal jumps from one to the next, so that rounding would
    decide at a place on an edge. The faces (k,) are the triangle that each place is on; they have an area.
    """
    corners = triangles[faces]
    member = np.zeros(len(points), dtype=np.bool_)
    member[corners] = True
    a, b, c = member.take(triangles.T)
    around = triangles[a | b | c]
    vectors = triangle_normals(points, around)
    owner = np.argsort(around.reshape(-1), kind="stable")
    ids = around.reshape(-1)[owner]
    first = np.searchsorted(ids, corners.reshape(-1))
    counts = np.searchsorted(ids, corners.reshape(-1), "right") - first
    corner = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(corner)) - np.repeat(np.cumsum(counts) - counts, counts)
    beside = vectors[owner[first[corner] + within] // 3]
    own = unit_vectors(triangle_normals(points, corners))
    cosines = (beside * own[corner // 3]).sum(axis=1)
    beside[cosines < np.cos(np.radians(CREASE)) * np.linalg.norm(beside, axis=1)] = 0.0
    sums: Floats = np.column_stack([np.bincount(corner, x, len(counts)) for x in beside.T])
    at_corners = unit_vectors(sums).reshape(-1, 3, 3)
    between: Floats = (_shares(points[corners], places, own)[:, :, None] * at_corners).sum(axis=1)
    return unit_vectors(between)


def _shares(corners: Floats, places: Floats, normals: Floats) -> Floats:
    """Return the barycentric coordinates (k, 3) of places (k, 3) on triangles (k, 3, 3)."""
    following, last = np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    across = np.cross(following - places[:, None], last - places[:, None])
    areas = np.maximum((across * normals[:, None]).sum(axis=2), 0.0)
    result: Floats = areas / np.maximum(areas.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    return result


def unit_vectors(vectors: Floats) -> Floats:
    """Return vectors (..., 3) of length 1, 0 where a vector is 0."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Floats = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
    return unit


def perpendiculars(axis: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors (3,) that make a right-handed frame with a third as its last."""
    first = np.cross(np.eye(3)[int(np.abs(axis).argmin())], axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)
