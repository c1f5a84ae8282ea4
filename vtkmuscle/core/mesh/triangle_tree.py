"""A tree of boxes around triangles: the nearest point of a surface, and on which side of it a point is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.triangle_distance import FACE, nearest_on_triangle, pseudonormals
from vtkmuscle.core.types import Floats, Ints

#: Triangles in a box of the lowest level, on average at most.
PER_LEAF = 4
#: Nearer than this part of its size, a point is on a surface: there is no direction away from it.
_ON_SURFACE = 1e-9
#: A surface with this many triangles per query is large: normals are computed where they are needed.
_FEW = 2
#: Bits of each coordinate in the order along the Z curve.
_BITS = 10


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """A balanced tree of boxes around the triangles of a surface.

    Triangles are ordered along the Z curve of their centres and shared out evenly to the leaves (Lauterbach
    et al. 2009, *Fast BVH construction on GPUs*, doi:10.1111/j.1467-8659.2009.01377.x): quick to build, and
    the tree needs no links, for the children of box i are the boxes 2 i + 1 and 2 i + 2.

    Attributes
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions; point ids, m >= 1.
    order : (m,) int array
        Which triangle is at which place of the order.
    corners : (m, 3, 3) array
        Corners of the triangles in that order.
    boxes : (2^k - 1, 6) array
        Low and high corner of each box, level by level.
    """

    points: Floats
    triangles: Ints
    order: Ints
    corners: Floats
    boxes: Floats

    @cached_property
    def _normals(self) -> Floats:
        return pseudonormals(self.points, self.triangles)[self.order]

    def _normals_at(self, places: Ints, regions: Ints) -> Floats:
        """Return the angle-weighted normals of regions of triangles, (q, 3).

        Where few are asked for, only those around these triangles are computed.
        """
        if "_normals" in vars(self) or not 0 < _FEW * len(places) <= len(self.triangles):
            known: Floats = self._normals[places, regions]
            return known
        found = self.order[places]
        at_corner = np.zeros(len(self.points), dtype=np.bool_)
        at_corner[self.triangles[found]] = True
        around = at_corner[self.triangles].any(axis=1)
        normals = pseudonormals(self.points, self.triangles[around])
        chosen: Floats = normals[(np.cumsum(around) - 1)[found], regions]
        return chosen

    def nearest(self, queries: Floats) -> tuple[Ints, Floats, Floats]:
        """Return what of the surface is nearest to points.

        Parameters
        ----------
        queries : (q, 3) array
            Positions.

        Returns
        -------
        triangle : (q,) int array
            The nearest triangle.
        closest : (q, 3) array
            The nearest point, on that triangle.
        distance : (q,) array
            How far it is, >= 0.
        """
        places, closest, distances, _ = _nearest(self.corners, self.boxes, np.ascontiguousarray(queries))
        return self.order[places], closest, distances

    def signed(self, queries: Floats) -> tuple[Floats, Floats]:
        """Return distances (q,), negative inside, and the nearest points (q, 3) of a closed surface.

        The sign is that of the angle-weighted normal at the nearest point: for surfaces that are closed,
        manifold and face outward. Points on the surface are outside.
        """
        places, closest, distances, regions = _nearest(
            self.corners, self.boxes, np.ascontiguousarray(queries)
        )
        normals = self._normals[places, regions]
        inside = np.einsum("ij,ij->i", queries - closest, normals) < 0.0
        return np.where(inside, -distances, distances), closest

    def tangent_planes(self, queries: Floats) -> tuple[Floats, Floats, Floats]:
        """Return distances and nearest points as :meth:`signed`, and unit normals (q, 3) at these.

        The normal is the direction of the distance's gradient; on the surface, the angle-weighted one. For
        surfaces that are asked once: few queries take the time of few triangles.
        """
        places, closest, distances, regions = _nearest(
            self.corners, self.boxes, np.ascontiguousarray(queries)
        )
        normals = self._normals_at(places, regions)
        away = queries - closest
        inside = np.einsum("ij,ij->i", away, normals) < 0.0
        distances = np.where(inside, -distances, distances)
        size = float(np.abs(self.boxes[0, 3:] - self.boxes[0, :3]).max())
        apart = np.abs(distances) > _ON_SURFACE * size
        directions = np.where(apart[:, None], away * np.where(inside, -1.0, 1.0)[:, None], normals)
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        unit = np.divide(directions, lengths, out=np.zeros_like(directions), where=lengths > 0.0)
        return distances, closest, unit


def triangle_tree(points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of a surface.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions, finite; point ids, m >= 1.

    Returns
    -------
    TriangleTree
        Holds the arrays that were given.
    """
    corners = np.ascontiguousarray(points[triangles], dtype=np.float64)
    centres = corners.mean(axis=1)
    inner = centres - centres.min(axis=0)
    cells = inner * ((2**_BITS - 1) / (float(inner.max()) or 1.0))
    order = np.argsort(_z_order(cells.astype(np.int64)), kind="stable")
    corners = corners[order]
    levels = max(int(np.ceil(np.log2(len(triangles) / PER_LEAF))), 0)
    return TriangleTree(points, triangles, order, corners, _boxes(corners, 2**levels))


