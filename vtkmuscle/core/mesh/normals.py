"""Normals of triangles and points, by NumPy alone: drawing loads no compiled kernels for them."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Triangles turned from each other by more than this meet in a crease [degrees]: two faces of a body. Those
#: turned by less count less and less from the first on, so that a normal does not jump as a body bends.
CREASE = 45.0, 75.0

#: A place with a smaller share of a triangle's corner is on the edge or the corner across from it.
ON_EDGE = 1e-6


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
    corner, which, near = _triangles_around(triangles, faces)
    vectors = triangle_normals(points, triangles[near])
    own = unit_vectors(triangle_normals(points, triangles[faces]))
    turned = np.einsum("jc,jc->j", unit_vectors(vectors).take(which, axis=0), own.take(corner // 3, axis=0))
    together, apart = np.cos(np.radians(CREASE))
    counts = np.clip((turned - apart) / (together - apart), 0.0, 1.0)
    sums: Floats = np.column_stack(
        [np.bincount(corner, counts * x[which], 3 * len(faces)) for x in vectors.T]
    )
    at_corners = unit_vectors(sums).reshape(-1, 3, 3)
    between: Floats = (_shares(points[triangles[faces]], places, own)[:, :, None] * at_corners).sum(axis=1)
    return unit_vectors(between)


def faces_that_meet(points: Floats, triangles: Ints, faces: Ints, places: Floats) -> tuple[Ints, Ints]:
    """Return all triangles that places (k, 3) are on: the number of a place and a triangle, (j,) each.

    That is one, or those on both sides of an edge, or all round a corner; each is on the one of ``faces``
    (k,), which have an area.
    """
    own = unit_vectors(triangle_normals(points, triangles[faces]))
    on = _shares(points[triangles[faces]], places, own) > ON_EDGE
    inside = on.all(axis=1)
    outer = np.flatnonzero(~inside)
    corner, which, near = _triangles_around(triangles, faces[outer])
    spans = on[outer].ravel()[corner]
    pairs, counts = np.unique(corner[spans] // 3 * len(near) + which[spans], return_counts=True)
    place, face = np.divmod(pairs, max(len(near), 1))
    whole = counts == on[outer].sum(axis=1)[place]
    numbers = np.concatenate([np.flatnonzero(inside), outer[place[whole]]])
    return numbers, np.concatenate([faces[inside], near[face[whole]]])


def _triangles_around(triangles: Ints, faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Return each corner of some triangles, counted on, with each triangle around it, (j,) both.

    Those around are numbers of the last array returned, which has triangles.
    """
    corners = triangles[faces]
    member = np.zeros(int(triangles.max()) + 1, dtype=np.bool_)
    member[corners] = True
    a, b, c = member.take(triangles.T)
    near = np.flatnonzero(a | b | c)
    at = triangles[near].reshape(-1)
    order = np.argsort(at, kind="stable")
    first, last = (np.searchsorted(at[order], corners.reshape(-1), side) for side in ("left", "right"))
    counts = last - first
    corner = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(corner)) - np.repeat(np.cumsum(counts) - counts, counts)
    return corner, order[first[corner] + within] // 3, near


def _shares(corners: Floats, places: Floats, normals: Floats) -> Floats:
    """Return the barycentric coordinates (k, 3) of places (k, 3) on triangles (k, 3, 3)."""
    following, last = np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    across = np.cross(following - places[:, None], last - places[:, None])
    areas = np.maximum(np.einsum("kij,kj->ki", across, normals), 0.0)
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
