"""Between rigid motions: blending several by weights, and a part of one along its screw."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

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
    real = Rotation.from_matrix(transforms[:, :3, :3].copy()).as_quat()
    # q and -q are the same rotation: take the one that is nearer to the first, to blend the short way.
    real[real @ real[0] < 0.0] *= -1.0
    shift = transforms[:, :3, 3]
    dual = np.empty_like(real)
    dual[:, :3] = 0.5 * (real[:, 3:] * shift + np.cross(shift, real[:, :3]))
    dual[:, 3] = -0.5 * np.einsum("ij,ij->i", shift, real[:, :3])

    real, dual = weights @ real, weights @ dual
    norms = np.maximum(np.linalg.norm(real, axis=1, keepdims=True), EPSILON)
    v, w = np.split(real / norms, [3], axis=1)
    d, e = np.split(dual / norms, [3], axis=1)
    # v x p + w p, then v x that: the turn; w d - e v + v x d: the shift.
    across = np.cross(v, points) + w * points
    moved: Floats = points + 2.0 * (np.cross(v, across + d) + w * d - e * v)
    return moved


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
