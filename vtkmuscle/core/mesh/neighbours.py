"""Contact of a muscle with other muscles beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.types import Bools, Floats

#: Part of its distance from a neighbour that a point may move before it is tested again.
_SURELY_CLEAR = 0.9

#: Part of a neighbour's mean edge within which its surface counts as flat.
_FLAT = 0.25


@dataclass(frozen=True, eq=False)
class Neighbour:
    """Another muscle: the tree of its surface, facing outward, in the scene now [mm].

    The allowance (n,) is the depth that each point of the muscle may have in it [mm]: its depth at rest.
    """

    tree: TriangleTree
    allowance: Floats


class MuscleContact:
    """The neighbours of a muscle during one step, in which they stand still.

    A point that is deeper in a neighbour than at rest goes to the plane that touches the neighbour at its
    place nearest to the point. The plane is updated when the point has moved by a part of the neighbour's
    edges. Points may be moved where ``free`` (n,); ``centre`` (3,) is their origin in the scene [mm].
    """

    def __init__(self, neighbours: Sequence[Neighbour], free: Bools, centre: Floats) -> None:
        self._planes = [_Planes(neighbour, len(free)) for neighbour in neighbours]
        self._free = free
        self._centre = centre

    def keep_out(self, p: Floats) -> Bools:
        """Move predicted positions (n, 3) out of the neighbours, in place; return which were moved, (n,)."""
        hit = np.zeros(len(p), dtype=np.bool_)
        for planes in self._planes:
            hit |= planes.keep_out(p, self._free, self._centre)
        return hit


class _Planes:
    """The tangent plane of a neighbouring muscle at the point nearest to each point of the muscle."""

    def __init__(self, neighbour: Neighbour, n_points: int) -> None:
        self._neighbour = neighbour
        self._seen_from, self._place, self._normal = np.zeros((3, n_points, 3))
        self._valid_for = np.full(n_points, -1.0)  # squared distance that a point may move from there
        corners = neighbour.tree.corners
        self._detail = _FLAT * float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    def keep_out(self, p: Floats, free: Bools, centre: Floats) -> Bools:
        neighbour = self._neighbour
        low, high = neighbour.tree.boxes[0, :3] - centre, neighbour.tree.boxes[0, 3:] - centre
        near = np.flatnonzero(free & ((p >= low) & (p <= high)).all(axis=1))
        hit = np.zeros(len(p), dtype=np.bool_)
        if not len(near):
            return hit
        moved = p[near] - self._seen_from[near]
        stale = near[np.einsum("ij,ij->i", moved, moved) > self._valid_for[near]]
        if len(stale):
            distance, place, normal = neighbour.tree.tangent_planes(p[stale] + centre)
            self._seen_from[stale] = p[stale]
            self._valid_for[stale] = np.maximum(_SURELY_CLEAR * distance, self._detail) ** 2
            self._place[stale], self._normal[stale] = place - centre, normal
        height = np.einsum("ij,ij->i", p[near] - self._place[near], self._normal[near])
        push = -neighbour.allowance[near] - height
        deep = push > 0.0
        p[near[deep]] += push[deep, None] * self._normal[near[deep]]
        hit[near[deep]] = True
        return hit
