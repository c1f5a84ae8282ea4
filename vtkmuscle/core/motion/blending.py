"""Between rigid motions: blending several by weights, and a part of one along its screw."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.motion.nearest_rotation import nearest_rotation
from vtkmuscle.core.motion.rigid import inverse
from vtkmuscle.core.types import Floats

#: Least norm that a blended quaternion is divided by.
EPSILON = float(np.finfo(np.float64).eps)

#: Below this angle [rad] the series of a screw's slide is exact to rounding: its next term is angle^2 / 720.
_SMALL = 1e-4


def blend_motions(transforms: Floats, weights: Floats, points: Floats) -> Floats:
    """Return points moved by rigid motions that are blended by weights, point by point.

    Dual quaternion linear blending (Kavan, Collins, Žára, O'Sullivan 2008, *Geometric skinning with
    approximate dual quaternion blending*, doi:10.1145/1409625.1409627). Every point moves rigidly: unlike
    the mean of the moved positions it does not collapse towards the axis when the motions are far apart,
    and for small motions the two are the same. The result does not depend on the choice of origin.

    Parameters
    ----------
    transforms : (b, 4, 4) array
        Rigid motions; any two turn by less than 180 degrees against each other.
    weights : (n, b) array
        Rows that sum to 1.
    points : (n, 3) array
        Positions [mm].

    Returns
    -------
    (n, 3) array
        Moved positions [mm].
    """
    real = np.array([_quaternion(transform) for transform in transforms])
    # q and -q are the same rotation: take the one that is nearer to the first, to blend the short way.
    real[real @ real[0] < 0.0] *= -1.0
    shift = transforms[:, :3, 3]
    dual = np.empty_like(real)
    dual[:, :3] = 0.5 * (real[:, 3:] * shift + np.cross(shift, real[:, :3]))
    dual[:, 3] = -0.5 * np.einsum("ij,ij->i", shift, real[:, :3])

    moved = np.empty_like(points)
    _move(np.ascontiguousarray(weights), real, dual, np.ascontiguousarray(points), moved)
    return moved


@array_kernel
def _quaternion(transform: Floats) -> Floats:
    """Return the quaternion (x, y, z, w) of the rotation nearest to a transform's, by its greatest component.

    Shepperd 1978, *Quaternion from rotation matrix*, doi:10.2514/3.55767b.
    """
    r = transform[:3, :3].copy()
    nearest_rotation(r, np.empty((8, 4)))  # motions from tables are rigid to a few digits only
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    q = np.array([r[0, 0], r[1, 1], r[2, 2], trace])
    i = q.argmax()
    if i == 3:
        q[0], q[1], q[2], q[3] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1.0 + trace
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 - trace + 2.0 * r[i, i]
        q[j], q[k], q[3] = r[j, i] + r[i, j], r[k, i] + r[i, k], r[k, j] - r[j, k]
    unit: Floats = q / np.sqrt((q * q).sum())
    return unit


@kernel
def _move(weights: Floats, real: Floats, dual: Floats, points: Floats, moved: Floats) -> None:
    """Move points (n, 3) by dual quaternions (x, y, z, w), (b, 4) each, blended by weights (n, b)."""
    for i in range(len(points)):
        x, y, z, w, dx, dy, dz, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for b in range(len(real)):
            part = weights[i, b]
            x, y, z, w = (
                x + part * real[b, 0],
                y + part * real[b, 1],
                z + part * real[b, 2],
                w + part * real[b, 3],
            )
            dx, dy, dz, dw = (
                dx + part * dual[b, 0],
                dy + part * dual[b, 1],
                dz + part * dual[b, 2],
                dw + part * dual[b, 3],
            )
        norm = max(math.sqrt(x * x + y * y + z * z + w * w), EPSILON)
        x, y, z, w = x / norm, y / norm, z / norm, w / norm
        dx, dy, dz, dw = dx / norm, dy / norm, dz / norm, dw / norm
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        # v x p + w p, then v x that: the turn; w d - d_w v + v x d: the shift.
        cx, cy, cz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
        moved[i, 0] = px + 2.0 * (y * cz - z * cy + w * dx - dw * x + y * dz - z * dy)
        moved[i, 1] = py + 2.0 * (z * cx - x * cz + w * dy - dw * y + z * dx - x * dz)
        moved[i, 2] = pz + 2.0 * (x * cy - y * cx + w * dz - dw * z + x * dy - y * dx)


def screw_between(start: Floats, end: Floats, fraction: float) -> Floats:
    """Return the rigid transform part of the way from one to another, along their screw motion.

    start to end is one turn about an axis and a slide along it; the fraction scales both. A bone on a hinge
    stays on its hinge, and the result does not depend on the choice of origin.

    Parameters
    ----------
    start, end : (4, 4) arrays
        Rigid transforms that turn by less than 180 degrees against each other.
    fraction : float
        In [0, 1].

    Returns
    -------
    (4, 4) array
        ``start`` at 0, ``end`` at 1.
    """
    if fraction >= 1.0:
        return end
    slide, turn = np.split(screws((end @ inverse(start))[None])[0], 2)
    part = np.eye(4)
    part[:3, :3] = Rotation.from_rotvec(fraction * turn).as_matrix()
    part[:3, 3] = fraction * _left_jacobian(fraction * turn) @ slide
    result: Floats = part @ start
    return result


def screws(motions: Floats) -> Floats:
    """Return the twists that, kept up for a unit of time, are rigid motions.

    The logarithm of SE(3) (Murray, Li, Sastry 1994, *A Mathematical Introduction to Robotic Manipulation*,
    2.36): a turn about an axis and a slide along it.

    Parameters
    ----------
    motions : (n, 4, 4) array
        Rigid transforms that turn by less than 180 degrees.

    Returns
    -------
    (n, 6) array
        Velocity of what is at the origin [unit of the translations], and angular velocity [rad].

    Examples
    --------
    >>> from vtkmuscle.core.motion.rigid import rotation_about
    >>> from vtkmuscle.core.motion.blending import screws
    >>> screws(rotation_about((0, 10, 0), (1, 0, 0), 90.0)[None]).round(3)
    array([[  0.   ,   0.   , -15.708,   1.571,   0.   ,   0.   ]])
    """
    turns = Rotation.from_matrix(motions[:, :3, :3].copy()).as_rotvec()
    shifts = motions[:, :3, 3]
    angles = np.linalg.norm(turns, axis=1)
    safe = np.maximum(angles, _SMALL)
    # (1 - angle / 2 cot(angle / 2)) / angle^2, of the inverse of the left Jacobian of SO(3).
    second = np.where(angles > _SMALL, (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2, 1.0 / 12.0)
    across = np.cross(turns, shifts)
    slides = shifts - 0.5 * across + second[:, None] * np.cross(turns, across)
    return np.hstack([slides, turns])


def _left_jacobian(turn: Floats) -> Floats:
    """Return V of SE(3): exp(turn, slide) has the translation V slide (Murray, Li, Sastry 1994, 2.36)."""
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sinc(t / pi) is sin(t) / t, without a hole at 0.
    first = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    second = (1.0 - np.sinc(angle / np.pi)) / angle**2 if angle > 1e-4 else 1.0 / 6.0
    jacobian: Floats = np.eye(3) + first * skew + second * skew @ skew
    return jacobian
