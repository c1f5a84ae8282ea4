"""Contact of a muscle with neighbouring muscles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.types import Bools, Floats

#: Displacement after which a point is tested again, as a part of its distance from the neighbour.
_SURELY_CLEAR = 0.9

#: Displacement within which a neighbour's surface counts as flat, as a part of its mean edge.
_FLAT = 0.25


class Neighbour(NamedTuple):
    """A neighbouring muscle: its tree now, and allowed depths.

    The surface faces outward [mm]; the allowance (n,) is the depth in the neighbour of each point of the
    muscle at rest [mm].
    """

    tree: TriangleTree
    allowance: Floats


class MuscleContact:
    """Neighbours of a muscle during a step. They stand still.

    A point deeper in a neighbour than at rest goes to the tangent plane at the nearest point of the
    neighbour. The plane is updated after a displacement of a part of the neighbour's edges. Points with
    ``free`` (n,) may move; ``centre`` (3,) is their origin in the scene [mm].
    """

    def __init__(self, neighbours: Sequence[Neighbour], free: Bools, centre: Floats) -> None:
        self._planes = [_Planes(neighbour, len(free)) for neighbour in neighbours]
        self._free = free
        self._centre = centre

    def keep_out(self, p: Floats) -> Bools:
        """Move positions out of the neighbours, in place. Positions (n, 3); returns the moved points (n,)."""
        hit = np.zeros(len(p), dtype=np.bool_)
        for planes in self._planes:
            hit |= planes.keep_out(p, self._free, self._centre)
        return hit


class _Planes:
    """Tangent planes of a neighbour, nearest to the muscle's points."""

    def __init__(self, neighbour: Neighbour, n_points: int) -> None:
        self._neighbour = neighbour
        self._seen_from, self._nearest, self._normal = np.zeros((3, n_points, 3))
        self._valid_for = np.full(n_points, -1.0)  # squared displacement until the next test
        corners = neighbour.tree.corners
        self._detail = _FLAT * float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    def keep_out(self, p: Floats, free: Bools, centre: Floats) -> Bools:
        neighbour, hit = self._neighbour, np.zeros(len(p), dtype=np.bool_)
        low, high = neighbour.tree.boxes[0, :3] - centre, neighbour.tree.boxes[0, 3:] - centre
        boxed = np.flatnonzero(free & ((p >= low) & (p <= high)).all(axis=1))
        moved = p[boxed] - self._seen_from[boxed]
        stale = boxed[np.einsum("ij,ij->i", moved, moved) > self._valid_for[boxed]]
        if len(stale):
            distance, nearest, normal = neighbour.tree.tangent_planes(p[stale] + centre)
            self._seen_from[stale] = p[stale]
            self._valid_for[stale] = np.maximum(_SURELY_CLEAR * distance, self._detail) ** 2
            self._nearest[stale], self._normal[stale] = nearest - centre, normal
        height = np.einsum("ij,ij->i", p[boxed] - self._nearest[boxed], self._normal[boxed])
        push = -neighbour.allowance[boxed] - height
        deep = boxed[push > 0.0]
        p[deep] += push[push > 0.0, None] * self._normal[deep]
        hit[deep] = True
        return hit
