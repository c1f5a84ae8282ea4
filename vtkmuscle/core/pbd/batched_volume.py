"""The volume constraint, its gradient gathered vertex by vertex from the rings around them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.pbd.batched_constraints import (
    RECORD,
    WIDTH,
    Offsets,
    Reals,
    gather,
    scatter,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Edges of a vertex's ring that are summed at once; six is what a closed triangle mesh has on average.
RING_STEP = 6

# Places in the buffer: the points of a step's rings, the vertices, their sums, totals, results.
_VERTEX = (RING_STEP + 1) * RECORD * WIDTH
_SUMS = _VERTEX + RECORD * WIDTH
_TOTALS = _SUMS + 3 * WIDTH
_GRADIENT = _TOTALS + 2 * WIDTH

#: Numbers in the working memory of :func:`volume_gradient`.
VOLUME_BUFFER = _GRADIENT + RECORD * WIDTH


@vector_kernel
def volume_gradient(
    p: Reals,
    vertex_at: Offsets,
    ring_starts: Ints,
    ring_at: Offsets,
    first: int,
    last: int,
    gradient: Reals,
    buffer: Reals,
) -> tuple[float, float]:
    """Compute the volume's gradient at some of the vertices.

    Each vertex gathers its gradient from the ring r_0, r_1, ... around it, two edges at a time:
    g = dV/dp = sum r_i x r_(i+1) / 6 = sum r_(2i+1) x (r_(2i+2) - r_(2i)) / 6. The volume is homogeneous of
    degree 3, so V = sum p . g / 3 comes out of the same pass. Positions are taken about the spare record,
    see :func:`centre_spare`.

    Parameters
    ----------
    p : (4 (n + 1),) array
        Records.
    vertex_at, ring_starts, ring_at : arrays
        As in :class:`~vtkmuscle.core.pbd.batches.PackedMuscle`.
    first, last : int
        Batches of vertices, the last excluded.
    gradient : (4 (n + 1),) array
        6 w g of these vertices is written into it; must be 0 at points without a triangle.
    buffer : array
        Working memory of :data:`VOLUME_BUFFER` numbers.

    Returns
    -------
    volume, weighted : float
        What these vertices add to V [mm^3] and to sum(w |g|^2) [mm^4].
    """
    corner = RECORD * WIDTH
    spare = len(p) - RECORD
    cx, cy, cz = p[spare], p[spare + 1], p[spare + 2]
    for i in range(2 * WIDTH):
        buffer[_TOTALS + i] = 0.0
    for batch in range(first, last):
        gather(p, vertex_at, WIDTH * batch, WIDTH, buffer, _VERTEX)
        for i in range(3 * WIDTH):
            buffer[_SUMS + i] = 0.0
        for step in range(ring_starts[batch], ring_starts[batch + 1]):
            points = (RING_STEP + 1) * WIDTH
            gather(p, ring_at, points * step, points, buffer, 0)
            for i in range(WIDTH):
                gx, gy, gz = buffer[_SUMS + i], buffer[_SUMS + i + WIDTH], buffer[_SUMS + i + 2 * WIDTH]
                at = RECORD * i
                x0, y0, z0 = buffer[at], buffer[at + 1], buffer[at + 2]
                for pair in range(RING_STEP // 2):
                    at = RECORD * i + (2 * pair + 1) * corner
                    x1, y1, z1 = buffer[at] - cx, buffer[at + 1] - cy, buffer[at + 2] - cz
                    at = RECORD * i + (2 * pair + 2) * corner
                    x2, y2, z2 = buffer[at], buffer[at + 1], buffer[at + 2]
                    dx, dy, dz = x2 - x0, y2 - y0, z2 - z0
                    gx += y1 * dz - z1 * dy
                    gy += z1 * dx - x1 * dz
                    gz += x1 * dy - y1 * dx
                    x0, y0, z0 = x2, y2, z2
                buffer[_SUMS + i], buffer[_SUMS + i + WIDTH], buffer[_SUMS + i + 2 * WIDTH] = gx, gy, gz
        for i in range(WIDTH):
            at = _VERTEX + RECORD * i
            x, y, z, w = buffer[at] - cx, buffer[at + 1] - cy, buffer[at + 2] - cz, buffer[at + 3]
            gx, gy, gz = buffer[_SUMS + i], buffer[_SUMS + i + WIDTH], buffer[_SUMS + i + 2 * WIDTH]
            buffer[_TOTALS + i] += x * gx + y * gy + z * gz
            buffer[_TOTALS + i + WIDTH] += w * (gx * gx + gy * gy + gz * gz)
            at = _GRADIENT + RECORD * i
            buffer[at], buffer[at + 1], buffer[at + 2] = w * gx, w * gy, w * gz
            buffer[at + 3] = w - w
        scatter(gradient, vertex_at, WIDTH * batch, WIDTH, buffer, _GRADIENT)
    volume, weighted = 0.0, 0.0
    for i in range(WIDTH):
        volume += buffer[_TOTALS + i] / 18.0
        weighted += buffer[_TOTALS + i + WIDTH] / 36.0
    return volume, weighted


@vector_kernel
def move_along_gradient(
    p: Reals,
    gradient: Reals,
    first: int,
    last: int,
    parts: Floats,
    rest: float,
    floor: float,
    stiffness: float,
) -> None:
    """Move points along the volume's gradient so that the volume is as at rest.

    Parameters
    ----------
    p, gradient : (4 (n + 1),) arrays
        Records, changed in place; of :func:`volume_gradient`.
    first, last : int
        Places in them, the last excluded.
    parts : (d, 2) array
        What :func:`volume_gradient` gave, part by part.
    rest : float
        V0 [mm^3].
    floor : float
        Least value of the denominator sum(w |g|^2) [mm^4].
    stiffness : float
        Stiffness per iteration, in [0, 1].
    """
    volume, weighted = 0.0, 0.0
    for part in range(len(parts)):
        volume += parts[part, 0]
        weighted += parts[part, 1]
    if weighted > 0.0:
        s = p.dtype.type(stiffness * (volume - rest) / max(weighted, floor) / 6.0)
        moved, along = p[first:last], gradient[first:last]
        for i in range(len(moved)):
            moved[i] -= s * along[i]


@vector_kernel
def centre_spare(p: Reals) -> None:
    """Put the spare record at the mean of the points.

    Volume and gradient do not depend on the origin they are taken about, but their last digits do; and the
    spare point's products with others are zero where it stands in a ring.
    """
    x, y, z = 0.0, 0.0, 0.0
    n = len(p) // RECORD - 1
    for i in range(n):
        x += p[RECORD * i]
        y += p[RECORD * i + 1]
        z += p[RECORD * i + 2]
    p[RECORD * n], p[RECORD * n + 1], p[RECORD * n + 2] = x / n, y / n, z / n
