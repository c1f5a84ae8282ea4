"""Moment arms of paths: the levers of their pulls about the axis of a coordinate, in every pose.

A path of unit tension pulls on the bones that it is fixed to, presses on or passes through. Where a
coordinate q moves bone b by the twist s_b per unit, the pull does the work sum_b w_b . s_b, w_b its wrench on
that bone; and since a taut path does no other work than to shorten, that is -dl/dq (principle of virtual
work; An et al. 1984, doi:10.1115/1.3138494; for any coordinate Sherman, Seth, Delp 2013,
doi:10.1115/DETC2013-13633). It takes the pose alone, no motion about it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vtkmuscle.core.moment_arms.differences import Differences, differences_by
from vtkmuscle.core.motion.blending import screws
from vtkmuscle.core.motion.frames import inverses
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints


def levers(wrenches: Mapping[str, Floats], twists: Mapping[str, Floats]) -> Floats:
    """Return the moment arms of paths by a coordinate.

    Parameters
    ----------
    wrenches : mapping of str to (f, k, 6) array
        On each bone in each pose: force [1] and moment about the origin [mm] of k paths of unit tension.
    twists : mapping of str to (f, 6) array
        Of each bone that moves: velocity at the origin and angular velocity, per unit of the coordinate.

    Returns
    -------
    (f, k) array
        Positive where the pull drives the coordinate up [mm by an angle, 1 by a slide].

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.levers import levers
    >>> pull = np.array([[[0.0, 1.0, 0.0, 0.0, 0.0, 30.0]]])  # along y, 30 mm beside the z axis
    >>> turn = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    >>> levers({"shank": pull}, {"shank": turn})
    array([[30.]])
    """
    shape = next(iter(wrenches.values())).shape[:2]
    parts = (np.einsum("fki,fi->fk", wrenches[bone], one) for bone, one in twists.items() if bone in wrenches)
    found: Floats = sum(parts, np.zeros(shape))
    return found


def twists_by(motion: RigidMotion, name: str, among: Sequence[str] = ()) -> tuple[Ints, dict[str, Floats]]:
    """Return how a coordinate moves the bones, the others held.

    Where the joint is known, exactly and in every pose; else by the screws to the poses beside, which differ
    in the coordinate alone.

    Parameters
    ----------
    motion, name, among
        As of :func:`~vtkmuscle.core.moment_arms.differences.differences_by`.

    Returns
    -------
    frames : (m,) int array
        In which it is known; none where no two poses differ in the coordinate alone.
    twists : dict of str to (m, 6) array
        Per bone that moves.
    """
    known = motion.coordinates[name].twists
    if known is not None:
        return np.arange(len(motion.times)), dict(known)
    near = differences_by(motion, name, among)
    return near.frames, {bone: _by_screws(table, near) for bone, table in motion.transforms.items()}


def _by_screws(table: Floats, near: Differences) -> Floats:
    """Return the twist (m, 6) of a bone from its transforms (f, 4, 4)."""
    back = inverses(table[near.frames])
    ways = (screws(table[near.beside[:, side]] @ back) for side in range(2))
    return near.of(np.stack(list(ways), axis=1))
