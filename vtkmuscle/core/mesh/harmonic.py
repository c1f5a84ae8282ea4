"""Harmonic functions on a muscle's surface, fixed at attached points."""

import numpy as np
import robust_laplacian
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import half_edges, point_components
from vtkmuscle.core.types import Floats, Ints


def intrinsic_laplacian(points: Floats, triangles: Ints) -> csr_array:
    """Return the Laplacian (n, n) of a surface.

    The Laplacian is the same for any triangles of one shape: it has the cotangent weights of the intrinsic
    Delaunay triangulation. No weight is negative, needles or not, so that a harmonic function stays between
    its boundary values. Rows sum to zero. Symmetric and positive semidefinite. Sharp, Crane 2020, *A
    Laplacian for nonmanifold triangle meshes*, doi:10.1111/cgf.14069.
    """
    proper = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return csr_array(robust_laplacian.mesh_laplacian(points, triangles[proper])[0])


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
        rows = intrinsic_laplacian(points, triangles)[free]
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
