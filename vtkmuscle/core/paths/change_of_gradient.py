"""How the gradient of a sheet's energy changes as its points move: all of its second derivatives."""

from __future__ import annotations

import math

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.types import Floats


@kernel
def change_gradient(
    x: Floats,
    velocity: Floats,
    held: Floats,
    neighbours: Neighbours,
    widths: Floats,
    widening: Floats,
    wider: Floats,
    change: Floats,
) -> None:
    """Write how the gradient changes as points go with velocities, ends with theirs: all of it.

    That is the derivative of what :func:`~vtkmuscle.core.paths.equilibrium.add_springs` and
    :func:`~vtkmuscle.core.paths.equilibrium.add_neighbours` write, with how tangents
    turn and widths change.

    Parameters
    ----------
    x, velocity : (f, n, 3) arrays
        Positions and velocities [mm].
    held : (f, n, 3, 3) array
        By how much what holds each point, bones among it, is stiffer.
    widths, widening : (f,) arrays
        Of the paths, and how they change with the paths' lengths [1/mm].
    wider : (f,) array
        Working memory.
    change : (f, n, 3) array
        Overwritten, 0 at the ends.
    """
    f, n, _ = x.shape
    for a in range(f):
        wider[a] = widening[a] * _lengthening(x[a], velocity[a])
        for i in range(1, n - 1):
            for c in range(3):
                total = 2.0 * velocity[a, i, c] - velocity[a, i - 1, c] - velocity[a, i + 1, c]
                for d in range(3):
                    total += held[a, i, c, d] * velocity[a, i, d]
                change[a, i, c] = total
        for c in range(3):
            change[a, 0, c] = change[a, n - 1, c] = 0.0
    points, going, by = x.reshape(f * n, 3), velocity.reshape(f * n, 3), change.reshape(f * n, 3)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        p, q, r = _tangent(points, i, j)
        size = math.sqrt(p * p + q * q + r * r)
        if not size > 0.0:
            continue
        p, q, r = p / size, q / size, r / size
        dp, dq, dr = _tangent(going, i, j)
        along = p * dp + q * dq + r * dr
        dp, dq, dr = (dp - along * p) / size, (dq - along * q) / size, (dr - along * r) / size
        u, v, w = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
        du, dv, dw = going[i, 0] - going[j, 0], going[i, 1] - going[j, 1], going[i, 2] - going[j, 2]
        ahead = u * p + v * q + w * r
        moved = du * p + dv * q + dw * r + u * dp + v * dq + w * dr
        u, v, w = u - ahead * p, v - ahead * q, w - ahead * r
        du, dv, dw = (
            du - moved * p - ahead * dp,
            dv - moved * q - ahead * dq,
            dw - moved * r - ahead * dr,
        )
        apart, parted = math.sqrt(u * u + v * v + w * w), 0.0
        if apart > 0.0:
            u, v, w = u / apart, v / apart, w / apart
            parted = u * du + v * dv + w * dw
            du, dv, dw = (du - parted * u) / apart, (dv - parted * v) / apart, (dw - parted * w) / apart
        width = 0.5 * (widths[i // n] + widths[j // n])
        widened = 0.5 * (wider[i // n] + wider[j // n])
        press = neighbours.stiffness[e, 0] * (apart - width * neighbours.distances[e])
        shear = neighbours.stiffness[e, 1] * (ahead - neighbours.ahead[e] / (width * width))
        pressed = neighbours.stiffness[e, 0] * (parted - widened * neighbours.distances[e])
        sheared = neighbours.stiffness[e, 1] * (
            moved + 2.0 * widened * neighbours.ahead[e] / (width * width * width)
        )
        p, q, r = (
            pressed * u + press * du + sheared * p + shear * dp,
            pressed * v + press * dv + sheared * q + shear * dq,
            pressed * w + press * dw + sheared * r + shear * dr,
        )
        by[i, 0], by[i, 1], by[i, 2] = by[i, 0] + p, by[i, 1] + q, by[i, 2] + r
        by[j, 0], by[j, 1], by[j, 2] = by[j, 0] - p, by[j, 1] - q, by[j, 2] - r


@kernel
def _lengthening(x: Floats, velocity: Floats) -> float:
    """Return how fast a path (n, 3) gets longer."""
    total = 0.0
    for i in range(len(x) - 1):
        length, along = 0.0, 0.0
        for c in range(3):
            segment = x[i + 1, c] - x[i, c]
            length += segment * segment
            along += segment * (velocity[i + 1, c] - velocity[i, c])
        if length > 0.0:
            total += along / math.sqrt(length)
    return total


@kernel
def _tangent(x: Floats, i: int, j: int) -> tuple[float, float, float]:
    """Return the sum of the paths' tangents at two points, each from the point before to the one after."""
    return (
        x[i + 1, 0] - x[i - 1, 0] + x[j + 1, 0] - x[j - 1, 0],
        x[i + 1, 1] - x[i - 1, 1] + x[j + 1, 1] - x[j - 1, 1],
        x[i + 1, 2] - x[i - 1, 2] + x[j + 1, 2] - x[j - 1, 2],
    )
