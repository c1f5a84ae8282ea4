"""Points embedded in a muscle's surface by mean value coordinates: equation 8 of the 2021 paper."""

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

#: Points whose weights are computed together: bounds the steps of progress and the time to abort.
_BLOCK = 256
#: Size up to which weights are kept [bytes]; other weights are computed again for each frame.
_LARGEST_CACHE = 2**31
#: Points nearer to the surface than this part of the muscle's size do not count as outside.
_ON_SURFACE = 1e-6


class EmbeddedPoints:
    """Points that move with a surface, each the mean of its vertices by mean value coordinates.

    Kohout, Cervenka 2021, eq. 8, doi:10.1007/978-3-030-72379-8_24.

    Parameters
    ----------
    positions : (p, 3) array
        The points at rest [mm].
    points, triangles : (n, 3) and (m, 3) arrays
        The closed surface at rest [mm], and point ids.
    weight_tolerance : float
        Tolerance for merging vertices into groups of one weight; 0 merges nothing
        (:func:`~vtkmuscle.core.fibres.sparse_weights.sparse_mean_value_coordinates`).
    """

    def __init__(self, positions: Floats, points: Floats, triangles: Ints, weight_tolerance: float) -> None:
        self.positions, self.points, self.triangles = positions, points, triangles
        self.weight_tolerance = weight_tolerance
        self._sparse: SparseWeights | None = None
        self._weights: dict[int, Floats] = {}
        self._bent: TriangleTree | None = None

    def same_as(self, positions: Floats, points: Floats, triangles: Ints, weight_tolerance: float) -> bool:
        """Return whether these are the arguments that the object was made from."""
        arrays = (self.positions, positions), (self.points, points), (self.triangles, triangles)
        return self.weight_tolerance == weight_tolerance and all(np.array_equal(*pair) for pair in arrays)

    @cached_property
    def gap(self) -> Floats:
        """Distances of the points from the muscle at rest, (p,) [mm], 0 inside."""
        within = solids_of(self.points, self.triangles).into(self.positions)
        distances: Floats = np.linalg.norm(within - self.positions, axis=1)
        return distances

    @cached_property
    def _tree(self) -> TriangleTree:
        return shared_tree(self.points, self.triangles)

    @cached_property
    def n_outside(self) -> int:
        """Number of points outside of the muscle at rest."""
        return int((self.gap > _ON_SURFACE * np.linalg.norm(np.ptp(self.points, axis=0))).sum())

    @property
    def error(self) -> float:
        """Largest error of the merged weights [mm], for a muscle bent by about a radian."""
        return 0.0 if self._sparse is None else self._sparse.error

    def moved(self, vertices: Floats, report: Callable[[float], None]) -> Floats:
        """Return the weighted means (p, 3) of vertices (n, 3); `report` is called with the part done."""
        if self.weight_tolerance > 0.0:
            if self._sparse is None:
                self._sparse = sparse_mean_value_coordinates(
                    self.points,
                    self.triangles,
                    self.positions,
                    prune=self.weight_tolerance,
                    report=lambda part: report(0.9 * part),
                )
            moved = sparse_transport(self._sparse, vertices)
            report(1.0)
            return moved
        moved = np.empty_like(self.positions)
        for first in range(0, len(moved), _BLOCK):
            moved[first : first + _BLOCK] = transport(self._of_block(first), vertices)
            report(min(first + _BLOCK, len(moved)) / len(moved))
        return moved

    def keep_within(self, positions: Floats, vertices: Floats) -> None:
        """Move positions (p, 3), in place, that are farther outside of vertices (n, 3) than at rest.

        Parity decides about the inside: the triangle nearest to a point of a muscle that touches itself may
        belong to the other side.
        """
        self._bent = tree_of_deformed(self._tree, vertices, self.triangles)
        outside = np.flatnonzero(~points_inside(positions, self._bent))
        _, nearest, distances = self._bent.nearest(positions[outside])
        far = distances > self.gap[outside]
        out, nearest = outside[far], nearest[far]
        part = (self.gap[out] / distances[far])[:, None]
        positions[out] = nearest + part * (positions[out] - nearest)

    def _of_block(self, first: int) -> Floats:
        """Return the weights of a block of points, from number `first` on."""
        if first in self._weights:
            return self._weights[first]
        block = self.positions[first : first + _BLOCK]
        weights = mean_value_coordinates(self.points, self.triangles, block)
        if weights.nbytes + sum(kept.nbytes for kept in self._weights.values()) <= _LARGEST_CACHE:
            self._weights[first] = weights
        return weights
