"""The kernel that benchmarks are measured in: times over its own, taken in turns, hold on any machine."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology

TRIANGLES = 10_000


def calibration() -> Callable[[], object]:
    """Return the kernel that all times are divided by: it takes some 0.1 ms, and is run ten times.

    It is naive Gauss-Seidel on edge lengths, compiled, and this project will not change it.
    """
    points, triangles = torus(TRIANGLES)
    edges = mesh_topology(len(points), triangles).edges
    rest, ones, mass = edge_lengths(points, edges), np.ones(len(edges)), np.ones(len(points))
    moved = 1.01 * points

    def run() -> None:
        for _ in range(10):
            naive_distance(moved, mass, edges, rest, ones)

    return run


@kernel
def naive_distance(p, w, edges, rest, stiffness):
    """Project edge lengths, in the order of the mesh."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        dx, dy, dz = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        s = stiffness[e] * (length - rest[e]) / (w[i] + w[j]) / length
        p[i, 0] -= w[i] * s * dx
        p[i, 1] -= w[i] * s * dy
        p[i, 2] -= w[i] * s * dz
        p[j, 0] += w[j] * s * dx
        p[j, 1] += w[j] * s * dy
        p[j, 2] += w[j] * s * dz


def torus(n_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a bumpy closed surface of about so many triangles."""
    around = round((n_triangles / 2.0 / 3.0) ** 0.5)
    along = 3 * around
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    u, v = 2.0 * np.pi * i / along, 2.0 * np.pi * j / around
    r = 10.0 + np.sin(7 * u) * np.cos(5 * v)
    points = np.stack([(30 + r * np.cos(v)) * np.cos(u), (30 + r * np.cos(v)) * np.sin(u), r * np.sin(v)], 2)
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = (i + 1) % along * around + j, (i + 1) % along * around + (j + 1) % around
    triangles = np.stack([a, c, b, b, c, d], axis=2).reshape(-1, 3)
    return points.reshape(-1, 3), triangles
