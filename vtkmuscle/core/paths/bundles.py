"""Paths side by side: which of them a path's points keep company with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.types import Floats, Ints

#: Paths beside it that a point's mean is taken over, at most.
BESIDE = 64

#: Weights that differ by less are the same.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Bundle:
    """The neighbouring paths of each point of each path at rest, and their weights in a mean.

    Attributes
    ----------
    beside : (f n, k) int array
        Points of paths, those of one path after those of another.
    parts : (f n, k) array
        Rows sum to 1.
    """

    beside: Ints
    parts: Floats

    def mean(self, values: Floats) -> Floats:
        """Return the means of values (f n, ...) of paths' points over the paths beside each."""
        mean: Floats = np.einsum("pk,pk...->p...", self.parts, values[self.beside])
        return mean


def bundle_of(fibres: Floats, width: float) -> Bundle:
    """Return the neighbours of points (f, n, 3) of fibres, equally far along, within about a width [mm]."""
    f, n, _ = fibres.shape
    beside = np.empty((f, n, min(BESIDE, f)), dtype=np.int64)
    parts = np.empty(beside.shape)
    for i in range(n):
        apart, found = nearest(cKDTree(fibres[:, i]), fibres[:, i], BESIDE)
        falling = np.exp(-0.5 * (apart / width) ** 2)
        if f > BESIDE:
            falling = falling_to_zero(falling)
        beside[:, i], parts[:, i] = found * n + i, falling / falling.sum(axis=1, keepdims=True)
    return Bundle(beside.reshape(f * n, -1), parts.reshape(f * n, -1))


def nearest(tree: cKDTree, points: Floats, count: int) -> tuple[Floats, Ints]:
    """Return distances and numbers of the nearest points, (q, count) or as many as there are."""
    distances, found = tree.query(points, k=range(1, min(count, tree.n) + 1))
    return distances, found


def falling_to_zero(values: Floats) -> Floats:
    """Return values (m, k), descending, minus the last of their row: the farthest neighbour has weight 0.

    Which of several neighbours at the same distance is the last, rounding decides; its weight of 0 makes that
    choice irrelevant. Rows of equal values stay as they are.
    """
    falling: Floats = values - values[:, -1:]
    return np.where(falling[:, :1] > SAME, falling, values)
