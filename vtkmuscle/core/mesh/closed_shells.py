"""Surfaces as closed shells, each facing outward: only such a bone has an inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.surface import LEAST_VOLUME, numbered_edges, point_components, signed_volume
from vtkmuscle.core.types import Bools, Floats, Ints


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
        abs(volume) > LEAST_VOLUME * float(np.linalg.norm(np.ptp(one, axis=0))) ** 3
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
    proper: Bools = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
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
