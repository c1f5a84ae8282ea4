"""Harmonic functions on a muscle's surface, fixed at attached points."""

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import half_edges, point_components
from vtkmuscle.core.types import ROUNDING, Floats, Ints

#: Bounds of an edge's cotangent weight; between equilateral triangles the weight is 0.58. The lower bound
#: keeps an M-matrix with obtuse triangles, so a harmonic function stays between its boundary values; the
#: upper bound keeps the matrix well conditioned with degenerate triangles. With bounds ten times as wide or
#: as narrow lengths of fibres change by at most 0.0002 mm.
COTANGENT_BOUNDS = (1e-3, 1e3)


def cotangent_laplacian(points: Floats, triangles: Ints) -> csr_array:
    """Return the cotangent Laplacian (n, n), with positive weights.

    L_ij = -(cot a + cot b) / 2 for the angles a, b opposite the edge i j, clamped to
    :data:`COTANGENT_BOUNDS`; rows sum to zero. Symmetric and positive semidefinite. Pinkall, Polthier 1993,
    *Computing discrete minimal surfaces and their conjugates*, doi:10.1080/10586458.1993.10504266.
    """
    n = len(points)
    doubled_areas = np.linalg.norm(triangle_normals(points, triangles), axis=1)
    cotangents = np.empty((len(triangles), 3))
    for corner in range(3):  # the cotangent at a corner belongs to the opposite edge, here in half-edge order
        apex, first, second = (points[triangles[:, (corner + 2 + turn) % 3]] for turn in range(3))
        dots = np.einsum("ij,ij->i", first - apex, second - apex)
        # The floor keeps the quotient from overflowing, far above COTANGENT_BOUNDS.
        floor = np.maximum(ROUNDING * np.abs(dots), np.finfo(float).tiny)
        cotangents[:, corner] = dots / np.maximum(doubled_areas, floor)
    bound = 2.0 * COTANGENT_BOUNDS[1]
    halves = np.clip(cotangents.reshape(-1), -bound, bound) / 2.0

    edges = half_edges(triangles)
    proper = edges[:, 0] != edges[:, 1]
    i, j = np.sort(edges[proper], axis=1).T
    weights = coo_array((halves[proper], (i, j)), shape=(n, n)).tocsr()
    weights.data = np.clip(weights.data, *COTANGENT_BOUNDS)
    weights = weights + weights.T
    return csr_array(diags_array(np.asarray(weights.sum(axis=1)).reshape(-1)).tocsr() - weights)


def harmonic_extension(points: Floats, triangles: Ints, fixed: Ints, values: Floats) -> Floats:
    """Return harmonic functions (n, c) on a surface. Values (k, c) at fixed points (k,).

    Each lies between its least and greatest value. A connected part without a fixed point takes the mean.
    """
    n = len(points)
    result: Floats = np.tile(values.mean(axis=0), (n, 1))
    result[fixed] = values
    components = point_components(n, half_edges(triangles))
    reached = np.isin(components, components[fixed])
    reached[fixed] = False
    free = np.flatnonzero(reached)
    if len(free):
        rows = cotangent_laplacian(points, triangles)[free]
        inner, border = rows[:, free], rows[:, fixed]
        # Diagonally dominant: no pivoting. SuperLU's own order, COLAMD, takes 1.4 times as long as minimum
        # degree (medians on four muscles of a hip; 1.8 times the fill, 4 to 16 ms). With each triangle cut
        # in 16 it takes half as long; on some surfaces minimum degree takes minutes.
        result[free] = splu(inner.tocsc(), diag_pivot_thresh=0.0).solve(-(border @ values))
    return np.clip(result, values.min(axis=0), values.max(axis=0))


def harmonic_weights(points: Floats, triangles: Ints, fixed_to: Ints) -> tuple[Ints, Floats, Floats]:
    """Return bones (b,), weights (n, b), and places among fixed points (n, 4 b).

    The weight of a bone is 1 at its fixed points, 0 at points fixed to further bones, harmonic between; rows
    sum to 1. Bones ascend. ``fixed_to`` (n,) is the index of each point's bone, -1 for free points; at least
    one point is fixed. A place has the homogeneous coordinates of the bone's fixed points instead of 1:
    places that move with their bones sum to the fixed points, spread harmonically.
    """
    fixed = np.flatnonzero(fixed_to >= 0)
    bones, column = np.unique(fixed_to[fixed], return_inverse=True)
    values = np.zeros((len(fixed), len(bones), 4))
    values[np.arange(len(fixed)), column.reshape(-1)] = np.insert(points[fixed], 3, 1.0, axis=1)
    places = harmonic_extension(points, triangles, fixed, values.reshape(len(fixed), -1))
    places /= places[:, 3::4].sum(axis=1, keepdims=True)
    return bones.astype(np.int64), np.ascontiguousarray(places[:, 3::4]), places


def harmonic_field(points: Floats, triangles: Ints, fixed_to: Ints) -> Floats | None:
    """Return a function (n,) between the muscle's ends, 0 to 1.

    The ends are the bones whose fixed points' centres lie farthest apart; points fixed to a further bone
    count to the nearer end. None for fewer than two bones with fixed points.
    """
    fixed = np.flatnonzero(fixed_to >= 0)
    bones, column = np.unique(fixed_to[fixed], return_inverse=True)
    if len(bones) < 2:
        return None
    centres = np.array([points[fixed[column == b]].mean(axis=0) for b in range(len(bones))])
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    start, end = divmod(int(apart.argmax()), len(bones))
    if apart[start, end] == 0.0:  # coincident centres: still two different bones
        start, end = 0, 1
    value = (apart[end] < apart[start]).astype(np.float64)
    value[start], value[end] = 0.0, 1.0
    return harmonic_extension(points, triangles, fixed, value[column][:, None])[:, 0]


def triangle_gradients(points: Floats, triangles: Ints, field: Floats) -> Floats:
    """Return gradients (m, 3) of a function (n,). It is linear on each triangle.

    grad f = sum_i f_i N x e_i / (2 A), with the edge e_i opposite point i and the unit normal N; 0 on
    degenerate triangles.
    """
    a, b, c = (points[triangles[:, i]] for i in range(3))
    fa, fb, fc = (field[triangles[:, i]][:, None] for i in range(3))
    normals = triangle_normals(points, triangles)
    squares = np.einsum("ij,ij->i", normals, normals)[:, None]
    # With fb - fa and fc - fa a constant function has a gradient of exactly zero.
    numerators = np.cross(normals, (fb - fa) * (a - c) + (fc - fa) * (b - a))
    return np.asarray(np.divide(numerators, squares, out=np.zeros_like(normals), where=squares > 0))
