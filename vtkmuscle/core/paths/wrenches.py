"""What paths do to the bones: how their lengths change as a bone moves, all else in equilibrium."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.paths.bone_contact import Load
from vtkmuscle.core.paths.equilibrium import axes_of_pair
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.types import Floats, Ints

#: Steps in which the response to a bone's move is solved for. Of four muscles of a real hip and one of a
#: knee, one has mean levers 1.8 to 8.6 mm off -dl/dq (rms), two 0.4 to 1.4, four 0.1 to 0.5.
RESPONSES = 4


def path_wrenches(
    points: Floats,
    start_bones: Ints,
    end_bones: Ints,
    loads: Mapping[int, Load],
    transforms: Floats,
    change: Callable[[Floats], Floats],
    step: Callable[[Floats], Floats],
) -> Floats:
    """Return the force and moment on the bones that a path of unit tension does its work by, (f, b, 6).

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
        Bones of the ends.
    loads : mapping of int to Load
        Forces of each bone on the points.
    transforms : (b, 4, 4) array
        Of the bones, rest to now.
    change : callable
        Takes velocities of the points (f, n, 3, 6), ends included, and returns how the energy's gradient
        changes with them, 0 at the ends.
    step : callable
        Takes gradients likewise, and returns velocities of the inner points that about cancel them.
    """
    segments = np.diff(points, axis=1)
    along = segments / np.maximum(np.linalg.norm(segments, axis=2, keepdims=True), np.finfo(float).tiny)
    middle = points.reshape(-1, 3).mean(axis=0)
    wrenches = np.zeros((len(points), len(transforms), 6))
    moving = sorted({*start_bones.tolist(), *end_bones.tolist(), *loads})
    # Of a bone that shifts along the axes of the first one and turns about them: how the scene lies does not
    # matter.
    axes = transforms[moving[0], :3, :3].T
    velocity = np.concatenate(
        [np.broadcast_to(axes.T, (*points.shape, 3)), _turned(points - middle, axes)], axis=3
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
            gradient[:, 1:-1, :, 3:] -= _turned(force, axes)[:, 1:-1]
        moved = given + _response(gradient, change, step)
        wrenches[:, bone] = -np.einsum("fni,fniv->fv", along, np.diff(moved, axis=1))
        wrenches[:, moving[0]] -= wrenches[:, bone]
    wrenches = (wrenches.reshape(-1, 3) @ axes).reshape(wrenches.shape)
    wrenches[:, :, 3:] += np.cross(middle, wrenches[:, :, :3])
    return wrenches


def _turned(vectors: Floats, axes: Floats) -> Floats:
    """Return how vectors (..., 3) change as they turn about each of three axes (3, 3), (..., 3, 3)."""
    return np.stack([np.cross(axis, vectors) for axis in axes], axis=-1)


def _response(
    gradient: Floats, change: Callable[[Floats], Floats], step: Callable[[Floats], Floats]
) -> Floats:
    """Return the velocities of the points (f, n, 3, v) by which the gradient changes by minus ``gradient``.

    Each of the v for itself, by generalised conjugate residuals (Eisenstat, Elman, Schultz 1983,
    doi:10.1137/0720023), whose preconditioner is a step of Newton's method: its matrix leaves out how
    tangents and the bones' surfaces turn, which the change of the gradient knows.
    """
    left, response = gradient.copy(), np.zeros_like(gradient)
    before: list[tuple[Floats, Floats, Floats]] = []
    for _ in range(RESPONSES):
        way = step(left)
        by_way = change(way)
        for other, by_other, size in before:
            part = _products(by_way, by_other) / size
            way -= part * other
            by_way -= part * by_other
        size = _products(by_way, by_way)
        size[size == 0.0] = 1.0
        part = _products(left, by_way) / size
        response -= part * way
        left -= part * by_way
        before.append((way, by_way, size))
    return response


def _products(a: Floats, b: Floats) -> Floats:
    """Return the scalar products of a and b (f, n, 3, v), one for each v."""
    products: Floats = np.einsum("fniv,fniv->v", a, b)
    return products


@vector_kernel
def change_gradient(
    x: Floats,
    velocity: Floats,
    held: Floats,
    neighbours: Neighbours,
    widths: Floats,
    widening: Floats,
    wider: Floats,
    turning: Floats,
    change: Floats,
) -> None:
    """Write how the gradient changes as points go with velocities, those of the ends included.

    That is the derivative of what :func:`~vtkmuscle.core.paths.equilibrium.add_springs` and
    :func:`~vtkmuscle.core.paths.equilibrium.add_neighbours` write, with tangents that turn and widths that
    change.

    Parameters
    ----------
    x : (f, n, 3) array
        Positions [mm].
    velocity : (f, n, 3, v) array
        Of the points, v of them.
    held : (f, n, 3, 3) array
        Stiffness of what holds each point, bones among it.
    widths, widening : (f,) arrays
        Of the paths, and how they change with the paths' lengths [1/mm].
    wider, turning : (f, v), (f, n, 3, v) arrays
        Working memory: how fast paths get wider, and how tangents change at their points.
    change : (f, n, 3, v) array
        Overwritten, 0 at the ends.
    """
    f, n, _, ways = velocity.shape
    wider[:] = 0.0
    for a in range(f):
        for i in range(n - 1):
            s0, s1, s2 = x[a, i + 1, 0] - x[a, i, 0], x[a, i + 1, 1] - x[a, i, 1], x[a, i + 1, 2] - x[a, i, 2]
            length = math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
            part = widening[a] / length if length > 0.0 else 0.0
            for v in range(ways):
                wider[a, v] += part * (
                    s0 * (velocity[a, i + 1, 0, v] - velocity[a, i, 0, v])
                    + s1 * (velocity[a, i + 1, 1, v] - velocity[a, i, 1, v])
                    + s2 * (velocity[a, i + 1, 2, v] - velocity[a, i, 2, v])
                )
        for c in range(3):
            for v in range(ways):
                change[a, 0, c, v] = change[a, n - 1, c, v] = 0.0
        for i in range(1, n - 1):
            for c in range(3):
                h0, h1, h2 = held[a, i, c, 0], held[a, i, c, 1], held[a, i, c, 2]
                for v in range(ways):
                    before, after = velocity[a, i - 1, c, v], velocity[a, i + 1, c, v]
                    turning[a, i, c, v] = after - before
                    change[a, i, c, v] = (2.0 * velocity[a, i, c, v] - before - after) + (
                        h0 * velocity[a, i, 0, v] + h1 * velocity[a, i, 1, v] + h2 * velocity[a, i, 2, v]
                    )
    p, by = x.reshape(f * n, 3), change.reshape(f * n, 3, ways)
    going, turns = velocity.reshape(f * n, 3, ways), turning.reshape(f * n, 3, ways)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        t0, t1, t2, u0, u1, u2, size, ahead, apart = axes_of_pair(p, i, j)
        if not size > 0.0:
            continue
        per_size, per_apart = 1.0 / size, 1.0 / apart if apart > 0.0 else 0.0
        # The force is press u + shear t; press = turn apart.
        width = 0.5 * (widths[i // n] + widths[j // n])
        across, along = neighbours.stiffness[e, 0], neighbours.stiffness[e, 1]
        turn = across * (apart - width * neighbours.distances[e]) * per_apart
        shear = along * (ahead - neighbours.ahead[e] / (width * width))
        bend = (shear - turn * ahead) * per_size
        press_wider = -across * neighbours.distances[e]
        shear_wider = 2.0 * along * neighbours.ahead[e] / (width * width * width)
        for v in range(ways):
            w0 = going[i, 0, v] - going[j, 0, v]
            w1 = going[i, 1, v] - going[j, 1, v]
            w2 = going[i, 2, v] - going[j, 2, v]
            d0 = turns[i, 0, v] + turns[j, 0, v]
            d1 = turns[i, 1, v] + turns[j, 1, v]
            d2 = turns[i, 2, v] + turns[j, 2, v]
            widened = 0.5 * (wider[i // n, v] + wider[j // n, v])
            turned = (u0 * d0 + u1 * d1 + u2 * d2) * per_size
            parted = u0 * w0 + u1 * w1 + u2 * w2 - ahead * turned
            moved = t0 * w0 + t1 * w1 + t2 * w2 + apart * turned
            by_u = (across - turn) * parted + press_wider * widened
            by_t = (along - turn) * moved + shear_wider * widened - bend * (t0 * d0 + t1 * d1 + t2 * d2)
            f0 = turn * w0 + bend * d0 + by_u * u0 + by_t * t0
            f1 = turn * w1 + bend * d1 + by_u * u1 + by_t * t1
            f2 = turn * w2 + bend * d2 + by_u * u2 + by_t * t2
            by[i, 0, v], by[i, 1, v], by[i, 2, v] = by[i, 0, v] + f0, by[i, 1, v] + f1, by[i, 2, v] + f2
            by[j, 0, v], by[j, 1, v], by[j, 2, v] = by[j, 0, v] - f0, by[j, 1, v] - f1, by[j, 2, v] - f2
