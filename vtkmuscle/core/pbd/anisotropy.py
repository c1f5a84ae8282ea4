"""Stiffness of edges along the fibres of a muscle.

Kohout and Cervenka 2021, eq. 9, doi:10.1007/978-3-030-72379-8_24.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.harmonic import harmonic_field, triangle_gradients
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import proper_segments, segment_distances
from vtkmuscle.core.mesh.surface import MeshTopology
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.types import Floats, Ints

#: Difference within which segments with a common end count as equally near, as a part of the longest.
EQUALLY_NEAR = 5e-8


def edge_stiffness(points: Floats, edges: Ints, directions: Floats) -> Floats:
    """Return k = 1 - abs(u . v) for each edge.

    The unit vectors u are along the edges (k, 2), and k (k,) is 1 across the fibres and 0 along the fibres.
    Kohout and Cervenka 2021, eq. 9, reads k = 1 - u . v. An edge has no sign, so that eq. 9 gives 0 or 2 by
    the order of the edge's ends; "if both vectors are collinear, the result will be zero" calls for the
    absolute value. The directions v (k, 3) of the fibres are unit vectors, 0 at edges without a direction.
    """
    difference = points[edges[:, 1]] - points[edges[:, 0]]
    lengths = np.linalg.norm(difference, axis=1)
    along = np.abs(np.einsum("ij,ij->i", difference, directions))
    cosines = np.divide(along, lengths, out=np.zeros(len(edges)), where=lengths > 0)
    stiffness: Floats = 1.0 - np.clip(cosines, 0.0, 1.0)
    return stiffness


def fibre_directions_at(queries: Floats, fibre_points: Floats, offsets: Ints) -> Floats:
    """Return directions of the nearest fibre segments. Unit vectors (q, 3) at positions (q, 3)."""
    a, b, lengths = proper_segments(fibre_points, offsets)
    ends = np.stack([a, b], axis=1).reshape(-1, 3)
    triangles = 2 * np.arange(len(a))[:, None] + np.array(
        [0, 1, 1]
    )  # each segment as a triangle without area
    nearest, _, distances = triangle_tree(ends, triangles).nearest(queries)
    _, first, point = np.unique(ends, axis=0, return_index=True, return_inverse=True)
    first, limit = first[point.reshape(-1, 2)] // 2, distances + EQUALLY_NEAR * lengths.max()
    for end in (0, 1):  # of equally near segments with a common end the first counts
        other = first[nearest, end]
        equal = segment_distances(queries, a[other], b[other]) <= limit
        nearest = np.where(equal, other, nearest)
    return (b[nearest] - a[nearest]) / lengths[nearest, None]


def harmonic_directions(points: Floats, topology: MeshTopology, fixed_to: Ints) -> Floats | None:
    """Return the unit direction along a muscle at each edge.

    The directions (k, 3) lead from one end of a muscle without fibres to the other end. A direction is the
    mean of the unit gradients, in the edge's two triangles, of
    :func:`~vtkmuscle.core.mesh.harmonic.harmonic_field`; 0 where the field is constant (inside an
    attachment). None where fewer than two bones have fixed points.
    """
    field = harmonic_field(points, topology.triangles, fixed_to)
    if field is None:
        return None
    gradients = unit_vectors(triangle_gradients(points, topology.triangles, field))
    gradients = np.vstack([gradients, np.zeros(3)])  # row -1: no triangle
    return unit_vectors(gradients[topology.edge_triangles].sum(axis=1))
