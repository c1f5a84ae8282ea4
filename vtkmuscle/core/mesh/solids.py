"""Surfaces made closed, which points are inside of them, and how far from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.surface import LEAST_VOLUME, numbered_edges, point_components, signed_volume
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import Bools, Floats, Ints

#: Boxes are larger by this part of the coordinates, so that rounding hides no triangle from a ray.
_ROUNDING = 1e-14


def points_inside(queries: Floats, tree: TriangleTree) -> Bools:
    """Return which points (k, 3) are inside a closed surface, by the number of triangles beyond them, (k,).

    Triangles may face either way. Points on the surface may be inside or not, but each is so whatever other
    points are asked for. Rays run along the axis that the surface extends least along: across a long muscle,
    where few of its boxes are in line. Seen along the rays, each place on an edge belongs to exactly one of
    its two triangles: no ray slips through.
    """
    inside = np.zeros(len(queries), dtype=np.bool_)
    if len(queries):
        along = int((tree.boxes[0, 3:] - tree.boxes[0, :3]).argmin())
        slack = _ROUNDING * float(np.abs(tree.boxes[0]).max())
        stack = np.empty(64, dtype=np.int64)
        _count(np.ascontiguousarray(queries), tree.corners, tree.boxes, along, slack, stack, inside)
    return inside


@kernel
def _count(
    queries: Floats, corners: Floats, boxes: Floats, along: int, slack: float, stack: Ints, inside: Bools
) -> None:
    """Write whether the triangles above each point are odd in number; stack is working memory."""
    n, n_leaves = len(corners), (len(boxes) + 1) // 2
    one, two = (along + 1) % 3, (along + 2) % 3
    for q in range(len(queries)):
        x, y, z = queries[q, one], queries[q, two], queries[q, along]
        stack[0], size, odd = 0, 1, False
        while size:
            size -= 1
            node = stack[size]
            if x + slack < boxes[node, one] or x - slack > boxes[node, 3 + one]:
                continue
            if y + slack < boxes[node, two] or y - slack > boxes[node, 3 + two]:
                continue
            if z - slack > boxes[node, 3 + along]:
                continue
            if node < n_leaves - 1:
                stack[size], stack[size + 1] = 2 * node + 1, 2 * node + 2
                size += 2
                continue
            leaf = node - (n_leaves - 1)
            for i in range(leaf * n // n_leaves, (leaf + 1) * n // n_leaves):
                if _is_below(queries[q], corners[i, 0], corners[i, 1], corners[i, 2], along):
                    odd = not odd
        inside[q] = odd


@kernel
def _is_below(query: Floats, a: Floats, b: Floats, c: Floats, along: int) -> bool:
    """Return True where a triangle is above a point, seen along an axis; an edge belongs to one side."""
    one, two = (along + 1) % 3, (along + 2) % 3
    x, y = query[one], query[two]
    ax, ay, bx, by, cx, cy = a[one], a[two], b[one], b[two], c[one], c[two]
    within = _crosses(x, y, ax, ay, bx, by) != _crosses(x, y, bx, by, cx, cy)
    if within == _crosses(x, y, cx, cy, ax, ay):
        return False
    ux, uy, uz = bx - ax, by - ay, b[along] - a[along]
    vx, vy, vz = cx - ax, cy - ay, c[along] - a[along]
    area = ux * vy - uy * vx
    if area == 0.0:
        return False
    first = ((x - ax) * vy - (y - ay) * vx) / area
    second = (ux * (y - ay) - uy * (x - ax)) / area
    return bool(a[along] + first * uz + second * vz > query[along])


@kernel
def _crosses(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return True where an edge crosses the ray from a place towards greater x, whichever way it runs."""
    if (ay > y) == (by > y):
        return False
    # From the lower end on, so that the edge's other triangle gets the same answer to the last digit.
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return bool(ax + (y - ay) / (by - ay) * (bx - ax) > x)


#: The distance of points that are too far away to matter, or whose distance is not known yet.
FAR = 1e30


@dataclass(frozen=True, eq=False)
class ClosedShells:
    """The connected parts of a surface, closed and turned outward."""

    points: Floats  # (n, 3), with one more for each hole that was closed
    shells: tuple[Ints, ...]  # triangles (k, 3) of each part; every edge is run through as often either way
    solid: tuple[bool, ...]  # False for parts that enclose no volume
    remarks: tuple[str, ...]  # defects of the surface, in words


