"""Meshes with edges half as long: each triangle in four, flat, or rounded as normals at its corners say."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.mesh.surface import numbered_edges, signed_volume
from vtkmuscle.core.types import Floats, Ints


def halved(points: Floats, triangles: Ints) -> tuple[Floats, Ints, Ints]:
    """Return a mesh with a point more in the middle of each edge, the same surface.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions [mm]; point ids.

    Returns
    -------
    points : (n + e, 3) array
        The given ones, then the middles of the e edges.
    triangles : (4 m, 3) int array
        Four for each, facing as before.
    edges : (e, 2) int array
        Ends of the edges, in the order of their middles.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.halving import halved
    >>> points, triangles, _ = halved(np.eye(3), np.array([[0, 1, 2]]))
    >>> len(points), len(triangles)
    (6, 4)
    """
    edges, number = numbered_edges(triangles)
    a, b, c = triangles.T
    ab, bc, ca = (len(points) + number.reshape(-1, 3)).T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    finer = np.stack([np.column_stack(part) for part in parts], axis=1).reshape(-1, 3)
    middles = points[edges].mean(axis=1)
    return np.vstack([points, middles]), finer, edges


def rounded_volume(points: Floats, triangles: Ints) -> float:
    """Return the volume of a closed mesh whose edges are halved and bulge as the normals at their ends say.

    The middle of an edge is that of the cubic whose ends are at right angles to the normals (Vlachos et al.
    2001, *Curved PN triangles*, doi:10.1145/364338.364387): it is off the chord's by an eighth of the
    difference of the end tangents. So it is the volume of a smooth surface's finer mesh, as far as the
    coarse one tells.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions [mm]; point ids, facing outward.

    Returns
    -------
    float
        [mm^3].
    """
    normals = vertex_normals(points, triangles)
    finer, parts, edges = halved(points, triangles)
    ends = normals[edges]
    chords = points[edges[:, 1]] - points[edges[:, 0]]
    along = (chords[:, None] * ends).sum(axis=2)  # (e, 2): how far the chord leaves each tangent plane
    finer[len(points) :] += (along[:, 1:] * ends[:, 1] - along[:, :1] * ends[:, 0]) / 8.0
    return float(signed_volume(finer, parts))
