"""Harmonic functions on a muscle's surface, with the fixed points as boundary values."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.linalg import splu

from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import half_edges, point_components
from vtkmuscle.core.types import Floats, Ints

#: Bounds of an edge's cotangent weight; an edge between equilateral triangles has 0.58. The lower one
#: keeps the matrix an M-matrix where triangles are obtuse, so that a harmonic function stays between its
#: boundary values; the upper one keeps it well conditioned where triangles are degenerate.
COTANGENT_BOUNDS = (1e-3, 1e3)


def cotangent_laplacian(points: Floats, triangles: Ints) -> csr_array:
    """Return the cotangent Laplacian of a surface, (n, n), with its weights kept positive.

    L_ij = -(cot a + cot b) / 2 for the angles a, b opposite the edge i j, clamped to
    :data:`COTANGENT_BOUNDS`; rows sum to zero. Symmetric and positive semidefinite. Pinkall, Polthier 1993,
    *Computing discrete minimal surfaces and their conjugates*, doi:10.1080/10586458.1993.10504266.
    """
    n = len(points)
    doubled_areas = np.linalg.norm(triangle_normals(points, triangles), axis=1)
    cotangents = np.empty((len(triangles), 3))
    for corner in range(3):  # the cotangent at a corner belongs to the edge opposite, here in half-edge order
        apex, one, other = (points[triangles[:, (corner + 2 + turn) % 3]] for turn in range(3))
        dots = np.einsum("ij,ij->i", one - apex, other - apex)
        # The second bound is far above COTANGENT_BOUNDS: it only keeps the quotient from overflowing.
        floor = np.maximum(1e-9 * np.abs(dots), np.finfo(float).tiny)
        cotangents[:, corner] = dots / np.maximum(doubled_areas, floor)
    bound = 2.0 * COTANGENT_BOUNDS[1]
    halves = np.clip(cotangents.reshape(-1), -bound, bound) / 2.0

    edges = half_edges(triangles)
    proper = edges[:, 0] != edges[:, 1]
    i, j = np.sort(edges[proper], axis=1).T
    weights = coo_array((halves[proper], (i, j)), shape=(n, n)).tocsr()
    weights.data = np.clip(weights.data, *COTANGENT_BOUNDS)
    weights = weights + weights.T
    degrees = np.asarray(weights.sum(axis=1)).reshape(-1)
    diagonal = np.arange(n)
    return csr_array(coo_array((degrees, (diagonal, diagonal)), shape=(n, n)).tocsr() - weights)


def harmonic_extension(points: Floats, triangles: Ints, known: Ints, values: Floats) -> Floats:
    """Return functions (n, c) that are harmonic on a surface, with values (k, c) at known points (k,).

    They lie between the least and the greatest value of each. A connected part of the mesh without a known
    point, where any constant is harmonic, takes the mean of the values.
    """
    n = len(points)
    result = np.empty((n, values.shape[1]))
    result[:] = values.mean(axis=0)
    result[known] = values
    components = point_components(n, half_edges(triangles))
    reached = np.isin(components, components[known])
    reached[known] = False
    free = np.flatnonzero(reached)
    if len(free):
        rows = cotangent_laplacian(points, triangles)[free]
        inner, border = rows[:, free], rows[:, known]
        # Symmetric and diagonally dominant: no pivoting, and an ordering for symmetric matrices.
        symmetric = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        factors = splu(inner.tocsc(), diag_pivot_thresh=0.0, **symmetric)
        result[free] = factors.solve(-(border @ values))
    low, high = values.min(axis=0), values.max(axis=0)
    return np.clip(result, low, high)


def harmonic_weights(points: Floats, triangles: Ints, fixed_to: Ints) -> tuple[Ints, Floats]:
    """Return the bones (b,) that points are fixed to, ascending, and their weight at each point (n, b).

    The weight of a bone is 1 at the points fixed to it, 0 at those fixed to others, harmonic between; rows
    sum to 1. ``fixed_to`` (n,) is the index of each point's bone, -1 for free points; at least one is fixed.
    """
    known = np.flatnonzero(fixed_to >= 0)
    bones, column = np.unique(fixed_to[known], return_inverse=True)
    weights = harmonic_extension(points, triangles, known, np.eye(len(bones))[column.reshape(-1)])
    return bones.astype(np.int64), weights / weights.sum(axis=1, keepdims=True)


def harmonic_field(points: Floats, triangles: Ints, fixed_to: Ints) -> Floats | None:
    """Return a function (n,) that runs from 0 to 1 between the two ends of a muscle.

    The ends are the two bones whose fixed points' centres lie farthest apart; points fixed to any other bone
    count to the nearer of them. None where fewer than two bones have fixed points.
    """
    known = np.flatnonzero(fixed_to >= 0)
    bones, column = np.unique(fixed_to[known], return_inverse=True)
    if len(bones) < 2:
        return None
    centres = np.array([points[known[column == b]].mean(axis=0) for b in range(len(bones))])
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    start, end = divmod(int(apart.argmax()), len(bones))
    if apart[start, end] == 0.0:  # all centres in one place: still two different bones
        start, end = 0, 1
    value = (apart[end] < apart[start]).astype(np.float64)
    value[start], value[end] = 0.0, 1.0
    return harmonic_extension(points, triangles, known, value[column][:, None])[:, 0]


def triangle_gradients(points: Floats, triangles: Ints, field: Floats) -> Floats:
    """Return the gradient (m, 3) of a function (n,) that is linear on each triangle.

    grad f = sum_i f_i N x e_i / (2 A), e_i the edge opposite point i, N the unit normal; 0 on degenerate
    triangles.
    """
    a, b, c = (points[triangles[:, i]] for i in range(3))
    fa, fb, fc = (field[triangles[:, i]][:, None] for i in range(3))
    normals = np.cross(b - a, c - a)
    squares = np.einsum("ij,ij->i", normals, normals)[:, None]
    # With fb - fa and fc - fa a constant function has a gradient of exactly zero.
    numerators = np.cross(normals, (fb - fa) * (a - c) + (fc - fa) * (b - a))
    gradients: Floats = np.divide(numerators, squares, out=np.zeros_like(normals), where=squares > 0)
    return gradients
