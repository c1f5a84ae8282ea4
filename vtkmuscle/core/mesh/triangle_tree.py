"""A tree of boxes around triangles: the nearest point of a surface, and on which side of it a point is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakValueDictionary

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.shared import digest, shared
from vtkmuscle.core.mesh.surface import points_in_box
from vtkmuscle.core.mesh.tree_search import (
    LANES,
    along_disc,
    measure_nearest,
    pseudonormals,
    search_in_packets,
    search_tree,
)
from vtkmuscle.core.types import Floats, Ints

#: Most triangles in a box of the lowest level, on average.
PER_LEAF = 4
#: Nearer than this part of its size, a point is on a surface: there is no direction away from it.
_ON_SURFACE = 1e-9
#: Discs are larger by this part of the coordinates, so that none is too small by rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """A balanced tree of boxes around the triangles of a surface.

    Half of the triangles of a box go to each of its children, parted across the axis along which their
    centres lie farthest apart. All leaves are equally deep, and the children of box i are the boxes 2 i + 1
    and 2 i + 2.
    """

    points: Floats  # (n, 3)
    triangles: Ints  # (m, 3), m >= 1
    order: Ints  # (m,), the triangle at each place of the tree's order
    corners: Floats  # (m, 3, 3), of the triangles in that order
    boxes: Floats  # (2^k - 1, 6), low and high corner of each box, level by level
    #: (2^(k - 1), 8), centre, unit axis, radius and half height of a cylinder around each leaf's triangles:
    #: thin for a flat piece of surface, whose distance it bounds far better than the box.
    discs: Floats

    @cached_property
    def _normals(self) -> tuple[Floats, Ints]:
        return pseudonormals(self.points, self.triangles)

    def _normals_at(self, places: Ints, regions: Ints) -> Floats:
        normals, rows = self._normals
        return normals[rows[self.order[places], regions]]

    def _nearest(self, queries: Floats, run: int = 0) -> tuple[Ints, Floats, Floats, Ints]:
        """Return the nearest triangle's place in the order, the point on it, its distance and region."""
        places, regions = np.zeros((2, len(queries)), dtype=np.int64)
        closest, distances = np.zeros((len(queries), 3)), np.zeros(len(queries))
        tree, memory = (self.corners, self.boxes, self.discs), (np.empty(64, dtype=np.int64), np.empty(64))
        if run:
            search_in_packets(*tree, queries, run, places, *memory, np.empty((5, LANES)))
        else:
            search_tree(*tree, queries, places, *memory)
        measure_nearest(self.corners, queries, places, closest, distances, regions)
        return places, closest, distances, regions

    def nearest(self, queries: Floats) -> tuple[Ints, Floats, Floats]:
        """Return the triangle nearest to each point (q, 3), its nearest point, and the distance >= 0."""
        places, closest, distances, _ = self._nearest(np.ascontiguousarray(queries))
        return self.order[places], closest, distances

    def signed(self, queries: Floats, *, run: int = 0) -> tuple[Floats, Floats]:
        """Return distances (q,), negative inside, and the nearest points (q, 3) of a closed surface.

        The sign is that of the angle-weighted normal at the nearest point: the surface must be closed,
        manifold and face outward. Points on it are outside. ``run`` is for points that come in runs of that
        many, each near those before it, as of a lattice: it takes half as long, and gives the same but for
        rounding, whatever other runs there are.
        """
        queries = np.ascontiguousarray(queries)
        places, closest, distances, regions = self._nearest(queries, run)
        normals = self._normals_at(places, regions)
        inside = np.einsum("ij,ij->i", queries - closest, normals) < 0.0
        return np.where(inside, -distances, distances), closest

    def depth(self, queries: Floats) -> Floats:
        """Return the depth (q,) of points (q, 3) in a closed surface as of :meth:`signed`, 0 outside."""
        depth = np.zeros(len(queries))
        near = points_in_box(queries, self.boxes[0, :3], self.boxes[0, 3:])
        if len(near):
            depth[near] = np.maximum(-self.signed(queries[near])[0], 0.0)
        return depth

    def tangent_planes(self, queries: Floats) -> tuple[Floats, Floats, Floats]:
        """Return distances and nearest points as :meth:`signed`, and unit normals (q, 3) at these.

        The normal is the direction of the distance's gradient; on the surface, the angle-weighted one.
        """
        places, closest, distances, regions = self._nearest(np.ascontiguousarray(queries))
        normals = self._normals_at(places, regions)
        away = queries - closest
        inside = np.einsum("ij,ij->i", away, normals) < 0.0
        distances = np.where(inside, -distances, distances)
        size = float(np.abs(self.boxes[0, 3:] - self.boxes[0, :3]).max())
        apart = np.abs(distances) > _ON_SURFACE * size
        directions = np.where(apart[:, None], away * np.where(inside, -1.0, 1.0)[:, None], normals)
        return distances, closest, unit_vectors(directions)


