"""Solids: closed surfaces, their inside, and distances to them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.sampling import part_means
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.surface import box_of, diagonal, numbered_edges, point_components, signed_volume
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, shared_tree
from vtkmuscle.core.types import ROUNDING, Bools, Floats, Ints

#: Distance of points too far to matter, or not yet computed.
FAR = 1e30
#: Least part of a surface's triangles in a piece of its own: crumbs have less, pieces of eight bones 9 %.
LEAST_PIECE = 0.02


@dataclass(frozen=True, eq=False)
class ClosedShells:
    """Connected parts of a surface, closed and turned outward."""

    points: Floats  # (n, 3), with a further point for each closed hole
    shells: tuple[Ints, ...]  # triangles (k, 3) of each part, without boundary
    solid: tuple[bool, ...]  # False for parts that enclose no volume
    remarks: tuple[str, ...]  # defects of the surface, in words


@shared
def closed_shells(points: Floats, triangles: Ints) -> ClosedShells:
    """Return the connected parts of a surface, closed and oriented.

    In an open surface, points (n, 3) and triangles (m, 3), equal points merge. Triangles of a part turn to
    agree about their side. A hole is closed by triangles from its rim to the rim's centre. A part that faces
    inward is turned, so a hollow in a bone counts as filled. Each kind of defect has a remark; a hollow has
    no remark. A ValueError says that no triangle has three different points, or a coordinate is not finite.
    """
    points = np.asarray(points, dtype=np.float64)
    triangles = _proper(np.asarray(triangles, dtype=np.int64).reshape(-1, 3))
    if not np.isfinite(points[triangles]).all():
        raise InputError("", "the surface has a coordinate that is not finite")
    remarks = []
    rim = open_edges(triangles)
    if len(rim):
        points, triangles = welded(points, triangles)
        first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]
        if len(first) < len(triangles):
            remarks.append(f"{len(triangles) - len(first)} triangles were double and were left out")
            triangles = triangles[np.sort(first)]
        rim = open_edges(triangles)
    if len(rim):
        triangles, n_turned = _consistent(triangles)
        if n_turned:
            turned = f"{n_turned} of {len(triangles)} triangles"
            remarks.append(f"{turned} faced the opposite side and were turned")
        rim = open_edges(triangles)
        if len(rim):
            # Triangles lead from each hole's rim to the rim's centre.
            hole = _loops(rim)
            n_holes = int(hole.max()) + 1
            caps = np.column_stack([rim[:, 1], rim[:, 0], len(points) + hole])
            points = np.vstack([points, part_means(points[rim].mean(axis=1), hole, n_holes)])
            triangles = np.vstack([triangles, caps])
            remarks.append(f"the surface is open: {n_holes} hole(s), {len(rim)} edges, were closed")
    labels = point_components(len(points), triangles[:, [0, 1, 1, 2]].reshape(-1, 2))[triangles[:, 0]]
    order = np.argsort(labels, kind="stable")
    shells, solid, total = [], [], 0.0
    for shell in np.split(triangles[order], np.flatnonzero(np.diff(labels[order])) + 1):
        corners = points[shell.reshape(-1)]
        volume = signed_volume(corners, np.arange(len(corners)).reshape(-1, 3))
        shells.append(shell[:, ::-1].copy() if volume < 0 else shell)
        solid.append(abs(volume) > ROUNDING * diagonal(corners) ** 3)
        total += volume
    if total < 0 and any(solid):
        remarks.append("the surface is inside out: its triangles face inward and were turned")
    if not all(solid):
        remarks.append(f"{solid.count(False)} of {len(shells)} part(s) enclose no volume and have no inside")
    return ClosedShells(points, tuple(shells), tuple(solid), tuple(remarks))


def _proper(triangles: Ints) -> Ints:
    """Return the triangles of three different points; a ValueError for none."""
    proper: Ints = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    if not len(proper):
        raise InputError("", "the surface has no triangles of three different points")
    return proper


def _directions(triangles: Ints) -> Ints:
    """Return 1 for edges to the higher point id, else -1."""
    return np.where(triangles < np.roll(triangles, -1, axis=1), 1, -1).astype(np.int64)


def open_edges(triangles: Ints) -> Ints:
    """Return directed edges (k, 2) without an opposite edge."""
    edges, numbers = numbered_edges(triangles)
    balance = np.rint(np.bincount(numbers, weights=_directions(triangles).reshape(-1))).astype(np.int64)
    alone = np.flatnonzero(balance)
    ends = np.where(balance[alone, None] > 0, edges[alone], edges[alone, ::-1])
    return np.repeat(ends, np.abs(balance[alone]), axis=0)


def _loops(rim: Ints) -> Ints:
    """Return the loop (k,) of each directed edge of rims.

    A loop passes a point once: holes that touch in a point have triangles to centres of their own.
    """
    leaving: dict[int, list[int]] = {}
    for edge in np.argsort(rim[:, 0], kind="stable").tolist():
        leaving.setdefault(int(rim[edge, 0]), []).append(edge)
    loop, count = np.empty(len(rim), dtype=np.int64), 0
    for point in list(leaving):
        chain, passed = list[int](), {point: 0}
        while leaving[point]:
            chain.append(leaving[point].pop())
            point = int(rim[chain[-1], 1])  # noqa: PLW2901
            if point in passed:
                closed = chain[passed[point] :]
                del chain[passed[point] :]
                for edge in closed[:-1]:
                    del passed[int(rim[edge, 1])]
                loop[closed], count = count, count + 1
            passed[point] = len(chain)
    return loop


def welded(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return the mesh with equal points merged.

    Surfaces with points of their own for each triangle would otherwise be open everywhere. Triangles of fewer
    than three points are dropped.
    """
    used, of_corner = np.unique(triangles, return_inverse=True)
    distinct, of_used = np.unique(points[used], axis=0, return_inverse=True)
    return distinct, _proper(of_used.reshape(-1)[of_corner.reshape(-1)].reshape(-1, 3).astype(np.int64))


