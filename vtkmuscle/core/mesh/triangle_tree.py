"""Nearest points and sides of a surface, by a tree."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakValueDictionary

import numpy as np

from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.shared import digest, shared
from vtkmuscle.core.mesh.surface import points_in_box
from vtkmuscle.core.mesh.tree_search import measure_nearest, pseudonormals, search_tree
from vtkmuscle.core.types import Floats, Ints

#: Most triangles in a leaf, on average.
PER_LEAF = 4
#: Distance of a point on the surface, as a part of the surface's size: too near for a direction away.
_ON_SURFACE = 1e-9


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Balanced tree of boxes around a surface's triangles.

    Each child of a box takes half of its triangles, parted across the axis of the centres' largest extent.
    All leaves are equally deep; the children of box i are the boxes 2 i + 1 and 2 i + 2.
    """

    points: Floats  # (n, 3)
    triangles: Ints  # (m, 3), m >= 1
    order: Ints  # (m,), triangles in the tree's order
    corners: Floats  # (m, 3, 3), of the triangles in the tree's order
    boxes: Floats  # (2^k - 1, 6), low and high corner of each box, level by level

    @cached_property
    def _normals(self) -> tuple[Floats, Ints]:
        return pseudonormals(self.points, self.triangles)

    def _nearest(self, queries: Floats) -> tuple[Ints, Floats, Floats, Ints]:
        """Return the nearest triangle, its nearest point, distance and region."""
        queries = np.ascontiguousarray(queries)
        nearest, regions = np.zeros((2, len(queries)), dtype=np.int64)
        closest, distances = np.zeros((len(queries), 3)), np.zeros(len(queries))
        memory = np.empty(64, dtype=np.int64), np.empty(64)
        search_tree(self.corners, self.boxes, queries, nearest, *memory)
        measure_nearest(self.corners, queries, nearest, closest, distances, regions)
        return self.order[nearest], closest, distances, regions

    def _sided(self, queries: Floats) -> tuple[Floats, Floats, Floats]:
        """Return signed distances, nearest points, and normals there. (q,), (q, 3) and (q, 3)."""
        triangles, closest, distances, regions = self._nearest(queries)
        normals, rows = self._normals
        at_closest = normals[rows[triangles, regions]]
        inside = np.einsum("ij,ij->i", queries - closest, at_closest) < 0.0
        return np.where(inside, -distances, distances), closest, at_closest

    def nearest(self, queries: Floats) -> tuple[Ints, Floats, Floats]:
        """Return nearest triangles, nearest points, and distances >= 0. Of points (q, 3)."""
        return self._nearest(queries)[:3]

    def signed(self, queries: Floats) -> tuple[Floats, Floats]:
        """Return distances (q,), negative inside, and nearest points (q, 3).

        The angle-weighted normal at the nearest point gives the sign: the surface must be closed, manifold
        and face outward. Points on the surface are outside.
        """
        return self._sided(queries)[:2]

    def depth(self, queries: Floats) -> Floats:
        """Return the depth (q,) in a closed surface. Of points (q, 3), 0 outside."""
        depth = np.zeros(len(queries))
        near = points_in_box(queries, self.boxes[0, :3], self.boxes[0, 3:])
        if len(near):
            depth[near] = np.maximum(-self.signed(queries[near])[0], 0.0)
        return depth

    def tangent_planes(self, queries: Floats) -> tuple[Floats, Floats, Floats]:
        """Return signed distances, nearest points, and unit normals (q, 3).

        The normal is the gradient of the distance; on the surface, the angle-weighted normal.
        """
        distances, closest, normals = self._sided(queries)
        size = float(np.abs(self.boxes[0, 3:] - self.boxes[0, :3]).max())
        away = (queries - closest) * np.where(distances < 0.0, -1.0, 1.0)[:, None]
        directions = np.where(np.abs(distances)[:, None] > _ON_SURFACE * size, away, normals)
        return distances, closest, unit_vectors(directions)


def triangle_tree(points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of a surface.

    Finite points (n, 3) and triangles (m, 3), m >= 1; the tree keeps both.
    """
    centres = (points[triangles[:, 0]] + points[triangles[:, 1]] + points[triangles[:, 2]]) / 3.0
    order, starts = np.arange(len(triangles)), _leaf_starts(len(triangles))
    width = len(starts)
    while width > 1:  # part each box across the longest extent of its centres, by a sort of all boxes
        first, parted = starts[::width], centres[order]
        low = np.minimum.reduceat(parted, first)
        extents = np.maximum.reduceat(parted, first) - low
        box, axis = (
            np.repeat(np.arange(len(first)), np.diff(first, append=len(order))),
            extents.argmax(axis=1),
        )
        scale = 0.5 / np.maximum(extents.max(axis=1), np.finfo(np.float64).tiny)
        heights = np.take_along_axis(parted - low[box], axis[box, None], axis=1)[:, 0]
        order = order[np.argsort(box + heights * scale[box])]
        width //= 2
    return _filled(points, triangles, order)


#: As :func:`triangle_tree`, with a common tree for all users of a surface.
shared_tree = shared(triangle_tree)


#: Trees of deformed surfaces in use, by their points.
_deformed: WeakValueDictionary[bytes, TriangleTree] = WeakValueDictionary()


def tree_of_deformed(rest: TriangleTree | None, points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of a deformed surface. It is common to its users.

    Transport and measures of fibres ask for nearest points on the same bent muscle. Triangles are in the
    order of a tree of the surface's rest shape, if any, which takes a quarter of the time of a new tree:
    neighbouring triangles stay neighbours, so boxes stay small. Results equal those of a new tree, except
    among equally near triangles.
    """
    key = digest(points)
    tree = _deformed.get(key)
    if tree is None or not np.array_equal(tree.triangles, triangles):
        points = points.copy()  # the caller's may change
        if rest is not None and np.array_equal(rest.triangles, triangles):
            tree = _filled(points, rest.triangles, rest.order)
        else:
            tree = triangle_tree(points, triangles.copy())
        _deformed[key] = tree
    return tree


def _filled(points: Floats, triangles: Ints, order: Ints) -> TriangleTree:
    """Return the tree of a surface with triangles in order."""
    corners = np.take(points, np.take(triangles, order, axis=0), axis=0).astype(np.float64, copy=False)
    starts, (a, b, c) = _leaf_starts(len(triangles)), corners.transpose(1, 0, 2)
    lows = [np.minimum.reduceat(np.minimum(np.minimum(a, b), c), starts)]
    highs = [np.maximum.reduceat(np.maximum(np.maximum(a, b), c), starts)]
    while len(lows[-1]) > 1:
        lows.append(np.minimum(lows[-1][::2], lows[-1][1::2]))
        highs.append(np.maximum(highs[-1][::2], highs[-1][1::2]))
    boxes = np.hstack([np.vstack(lows[::-1]), np.vstack(highs[::-1])])
    return TriangleTree(points, triangles, order, corners, boxes)


def _leaf_starts(count: int) -> Ints:
    """Return the first triangle of each leaf, (2^k,)."""
    n_leaves = 2 ** max(int(np.ceil(np.log2(count / PER_LEAF))), 0)
    starts: Ints = np.arange(n_leaves) * count // n_leaves
    return starts
