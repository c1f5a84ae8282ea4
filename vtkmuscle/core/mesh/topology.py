"""What is next to what on a triangle mesh: edges, the triangles beside them, and dihedral quadruples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.mesh.surface import half_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MeshTopology:
    """Neighbourhood of the edges of a triangle mesh, built once by :func:`mesh_topology`.

    Attributes
    ----------
    n_points : int
        Number of points of the mesh.
    triangles : (m, 3) int array
        Point ids.
    edges : (k, 2) int array
        Each undirected edge once, sorted, the smaller point id first.
    edge_triangles : (k, 2) int array
        Two triangles beside each edge, -1 where there is none (an edge of more triangles keeps two).
    quads : (q, 4) int array
        For each edge of exactly two triangles (p1, p2, p3, p4): p1 to p2 is the edge as the first triangle
        (p1, p2, p3) runs through it, p4 is the other triangle's third point. In the order of ``edges``.
    quad_edges : (q,) int array
        The edge of each quadruple.
    """

    n_points: int
    triangles: Ints
    edges: Ints
    edge_triangles: Ints
    quads: Ints
    quad_edges: Ints

    @property
    def n_boundary_edges(self) -> int:
        """Edges of one triangle only; 0 for a closed surface."""
        return int((self.edge_triangles[:, 1] < 0).sum())


def mesh_topology(n_points: int, triangles: Ints) -> MeshTopology:
    """Return the edges of a mesh and what lies beside them.

    Edges of one triangle (a boundary) or of more than two (not manifold) get no quadruple: no dihedral
    angle is defined there. Degenerate triangles, with a repeated point, take no part.

    Parameters
    ----------
    n_points : int
        Number of points, more than any id.
    triangles : (m, 3) int array
        Point ids.

    Returns
    -------
    MeshTopology
        Edges, triangles beside them, quadruples.
    """
    a, b, c = triangles.T
    proper = np.flatnonzero((a != b) & (b != c) & (c != a))
    directed = half_edges(triangles[proper])
    opposite = triangles[proper][:, [2, 0, 1]].reshape(-1)
    triangle_of = np.repeat(proper, 3)

    keys = directed.min(axis=1) * np.int64(n_points) + directed.max(axis=1)
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(np.diff(keys[order], prepend=-1))
    uses = np.diff(first, append=len(keys))
    edges = np.column_stack(np.divmod(keys[order[first]], max(n_points, 1)))

    edge_triangles = np.full((len(edges), 2), -1, dtype=np.int64)
    edge_triangles[:, 0] = triangle_of[order[first]]
    shared = uses >= 2
    edge_triangles[shared, 1] = triangle_of[order[first[shared] + 1]]

    quad_edges = np.flatnonzero(uses == 2)
    one, other = order[first[quad_edges]], order[first[quad_edges] + 1]
    quads = np.column_stack([directed[one], opposite[one], opposite[other]])
    return MeshTopology(n_points, triangles, edges, edge_triangles, quads, quad_edges)