@shared
def closed_shells(points: Floats, triangles: Ints) -> ClosedShells:
    """Return the connected parts of a surface, points (n, 3) and triangles (m, 3), closed and oriented.

    Equal points are made one where the surface is open otherwise. Parts whose triangles disagree about their
    side are made consistent. A hole is closed by triangles from its rim to the rim's centre. A part that
    faces inward is turned round, so that a hollow in a bone counts as filled. There is a remark for each kind
    of defect; a hollow is none. A ValueError says that there is no triangle of three different points, or a
    coordinate is not finite.
    """
    points = np.asarray(points, dtype=np.float64)
    triangles = _proper(np.asarray(triangles, dtype=np.int64).reshape(-1, 3))
    _check_any(triangles)
    if not np.isfinite(points[triangles]).all():
        raise InputError("", "the surface has a coordinate that is not finite")
    remarks = []
    rim = _excess(triangles)
    if len(rim):
        points, triangles = welded(points, triangles)
        _check_any(triangles)
        rim = _excess(triangles)
    if len(rim):
        triangles, n_turned = _consistent(triangles)
        if n_turned:
            remarks.append(f"{n_turned} of {len(triangles)} triangles faced the other way and were turned")
        rim = _excess(triangles)
        if len(rim):
            points, triangles, n_holes = _capped(points, triangles, rim)
            remarks.append(f"the surface is open: {n_holes} hole(s), {len(rim)} edges, were closed")
    labels = point_components(len(points), triangles[:, [0, 1, 1, 2]].reshape(-1, 2))[triangles[:, 0]]
    order = np.argsort(labels, kind="stable")
    shells = np.split(triangles[order], np.flatnonzero(np.diff(labels[order])) + 1)
    corners = [points[shell.reshape(-1)] for shell in shells]
    volumes = [signed_volume(one, np.arange(len(one)).reshape(-1, 3)) for one in corners]
    solid = [
        abs(volume) > LEAST_VOLUME * float(np.linalg.norm(np.ptp(one.T.copy(), axis=1))) ** 3
        for one, volume in zip(corners, volumes, strict=True)
    ]
    if sum(volumes) < 0 and any(solid):
        remarks.append("the surface is inside out: its triangles face inward and were turned")
    if not all(solid):
        remarks.append(f"{solid.count(False)} of {len(shells)} part(s) enclose no volume: nothing is in them")
    sides = [volume < 0 for volume in volumes]
    turned = [shell[:, ::-1].copy() if side else shell for shell, side in zip(shells, sides, strict=True)]
    return ClosedShells(points, tuple(turned), tuple(solid), tuple(remarks))


def _check_any(triangles: Ints) -> None:
    if not len(triangles):
        raise InputError("", "the surface has no triangles of three different points")


def _proper(triangles: Ints) -> Ints:
    """Return the triangles without those that have a point twice."""
    a, b, c = triangles.T
    proper: Bools = (a != b) & (b != c) & (c != a)
    return triangles[proper]


def _directions(triangles: Ints) -> Ints:
    """Return 1 for edges that a triangle runs through from the lower point id to the higher, else -1."""
    return np.where(triangles < np.roll(triangles, -1, axis=1), 1, -1).astype(np.int64)


def _excess(triangles: Ints) -> Ints:
    """Return the directed edges that lack one of the opposite direction, (k, 2)."""
    numbers, directions = numbered_edges(triangles)[1], _directions(triangles).reshape(-1)
    balance = np.rint(np.bincount(numbers, weights=directions)).astype(np.int64)
    first = np.zeros(len(balance), dtype=np.int64)
    first[numbers] = np.arange(len(numbers))
    edges = np.flatnonzero(balance)
    ends = np.column_stack([triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)])[first[edges]]
    backward = (ends[:, 0] < ends[:, 1]) != (balance[edges] > 0)
    ends[backward] = ends[backward][:, ::-1]
    return np.repeat(ends, np.abs(balance[edges]), axis=0)


