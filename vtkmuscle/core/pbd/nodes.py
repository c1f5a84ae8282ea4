"""Nodes that carry the points of a muscle with them, each by a small rigid motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Points whose distances differ by less than this part count as equally far.
AS_FAR = 1e-6


class Nodes(NamedTuple):
    """Points and the nodes that carry them, at one time.

    Attributes
    ----------
    points : (n, 3) array
        [mm].
    mass : (n,) array
        Inverse masses: 1 free, 0 fixed.
    neighbours, weights : (n, m) arrays
        Nodes that each point follows, and how much.
    centres : (c, 3) array
        Of the nodes [mm].
    turns : (c, 3, 3) array
        How they have turned since rest.
    reach : float
        Distance at which a turn is measured [mm].
    """

    points: Floats
    mass: Floats
    neighbours: Ints
    weights: Floats
    centres: Floats
    turns: Floats
    reach: float


def farthest_points(points: Floats, count: int) -> Ints:
    """Return the ids (count,) of points spread evenly: each the farthest from all before it.

    The first is the farthest from the mean. Gonzalez 1985, *Clustering to minimize the maximum intercluster
    distance*, doi:10.1016/0304-3975(85)90224-5.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    count : int
        At most n.
    """
    picked = np.empty(count, dtype=np.int64)
    _farthest(points, np.linalg.norm(points - points.mean(axis=0), axis=1), picked)
    return picked


@kernel
def _farthest(points: Floats, distances: Floats, picked: Ints) -> None:
    for number in range(len(picked)):
        # Of several as far but for rounding the first: or a turned muscle might have other nodes.
        best = 0
        least = distances.max() * (1.0 - AS_FAR)
        while distances[best] < least:
            best += 1
        picked[number] = best
        for i in range(len(points)):
            x = points[i, 0] - points[best, 0]
            y = points[i, 1] - points[best, 1]
            z = points[i, 2] - points[best, 2]
            d = np.sqrt(x * x + y * y + z * z)
            if number == 0 or d < distances[i]:
                distances[i] = d


@kernel
def gather(points: Floats, neighbours: Ints, weights: Floats, total: Floats, sums: Floats) -> None:
    """Add up, for each node, weights (c,) and weighted points (c, 3)."""
    for i in range(len(points)):
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n]
            total[j] += w
            for c in range(3):
                sums[j, c] += w * points[i, c]


@kernel
def covariances(
    rest: Floats,
    points: Floats,
    neighbours: Ints,
    weights: Floats,
    rest_centres: Floats,
    centres: Floats,
    covariance: Floats,
) -> None:
    """Add up, for each node, w (x - c) (x0 - c0)', (c, 3, 3), of points now and at rest."""
    for i in range(len(points)):
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n]
            for a in range(3):
                for b in range(3):
                    covariance[j, a, b] += (
                        w * (points[i, a] - centres[j, a]) * (rest[i, b] - rest_centres[j, b])
                    )


@kernel
def restrict(
    residual: Floats,
    nodes: Nodes,
    result: Floats,
) -> None:
    """Write P' r into result (6 c,)."""
    points, mass, neighbours, weights, centres, turns, reach = nodes
    sums = np.zeros((len(centres), 6))
    for i in range(len(points)):
        if mass[i] == 0.0:
            continue
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        fx, fy, fz = residual[i, 0], residual[i, 1], residual[i, 2]
        mx, my, mz = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n]
            sums[j, 0] += w * fx
            sums[j, 1] += w * fy
            sums[j, 2] += w * fz
            sums[j, 3] += w * mx
            sums[j, 4] += w * my
            sums[j, 5] += w * mz
    for j in range(len(centres)):
        x, y, z = centres[j, 0], centres[j, 1], centres[j, 2]
        fx, fy, fz = sums[j, 0], sums[j, 1], sums[j, 2]
        mx, my, mz = sums[j, 3] - y * fz + z * fy, sums[j, 4] - z * fx + x * fz, sums[j, 5] - x * fy + y * fx
        for c in range(3):
            t = turns[j]
            result[6 * j + c] = t[0, c] * fx + t[1, c] * fy + t[2, c] * fz
            result[6 * j + 3 + c] = (t[0, c] * mx + t[1, c] * my + t[2, c] * mz) / reach


@kernel
def prolong(
    motion: Floats,
    nodes: Nodes,
    longest: float,
    result: Floats,
) -> None:
    """Add P q to result (n, 3), shortened so that no point moves by more than the longest move."""
    points, mass, neighbours, weights, centres, turns, reach = nodes
    parts = np.empty((len(centres), 6))
    for j in range(len(centres)):
        for c in range(3):
            t, o = 0.0, 0.0
            for d in range(3):
                t += turns[j, c, d] * motion[6 * j + d]
                o += turns[j, c, d] * motion[6 * j + 3 + d]
            parts[j, c], parts[j, 3 + c] = t, o / reach
        x, y, z = centres[j, 0], centres[j, 1], centres[j, 2]
        ox, oy, oz = parts[j, 3], parts[j, 4], parts[j, 5]
        parts[j, 0] -= oy * z - oz * y
        parts[j, 1] -= oz * x - ox * z
        parts[j, 2] -= ox * y - oy * x
    moves = np.empty_like(points)
    most = 0.0
    for i in range(len(points)):
        tx, ty, tz, ox, oy, oz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if mass[i] != 0.0:
            for n in range(neighbours.shape[1]):
                j, w = neighbours[i, n], weights[i, n]
                tx += w * parts[j, 0]
                ty += w * parts[j, 1]
                tz += w * parts[j, 2]
                ox += w * parts[j, 3]
                oy += w * parts[j, 4]
                oz += w * parts[j, 5]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        tx, ty, tz = tx + oy * z - oz * y, ty + oz * x - ox * z, tz + ox * y - oy * x
        moves[i, 0], moves[i, 1], moves[i, 2] = tx, ty, tz
        most = max(most, tx * tx + ty * ty + tz * tz)
    factor = min(1.0, longest / np.sqrt(most)) if most > 0.0 else 1.0
    for i in range(len(points)):
        for c in range(3):
            result[i, c] += factor * moves[i, c]


@kernel
def contact_rows(
    contacts: Ints,
    normals: Floats,
    nodes: Nodes,
    inverse: Floats,
    rows: Floats,
    answers: Floats,
) -> None:
    """Write how far the nodes' motions move points along normals, (m, 6 c), and that times the inverse."""
    points, mass, neighbours, weights, centres, turns, reach = nodes
    for m in range(len(contacts)):
        i = contacts[m]
        g = normals[m]
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n] * mass[i]
            x, y, z = points[i, 0] - centres[j, 0], points[i, 1] - centres[j, 1], points[i, 2] - centres[j, 2]
            tx, ty, tz = y * g[2] - z * g[1], z * g[0] - x * g[2], x * g[1] - y * g[0]
            t = turns[j]
            for c in range(3):
                rows[m, 6 * j + c] = w * (t[0, c] * g[0] + t[1, c] * g[1] + t[2, c] * g[2])
                rows[m, 6 * j + 3 + c] = w * (t[0, c] * tx + t[1, c] * ty + t[2, c] * tz) / reach
            for c in range(6 * j, 6 * j + 6):
                part = rows[m, c]
                for k in range(len(inverse)):
                    answers[m, k] += part * inverse[c, k]
