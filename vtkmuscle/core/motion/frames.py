"""Turns and frames, many at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.types import Floats


def turns(axis: Floats, angles: Floats) -> Floats:
    """Return right-handed turns (f, 3, 3) by angles (f,) [radians] about an axis of length 1 (Rodrigues)."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    result: Floats = np.eye(3) * cosine + skew * sine + np.outer(axis, axis) * (1.0 - cosine)
    return result


def inverses(transforms: Floats) -> Floats:
    """Return the inverses of rigid transforms (f, 4, 4)."""
    result = np.tile(np.eye(4), (len(transforms), 1, 1))
    result[:, :3, :3] = transforms[:, :3, :3].transpose(0, 2, 1)
    result[:, :3, 3] = -np.einsum("fij,fj->fi", result[:, :3, :3], transforms[:, :3, 3])
    return result


def frame_at(centre: ArrayLike, angles: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """Return a frame at a place, turned about x, y and z in turn, each time about its own axis [radians]."""
    result = np.eye(4)
    for axis, angle in zip(np.eye(3), np.asarray(angles, dtype=np.float64), strict=True):
        result[:3, :3] = result[:3, :3] @ turns(axis, np.array([angle]))[0]
    result[:3, 3] = centre
    return result
