"""Twists: how fast a rigid body moves, as the linear velocity at the origin and the angular velocity."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.types import Floats


def twist_about(centre: ArrayLike, axis: ArrayLike) -> Floats:
    """Return the twist (6,) of a turn by a radian about an axis through a centre, right-handed."""
    direction = np.asarray(axis, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    return np.concatenate([np.cross(np.asarray(centre, dtype=np.float64), direction), direction])


def carried_twists(twists: Floats, transform: Floats) -> Floats:
    """Return the twists (..., 6) of bodies after space went by an isometry (4, 4), mirrors included."""
    linear, shift = transform[:3, :3], transform[:3, 3]
    angular = np.linalg.det(linear) * twists[..., 3:] @ linear.T
    return np.concatenate([twists[..., :3] @ linear.T + np.cross(shift, angular), angular], axis=-1)
