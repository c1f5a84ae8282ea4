"""What is next to what on a triangle mesh: triangles beside an edge, half-edges, and dihedral quadruples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import half_edges, numbered_edges, sorted_into_bins
from vtkmuscle.core.types import Ints


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
    edges, edge_of = numbered_edges(triangles[proper])
    order, starts = sorted_into_bins(edge_of, len(edges))
    first, uses = starts[:-1], np.diff(starts)

    edge_triangles = np.full((len(edges), 2), -1, dtype=np.int64)
    edge_triangles[:, 0] = triangle_of[order[first]]
    shared = uses >= 2
    edge_triangles[shared, 1] = triangle_of[order[first[shared] + 1]]

    quad_edges = np.flatnonzero(uses == 2)
    one, other = order[first[quad_edges]], order[first[quad_edges] + 1]
    quads = np.column_stack([directed[one], opposite[one], opposite[other]])
    return MeshTopology(n_points, triangles, edges, edge_triangles, quads, quad_edges)


def opposite_half_edges(triangles: Ints) -> Ints:
    """Return for each half-edge of a closed surface the one that runs along it in the other triangle.

    Parameters
    ----------
    triangles : (m, 3) int array
        Point ids; half-edge 3 i + j runs from corner j of triangle i to the next corner.

    Returns
    -------
    (3 m,) int array
        Half-edges.

    Raises
    ------
    ValueError
        If the surface is open, or neighbouring triangles face different sides.
    """
    directed, edge_of = half_edges(triangles), numbered_edges(triangles)[1]
    opposite = np.full(len(directed), -1, dtype=np.int64)
    ways = [np.flatnonzero(way) for way in (directed[:, 0] < directed[:, 1], directed[:, 0] > directed[:, 1])]
    # The first of those that run one way along an edge goes with the first of the other way, and so on.
    forth, back = (way[np.argsort(edge_of[way], kind="stable")] for way in ways)
    nth_forth, nth_back = (
        edge_of[way] * len(directed) + np.arange(len(way)) - np.searchsorted(edge_of[way], edge_of[way])
        for way in (forth, back)
    )
    _, one, other = np.intersect1d(nth_forth, nth_back, return_indices=True)
    opposite[forth[one]], opposite[back[other]] = back[other], forth[one]
    alone = int((opposite < 0).sum())
    if alone:
        raise InputError(
            "",
            f"the surface must be closed and its triangles must agree on the outside, but {alone} triangle "
            "edge(s) have no counterpart",
            "fill its holes and run vtkPolyDataNormals with ConsistencyOn",
        )
    return opposite
