"""Normals of triangles and points, without compiled kernels."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import SAME, Floats, Ints

#: Turns between triangles that meet in a crease [degrees]. From the first to the second angle the weight of a
#: neighbour falls to 0, so a normal does not jump as a body bends.
CREASE = 45.0, 75.0


def triangle_normals(points: Floats, triangles: Ints) -> Floats:
    """Return normals (b - a) x (c - a) of triangles (m, 3), as long as twice the area."""
    a, b, c = np.take(points, triangles, axis=0).swapaxes(0, 1)
    return np.cross(b - a, c - a)


def vertex_normals(points: Floats, triangles: Ints) -> Floats:
    """Return area-weighted unit normals of points, 0 without triangles."""
    at, normals = triangles.T.ravel(), triangle_normals(points, triangles)
    total = [np.bincount(at, np.tile(axis, 3), minlength=len(points)) for axis in normals.T]
    return unit_vectors(np.stack(total, axis=1))


def smooth_normals(points: Floats, triangles: Ints, faces: Ints, positions: Floats) -> Floats:
    """Return unit normals (k, 3), continuous except at creases.

    At a corner the normal is the area-weighted mean over the triangles there, without triangles turned by
    more than :data:`CREASE`; within a triangle the normal is linear between corners (Phong 1975,
    doi:10.1145/360825.360839). A triangle's normal jumps at edges, where rounding would decide. Positions (k,
    3) are on the triangles `faces` (k,), with an area.
    """
    corner, which, around = _triangles_around(triangles, faces)
    vectors = triangle_normals(points, triangles[around])
    own = unit_vectors(triangle_normals(points, triangles[faces]))
    turned = np.einsum("jc,jc->j", unit_vectors(vectors).take(which, axis=0), own.take(corner // 3, axis=0))
    together, apart = np.cos(np.radians(CREASE))
    counts = np.clip((turned - apart) / (together - apart), 0.0, 1.0)
    parts = [np.bincount(corner, counts * x[which], 3 * len(faces)) for x in vectors.T]
    at_corners = unit_vectors(np.column_stack(parts).astype(np.float64)).reshape(-1, 3, 3)
    between: Floats = (_shares(points[triangles[faces]], positions, own)[:, :, None] * at_corners).sum(axis=1)
    return unit_vectors(between)


def faces_that_meet(points: Floats, triangles: Ints, faces: Ints, positions: Floats) -> tuple[Ints, Ints]:
    """Return all triangles at positions on a surface.

    The index of a position and a triangle, (j,) each: a single triangle, both sides of an edge, or all around
    a corner. Positions (k, 3) are on the triangles ``faces`` (k,), with an area.
    """
    own = unit_vectors(triangle_normals(points, triangles[faces]))
    on = _shares(points[triangles[faces]], positions, own) > SAME
    inside = on.all(axis=1)
    outer = np.flatnonzero(~inside)
    corner, which, around = _triangles_around(triangles, faces[outer])
    spans = on[outer].ravel()[corner]
    pairs, counts = np.unique(corner[spans] // 3 * len(around) + which[spans], return_counts=True)
    position, face = np.divmod(pairs, max(len(around), 1))
    whole = counts == on[outer].sum(axis=1)[position]
    numbers = np.concatenate([np.flatnonzero(inside), outer[position[whole]]])
    return numbers, np.concatenate([faces[inside], around[face[whole]]])


def _triangles_around(triangles: Ints, faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Return corners and the triangles around each, (j,) both, as indices into the last array returned."""
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


def _shares(corners: Floats, positions: Floats, normals: Floats) -> Floats:
    """Return barycentric coordinates (k, 3). Positions (k, 3) on triangles (k, 3, 3)."""
    following, last = np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    across = np.cross(following - positions[:, None], last - positions[:, None])
    areas = np.maximum(np.einsum("kij,kj->ki", across, normals), 0.0)
    return np.asarray(areas / np.maximum(areas.sum(axis=1, keepdims=True), np.finfo(float).tiny))


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