def _consistent(triangles: Ints) -> tuple[Ints, int]:
    """Return triangles that agree with neighbours, and the number turned.

    Neighbours share an edge of two triangles. Each triangle is two nodes, as given and turned, and an edge
    joins agreeing nodes: an orientable part has two components, each the reverse of the other, and the
    component that turns fewer triangles is taken. A part of one component, as a Möbius strip, stays as given.
    """
    numbers, directions = numbered_edges(triangles)[1], _directions(triangles).reshape(-1)
    order, count = np.argsort(numbers, kind="stable"), len(triangles)
    pairs = order[np.isin(numbers[order], np.flatnonzero(np.bincount(numbers) == 2))].reshape(-1, 2)
    first, second = pairs.T // 3
    across = np.where(directions[pairs[:, 0]] == directions[pairs[:, 1]], count, 0)
    unturned = np.column_stack([first, second + across])
    both_turned = np.column_stack([first + count, second + count - across])
    labels = point_components(2 * count, np.vstack([unturned, both_turned])).reshape(2, count)
    turn, part = labels[0] > labels[1], labels.min(axis=0)
    turn ^= (np.bincount(part, weights=turn) > 0.5 * np.bincount(part))[part]  # the most keep their side
    result = triangles.copy()
    result[turn] = result[turn][:, ::-1]
    return result, int(turn.sum())


