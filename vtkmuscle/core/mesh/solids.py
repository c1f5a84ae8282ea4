"""The solid parts of a surface, and the distance from the nearest of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.mesh.closed_shells import closed_shells
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, shared_tree
from vtkmuscle.core.types import Floats, Ints

#: What stands for a distance that nobody needs to know.
FAR = 1e30


class Shell(NamedTuple):
    """A solid part, closed and facing outward, with the corners of its box."""

    tree: TriangleTree
    low: Floats
    high: Floats


@dataclass(frozen=True, eq=False)
class Solids:
    """The parts of a surface that enclose something.

    Attributes
    ----------
    points : (n, 3) array
        Of the surface.
    shells : tuple of Shell
        Empty where nothing encloses anything; all distances are :data:`FAR` then.
    """

    points: Floats
    shells: tuple[Shell, ...]

    def distances(self, points: Floats) -> Floats:
        """Return exact distances (n,), negative inside; each of the points (n, 3) is near those before."""
        result = np.full(len(points), FAR)
        low, high = points.min(axis=0), points.max(axis=0)
        middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        # In the order of how near their boxes can be: most of many are beyond the nearest one.
        apart = [
            float(np.linalg.norm(np.maximum(np.maximum(shell.low - middle, middle - shell.high), 0.0)))
            for shell in self.shells
        ]
        for number in np.argsort(apart, kind="stable"):
            if apart[number] - radius > float(result.max()):
                break
            signed, _ = self.shells[number].tree.signed(points, close_by=True)
            np.minimum(result, signed, out=result)
        return result

    def closest(self, points: Floats) -> tuple[Floats, Floats]:
        """Return exact distances (n,) and the directions (n, 3) in which they grow, 1 long or 0."""
        best, direction = np.full(len(points), FAR), np.zeros((len(points), 3))
        for shell in self.shells:
            distances, _, normals = shell.tree.tangent_planes(points)
            nearer = distances < best
            best[nearer], direction[nearer] = distances[nearer], normals[nearer]
        return best, direction


@shared
def solids_of(points: Floats, triangles: Ints) -> Solids:
    """Return the solid parts of a surface, points (n, 3) and triangles (m, 3); closed where they are not.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.solids import solids_of
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> solids_of(points, triangles).distances(np.array([[0.2, 0.2, -1.0]]))
    array([1.])
    """
    mended = closed_shells(points, triangles)
    shells = []
    for shell, solid in zip(mended.shells, mended.solid, strict=True):
        if solid:
            corners = mended.points[np.unique(shell)]
            low, high = corners.min(axis=0), corners.max(axis=0)
            shells.append(Shell(shared_tree(mended.points, shell), low, high))
    return Solids(mended.points, tuple(shells))
