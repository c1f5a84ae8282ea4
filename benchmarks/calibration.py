"""The kernel that benchmarks are measured in: times over its own, taken in turns, hold on any machine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bench_kernels import torus
from naive_kernels import naive_distance

from vtkmuscle.core.mesh.surface import edge_lengths
from vtkmuscle.core.mesh.topology import mesh_topology

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
