"""What paths do to the bones: how their lengths change as a bone moves, all else in equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from vtkmuscle.core.paths.bone_contact import Load
from vtkmuscle.core.types import Floats, Ints

#: Steps in which the response to a bone's move is solved for. Of four muscles of a real hip and one of a
#: knee, one has mean levers 1.8 to 8.6 mm off -dl/dq (rms), two 0.4 to 1.4, four 0.1 to 0.5.
RESPONSES = 4


def path_wrenches(
    points: Floats,
    start_bones: Ints,
    end_bones: Ints,
    loads: Mapping[int, Load],
    count: int,
    change: Callable[[Floats], Floats],
    step: Callable[[Floats], Floats],
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
    loads : mapping of int to Load
        What each bone does to the points.
    count : int
        Bones.
    change : callable
        Takes the points' velocities (f, n, 3), ends included, and returns how the energy's gradient changes
        with them, 0 at the ends.
    step : callable
        Takes a gradient, and returns about how the inner points go to be rid of it.
    """
    segments = np.diff(points, axis=1)
    along = segments / np.maximum(np.linalg.norm(segments, axis=2, keepdims=True), np.finfo(float).tiny)
    middle = points.reshape(-1, 3).mean(axis=0)
    wrenches = np.zeros((len(points), count, 6))
    moving = sorted({*start_bones.tolist(), *end_bones.tolist(), *loads})
    # All bones that move together leave the lengths as they are: one follows from the others.
    for bone in moving[1:]:
        ends = np.zeros((*points.shape[:2], 1))
        ends[start_bones == bone, 0] = ends[end_bones == bone, -1] = 1.0
        for number in range(6):
            shift, turn = np.zeros(3), np.zeros(3)
            (shift if number < 3 else turn)[number % 3] = 1.0
            velocity = shift + np.cross(turn, points - middle)
            given = ends * velocity
            gradient = change(given)
            if bone in loads:  # which go with it, and turn with it
                force, stiffness = loads[bone]
                gradient[:, 1:-1] -= (
                    np.einsum("fnij,fnj->fni", stiffness, velocity) + np.cross(turn, force)
                )[:, 1:-1]
            moved = given + _response(gradient, change, step)
            wrenches[:, bone, number] = -np.einsum("fni,fni->f", along, np.diff(moved, axis=1))
        wrenches[:, moving[0]] -= wrenches[:, bone]
    wrenches[:, :, 3:] += np.cross(middle, wrenches[:, :, :3])
    return wrenches


def _response(
    gradient: Floats, change: Callable[[Floats], Floats], step: Callable[[Floats], Floats]
) -> Floats:
    """Return how the points go, so that the gradient changes by minus ``gradient``.

    By generalised conjugate residuals (Eisenstat, Elman, Schultz 1983, doi:10.1137/0720023), whose
    preconditioner is a step of Newton's method: its matrix leaves out how tangents and the bones' surfaces
    turn, which the change of the gradient knows.
    """
    left, response = gradient.copy(), np.zeros_like(gradient)
    before: list[tuple[Floats, Floats, float]] = []
    for _ in range(RESPONSES):
        way = step(left)
        by_way = change(way)
        for other, by_other, size in before:
            part = float(np.vdot(by_way, by_other)) / size
            way -= part * other
            by_way -= part * by_other
        size = float(np.vdot(by_way, by_way))
        if size == 0.0:
            break
        part = -float(np.vdot(left, by_way)) / size
        response += part * way
        left += part * by_way
        before.append((way, by_way, size))
    return response
