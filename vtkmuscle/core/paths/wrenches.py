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
        Takes velocities of the points (f, n, 3, 6), ends included, and returns how the energy's gradient
        changes with them, 0 at the ends.
    step : callable
        Takes gradients likewise, and returns about how the inner points go to be rid of them.
    """
    segments = np.diff(points, axis=1)
    along = segments / np.maximum(np.linalg.norm(segments, axis=2, keepdims=True), np.finfo(float).tiny)
    middle = points.reshape(-1, 3).mean(axis=0)
    wrenches = np.zeros((len(points), count, 6))
    moving = sorted({*start_bones.tolist(), *end_bones.tolist(), *loads})
    # Of a bone that shifts along the axes and turns about them.
    velocity = np.concatenate(
        [np.broadcast_to(np.eye(3), (*points.shape, 3)), _turned(points - middle)], axis=3
    )
    # All bones that move together leave the lengths as they are: one follows from the others.
    for bone in moving[1:]:
        given = np.zeros_like(velocity)
        given[start_bones == bone, 0] = velocity[start_bones == bone, 0]
        given[end_bones == bone, -1] = velocity[end_bones == bone, -1]
        gradient = change(given)
        if bone in loads:  # which go with it, and turn with it
            force, stiffness = loads[bone]
            gradient[:, 1:-1] -= (stiffness @ velocity)[:, 1:-1]
            gradient[:, 1:-1, :, 3:] -= _turned(force)[:, 1:-1]
        moved = given + _response(gradient, change, step)
        wrenches[:, bone] = -np.einsum("fni,fniv->fv", along, np.diff(moved, axis=1))
        wrenches[:, moving[0]] -= wrenches[:, bone]
    wrenches[:, :, 3:] += np.cross(middle, wrenches[:, :, :3])
    return wrenches


def _turned(vectors: Floats) -> Floats:
    """Return how vectors (..., 3) change as they turn about each of the three axes, (..., 3, 3)."""
    return np.stack([np.cross(axis, vectors) for axis in np.eye(3)], axis=-1)


def _response(
    gradient: Floats, change: Callable[[Floats], Floats], step: Callable[[Floats], Floats]
) -> Floats:
    """Return how the points go (f, n, 3, v), so that the gradient changes by minus ``gradient``.

    Each of the v for itself, by generalised conjugate residuals (Eisenstat, Elman, Schultz 1983,
    doi:10.1137/0720023), whose preconditioner is a step of Newton's method: its matrix leaves out how
    tangents and the bones' surfaces turn, which the change of the gradient knows.
    """
    left, response = gradient.copy(), np.zeros_like(gradient)
    before: list[tuple[Floats, Floats]] = []
    for _ in range(RESPONSES):
        way = step(left)
        by_way = change(way)
        for other, by_other in before:
            part = _part(by_way, by_other)
            way -= part * other
            by_way -= part * by_other
        part = _part(left, by_way)
        response -= part * way
        left -= part * by_way
        before.append((way, by_way))
    return response


def _part(a: Floats, b: Floats) -> Floats:
    """Return the projection coefficient of a onto b (f, n, 3, v), (v,); 0 where b is 0."""
    size = np.einsum("fniv,fniv->v", b, b)
    part: Floats = np.einsum("fniv,fniv->v", a, b) / np.where(size > 0.0, size, 1.0)
    return part