def triangle_tree(points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of a surface, finite points (n, 3) and triangles (m, 3), m >= 1, which it holds."""
    centres = (points[triangles[:, 0]] + points[triangles[:, 1]] + points[triangles[:, 2]]) / 3.0
    levels = max(int(np.ceil(np.log2(len(triangles) / PER_LEAF))), 0)
    order = np.arange(len(triangles))
    _share_out(centres, order, np.arange(2**levels + 1) * len(triangles) // 2**levels)
    return _filled(points, triangles, order)


#: As :func:`triangle_tree`; one tree for all users of a surface.
shared_tree = shared(triangle_tree)


#: The trees of deformed surfaces that somebody holds, by their points.
_deformed: WeakValueDictionary[bytes, TriangleTree] = WeakValueDictionary()


def tree_of_deformed(known: TriangleTree | None, points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of a surface in one of its shapes, the same object as long as anyone holds it.

    Carrying fibres, measuring them and judging the frame each ask for the nearest places on the same bent
    muscle. Triangles are in the order of the known tree of another shape of it, where there is one: that
    takes a quarter of the time of a new tree. Neighbouring triangles stay neighbours while a surface bends,
    so that the boxes stay small. Answers are those of a new tree, but for the choice among equally near
    triangles.
    """
    key = digest(points)
    tree = _deformed.get(key)
    if tree is None or not np.array_equal(tree.triangles, triangles):
        points = points.copy()  # the caller's may change
        if known is not None and np.array_equal(known.triangles, triangles):
            tree = _filled(points, known.triangles, known.order)
        else:
            tree = triangle_tree(points, triangles.copy())
        _deformed[key] = tree
    return tree


def _filled(points: Floats, triangles: Ints, order: Ints) -> TriangleTree:
    corners = np.take(points, np.take(triangles, order, axis=0), axis=0).astype(np.float64, copy=False)
    n_leaves = 2 ** max(int(np.ceil(np.log2(len(triangles) / PER_LEAF))), 0)
    boxes, discs = np.empty((2 * n_leaves - 1, 6)), np.empty((n_leaves, 8))
    _enclose(corners, boxes, discs)
    return TriangleTree(points, triangles, order, corners, boxes, discs)


@kernel
def _share_out(centres: Floats, order: Ints, starts: Ints) -> None:
    """Order triangles so that each half of a box's, each half of these and so on lie apart.

    centres : (m, 3); order : (m,), changed in place; starts : (2^k + 1,), first triangle of each leaf, and m.
    """
    n_leaves = len(starts) - 1
    width = n_leaves
    while width > 1:
        for leaf in range(0, n_leaves, width):
            first, middle, last = starts[leaf], starts[leaf + width // 2], starts[leaf + width]
            axis, longest = int(np.int64(0)), -1.0  # a constant would be compiled apart
            for k in range(3):
                low, high = np.inf, -np.inf
                for i in range(first, last):
                    low, high = min(low, centres[order[i], k]), max(high, centres[order[i], k])
                if high - low > longest:
                    axis, longest = k, high - low
            _part(centres, axis, order, first, middle, last)
        width //= 2


@kernel
def _part(centres: Floats, axis: int, order: Ints, first: int, middle: int, last: int) -> None:
    """Put the least of order[first:last] along an axis before ``middle`` (Hoare 1961, quickselect)."""
    low, high = first, last - 1
    while low < high:
        pivot = centres[order[(low + high) // 2], axis]
        i, j = low, high
        while i <= j:
            while centres[order[i], axis] < pivot:
                i += 1
            while centres[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break


@kernel
def _enclose(corners: Floats, boxes: Floats, discs: Floats) -> None:
    """Write the boxes of a tree, from its leaves to its root, and the discs of its leaves."""
    n, n_leaves = len(corners), len(discs)
    for leaf in range(n_leaves):
        first, last = leaf * n // n_leaves, (leaf + 1) * n // n_leaves
        disc, box = discs[leaf], boxes[n_leaves - 1 + leaf]
        for k in range(8):
            disc[k] = 0.0
        for k in range(3):
            box[k], box[3 + k] = np.inf, -np.inf
        for i in range(first, last):
            a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
            for k in range(3):
                p, q = (k + 1) % 3, (k + 2) % 3
                disc[k] += (a[k] + b[k] + c[k]) / (3 * (last - first))
                disc[3 + k] += (b[p] - a[p]) * (c[q] - a[q]) - (b[q] - a[q]) * (c[p] - a[p])
        length = np.sqrt(disc[3] * disc[3] + disc[4] * disc[4] + disc[5] * disc[5])
        for k in range(3):
            disc[3 + k] = disc[3 + k] / length if length > 0.0 else 1.0 * (k == 0)
        for i in range(first, last):
            for corner in range(3):
                up, aside = along_disc(
                    disc, corners[i, corner, 0], corners[i, corner, 1], corners[i, corner, 2]
                )
                disc[6], disc[7] = max(disc[6], aside), max(disc[7], abs(up))
                for k in range(3):
                    box[k] = min(box[k], corners[i, corner, k])
                    box[3 + k] = max(box[3 + k], corners[i, corner, k])
        size = abs(disc[0]) + abs(disc[1]) + abs(disc[2]) + disc[6] + disc[7]
        disc[6], disc[7] = disc[6] + _ROUNDING * size, disc[7] + _ROUNDING * size
    for node in range(n_leaves - 2, -1, -1):
        for k in range(3):
            boxes[node, k] = min(boxes[2 * node + 1, k], boxes[2 * node + 2, k])
            boxes[node, 3 + k] = max(boxes[2 * node + 1, 3 + k], boxes[2 * node + 2, 3 + k])
