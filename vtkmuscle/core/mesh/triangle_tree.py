"""Nearest points and sides of a surface, by a tree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple
from weakref import WeakValueDictionary

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import LANES, kernel, lane, vector_kernel
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.shared import digest, shared
from vtkmuscle.core.mesh.surface import numbered_edges
from vtkmuscle.core.mesh.winding import find_inside, is_inside
from vtkmuscle.core.types import ROUNDING, Bools, Floats, Ints

#: Shift of a triangle's centre by its number, as a part of the surface's size.
_SLOPE = 1e-12
#: Enlargement of boxes, as a part of the coordinates: rounding must hide no triangle from a ray.
_ROUNDING = 1e-14
#: Keeps a division by nothing finite.
_TINY = float(np.finfo(np.float64).tiny)


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
        corners = self.points[self.triangles]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    @cached_property
    def _normals(self) -> tuple[Floats, Ints]:
        """Normals and rows of :func:`pseudonormals`, rows in the tree's order."""
        normals, rows = pseudonormals(self.points, self.triangles)
        return normals, rows[self.order]

    def _nearest(self, queries: Floats) -> tuple[Ints, Floats, Floats, Ints]:
        """Return the nearest triangle in the tree's order, its nearest point, distance and region."""
        nearest, regions = np.zeros((2, len(queries)), dtype=np.int64)
        closest, distances = np.zeros((len(queries), 3)), np.zeros(len(queries))
        queries, tree = np.ascontiguousarray(queries), (self.corners, self.boxes, self.leaves)
        search_tree(*tree, queries, nearest, closest, distances, regions, *_memory())
        return nearest, closest, distances, regions

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
        nearest, closest, distances, _ = self._nearest(queries)
        return self.order[nearest], closest, distances

    def inside(self, queries: Floats) -> Bools:
        """Return which points (q, 3) are inside a closed surface.

        Triangles may face either side and cross: the winding number is not 0 inside. A point on the surface
        is on either side.
        """
        inside = np.zeros(len(queries), dtype=np.bool_)
        tree, (stack, *_) = (self.corners, self.boxes, self.leaves), _memory()
        find_inside(np.ascontiguousarray(queries), *tree, *self._rays, stack, inside)
        return inside

    def depth(self, queries: Floats) -> Floats:
        """Return the depth (q,) in a closed surface. Of points (q, 3), 0 outside."""
        depth, inside = np.zeros(len(queries)), self.inside(queries)
        depth[inside] = self.nearest(queries[inside])[2]
        return depth

    def tangent_planes(self, queries: Floats) -> tuple[Floats, Floats, Floats]:
        """Return signed distances, nearest points, and unit normals (q, 3).

        The normal is the gradient of the distance; on the surface, the angle-weighted normal.
        """
        nearest, closest, distances, regions = self._nearest(queries)
        normals, rows = self._normals
        sides, size = np.where(self.inside(queries), -1.0, 1.0), np.ptp(self.boxes[0].reshape(2, 3), axis=0)
        away = distances[:, None] > ROUNDING * size.max()
        outward = np.where(away, (queries - closest) * sides[:, None], normals[rows[nearest, regions]])
        return sides * distances, closest, unit_vectors(outward)


def _memory() -> tuple[Ints, Floats, Floats]:
    """Return working memory of a search: a stack as deep as any tree, and a leaf's distances."""
    return np.empty(64, dtype=np.int64), np.empty(64), np.empty(LANES)


def triangle_tree(points: Floats, triangles: Ints) -> TriangleTree:
    """Return the tree of finite points (n, 3) and triangles (m, 3), m >= 1, and keep both."""
    centres = (points[triangles[:, 0]] + points[triangles[:, 1]] + points[triangles[:, 2]]) / 3.0
    # Equal centres are parted by their order: each half of a box is as large as a leaf expects.
    centres += _SLOPE * np.ptp(centres, axis=0).max() * np.arange(len(centres))[:, None]
    return _filled(points, triangles, cKDTree(centres, leafsize=LANES).indices)


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
    key = digest(points, triangles)
    tree = _deformed.get(key)
    if tree is None:
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


#: Regions of a triangle: its face, the edge from corner k to the next, or corner k.
FACE, EDGE, CORNER = 0, 1, 4


