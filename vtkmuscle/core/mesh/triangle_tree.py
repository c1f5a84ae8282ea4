"""Nearest points and sides of a surface, by a tree."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple
from weakref import WeakValueDictionary

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import LANES, kernel
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.shared import digest, shared
from vtkmuscle.core.mesh.smooth_normals import smooth_normals
from vtkmuscle.core.mesh.surface import edge_lengths, half_edges, longest_side
from vtkmuscle.core.mesh.tree_search import find_inside, lower_distances, search_tree
from vtkmuscle.core.types import ROUNDING, Bools, Floats, Ints

#: Shift of a triangle's centre by its number, as a part of the surface's size: orders equal centres.
_SLOPE = 1e-12
#: Enlargement of boxes, as a part of the coordinates: rounding must hide no triangle from a ray.
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Balanced tree of boxes around a surface's triangles.

    Each child of a box takes half of its triangles, parted across the axis of the centres' largest extent.
    All leaves are equally deep; the children of box i are the boxes 2 i + 1 and 2 i + 2.
    """

    points: Floats  # (n, 3)
    triangles: Ints  # (m, 3), m >= 1
    order: Ints  # (m,), triangles in the tree's order
    boxes: Floats  # (2 l - 1, 6), low and high corner of each box, level by level, the l leaves last
    leaves: Ints  # (l + 1,), the first triangle of each leaf, and m
    corners: Floats  # (l, 9, LANES), of each leaf's triangles, side by side; the last one fills up the leaf

    @cached_property
    def mean_edge(self) -> float:
        """Mean length of the triangles' edges."""
        return float(edge_lengths(self.points, half_edges(self.triangles)).mean())

    @cached_property
    def _rays(self) -> tuple[int, float]:
        """Axis of rays and slack of boxes. Across a long muscle, along its least extent, few are in line."""
        box = self.boxes[0]
        return int((box[3:] - box[:3]).argmin()), _ROUNDING * float(np.abs(box).max())

    def lower(self, distances: Floats, queries: Floats, *, unsigned: bool = False) -> None:
        """Lower distances (q,) of points (q, 3) to the signed distances from the surface, in place."""
        tree, (along, slack) = (self.corners, self.boxes, self.leaves), self._rays
        lower_distances(*tree, along, slack, unsigned, queries, distances, *_memory())

    def nearest(self, queries: Floats) -> tuple[Ints, Floats, Floats]:
        """Return nearest triangles, nearest points, and distances >= 0. Of points (q, 3)."""
        nearest, distances = np.zeros(len(queries), dtype=np.int64), np.zeros(len(queries))
        queries, closest = np.ascontiguousarray(queries), np.zeros((len(queries), 3))
        search_tree(self.corners, self.boxes, self.leaves, queries, nearest, closest, distances, *_memory())
        return self.order[nearest], closest, distances

    def inside(self, queries: Floats) -> Bools:
        """Return which points (q, 3) are inside a closed surface.

        Triangles may face either side and cross: the winding number is not 0 inside. A point on the surface
        is on either side.
        """
        inside = np.zeros(len(queries), dtype=np.bool_)
        tree, (stack, _, sides) = (self.corners, self.boxes, self.leaves), _memory()
        find_inside(np.ascontiguousarray(queries), *tree, *self._rays, stack, sides, inside)
        return inside

    def depth(self, queries: Floats) -> Floats:
        """Return the depth (q,) in a closed surface. Of points (q, 3), 0 outside."""
        depth, inside = np.zeros(len(queries)), self.inside(queries)
        depth[inside] = self.nearest(queries[inside])[2]
        return depth

    def tangent_planes(self, queries: Floats) -> tuple[Floats, Floats, Floats]:
        """Return signed distances, nearest points, and unit normals (q, 3).

        The normal is the gradient of the distance; on the surface, the surface's smooth normal.
        """
        nearest, closest, distances = self.nearest(queries)
        sides, size = np.where(self.inside(queries), -1.0, 1.0), np.ptp(self.boxes[0].reshape(2, 3), axis=0)
        outward, on = (queries - closest) * sides[:, None], distances <= ROUNDING * size.max()
        if on.any():
            outward[on] = smooth_normals(self.points, self.triangles, nearest[on], closest[on])
        return sides * distances, closest, unit_vectors(outward)


def _memory() -> tuple[Ints, Floats, Floats]:
    """Return working memory of a search: a stack as deep as any tree, and a leaf's distances."""
    return np.empty(64, dtype=np.int64), np.empty(64), np.empty(LANES)


