"""Points embedded in a muscle's surface (2021 paper, eq. 8)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from vtkmuscle.core.fibres.mean_value import mean_value_coordinates, transport
from vtkmuscle.core.fibres.sparse_weights import (
    SparseWeights,
    sparse_mean_value_coordinates,
    sparse_transport,
)
from vtkmuscle.core.mesh.solids import points_inside, solids_of
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, shared_tree, tree_of_deformed
from vtkmuscle.core.types import Floats, Ints

#: Points in a block of weights: a step of progress, and the time until an abort.
_BLOCK = 256
#: Size up to which weights are kept [bytes]; further weights are computed again for each frame.
_LARGEST_CACHE = 2**31
#: Points nearer to the surface than this part of the muscle's size count as inside.
_ON_SURFACE = 1e-6


class EmbeddedPoints:
    """Points that move with a surface, by mean value coordinates.

    Kohout, Cervenka 2021, eq. 8, doi:10.1007/978-3-030-72379-8_24.

    Parameters
    ----------
    positions : (p, 3) array
        Points at rest [mm].
    points, triangles : (n, 3) array, (m, 3) int array
        The closed surface at rest [mm]; point ids.
    weight_tolerance : float
        Tolerance for merging vertices into groups of equal weight; 0 merges nothing
        (:func:`~vtkmuscle.core.fibres.sparse_weights.sparse_mean_value_coordinates`).
    """

    def __init__(self, positions: Floats, points: Floats, triangles: Ints, weight_tolerance: float) -> None:
        self.positions, self.points, self.triangles = positions, points, triangles
        self.weight_tolerance = weight_tolerance
        self._sparse: SparseWeights | None = None
        self._weights: dict[int, Floats] = {}
        self._bent: TriangleTree | None = None

    def same_as(self, positions: Floats, points: Floats, triangles: Ints, weight_tolerance: float) -> bool:
        """Return whether the object was made from equal arguments."""
        arrays = (self.positions, positions), (self.points, points), (self.triangles, triangles)
        return self.weight_tolerance == weight_tolerance and all(np.array_equal(*pair) for pair in arrays)

    @cached_property
    def gap(self) -> Floats:
        """Distances (p,) from the muscle at rest [mm]; 0 inside."""
        within = solids_of(self.points, self.triangles).into(self.positions)
        distances: Floats = np.linalg.norm(within - self.positions, axis=1)
        return distances

    @cached_property
    def _tree(self) -> TriangleTree:
        return shared_tree(self.points, self.triangles)

    @cached_property
    def n_outside(self) -> int:
        """Number of points outside the muscle at rest."""
        return int((self.gap > _ON_SURFACE * np.linalg.norm(np.ptp(self.points, axis=0))).sum())

    @property
    def error(self) -> float:
        """Largest error of merged weights [mm]. For a muscle bent by about a radian."""
        return 0.0 if self._sparse is None else self._sparse.error

    def moved(self, vertices: Floats, report: Callable[[float], None]) -> Floats:
        """Return the moved points (p, 3). For vertices (n, 3); `report` takes the fraction done."""
        if self.weight_tolerance > 0.0:
            if self._sparse is None:
                mesh, prune = (self.points, self.triangles, self.positions), self.weight_tolerance
                self._sparse = sparse_mean_value_coordinates(*mesh, prune=prune, report=report)
            return sparse_transport(self._sparse, vertices)
        moved = np.empty_like(self.positions)
        for first in range(0, len(moved), _BLOCK):
            moved[first : first + _BLOCK] = transport(self._of_block(first), vertices)
            report(min(first + _BLOCK, len(moved)) / len(moved))
        return moved

    def keep_within(self, positions: Floats, vertices: Floats) -> None:
        """Move positions back to their rest distance outside. Positions (p, 3), in place; vertices (n, 3).

        Parity tells inside from outside: in a muscle that touches itself the nearest triangle may belong to
        the opposite side.
        """
        self._bent = tree_of_deformed(self._tree, vertices, self.triangles)
        outside = np.flatnonzero(~points_inside(positions, self._bent))
        _, nearest, distances = self._bent.nearest(positions[outside])
        far = distances > self.gap[outside]
        out, nearest = outside[far], nearest[far]
        part = (self.gap[out] / distances[far])[:, None]
        positions[out] = nearest + part * (positions[out] - nearest)

    def _of_block(self, first: int) -> Floats:
        """Return the weights of a block from point `first`."""
        if first in self._weights:
            return self._weights[first]
        block = self.positions[first : first + _BLOCK]
        weights = mean_value_coordinates(self.points, self.triangles, block)
        if weights.nbytes + sum(kept.nbytes for kept in self._weights.values()) <= _LARGEST_CACHE:
            self._weights[first] = weights
        return weights
