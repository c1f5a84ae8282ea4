"""How stiff each edge of a muscle's surface is, by its direction to the muscle's fibres."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.harmonic import harmonic_field, triangle_gradients
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.surface import MeshTopology
from vtkmuscle.core.types import Floats, Ints


def edge_stiffness(points: Floats, edges: Ints, directions: Floats) -> Floats:
    """Return k = 1 - |u . v| for each edge: 1 across the fibres, 0 along them.

    Kohout and Cervenka 2021, eq. 9, which reads k = 1 - u . v. An edge has no sign, and so that reads as 0 or
    as 2, by the order in which its ends are named; "if both vectors are collinear, the result will be zero"
    says which: the absolute value.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    edges : (k, 2) int array
        Point ids.
    directions : (k, 3) array
        Unit direction v of the fibres at each edge, 0 where there is none.

    Returns
    -------
    (k,) array
        In [0, 1].
    """
    difference = points[edges[:, 1]] - points[edges[:, 0]]
    lengths = np.linalg.norm(difference, axis=1)
    along = np.abs(np.einsum("ij,ij->i", difference, directions))
    cosines = np.divide(along, lengths, out=np.zeros(len(edges)), where=lengths > 0)
    stiffness: Floats = 1.0 - np.clip(cosines, 0.0, 1.0)
    return stiffness


def harmonic_directions(points: Floats, topology: MeshTopology, fixed_to: Ints) -> Floats | None:
    """Return the direction from one end of a muscle to the other at each edge, where no fibres are known.

    It is the mean of the unit gradients, in the edge's two triangles, of the harmonic function between the
    points fixed to different bones (:func:`~vtkmuscle.core.mesh.harmonic.harmonic_field`).

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    topology : MeshTopology
        Of the muscle.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.

    Returns
    -------
    (k, 3) array or None
        Unit directions, 0 where the function is constant (inside an attachment); None where fewer than two
        bones have fixed points.
    """
    field = harmonic_field(points, topology.triangles, fixed_to)
    if field is None:
        return None
    gradients = unit_vectors(triangle_gradients(points, topology.triangles, field))
    gradients = np.vstack([gradients, np.zeros(3)])  # row -1: no triangle
    return unit_vectors(gradients[topology.edge_triangles].sum(axis=1))