def triangle_tree(points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of finite points (n, 3) and triangles (m, 3), m >= 1, and keep both."""
    centres = (points[triangles[:, 0]] + points[triangles[:, 1]] + points[triangles[:, 2]]) / 3.0
    # Equal centres are parted by their order: each half of a box is as large as a leaf expects.
    centres += _SLOPE * longest_side(centres) * np.arange(len(centres))[:, None]
    return _filled(points, triangles, cKDTree(centres, leafsize=LANES).indices)


#: As :func:`triangle_tree`, with a common tree for all users of a surface.
shared_tree = shared(triangle_tree)


#: Trees of deformed surfaces in use, by their points.
_deformed: WeakValueDictionary[bytes, TriangleTree] = WeakValueDictionary()


def tree_of_deformed(rest: TriangleTree | None, points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of a deformed surface. It is common to its users.

    Transport and measures of fibres ask for nearest points on the same bent muscle. Triangles are in the
    order of a tree of the surface's rest shape, if any: neighbours stay neighbours, so boxes stay small.
    Results equal those of a new tree, except among equally near triangles.
    """
    key = digest(points)
    tree = _deformed.get(key)
    if tree is None or not np.array_equal(tree.triangles, triangles):
        points, triangles = points.copy(), triangles.copy()  # the caller's may change
        if rest is not None and np.array_equal(rest.triangles, triangles):
            tree = _filled(points, triangles, rest.order)
        else:
            tree = triangle_tree(points, triangles)
        _deformed[key] = tree
    return tree


def _filled(points: Floats, triangles: Ints, order: Ints) -> TriangleTree:
    """Return the tree of a surface with triangles in order."""
    leaves = _leaf_bounds(len(triangles))
    boxes, corners = np.empty((2 * len(leaves) - 3, 6)), np.empty((len(leaves) - 1, 9, LANES))
    _fill(points.astype(np.float64, copy=False), triangles, order, leaves, boxes, corners)
    return TriangleTree(points, triangles, order, boxes, leaves, corners)


@kernel
def _fill(points: Floats, triangles: Ints, order: Ints, leaves: Ints, boxes: Floats, corners: Floats) -> None:
    n_leaves = len(leaves) - 1
    for leaf in range(n_leaves):
        box = boxes[n_leaves - 1 + leaf]
        box[:3], box[3:] = np.inf, -np.inf
        for k in range(LANES):
            triangle = triangles[order[min(leaves[leaf] + k, leaves[leaf + 1] - 1)]]
            for c in range(9):
                value = points[triangle[c // 3], c % 3]
                corners[leaf, c, k] = value
                box[c % 3], box[3 + c % 3] = min(box[c % 3], value), max(box[3 + c % 3], value)
    for node in range(n_leaves - 2, -1, -1):
        left, right = boxes[2 * node + 1], boxes[2 * node + 2]
        for c in range(3):
            boxes[node, c], boxes[node, 3 + c] = min(left[c], right[c]), max(left[3 + c], right[3 + c])


@lru_cache(16)
def _leaf_bounds(count: int) -> Ints:
    """Return the first triangle of each leaf, and the count, (2^k + 1,); boxes are halved, rounded down."""
    bounds = np.array([0, count])
    while np.diff(bounds).max() > LANES:
        bounds = np.insert(bounds, np.arange(1, len(bounds)), (bounds[:-1] + bounds[1:]) // 2)
    return bounds


#: Displacement within which a neighbour's surface counts as flat, as a part of its mean edge. With half and
#: twice of it overlaps of muscles of a hip change by at most 0.04 mm, and lengths of fibres by 0.001 mm.
_FLAT = 0.25


class Neighbour(NamedTuple):
    """A neighbouring muscle: its tree now, and allowed depths.

    The surface faces outward [mm]; the allowance (n,) is the depth in the neighbour of each point of the
    muscle at rest [mm].
    """

    tree: TriangleTree
    allowance: Floats


#: Neighbouring muscles now.
Near = Sequence[Neighbour]


class MuscleContact:
    """Neighbours of a muscle during a step. They stand still.

    A point deeper in a neighbour than at rest goes to the tangent plane at the nearest point of the
    neighbour. The plane is updated after a displacement of a part of the neighbour's edges. Points with
    ``free`` (n,) may move; ``centre`` (3,) is their origin in the scene [mm].
    """

    def __init__(self, neighbours: Sequence[Neighbour], free: Bools, centre: Floats) -> None:
        self._free, self._centre = free, centre
        # Each neighbour, the planes of all points (two arrays), the points then, and the squared displacement
        # until the next test.
        self._planes = [(near, *np.zeros((3, len(free), 3)), np.full(len(free), -1.0)) for near in neighbours]

    def keep_out(self, p: Floats) -> Bools:
        """Move positions out of the neighbours, in place. Positions (n, 3); returns the moved points (n,)."""
        hit = np.zeros(len(p), dtype=np.bool_)
        for (tree, allowance), nearest, normal, seen_from, valid_for in self._planes:
            low, high = tree.boxes[0, :3] - self._centre, tree.boxes[0, 3:] - self._centre
            boxed = np.flatnonzero(self._free & ((p >= low) & (p <= high)).all(axis=1))
            moved = p[boxed] - seen_from[boxed]
            stale = boxed[np.einsum("ij,ij->i", moved, moved) > valid_for[boxed]]
            if len(stale):
                distance, closest, normal[stale] = tree.tangent_planes(p[stale] + self._centre)
                nearest[stale], seen_from[stale] = closest - self._centre, p[stale]
                valid_for[stale] = np.maximum(distance, _FLAT * tree.mean_edge) ** 2
            height = np.einsum("ij,ij->i", p[boxed] - nearest[boxed], normal[boxed])
            push = -allowance[boxed] - height
            deep = boxed[push > 0.0]
            p[deep] += push[push > 0.0, None] * normal[deep]
            hit[deep] = True
        return hit
