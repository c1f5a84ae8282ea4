"""Twists: how fast a rigid body moves, as the linear velocity at the origin and the angular velocity."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from vtkmuscle.core.types import Floats

#: Below this angle [rad] the series of a screw's slide is exact to rounding: its next term is angle^2 / 720.
_SMALL = 1e-4


def twist_about(centre: ArrayLike, axis: ArrayLike) -> Floats:
    """Return the twist (6,) of a turn by a radian about an axis through a centre, right-handed."""
    direction = np.asarray(axis, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    return np.concatenate([np.cross(np.asarray(centre, dtype=np.float64), direction), direction])


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
    >>> from vtkmuscle.core.motion.twists import screws
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


def carried_twists(twists: Floats, transform: Floats) -> Floats:
    """Return the twists (..., 6) of bodies after space went by an isometry (4, 4), mirrors included."""
    linear, shift = transform[:3, :3], transform[:3, 3]
    angular = np.linalg.det(linear) * twists[..., 3:] @ linear.T
    return np.concatenate([twists[..., :3] @ linear.T + np.cross(shift, angular), angular], axis=-1)
