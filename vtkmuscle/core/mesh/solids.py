"""The parts of a surface, closed: exact distances from them, and what is inside of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.closed_shells import closed_shells
from vtkmuscle.core.mesh.inside import points_inside
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import Bools, Floats, Ints

#: What stands for the distance of what is too far away to matter, or not known yet.
FAR = 1e30


@dataclass(frozen=True, eq=False)
class Solids:
    """The exact surface of a body, and on which side of it points are.

    Each connected part has an inside of its own, whether its triangles face outward or inward: where parts
    overlap, as the bones of a pelvis do, and for a hollow in a bone, which counts as filled. Of several
    parts the least distance counts. A part that encloses nothing has a distance without a sign. The side is
    that of the angle-weighted normal at the nearest point, exact for closed manifold parts of any genus.

    Attributes
    ----------
    points : (n, 3) array
        Of the surface.
    trees : tuple of TriangleTree
        Solid parts, closed and facing outward. Those of one tree have boxes that do not meet: what is
        nearest to a point is then of the part that the point is in.
    sheets : TriangleTree or None
        Parts that enclose nothing.
    remarks : tuple of str
        What was wrong with the surface, in words.

    References
    ----------
    Baerentzen, Aanaes 2005, *Signed distance computation using the angle weighted pseudonormal*,
    doi:10.1109/TVCG.2005.49.
    """

    points: Floats
    trees: tuple[TriangleTree, ...]
    sheets: TriangleTree | None
    remarks: tuple[str, ...]

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box around all parts."""
        boxes = np.array([tree.boxes[0] for tree in (*self.trees, *self._sheets)])
        return boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)

    @property
    def _sheets(self) -> tuple[TriangleTree, ...]:
        return () if self.sheets is None else (self.sheets,)

    def distances(self, points: ArrayLike, *, run: int = 0) -> Floats:
        """Return the exact distances (n,) of points (n, 3), negative inside.

        ``run`` is for points in runs, as of :meth:`~vtkmuscle.core.mesh.triangle_tree.TriangleTree.signed`.
        """
        positions = _checked(points)
        least = np.full(len(positions), np.inf)
        for tree in (*self.trees, *self._sheets):
            near = _runs_in_reach(positions, least, run, tree) if run else np.arange(len(positions))
            found = tree.signed(positions[near], run=run)[0]
            least[near] = np.minimum(least[near], np.abs(found) if tree is self.sheets else found)
        return least

    def exact(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Return exact distances (n,) of points (n, 3), negative inside, and the directions away (n, 3).

        A direction is that in which the distance grows, 1 long: the nearest place on the surface is the
        point less its distance in that direction. On the surface it is the angle-weighted normal.
        """
        positions = _checked(points)
        best, outward = np.full(len(positions), np.inf), np.zeros((len(positions), 3))
        for tree in (*self.trees, *self._sheets):
            distance, _, normal = tree.tangent_planes(positions)
            if tree is self.sheets:
                normal[distance < 0.0] *= -1.0
                distance = np.abs(distance)
            nearer = distance < best
            best[nearer], outward[nearer] = distance[nearer], normal[nearer]
        return best, outward

    def depth(self, points: ArrayLike) -> Floats:
        """Return how deep points (n, 3) are inside, (n,), 0 outside; where parts overlap, in the deepest."""
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

    Raises
    ------
    ValueError
        If there is no triangle of three different points, or a coordinate is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.solids import solids_of
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> distance, outward = solids_of(points, triangles).exact([[0.2, 0.2, -1.0]])
    >>> distance.tolist(), outward.tolist()
    ([1.0], [[0.0, 0.0, -1.0]])
    """
    closed = closed_shells(points, triangles)
    parts = list(zip(closed.shells, closed.solid, strict=True))
    flat = [part for part, solid in parts if not solid]
    return Solids(
        closed.points,
        tuple(
            triangle_tree(closed.points, np.concatenate(apart))
            for apart in _apart(closed.points, [part for part, solid in parts if solid])
        ),
        triangle_tree(closed.points, np.concatenate(flat)) if flat else None,
        closed.remarks,
    )


def _apart(points: Floats, parts: list[Ints]) -> list[list[Ints]]:
    """Return parts of a surface shared out so that the boxes of those that are together do not meet."""
    groups: list[list[Ints]] = []
    boxes: list[Floats] = []
    for part in parts:
        corners = points[part.reshape(-1)]
        box = np.array([corners.min(axis=0), corners.max(axis=0)])
        for number, others in enumerate(boxes):
            if not ((others[:, 0] <= box[1]) & (box[0] <= others[:, 1])).all(axis=1).any():
                groups[number].append(part)
                boxes[number] = np.concatenate([others, box[None]])
                break
        else:
            groups.append([part])
            boxes.append(box[None])
    return groups


def _runs_in_reach(points: Floats, least: Floats, run: int, tree: TriangleTree) -> Ints:
    """Return the points (n, 3) of those runs that may be nearer to a tree's triangles than the least (n,)."""
    starts = np.arange(0, len(points), run)
    low, high = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
    apart = np.linalg.norm(
        np.maximum(np.maximum(tree.boxes[0, :3] - high, low - tree.boxes[0, 3:]), 0.0), axis=1
    )
    near: Ints = np.flatnonzero(np.repeat(apart <= np.maximum.reduceat(least, starts), run)[: len(points)])
    return near


def _checked(points: ArrayLike) -> Floats:
    positions = np.ascontiguousarray(points, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise InputError("", "points must be an (n, 3) array of finite numbers")
    return positions
