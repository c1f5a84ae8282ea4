"""Between rigid motions: blending several by weights, and a part of one along its screw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vtkmuscle.core.rigid import inverse

Floats = NDArray[np.float64]


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
    real = Rotation.from_matrix(transforms[:, :3, :3]).as_quat()  # (x, y, z, w)
    # q and -q are the same rotation: take the one that is nearer to the first, to blend the short way.
    real[real @ real[0] < 0.0] *= -1.0
    shift = transforms[:, :3, 3]
    dual = np.empty_like(real)
    dual[:, :3] = 0.5 * (real[:, 3:] * shift + np.cross(shift, real[:, :3]))
    dual[:, 3] = -0.5 * np.einsum("ij,ij->i", shift, real[:, :3])

    q, d = weights @ real, weights @ dual
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    norm = np.maximum(norm, np.finfo(float).eps)
    q, d = q / norm, d / norm
    v, w = q[:, :3], q[:, 3:]
    turned = points + 2.0 * np.cross(v, np.cross(v, points) + w * points)
    moved: Floats = turned + 2.0 * (w * d[:, :3] - d[:, 3:] * v + np.cross(v, d[:, :3]))
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
    motion = end @ inverse(start)
    turn = Rotation.from_matrix(motion[:3, :3]).as_rotvec()
    part = np.eye(4)
    part[:3, :3] = Rotation.from_rotvec(fraction * turn).as_matrix()
    slide = np.linalg.solve(_left_jacobian(turn), motion[:3, 3])
    part[:3, 3] = fraction * _left_jacobian(fraction * turn) @ slide
    result: Floats = part @ start
    return result


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