@dataclass(frozen=True, eq=False)
class Solids:
    """The exact surface of a body, with its inside.

    Each connected part has its own inside: parts may overlap, as the bones of a pelvis do, and a hollow in a
    bone counts as filled. The least distance over all parts counts; that of a part without volume is
    unsigned. The winding number tells the side: a part may cross itself, as noisy surfaces do.
    """

    #: Solid parts, closed and facing outward. Boxes of parts in a tree are disjoint: a point inside a part
    #: has its nearest triangle there.
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

    def distances(self, points: ArrayLike) -> Floats:
        """Return exact distances (n,) of points (n, 3), negative inside."""
        positions = _checked(points)
        least = np.full(len(positions), np.inf)
        for tree in self._all:
            tree.lower(least, positions, unsigned=tree is self.sheets)
        return least

    def exact(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Return exact distances (n,) and directions away (n, 3). Distances are negative inside.

        A direction is the unit gradient of the distance, on the surface its smooth normal: a point
        less its distance along the direction is the nearest surface point.
        """
        positions = _checked(points)
        best, outward = np.full(len(positions), np.inf), np.zeros((len(positions), 3))
        for tree in self._all:
            beyond = np.maximum(tree.boxes[0, :3] - positions, positions - tree.boxes[0, 3:])
            near = np.flatnonzero(np.linalg.norm(np.maximum(beyond, 0.0), axis=1) <= np.maximum(best, 0.0))
            distance, _, normal = tree.tangent_planes(positions[near])
            if tree is self.sheets:
                normal[distance < 0.0] *= -1.0
                distance = np.abs(distance)
            nearer = distance < best[near]
            best[near[nearer]], outward[near[nearer]] = distance[nearer], normal[nearer]
        return best, outward

    def depth(self, points: ArrayLike) -> Floats:
        """Return the depth (n,) of points, 0 outside. Points (n, 3); the deepest of overlapping parts."""
        positions = _checked(points)
        depths = [np.zeros(len(positions)), *(tree.depth(positions) for tree in self.trees)]
        return np.asarray(np.max(depths, axis=0))

    def inside(self, points: ArrayLike) -> Bools:
        """Return which points (n, 3) are inside. Either on the surface."""
        positions = _checked(points)
        within = np.zeros(len(positions), dtype=np.bool_)
        for tree in self.trees:
            within |= tree.inside(positions)
        return within

    def into(self, points: ArrayLike) -> Floats:
        """Return points (n, 3) moved into the solids. Outer points go to the nearest surface point."""
        moved = _checked(points).copy()
        beyond = np.flatnonzero(~self.inside(moved))
        distance, outward = self.exact(moved[beyond])
        moved[beyond] -= distance[:, None] * outward
        return moved


@shared
def solids_of(points: Floats, triangles: Ints) -> Solids:
    """Return the solid parts of a surface, closed if open.

    Points (n, 3), triangles (m, 3). A ValueError says that there is no triangle of three different points, or
    a coordinate is not finite.
    """
    closed = closed_shells(points, triangles)
    return solids_from(closed, range(len(closed.shells)))


def solids_from(closed: ClosedShells, numbers: Sequence[int]) -> Solids:
    """Return some shells of a surface as solids."""
    solid, sheets = ([closed.shells[i] for i in numbers if closed.solid[i] == kind] for kind in (True, False))
    groups = _disjoint_groups(closed.points, solid)
    trees = tuple(shared_tree(closed.points, np.concatenate(group)) for group in groups)
    flat = shared_tree(closed.points, np.concatenate(sheets)) if sheets else None
    return Solids(trees, flat, closed.remarks)


def _disjoint_groups(points: Floats, parts: list[Ints]) -> list[list[Ints]]:
    """Return parts in groups of disjoint boxes. Each large part is a group of its own."""
    groups: list[list[tuple[Ints, Floats, Floats]]] = []
    least = LEAST_PIECE * sum(map(len, parts))
    for part in sorted(parts, key=len):
        low, high = box_of(points[part.reshape(-1)])
        for group in groups if len(part) < least else ():
            if not any(((first <= high) & (low <= last)).all() for _, first, last in group):
                group.append((part, low, high))
                break
        else:
            groups.append([(part, low, high)])
    return [[part for part, *_ in group] for group in groups]


def _checked(points: ArrayLike) -> Floats:
    positions = np.ascontiguousarray(points, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise InputError("", "points must be an (n, 3) array of finite numbers")
    return positions
