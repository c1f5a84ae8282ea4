"""How the gradient of a sheet's energy changes as its points move: all of its second derivatives."""

from __future__ import annotations

import math

from vtkmuscle.core.jit import kernel, vector_kernel
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.types import Floats


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
    """Write how the gradient changes as points go with velocities, ends with theirs: all of it.

    That is the derivative of what :func:`~vtkmuscle.core.paths.equilibrium.add_springs` and
    :func:`~vtkmuscle.core.paths.equilibrium.add_neighbours` write, with how tangents
    turn and widths change.

    Parameters
    ----------
    x : (f, n, 3) array
        Positions [mm].
    velocity : (f, n, 3, v) array
        Of the points, v ways to go.
    held : (f, n, 3, 3) array
        By how much what holds each point, bones among it, is stiffer.
    widths, widening : (f,) arrays
        Of the paths, and how they change with the paths' lengths [1/mm].
    wider, turning : (f, v), (f, n, 3, v) arrays
        Working memory: how fast paths get wider, and how tangents change at their points.
    change : (f, n, 3, v) array
        Overwritten, 0 at the ends.
    """
    f, n, _, ways = velocity.shape
    for a in range(f):
        _widen(x[a], velocity[a], widening[a], wider[a])
        for c in range(3):
            for v in range(ways):
                change[a, 0, c, v] = change[a, n - 1, c, v] = 0.0
        for i in range(1, n - 1):
            for c in range(3):
                h0, h1, h2 = held[a, i, c, 0], held[a, i, c, 1], held[a, i, c, 2]
                for v in range(ways):
                    before, here, after = (
                        velocity[a, i - 1, c, v],
                        velocity[a, i, c, v],
                        velocity[a, i + 1, c, v],
                    )
                    turning[a, i, c, v] = after - before
                    change[a, i, c, v] = (2.0 * here - before - after) + (
                        h0 * velocity[a, i, 0, v] + h1 * velocity[a, i, 1, v] + h2 * velocity[a, i, 2, v]
                    )
    p, by = x.reshape(f * n, 3), change.reshape(f * n, 3, ways)
    going, turns = velocity.reshape(f * n, 3, ways), turning.reshape(f * n, 3, ways)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        # The tangent t, the way from one to the other, and its part across the paths, u.
        t0 = p[i + 1, 0] - p[i - 1, 0] + p[j + 1, 0] - p[j - 1, 0]
        t1 = p[i + 1, 1] - p[i - 1, 1] + p[j + 1, 1] - p[j - 1, 1]
        t2 = p[i + 1, 2] - p[i - 1, 2] + p[j + 1, 2] - p[j - 1, 2]
        size = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        if not size > 0.0:
            continue
        t0, t1, t2 = t0 / size, t1 / size, t2 / size
        u0, u1, u2 = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
        ahead = u0 * t0 + u1 * t1 + u2 * t2
        u0, u1, u2 = u0 - ahead * t0, u1 - ahead * t1, u2 - ahead * t2
        apart = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
        per_apart = 1.0 / apart if apart > 0.0 else 0.0
        u0, u1, u2 = u0 * per_apart, u1 * per_apart, u2 * per_apart
        # The force is press u + shear t; both turn, and what they are of changes.
        width = 0.5 * (widths[i // n] + widths[j // n])
        across, along = neighbours.stiffness[e, 0], neighbours.stiffness[e, 1]
        turn = across * (apart - width * neighbours.distances[e]) * per_apart
        shear = along * (ahead - neighbours.ahead[e] / (width * width))
        bend, per_size = (shear - turn * ahead) / size, 1.0 / size
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


@kernel
def _widen(x: Floats, velocity: Floats, widening: float, wider: Floats) -> None:
    """Write how fast a path (n, 3) gets wider, (v,), as its length changes."""
    for v in range(len(wider)):
        wider[v] = 0.0
    for i in range(len(x) - 1):
        s0, s1, s2 = x[i + 1, 0] - x[i, 0], x[i + 1, 1] - x[i, 1], x[i + 1, 2] - x[i, 2]
        length = math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
        part = widening / length if length > 0.0 else 0.0
        for v in range(len(wider)):
            wider[v] += part * (
                s0 * (velocity[i + 1, 0, v] - velocity[i, 0, v])
                + s1 * (velocity[i + 1, 1, v] - velocity[i, 1, v])
                + s2 * (velocity[i + 1, 2, v] - velocity[i, 2, v])
            )