@array_kernel
def _z_order(cells: Ints) -> Ints:
    """Return the number along the Z curve of cells (m, 3)."""
    result = np.zeros(len(cells), dtype=np.int64)
    for i in range(len(cells)):
        for bit in range(_BITS):
            for axis in range(3):
                result[i] |= ((cells[i, axis] >> bit) & 1) << (3 * bit + axis)
    return result


@array_kernel
def _boxes(corners: Floats, n_leaves: int) -> Floats:
    boxes = np.empty((2 * n_leaves - 1, 6))
    n = len(corners)
    for leaf in range(n_leaves):
        box = boxes[n_leaves - 1 + leaf]
        for axis in range(3):
            box[axis], box[3 + axis] = np.inf, -np.inf
        for i in range(leaf * n // n_leaves, (leaf + 1) * n // n_leaves):
            for corner in range(3):
                for axis in range(3):
                    box[axis] = min(box[axis], corners[i, corner, axis])
                    box[3 + axis] = max(box[3 + axis], corners[i, corner, axis])
    for node in range(n_leaves - 2, -1, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node + 1, axis], boxes[2 * node + 2, axis])
            boxes[node, 3 + axis] = max(boxes[2 * node + 1, 3 + axis], boxes[2 * node + 2, 3 + axis])
    return boxes


@kernel
def _distance2_to_box(box: Floats, x: float, y: float, z: float) -> float:
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    distance2: float = dx * dx + dy * dy + dz * dz
    return distance2


@kernel
def _foot(corners: Floats, query: Floats, foot: Floats) -> float:
    """Put the foot of the perpendicular onto a triangle's plane into foot (3,); return its length.

    For needles of triangles it has more digits than barycentric coordinates give.
    """
    a, b, c = corners[0], corners[1], corners[2]
    nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
    ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
    nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    double_area2 = nx * nx + ny * ny + nz * nz
    rise = (query[0] - a[0]) * nx + (query[1] - a[1]) * ny + (query[2] - a[2]) * nz
    foot[0] = query[0] - nx * rise / double_area2
    foot[1] = query[1] - ny * rise / double_area2
    foot[2] = query[2] - nz * rise / double_area2
    length: float = abs(rise) / np.sqrt(double_area2)
    return length


def _nearest(corners: Floats, boxes: Floats, queries: Floats) -> tuple[Ints, Floats, Floats, Ints]:
    """Return the nearest triangle (its place in the order), the point on it, its distance and region."""
    places = np.zeros(len(queries), dtype=np.int64)
    regions = np.zeros(len(queries), dtype=np.int64)
    closest, distances = np.zeros((len(queries), 3)), np.zeros(len(queries))
    stack, near = np.empty(64, dtype=np.int64), np.empty(64)
    _search(corners, boxes, queries, places, closest, distances, regions, stack, near)
    return places, closest, distances, regions


@kernel
def _search(
    corners: Floats,
    boxes: Floats,
    queries: Floats,
    places: Ints,
    closest: Floats,
    distances: Floats,
    regions: Ints,
    stack: Ints,
    near: Floats,
) -> None:
    """Write what :func:`_nearest` returns; the last two are working memory, as deep as the tree."""
    n, n_leaves = len(corners), (len(boxes) + 1) // 2
    place = 0  # the last query's answer is a good guess: neighbours follow each other along a fibre
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        a, b, c = corners[place, 0], corners[place, 1], corners[place, 2]
        cx, cy, cz, region = nearest_on_triangle(x, y, z, a, b, c)
        best = (cx - x) ** 2 + (cy - y) ** 2 + (cz - z) ** 2
        if not best >= 0.0:  # a triangle without area: its neighbours have its edges too
            best = np.inf
        stack[0], near[0], size = 0, 0.0, 1
        while size:
            size -= 1
            node = stack[size]
            if near[size] >= best:
                continue
            if node < n_leaves - 1:
                left, right = 2 * node + 1, 2 * node + 2
                to_left = _distance2_to_box(boxes[left], x, y, z)
                to_right = _distance2_to_box(boxes[right], x, y, z)
                if to_left < to_right:
                    left, right, to_left, to_right = right, left, to_right, to_left
                stack[size], near[size] = left, to_left
                stack[size + 1], near[size + 1] = right, to_right
                size += 2
                continue
            leaf = node - (n_leaves - 1)
            for i in range(leaf * n // n_leaves, (leaf + 1) * n // n_leaves):
                a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
                px, py, pz, where = nearest_on_triangle(x, y, z, a, b, c)
                distance2 = (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
                if distance2 < best:
                    best, place, region = distance2, i, where
                    cx, cy, cz = px, py, pz
        places[q], regions[q], distances[q] = place, region, np.sqrt(best)
        closest[q, 0], closest[q, 1], closest[q, 2] = cx, cy, cz
        if region == FACE:
            distances[q] = _foot(corners[place], queries[q], closest[q])
