"""The shapes of surfaces that bend: one tree of each for all who ask, one after another, in a frame."""

from __future__ import annotations

from threading import Lock
from weakref import WeakSet

import numpy as np

from vtkmuscle.core.mesh.inside import points_inside
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, tree_of_bent
from vtkmuscle.core.types import Bools, Floats, Ints


class BentSurface:
    """A surface in one of its shapes, and what several ask of it there.

    Parameters
    ----------
    tree : TriangleTree
        Of that shape.
    """

    def __init__(self, tree: TriangleTree) -> None:
        self.tree = tree
        self._asked, self._inside = np.empty((0, 3)), np.empty(0, dtype=np.bool_)

    def is_of(self, points: Floats, triangles: Ints) -> bool:
        """Return whether it is the surface of these points (n, 3) and triangles (m, 3)."""
        return np.array_equal(self.tree.points, points) and np.array_equal(self.tree.triangles, triangles)

    def inside(self, queries: Floats) -> Bools:
        """Return which points (k, 3) are inside, where it is closed, (k,).

        Of points that were asked for just before, only those that have moved since are looked at.
        """
        if queries.shape != self._asked.shape:
            self._asked, self._inside = queries.copy(), points_inside(queries, self.tree)
        else:
            moved = (queries != self._asked).any(axis=1)
            self._asked[moved] = queries[moved]
            self._inside[moved] = points_inside(queries[moved], self.tree)
        return self._inside.copy()


#: Those that somebody holds.
_held: WeakSet[BentSurface] = WeakSet()
_lock = Lock()


def bent_surface(points: Floats, triangles: Ints, known: TriangleTree | None) -> BentSurface:
    """Return a surface in one of its shapes, the same object as long as anyone holds it.

    Carrying fibres, measuring them and judging the frame each ask for the nearest places on the same bent
    muscle. Content decides which it is.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions, finite; point ids, m >= 1.
    known : TriangleTree or None
        Of another shape of the surface, for :func:`~vtkmuscle.core.mesh.triangle_tree.tree_of_bent`.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.bent import bent_surface
    >>> points, triangles = np.eye(3), np.array([[0, 1, 2]])
    >>> surface = bent_surface(points, triangles, None)
    >>> bent_surface(points.copy(), triangles, None) is surface
    True
    """
    with _lock:
        held = list(_held)
    for surface in held:
        if surface.is_of(points, triangles):
            return surface
    if known is not None and np.array_equal(known.triangles, triangles):
        triangles = known.triangles
    else:
        triangles = triangles.copy()
    surface = BentSurface(tree_of_bent(known, points.copy(), triangles))  # the caller's points may change
    with _lock:
        _held.add(surface)
    return surface
