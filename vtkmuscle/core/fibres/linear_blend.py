"""Fibres that follow two bones by a blend of their motions: the comparison method of the papers.

Modenese, Kohout 2020, *Automated generation of three-dimensional complex muscle geometries for use in
personalised musculoskeletal models*, doi:10.1007/s10439-020-02490-4.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import Floats, Ints


def origin_weights(offsets: Ints, a: float) -> Floats:
    """Return the weight of the origin's bone at each point: a t^2 - (a + 1) t + 1, t = (i - 1) / (n - 1).

    Parameters
    ----------
    offsets : (k + 1,) int array
        First point of each fibre, and the number of points n.
    a : float
        0 for a linear blend; in [-1, 1] weights go down from 1 at the origin to 0 at the insertion.

    Returns
    -------
    (n,) array
        Weights; those of the insertion's bone are 1 less these.
    """
    counts = np.diff(offsets)
    number = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
    t = number / np.repeat(np.maximum(counts - 1, 1), counts)
    weights: Floats = a * t**2 - (a + 1.0) * t + 1.0
    return weights


def blend_fibres(points: Floats, offsets: Ints, origin: Floats, insertion: Floats, a: float) -> Floats:
    """Return v' = w T_origin v + (1 - w) T_insertion v for each point v of fibres.

    Parameters
    ----------
    points : (n, 3) array
        Fibres at rest, from origin to insertion [mm].
    offsets : (k + 1,) int array
        First point of each fibre, and n.
    origin, insertion : (4, 4) arrays
        Motions of the two bones, rest to now.
    a : float
        See :func:`origin_weights`.

    Returns
    -------
    (n, 3) array
        Fibres now [mm].
    """
    w = origin_weights(offsets, a)[:, None]
    return w * apply_transform(origin, points) + (1.0 - w) * apply_transform(insertion, points)
