"""Facts about triangle meshes: edges and what is beside them, lengths, stretches, volume, orientation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.types import Floats, Ints

#: Least volume of a surface that encloses something, as a part of its box's diagonal cubed.
LEAST_VOLUME = 1e-9


def half_edges(triangles: Ints) -> Ints:
    """Return the directed edges (3 m, 2) of triangles (m, 3): (a, b), (b, c), (c, a) of each in turn."""
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def faces_between(triangles: Ints, ids: Ints) -> Ints:
    """Return the triangles (k, 3) all of whose points are among the given ids."""
    member = np.zeros(int(triangles.max(initial=-1)) + 1, dtype=np.bool_)
    member[ids[ids < len(member)]] = True
    return triangles[member[triangles].all(axis=1)]


def unique_edges(triangles: Ints) -> Ints:
    """Return each undirected edge of triangles (m, 3) once, (k, 2), sorted, the smaller point id first."""
    return numbered_edges(triangles)[0]


def numbered_edges(triangles: Ints) -> tuple[Ints, Ints]:
    """Return each undirected edge once, and the number of the edge that each half-edge runs along, (3 m,).

    Edges (k, 2) are sorted, the smaller point id first; half-edges are in the order of :func:`half_edges`.
    """
    ends, count = triangles[:, [1, 2, 0]], int(triangles.max(initial=0)) + 1
    keys = np.minimum(triangles, ends) * count + np.maximum(triangles, ends)
    keys, edge_of = np.unique(keys.reshape(-1), return_inverse=True)
    return np.column_stack(np.divmod(keys, count)), edge_of


def sorted_into_bins(bins: Ints, n_bins: int) -> tuple[Ints, Ints]:
    """Return the numbers 0 to n - 1 bin by bin, from the bin of each (n,), and where each bin starts.

    Those in bin b are ``order[starts[b] : starts[b + 1]]``, ascending.
    """
    starts = np.append(0, np.cumsum(np.bincount(bins, minlength=n_bins)))
    return np.argsort(bins, kind="stable"), starts


def edge_uses(triangles: Ints) -> Ints:
    """Return the number of triangles along each edge of :func:`unique_edges`, (k,): 2 in a closed surface."""
    return np.bincount(numbered_edges(triangles)[1])


def edge_lengths(points: Floats, edges: Ints) -> Floats:
    """Return the length of each edge, (k,), in the unit of the points."""
    columns = np.ascontiguousarray(points.T)  # of long rows they are found four times as fast
    apart = columns.take(edges[:, 1], axis=1) - columns.take(edges[:, 0], axis=1)
    lengths: Floats = np.sqrt((apart * apart).sum(axis=0))
    return lengths


def side_products(points: Floats, triangles: Ints) -> Floats:
    """Return the products a . a, a . b and b . b of two sides of each triangle (m, 3), (3, m) [mm^2]."""
    first, second, third = np.ascontiguousarray(points.T).take(triangles.T, axis=1).swapaxes(0, 1)
    a, b = second - first, third - second
    return np.stack([sum(p * q) for p, q in ((a, a), (a, b), (b, b))])


def triangle_stretches(rest: Floats, now: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the least and the greatest stretch (m,) of triangles, and their areas at rest (m,) [mm^2].

    These are the singular values of the map from a triangle at rest to itself now: the square roots of the
    eigenvalues of G^-1 H, of the 2 x 2 matrices G and H of :func:`side_products` (3, m) at rest and now. They
    are 1 for a triangle without area at rest.
    """
    squared, squared_now = (np.maximum(aa * bb - ab * ab, 0.0) for aa, ab, bb in (rest, now))
    areas: Floats = 0.5 * np.sqrt(squared)
    known = areas > 0.0
    over = np.divide(1.0, squared, out=np.zeros_like(squared), where=known)
    half = 0.5 * over * (rest[2] * now[0] - 2.0 * rest[1] * now[1] + rest[0] * now[2])
    apart = np.sqrt(np.maximum(half * half - over * squared_now, 0.0))
    least, greatest = (
        np.where(known, np.sqrt(np.maximum(square, 0.0)), 1.0) for square in (half - apart, half + apart)
    )
    return least, greatest, areas


def points_in_box(points: Floats, low: Floats, high: Floats) -> Ints:
    """Return the ids of the points (n, 3) in a box, its low and high corner (3,) included."""
    x, y, z = ((low[k] <= points[:, k]) & (points[:, k] <= high[k]) for k in range(3))
    return np.flatnonzero(x & y & z)


def signed_volume(points: Floats, triangles: Ints) -> float:
    """Return the volume inside a closed surface, positive where its triangles face outward.

    V = sum over triangles (m, 3) of a . (b x c) / 6, about the centre of the points (n, 3), so that a mesh
    far from the origin loses no digits.
    """
    columns = np.ascontiguousarray((points - points.mean(axis=0)).T)
    (ax, bx, cx), (ay, by, cy), (az, bz, cz) = columns.take(triangles.T, axis=1)
    return float((ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)).sum() / 6.0)


