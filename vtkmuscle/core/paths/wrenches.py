"""What paths do to the bones: how their lengths change as a bone moves, all else in equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Takes a bone, its velocities (f, n, 3) where the points of paths are, its angular velocity (3,), and those
#: velocities of the ends that are fixed to it, 0 at all other points; returns how the energy's gradient
#: (f, n, 3) changes as the bone moves with these ends, and the other points stay.
ChangeOfGradient = Callable[[int, Floats, Floats, Floats], Floats]


def path_wrenches(
    points: Floats,
    start_bones: Ints,
    end_bones: Ints,
    moving: Sequence[int],
    count: int,
    change_of_gradient: ChangeOfGradient,
    response: Callable[[Floats], Floats],
) -> Floats:
    """Return the force and moment on the bones that a path of unit tension does its work by, (f, count, 6).

    As a bone moves by a small twist, the points fixed to it move, and what presses or holds the others goes
    with it; these move until all is in equilibrium again. Minus the change of a path's length per part of the
    twist is the wrench: with it moment arms are -dl/dq, in every pose and for every coordinate (tendon
    excursion; An et al. 1984, doi:10.1115/1.3138494). Where bones alone hold a path, that is the pull at its
    ends and the pressure on the bones (principle of virtual work).

    Parameters
    ----------
    points : (f, n, 3) array
        In equilibrium [mm].
    start_bones, end_bones : (f,) int arrays
        Of the ends.
    moving : sequence of int
        Bones that anything goes with.
    count : int
        Bones.
    change_of_gradient : callable
        See :data:`ChangeOfGradient`.
    response : callable
        Takes a change of the gradient, and returns how the inner points go, 0 at the ends.
    """
    segments = np.diff(points, axis=1)
    along = segments / np.maximum(np.linalg.norm(segments, axis=2, keepdims=True), np.finfo(float).tiny)
    middle = points.reshape(-1, 3).mean(axis=0)
    wrenches = np.zeros((len(points), count, 6))
    # All bones that move together leave the lengths as they are: one follows from the others.
    for bone in moving[1:]:
        ends = np.zeros((*points.shape[:2], 1))
        ends[start_bones == bone, 0] = ends[end_bones == bone, -1] = 1.0
        for number in range(6):
            shift, turn = np.zeros(3), np.zeros(3)
            (shift if number < 3 else turn)[number % 3] = 1.0
            velocity = shift + np.cross(turn, points - middle)
            given = ends * velocity
            change = change_of_gradient(bone, velocity, turn, given)
            change[:, [0, -1]] = 0.0
            moved = given + response(change)
            wrenches[:, bone, number] = -np.einsum("fni,fni->f", along, np.diff(moved, axis=1))
        wrenches[:, moving[0]] -= wrenches[:, bone]
    wrenches[:, :, 3:] += np.cross(middle, wrenches[:, :, :3])
    return wrenches
