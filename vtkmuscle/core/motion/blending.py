"""Blends and screws of rigid motions, and nearest rotations."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import ROUNDING, SAME, Bools, Floats, Ints

#: Least norm of a blended quaternion, as a divisor.
EPSILON = float(np.finfo(np.float64).eps)


def blend_motions(transforms: Floats, weights: Floats, points: Floats) -> Floats:
    """Return points (n, 3) moved by blended rigid motions.

    Dual quaternion linear blending (Kavan, Collins, Žára, O'Sullivan 2008, *Geometric skinning with
    approximate dual quaternion blending*, doi:10.1145/1409625.1409627) of motions (b, 4, 4) by weights (n,
    b), with rows that sum to 1. Every point moves rigidly: in contrast to the mean of moved positions, points
    do not collapse towards the axis of far motions; for small motions both agree. The result is independent
    of the origin. Any two motions turn by less than 180 degrees against each other.
    """
    turns = Rotation.from_matrix(transforms[:, :3, :3].copy())  # SciPy < 1.17 wants to write
    motions = RigidTransform.from_components(transforms[:, :3, 3], turns).as_dual_quat()
    # q and -q are the same rotation: the sign nearer to the first blends the short way.
    motions[motions[:, :4] @ motions[0, :4] < 0.0] *= -1.0
    moved = np.empty_like(points)
    _blend(motions, weights, points, np.empty(8), moved)
    return moved


@kernel
def _blend(motions: Floats, weights: Floats, points: Floats, mean: Floats, moved: Floats) -> None:
    """Move points (n, 3) by mean dual quaternions (b, 8) of weights (n, b); mean : (8,), memory."""
    for i in range(len(points)):
        mean[:] = 0.0
        for k in range(len(motions)):
            for part in range(8):
                mean[part] += weights[i, k] * motions[k, part]
        x, y, z, w, a, b, c, e = mean[0], mean[1], mean[2], mean[3], mean[4], mean[5], mean[6], mean[7]
        square = max(x * x + y * y + z * z + w * w, EPSILON * EPSILON)
        p, q, r = points[i, 0], points[i, 1], points[i, 2]
        # v x p + w p + d, then v x that: the turn; the shift is w d - e v + v x d.
        u, v, t = y * r - z * q + w * p + a, z * p - x * r + w * q + b, x * q - y * p + w * r + c
        moved[i, 0] = p + 2.0 * (y * t - z * v + w * a - e * x) / square
        moved[i, 1] = q + 2.0 * (z * u - x * t + w * b - e * y) / square
        moved[i, 2] = r + 2.0 * (x * v - y * u + w * c - e * z) / square


def screws_between(start: Floats, end: Floats, fraction: float) -> Floats:
    """Return the transforms (b, 4, 4) at a fraction of screws.

    A turn about an axis and a slide along it, both scaled by the fraction in [0, 1]. A bone on a hinge stays
    on its hinge, and the result is independent of the origin. Turns are less than 180 degrees.
    """
    if fraction >= 1.0:
        return end
    exponents = fraction * RigidTransform.from_matrix(end @ np.linalg.inv(start)).as_exp_coords()
    return np.asarray(RigidTransform.from_exp_coords(exponents).as_matrix() @ start)


def screws(motions: Floats) -> Floats:
    """Return the twists (n, 6) of rigid motions (n, 4, 4).

    The logarithm of SE(3) (Murray, Li, Sastry 1994, *A Mathematical Introduction to Robotic Manipulation*,
    2.36). A twist is the velocity at the origin and the angular velocity [rad], over a unit of time; turns
    are less than 180 degrees.
    """
    turns, slides = np.split(RigidTransform.from_matrix(motions.copy()).as_exp_coords(), 2, axis=1)
    return np.hstack([slides, turns])


def nearest_rotations(matrices: Floats) -> Floats:
    """Return the rotation R of largest tr(R^T M) for each matrix M (n, 3, 3), the identity for zero."""
    rotations, converged = matrices.copy(), np.zeros(len(matrices), dtype=np.bool_)
    _by_newton(rotations, np.empty((3, 3)), converged)
    if not converged.all():  # mirrored or nearly singular (Kabsch 1976, doi:10.1107/S0567739476001873)
        u, _, v = np.linalg.svd(matrices[~converged])
        u[:, :, 2] *= np.sign(np.linalg.det(u @ v))[:, None]
        rotations[~converged] = u @ v
    return rotations


@kernel
def _by_newton(matrices: Floats, y: Floats, converged: Bools) -> None:
    """Replace matrices (n, 3, 3) by their orthogonal factors.

    X <- (g X + X^-T / g) / 2, with g from the norms of X and its inverse; Higham 1986, *Computing the polar
    decomposition - with applications*, doi:10.1137/0907079.  converged : (n,), written: False for mirroring
    and nearly singular matrices, which stay.
    """
    for k in range(len(matrices)):
        x = matrices[k]
        while not converged[k]:
            size2, other2 = 0.0, 0.0
            for i in range(3):
                for j in range(3):
                    a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
                    y[i, j] = x[a, c] * x[b, d] - x[a, d] * x[b, c]  # of X^-T, times the determinant
                    size2 += x[i, j] * x[i, j]
                    other2 += y[i, j] * y[i, j]
            determinant = x[0, 0] * y[0, 0] + x[0, 1] * y[0, 1] + x[0, 2] * y[0, 2]
            # Beside an equally large rotation's: below, the inverse has fewer than ten digits.
            if not determinant > SAME * (size2 / 3.0) * np.sqrt(size2 / 3.0):
                break
            scale = np.sqrt(np.sqrt(other2 / size2) / determinant)
            m, n, step2 = 0.5 * scale, 0.5 / (determinant * scale), 0.0
            for i in range(3):
                for j in range(3):
                    value = m * x[i, j] + n * y[i, j]
                    step2 += (value - x[i, j]) ** 2
                    x[i, j] = value
            converged[k] = step2 <= ROUNDING * ROUNDING  # quadratic convergence: the next step is smaller yet


def origin_weights(offsets: Ints, a: float) -> Floats:
    """Return the weights (n,) of the origin along fibres.

    a t^2 - (a + 1) t + 1, with t = (i - 1) / (n - 1); the insertion's bone has the rest to 1. For a = 0 the
    blend is linear; for a in [-1, 1] weights fall from 1 at the origin to 0 at the insertion. The offsets (k
    + 1,) are the first point of each fibre, and n.
    """
    counts = np.diff(offsets)
    number = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
    t = number / np.repeat(np.maximum(counts - 1, 1), counts)
    return np.asarray(a * t**2 - (a + 1.0) * t + 1.0)


def blend_fibres(points: Floats, offsets: Ints, origin: Floats, insertion: Floats, a: float) -> Floats:
    """Return fibres blended between the motions of two bones.

    v' = w T_origin v + (1 - w) T_insertion v for points v (n, 3) of fibres from origin to insertion at rest;
    motions (4, 4) from rest to now; w and a as in :func:`origin_weights`.
    """
    w = origin_weights(offsets, a)[:, None]
    return w * apply_transform(origin, points) + (1.0 - w) * apply_transform(insertion, points)
