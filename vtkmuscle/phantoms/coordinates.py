"""Poses of phantoms whose motion has several coordinates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats


def checked_poses(coordinates: ArrayLike, limits: Mapping[str, tuple[float, float]], phantom: str) -> Floats:
    """Return the angles of each frame, checked.

    Parameters
    ----------
    coordinates : (k, c) array_like
        A row per frame [degrees].
    limits : mapping of str to (low, high)
        Of each of the c coordinates, by name [degrees].
    phantom : str
        Named in errors.

    Returns
    -------
    (k, c) array
        The angles [degrees].

    Raises
    ------
    ValueError
        For another shape, or an angle out of range.
    """
    poses = np.array(coordinates, dtype=np.float64)
    where = f"{phantom}: coordinates"
    if poses.ndim != 2 or poses.shape[1] != len(limits) or not len(poses):
        raise InputError(where, f"of shape {poses.shape}", f"give a row per frame, of {' and '.join(limits)}")
    for column, (name, (low, high)) in enumerate(limits.items()):
        outside = poses[~((poses[:, column] >= low) & (poses[:, column] <= high)), column]
        if len(outside):
            raise InputError(
                where,
                f"{name} is {outside[0]:g} degrees, but answers are known from {low:g} to {high:g} only",
            )
    return poses