def welded(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return the mesh with equal points made one, without triangles of fewer than three points.

    Surfaces that give each triangle points of its own would otherwise be open everywhere.
    """
    used, of_corner = np.unique(triangles, return_inverse=True)
    distinct, of_used = np.unique(points[used], axis=0, return_inverse=True)
    corners = of_used.reshape(-1)[of_corner.reshape(-1)].reshape(-1, 3).astype(np.int64)
    return distinct, _proper(corners)


def _consistent(triangles: Ints) -> tuple[Ints, int]:
    """Return triangles that agree with their neighbours across edges of two, and how many were turned.

    Each triangle is a node twice, as it is and turned, and an edge joins the nodes that agree: a part that
    can be consistent is two components, one the reverse of the other. The one that turns fewer triangles is
    taken. A part of one component, such as a Möbius strip, stays as it is.
    """
    numbers, directions = numbered_edges(triangles)[1], _directions(triangles).reshape(-1)
    order, count = np.argsort(numbers, kind="stable"), len(triangles)
    pairs = order[np.isin(numbers[order], np.flatnonzero(np.bincount(numbers) == 2))].reshape(-1, 2)
    one, other = pairs.T // 3
    across = np.where(directions[pairs[:, 0]] == directions[pairs[:, 1]], count, 0)
    as_they_are = np.column_stack([one, other + across])
    both_turned = np.column_stack([one + count, other + count - across])
    labels = point_components(2 * count, np.vstack([as_they_are, both_turned])).reshape(2, count)
    turn, part = labels[0] > labels[1], labels.min(axis=0)
    most = np.bincount(part, weights=turn) > 0.5 * np.bincount(part)
    turn ^= most[part]
    result = triangles.copy()
    result[turn] = result[turn][:, ::-1]
    return result, int(turn.sum())


def _capped(points: Floats, triangles: Ints, rim: Ints) -> tuple[Floats, Ints, int]:
    """Close each hole by triangles from the edges of its rim to the rim's centre; return how many."""
    used, ends = np.unique(rim, return_inverse=True)
    ends = ends.reshape(-1, 2)
    hole_of_point = point_components(len(used), ends)
    hole = hole_of_point[ends[:, 0]]
    n_holes = int(hole_of_point.max()) + 1
    middles = points[rim].mean(axis=1)
    sums = np.column_stack([np.bincount(hole, weights=middles[:, k], minlength=n_holes) for k in range(3)])
    centres = sums / np.bincount(hole, minlength=n_holes)[:, None]
    caps = np.column_stack([rim[:, 1], rim[:, 0], len(points) + hole])
    return np.vstack([points, centres]), np.vstack([triangles, caps]), n_holes


@dataclass(frozen=True, eq=False)
class Solids:
    """The exact surface of a body, and on which side of it points are.

    Each connected part has an inside of its own, whether its triangles face outward or inward: parts may
    overlap, as the bones of a pelvis do, and a hollow in a bone counts as filled. Of several parts the least
    distance counts. A part that encloses nothing has a distance without a sign. The side is that of the
    angle-weighted normal at the nearest point, exact for closed manifold parts of any genus (Baerentzen,
    Aanaes 2005, *Signed distance computation using the angle weighted pseudonormal*,
    doi:10.1109/TVCG.2005.49).
    """

    points: Floats  # (n, 3), of the surface
    #: Solid parts, closed and facing outward. Parts in one tree have boxes that do not meet: a point inside
    #: one of them has its nearest triangle there.
    trees: tuple[TriangleTree, ...]
    sheets: TriangleTree | None  # parts that enclose nothing
    remarks: tuple[str, ...]  # defects of the surface, in words

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box around all parts."""
        boxes = np.array([tree.boxes[0] for tree in self._all])
        return boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)

    @property
    def _all(self) -> tuple[TriangleTree, ...]:
        return self.trees if self.sheets is None else (*self.trees, self.sheets)

    def distances(self, points: ArrayLike, *, run: int = 0) -> Floats:
        """Return the exact distances (n,) of points (n, 3), negative inside.

        ``run`` is for points in runs, see :meth:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree.signed`.
        """
        positions = _checked(points)
        least = np.full(len(positions), np.inf)
        for tree, near in zip(self._all, self._in_reach(positions, run), strict=True):
            least[near] = np.minimum(least[near], self._signed(tree, positions[near], run))
        return least

    def _signed(self, tree: TriangleTree, points: Floats, run: int) -> Floats:
        distances = tree.signed(points, run=run)[0]
        return np.abs(distances) if tree is self.sheets else distances

    def _in_reach(self, points: Floats, run: int) -> list[Ints]:
        """Return for each tree the points (n, 3) of those runs that may be nearer to it than to all others.

        From the middle of a run to any of its points no distance changes by more than the way.
        """
        if not run or len(self._all) == 1:
            return [np.arange(len(points))] * len(self._all)
        starts = np.arange(0, len(points), run)
        middles = points[np.minimum(starts + run // 2, len(points) - 1)]
        ways = np.linalg.norm(points - np.repeat(middles, run, axis=0)[: len(points)], axis=1)
        radii = np.maximum.reduceat(ways, starts)
        values = np.array([self._signed(tree, middles, 0) for tree in self._all])
        near = values - radii <= values.min(axis=0) + radii
        return [np.flatnonzero(np.repeat(one, run)[: len(points)]) for one in near]

    def exact(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Return exact distances (n,) of points (n, 3), negative inside, and the directions away (n, 3).

        A direction is the unit vector in which the distance grows, on the surface the angle-weighted normal:
        the nearest place is the point less its distance in that direction.
        """
        positions = _checked(points)
        best, outward = np.full(len(positions), np.inf), np.zeros((len(positions), 3))
        for tree in self._all:
            distance, _, normal = tree.tangent_planes(positions)
            if tree is self.sheets:
                normal[distance < 0.0] *= -1.0
                distance = np.abs(distance)
            nearer = distance < best
            best[nearer], outward[nearer] = distance[nearer], normal[nearer]
        return best, outward

    def depth(self, points: ArrayLike) -> Floats:
        """Return the depth (n,) of points (n, 3), 0 outside; where parts overlap, in the deepest."""
        positions = _checked(points)
        depth = np.zeros(len(positions))
        for tree in self.trees:
            np.maximum(depth, tree.depth(positions), out=depth)
        return depth

    def inside(self, points: ArrayLike) -> Bools:
        """Return which points (n, 3) are inside, (n,); those on the surface may be or not."""
        positions = _checked(points)
        within = np.zeros(len(positions), dtype=np.bool_)
        for tree in self.trees:
            within |= points_inside(positions, tree)
        return within

    def into(self, points: ArrayLike) -> Floats:
        """Return points (n, 3) with those outside moved to the nearest place on the surface."""
        moved = _checked(points).copy()
        beyond = np.flatnonzero(~self.inside(moved))
        distance, outward = self.exact(moved[beyond])
        moved[beyond] -= np.maximum(distance, 0.0)[:, None] * outward
        return moved


@shared
def solids_of(points: Floats, triangles: Ints) -> Solids:
    """Return the parts of a surface, points (n, 3) and triangles (m, 3); closed where they are not.

    A ValueError says that there is no triangle of three different points, or a coordinate is not finite.
    """
    closed = closed_shells(points, triangles)
    parts: dict[bool, list[Ints]] = {True: [], False: []}
    for part, solid in zip(closed.shells, closed.solid, strict=True):
        parts[solid].append(part)
    groups = _apart(closed.points, parts[True])
    trees = tuple(triangle_tree(closed.points, np.concatenate(group)) for group in groups)
    flat = triangle_tree(closed.points, np.concatenate(parts[False])) if parts[False] else None
    return Solids(closed.points, trees, flat, closed.remarks)


def _apart(points: Floats, parts: list[Ints]) -> list[list[Ints]]:
    """Return parts of a surface in groups within which their boxes do not meet."""
    groups: list[list[Ints]] = []
    boxes: list[Floats] = []
    for part in parts:
        corners = points[part.reshape(-1)].T.copy()
        box = np.array([corners.min(axis=1), corners.max(axis=1)])
        for number, others in enumerate(boxes):
            if not ((others[:, 0] <= box[1]) & (box[0] <= others[:, 1])).all(axis=1).any():
                groups[number].append(part)
                boxes[number] = np.concatenate([others, box[None]])
                break
        else:
            groups.append([part])
            boxes.append(box[None])
    return groups


def _checked(points: ArrayLike) -> Floats:
    positions = np.ascontiguousarray(points, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise InputError("", "points must be an (n, 3) array of finite numbers")
    return positions