def mean_thickness(points: Floats, triangles: Ints) -> float:
    """Return 2 V / A of a closed surface, the thickness of a flat muscle [mm].

    Raises a ValueError where the surface encloses no volume.
    """
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice_area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    volume = signed_volume(points, triangles)
    check_volume(points, volume)
    return 4.0 * abs(volume) / twice_area


def extent(points: Floats) -> float:
    """Return twice the distance of the farthest of points (n, 3) from their mean, which no turn changes."""
    return 2.0 * float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def point_components(n_points: int, edges: Ints) -> Ints:
    """Return the number of the connected component of each point, (n_points,)."""
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n_points, n_points))
    labels: Ints = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


@dataclass(frozen=True)
class SurfaceReport:
    """Facts about a triangle mesh."""

    n_points: int
    n_triangles: int
    n_components: int  # connected parts among the points that triangles use
    n_unused_points: int  # points that no triangle uses
    n_boundary_edges: int  # edges of one triangle only; 0 for a closed surface
    n_nonmanifold_edges: int  # edges of more than two triangles
    n_misoriented_edges: int  # edges whose two triangles run through it in the same direction
    n_degenerate_triangles: int  # triangles with a repeated point or of zero area
    area: float
    volume: float  # signed

    @property
    def closed(self) -> bool:
        """True where no edge is a boundary."""
        return self.n_boundary_edges == 0

    @property
    def manifold(self) -> bool:
        """True where no edge has more than two triangles."""
        return self.n_nonmanifold_edges == 0

    @property
    def oriented(self) -> bool:
        """True where neighbouring triangles agree on their side."""
        return self.n_misoriented_edges == 0


def survey(points: Floats, triangles: Ints) -> SurfaceReport:
    """Return the facts about a mesh, points (n, 3) and triangles (m, 3), m >= 1."""
    directed = half_edges(triangles)
    edges, edge_of = numbered_edges(triangles)
    uses = np.bincount(edge_of)
    balance = np.bincount(edge_of, weights=np.where(directed[:, 0] < directed[:, 1], 1, -1))
    double_areas = np.linalg.norm(triangle_normals(points, triangles), axis=1)
    used = np.unique(triangles)
    labels = point_components(len(points), edges)
    return SurfaceReport(
        n_points=len(points),
        n_triangles=len(triangles),
        n_components=len(np.unique(labels[used])),
        n_unused_points=len(points) - len(used),
        n_boundary_edges=int((uses == 1).sum()),
        n_nonmanifold_edges=int((uses > 2).sum()),
        n_misoriented_edges=int(((uses == 2) & (balance != 0)).sum()),
        n_degenerate_triangles=int((double_areas == 0).sum()),
        area=float(double_areas.sum() / 2.0),
        volume=signed_volume(points, triangles),
    )


def check_volume(points: Floats, volume: float) -> None:
    """Raise a ValueError where a surface of points (n, 3) [mm] encloses no volume [mm^3]."""
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if abs(volume) <= LEAST_VOLUME * diagonal**3:
        raise InputError(
            "",
            f"the surface encloses no volume ({volume:.3g} within a box of diagonal {diagonal:.3g})",
            "it must be a closed surface with all triangles facing outward",
        )


@dataclass(frozen=True, eq=False)
class MeshTopology:
    """The edges of a triangle mesh and what is beside them, made by :func:`mesh_topology`."""

    n_points: int
    triangles: Ints  # (m, 3)
    edges: Ints  # (k, 2), each undirected edge once, sorted, the smaller point id first
    edge_triangles: Ints  # (k, 2), two of the triangles beside each edge, -1 where there is none
    #: (q, 4), for each edge of exactly two triangles (p1, p2, p3, p4): p1 to p2 is the edge as the first
    #: triangle (p1, p2, p3) runs through it, p4 is the other's third point. In the order of ``edges``.
    quads: Ints

    @property
    def n_boundary_edges(self) -> int:
        """Edges of one triangle only; 0 for a closed surface."""
        return int((self.edge_triangles[:, 1] < 0).sum())


def mesh_topology(n_points: int, triangles: Ints) -> MeshTopology:
    """Return the edges of a mesh and the triangles beside them; n_points is more than any id.

    Edges of one triangle (a boundary) or of more than two (not manifold) get no quadruple: no dihedral angle
    is defined there. Triangles with a repeated point take no part.
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

    of_two = first[uses == 2]
    one, other = order[of_two], order[of_two + 1]
    quads = np.column_stack([directed[one], opposite[one], opposite[other]])
    return MeshTopology(n_points, triangles, edges, edge_triangles, quads)


def opposite_half_edges(triangles: Ints) -> Ints:
    """Return for each half-edge (3 m,) of a closed surface the one along it in the other triangle.

    Half-edge 3 i + j runs from corner j of triangle i to the next corner. A ValueError says that the surface
    is open, or neighbouring triangles face different sides.
    """
    directed, edge_of = half_edges(triangles), numbered_edges(triangles)[1]
    opposite = np.full(len(directed), -1, dtype=np.int64)
    ways = [np.flatnonzero(way) for way in (directed[:, 0] < directed[:, 1], directed[:, 0] > directed[:, 1])]
    # The n-th half-edge that runs one way along an edge goes with the n-th of the other way.
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