@kernel
def nearest_on_triangle(  # noqa: PLR0911 -- a return for each region
    px: float, py: float, pz: float, corners: Floats
) -> tuple[float, float, float, int]:
    """Return the point and region of a triangle nearest to p. Corners (9,).

    Voronoi regions of corners, edges and face, Ericson 2005, *Real-time collision detection*, 5.1.5. The
    region is FACE, EDGE + k (from corner k to the next) or CORNER + k.
    """
    a, b, c = corners[:3], corners[3:6], corners[6:]
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = px - a[0], py - a[1], pz - a[2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return a[0], a[1], a[2], CORNER
    bpx, bpy, bpz = px - b[0], py - b[1], pz - b[2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return b[0], b[1], b[2], CORNER + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return a[0] + t * abx, a[1] + t * aby, a[2] + t * abz, EDGE
    cpx, cpy, cpz = px - c[0], py - c[1], pz - c[2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return c[0], c[1], c[2], CORNER + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return a[0] + t * acx, a[1] + t * acy, a[2] + t * acz, EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return b[0] + t * (c[0] - b[0]), b[1] + t * (c[1] - b[1]), b[2] + t * (c[2] - b[2]), EDGE + 1
    # The foot on the plane, exact for needles.
    nx, ny, nz = aby * acz - abz * acy, abz * acx - abx * acz, abx * acy - aby * acx
    rise = (apx * nx + apy * ny + apz * nz) / (nx * nx + ny * ny + nz * nz)
    return px - rise * nx, py - rise * ny, pz - rise * nz, FACE


@kernel
def distance2_to_box(box: Floats, x: float, y: float, z: float) -> float:
    """Return the squared distance from a box. The box has corners (6,); 0 inside."""
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    return float(dx * dx + dy * dy + dz * dz)


def pseudonormals(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return normals (k, 3) for sides, and their rows (m, 7).

    A point is outside if its offset from the nearest surface point goes along the normal there. The normal of
    an edge is the sum of its triangles' unit normals; the normal of a corner weights them by the triangles'
    angles: Baerentzen, Aanaes 2005, doi:10.1109/TVCG.2005.49. Rows are of each triangle's regions FACE, EDGE
    + k and CORNER + k; triangles face outward.
    """
    normals = triangle_normals(points, triangles)
    faces = unit_vectors(normals)
    onward = points[triangles[:, [1, 2, 0]]] - points[triangles]
    # atan2 keeps small angles exact, and is 0 for triangles without area.
    sines, cosines = np.linalg.norm(normals, axis=1), -np.einsum("mki,mki->mk", onward, onward[:, [2, 0, 1]])
    angles = np.arctan2(sines[:, None], cosines).reshape(-1)
    edge_of = numbered_edges(triangles)[1]
    parts = [faces]
    for at, weights, count in (
        (edge_of, np.ones(len(angles)), int(edge_of.max(initial=-1)) + 1),
        (triangles.reshape(-1), angles, len(points)),
    ):
        sums = [np.bincount(at, weights * np.repeat(axis, 3), count) for axis in faces.T]
        parts.append(np.column_stack(sums))
    first, second = len(faces), len(faces) + len(parts[1])
    own = np.arange(len(faces))[:, None]
    return np.vstack(parts), np.hstack([own, first + edge_of.reshape(-1, 3), second + triangles])


@kernel
def search_tree(
    corners: Floats, boxes: Floats, leaves: Ints, queries: Floats, nearest: Ints, closest: Floats,
    distances: Floats, regions: Ints, stack: Ints, to_box: Floats, apart: Floats,
) -> None:  # fmt: skip
    """Write the nearest triangle to each query, with its nearest point, distance and region.

    corners, boxes, leaves : of a :class:`TriangleTree`; queries, closest : (q, 3); nearest, distances,
    regions : (q,), triangles in the tree's order; stack, to_box, apart : of :func:`_memory`.
    """
    leaf = 0  # the last query's: consecutive queries are neighbours along a fibre
    for q in range(len(queries)):
        x, y, z = queries[q, 0], queries[q, 1], queries[q, 2]
        leaf, k, square = _nearest_triangle(corners, boxes, leaves, x, y, z, leaf, stack, to_box, apart)
        nearest[q] = min(leaves[leaf] + k, leaves[leaf + 1] - 1)
        cx, cy, cz, regions[q] = nearest_on_triangle(x, y, z, corners[leaf, :, k])
        closest[q, 0], closest[q, 1], closest[q, 2] = cx, cy, cz
        distances[q] = math.sqrt(square)  # of equally near triangles each has the same


@kernel
def lower_distances(
    corners: Floats, boxes: Floats, leaves: Ints, along: int, slack: float, unsigned: bool, queries: Floats,
    distances: Floats, stack: Ints, to_box: Floats, apart: Floats,
) -> None:  # fmt: skip
    """Lower distances (q,) to the signed distances from a tree's surface, where these are less.

    Arrays are as of :func:`search_tree`, ``along`` and ``slack`` as of
    :func:`~vtkmuscle.core.mesh.winding.is_inside`. ``unsigned`` distances are of a surface without an inside.
    """
    leaf, last, distance, inside = 0, 0, -1.0, False
    for q in range(len(queries)):
        x, y, z, best = queries[q, 0], queries[q, 1], queries[q, 2], distances[q]
        if math.sqrt(distance2_to_box(boxes[0], x, y, z)) > max(best, 0.0):
            continue
        leaf, _, square = _nearest_triangle(corners, boxes, leaves, x, y, z, leaf, stack, to_box, apart)
        x, y, z = x - queries[last, 0], y - queries[last, 1], z - queries[last, 2]
        # No surface is between two points that are nearer to each other than to the surface.
        if not (unsigned or math.sqrt(x * x + y * y + z * z) < distance):
            inside = is_inside(queries[q], corners, boxes, leaves, along, slack, stack)
        last, distance = q, math.sqrt(square)
        distances[q] = min(-distance if inside else distance, best)


@kernel
def _nearest_triangle(
    corners: Floats, boxes: Floats, leaves: Ints, x: float, y: float, z: float, guess: int, stack: Ints,
    to_box: Floats, apart: Floats,
) -> tuple[int, int, float]:  # fmt: skip
    """Return the leaf of the triangle nearest to a position, its place there, and its squared distance.

    The search begins with the leaf ``guess``.
    """
    n_leaves = len(leaves) - 1
    stack[0], stack[1], to_box[0], to_box[1], size = 0, n_leaves - 1 + guess, 0.0, 0.0, 2
    nearest, place, best = guess, 0, np.inf
    while size:
        size -= 1
        node = stack[size]
        if to_box[size] >= best:
            continue
        if node < n_leaves - 1:
            left, right = 2 * node + 1, 2 * node + 2
            to_left = distance2_to_box(boxes[left], x, y, z)
            to_right = distance2_to_box(boxes[right], x, y, z)
            if to_left < to_right:
                left, right, to_left, to_right = right, left, to_right, to_left
            stack[size], to_box[size] = left, to_left
            stack[size + 1], to_box[size + 1] = right, to_right
            size += 2
            continue
        leaf = node - (n_leaves - 1)
        _squares(corners[leaf].reshape(-1), x, y, z, apart)
        for k in range(LANES):
            if apart[k] < best:
                nearest, place, best = leaf, k, apart[k]
    return nearest, place, best


@vector_kernel
def _squares(corners: Floats, x: float, y: float, z: float, apart: Floats) -> None:
    """Write the squared distances of a position from a leaf's triangles."""
    for k in range(LANES):
        apart[k] = _square(corners, x, y, z, k)


@lane
def _square(corners: Floats, x: float, y: float, z: float, k: int) -> float:
    """Return the squared distance from the k-th triangle: from its plane above the triangle, else its edges.

    A needle counts as its edges.
    """
    a, b, c = corners[k], corners[LANES + k], corners[2 * LANES + k]
    px, py, pz = x - a, y - b, z - c
    ux, uy, uz = corners[3 * LANES + k] - a, corners[4 * LANES + k] - b, corners[5 * LANES + k] - c
    vx, vy, vz = corners[6 * LANES + k] - a, corners[7 * LANES + k] - b, corners[8 * LANES + k] - c
    uu, vv, uv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
    pu, pv = px * ux + py * uy + pz * uz, px * vx + py * vy + pz * vz
    to_edges = min(_square_from(px, py, pz, ux, uy, uz, uu, pu), _square_from(px, py, pz, vx, vy, vz, vv, pv))
    qx, qy, qz, wx, wy, wz = px - ux, py - uy, pz - uz, vx - ux, vy - uy, vz - uz
    ww, qw = wx * wx + wy * wy + wz * wz, qx * wx + qy * wy + qz * wz
    to_edges = min(to_edges, _square_from(qx, qy, qz, wx, wy, wz, ww, qw))
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    nn, height = nx * nx + ny * ny + nz * nz, px * nx + py * ny + pz * nz
    by_u, by_v = vv * pu - uv * pv, uu * pv - uv * pu
    above = (by_u > 0.0) & (by_v > 0.0) & (by_u + by_v < nn) & (nn > ROUNDING * ROUNDING * uu * vv)
    return height * height / (nn + _TINY) if above else to_edges


@lane
def _square_from(
    x: float, y: float, z: float, u: float, v: float, w: float, square: float, along: float
) -> float:
    """Return the squared distance from an edge (u, v, w), of a position from the edge's start."""
    part = min(max(along / (square + _TINY), 0.0), 1.0)
    x, y, z = x - part * u, y - part * v, z - part * w
    return x * x + y * y + z * z


#: Displacement within which a neighbour's surface counts as flat, as a part of its mean edge.
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
