"""Triangle meshes: edges, lengths, stretches, volume, orientation, topology."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.types import ROUNDING, Floats, Ints

#: Largest part of a whole that is noise of a segmentation: a contact, a branch, a piece, an overlap. If small
#: contacts counted, mean lengths of fibres in estimated muscles of a knee would change by 0.4 mm.
NOISE = 0.05
#: Largest change of a surface's volume as it is made or repaired, and largest part in holes. A ball loses
#: three times the square of the part to a flat cap: 0.03 % of the volume.
MOST_REPAIRED = 0.01


def half_edges(triangles: Ints) -> Ints:
    """Return directed edges (3 m, 2) of triangles (m, 3): (a, b), (b, c), (c, a)."""
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def faces_between(triangles: Ints, ids: Ints) -> Ints:
    """Return the triangles (k, 3) with all corners among point ids."""
    return triangles[np.isin(triangles, ids).all(axis=1)]


def unique_edges(triangles: Ints) -> Ints:
    """Return each undirected edge once, (k, 2). Triangles (m, 3). Sorted, the smaller point id first."""
    return numbered_edges(triangles)[0]


def numbered_edges(triangles: Ints) -> tuple[Ints, Ints]:
    """Return edges (k, 2), and each half-edge's edge (3 m,).

    Edges are sorted, the smaller point id first; half-edges are in the order of :func:`half_edges`.
    """
    ends, count = triangles[:, [1, 2, 0]], int(triangles.max(initial=0)) + 1
    keys = np.minimum(triangles, ends) * count + np.maximum(triangles, ends)
    keys, edge_of = np.unique(keys.reshape(-1), return_inverse=True)
    return np.column_stack(np.divmod(keys, count)), edge_of


def sorted_into_bins(bins: Ints, n_bins: int) -> tuple[Ints, Ints]:
    """Return indices sorted by bin (n,), and bins' starts.

    Bin b has the ascending indices ``order[starts[b] : starts[b + 1]]``.
    """
    return np.argsort(bins, kind="stable"), np.append(0, np.cumsum(np.bincount(bins, minlength=n_bins)))


def edge_uses(triangles: Ints) -> Ints:
    """Return the number of triangles at each unique edge, (k,). It is 2 in a closed surface."""
    return np.bincount(numbered_edges(triangles)[1])


def edge_lengths(points: Floats, edges: Ints) -> Floats:
    """Return the length of each edge, (k,). In the unit of the points."""
    columns = np.ascontiguousarray(points.T)  # four times as fast by long rows
    apart = columns.take(edges[:, 1], axis=1) - columns.take(edges[:, 0], axis=1)
    return np.asarray(np.sqrt((apart * apart).sum(axis=0)))


def side_products(points: Floats, triangles: Ints) -> Floats:
    """Return products a . a, a . b, b . b of triangle sides, (3, m) [mm^2]."""
    first, second, third = np.ascontiguousarray(points.T).take(triangles.T, axis=1).swapaxes(0, 1)
    a, b = second - first, third - second
    return np.stack([sum(p * q) for p, q in ((a, a), (a, b), (b, b))])


def triangle_stretches(rest: Floats, now: Floats) -> tuple[Floats, Floats, Floats]:
    """Return least and greatest stretches of triangles, and rest areas. (m,) each, areas in [mm^2].

    Singular values of the map from a triangle at rest to its shape now: square roots of the eigenvalues of
    G^-1 H, for the 2 x 2 matrices G and H of :func:`side_products` (3, m) at rest and now. They are 1 for a
    triangle without area at rest.
    """
    squared, squared_now = (np.maximum(aa * bb - ab * ab, 0.0) for aa, ab, bb in (rest, now))
    areas: Floats = 0.5 * np.sqrt(squared)
    proper = areas > 0.0
    over = np.divide(1.0, squared, out=np.zeros_like(squared), where=proper)
    half = 0.5 * over * (rest[2] * now[0] - 2.0 * rest[1] * now[1] + rest[0] * now[2])
    apart = np.sqrt(np.maximum(half * half - over * squared_now, 0.0))
    squares = half - apart, half + apart
    least, greatest = (np.where(proper, np.sqrt(np.maximum(square, 0.0)), 1.0) for square in squares)
    return least, greatest, areas


def box_of(points: Floats) -> tuple[Floats, Floats]:
    """Return the box around points (n, 3). Its lowest and highest corner.

    numpy takes twenty times as long over rows of three as over three columns.
    """
    columns = np.ascontiguousarray(points.T)
    return columns.min(axis=1), columns.max(axis=1)


def used_alone(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return a surface (n, 3), (m, 3) without points of no triangle. The order of the points stays."""
    used, corners = np.unique(triangles, return_inverse=True)
    return points[used], corners.reshape(-1, 3)


def longest_side(points: Floats) -> float:
    """Return the longest side of a box. Around points (n, 3)."""
    return float(np.ptp(box_of(points), axis=0).max())


def diagonal(points: Floats) -> float:
    """Return the diagonal of a box. Around points (n, 3)."""
    return float(np.linalg.norm(np.ptp(box_of(points), axis=0)))


def signed_volume(points: Floats, triangles: Ints) -> float:
    """Return the volume, positive for outward triangles.

    V = sum over triangles (m, 3) of a . (b x c) / 6, about the centre of the points (n, 3), so a mesh far
    from the origin loses no digits.
    """
    columns = np.ascontiguousarray((points - points.mean(axis=0)).T)
    (ax, bx, cx), (ay, by, cy), (az, bz, cz) = columns.take(triangles.T, axis=1)
    return float((ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)).sum() / 6.0)


def mean_thickness(points: Floats, triangles: Ints) -> float:
    """Return the mean thickness 2 V / A [mm], as of a flat muscle. Raises a ValueError without volume."""
    volume = signed_volume(points, triangles)
    check_volume(points, volume)
    return 4.0 * abs(volume) / float(np.linalg.norm(triangle_normals(points, triangles), axis=1).sum())


def extent(points: Floats) -> float:
    """Return twice the largest distance from the mean. Points (n, 3). No rotation changes the value."""
    return 2.0 * float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def point_components(n_points: int, edges: Ints) -> Ints:
    """Return the connected component of each point, (n_points,)."""
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n_points, n_points))
    return np.asarray(connected_components(graph, directed=False)[1].astype(np.int64))


class SurfaceReport(NamedTuple):
    """Facts about a triangle mesh."""

    n_points: int
    n_triangles: int
    n_components: int  # connected parts among the points that triangles use
    n_unused_points: int  # points without triangles
    n_boundary_edges: int  # edges of a single triangle; 0 for a closed surface
    n_nonmanifold_edges: int  # edges of more than two triangles
    n_misoriented_edges: int  # edges whose two triangles run through it in the same direction
    n_degenerate_triangles: int  # triangles with a repeated point or of zero area
    area: float
    volume: float  # signed

    @property
    def closed(self) -> bool:
        """True for a mesh without boundary edges."""
        return self.n_boundary_edges == 0

    @property
    def manifold(self) -> bool:
        """True for edges of at most two triangles."""
        return self.n_nonmanifold_edges == 0

    @property
    def oriented(self) -> bool:
        """True for neighbours that agree on their side."""
        return self.n_misoriented_edges == 0


def survey(points: Floats, triangles: Ints) -> SurfaceReport:
    """Return the facts about a mesh. Points (n, 3), triangles (m, 3), m >= 1."""
    directed = half_edges(triangles)
    edges, edge_of = numbered_edges(triangles)
    uses = np.bincount(edge_of)
    balance = np.bincount(edge_of, weights=np.where(directed[:, 0] < directed[:, 1], 1, -1))
    double_areas = np.linalg.norm(triangle_normals(points, triangles), axis=1)
    used = np.unique(triangles)
    of_points = len(np.unique(point_components(len(points), edges)[used])), len(points) - len(used)
    of_edges = (int(bad.sum()) for bad in (uses == 1, uses > 2, (uses == 2) & (balance != 0)))
    degenerate, area = int((double_areas == 0).sum()), float(double_areas.sum() / 2.0)
    sizes = degenerate, area, signed_volume(points, triangles)
    return SurfaceReport._make([len(points), len(triangles), *of_points, *of_edges, *sizes])


def check_volume(points: Floats, volume: float) -> None:
    """Raise a ValueError for a surface without volume. Points (n, 3) [mm], volume [mm^3]."""
    size = diagonal(points)
    if abs(volume) <= ROUNDING * size**3:
        problem = f"the surface encloses no volume ({volume:.3g} within a box of diagonal {size:.3g})"
        raise InputError("", problem, "give a closed surface with all triangles facing outward")


@dataclass(frozen=True, eq=False)
class MeshTopology:
    """Edges of a mesh and their triangles, by :func:`mesh_topology`."""

    n_points: int
    triangles: Ints  # (m, 3)
    edges: Ints  # (k, 2), each undirected edge once, sorted, the smaller point id first
    edge_triangles: Ints  # (k, 2), triangles at each edge, -1 for a missing second
    #: (q, 4), p1 to p4 for each edge of exactly two triangles: (p1, p2, p3) is the first, and p4 the third
    #: point of the second. In the order of ``edges``.
    quads: Ints

    @property
    def n_boundary_edges(self) -> int:
        """Number of boundary edges; 0 for a closed surface."""
        return int((self.edge_triangles[:, 1] < 0).sum())


def mesh_topology(n_points: int, triangles: Ints) -> MeshTopology:
    """Return the edges of a mesh and their triangles.

    `n_points` exceeds any id. Edges of one triangle (a boundary) or of more than two (not manifold) have no
    quadruple, as no dihedral angle is defined. Triangles with a repeated point take no part.
    """
    proper = np.flatnonzero((triangles != np.roll(triangles, 1, axis=1)).all(axis=1))
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
    first_half, second_half = order[of_two], order[of_two + 1]
    quads = np.column_stack([directed[first_half], opposite[first_half], opposite[second_half]])
    return MeshTopology(n_points, triangles, edges, edge_triangles, quads)


def opposite_half_edges(triangles: Ints) -> Ints:
    """Return the opposite half-edges (3 m,) of a closed surface.

    Half-edge 3 i + j runs from corner j of triangle i to the next corner; its opposite runs back in the
    neighbouring triangle. A ValueError says that the surface is open, or neighbouring triangles face
    different sides.
    """
    directed, edge_of = half_edges(triangles), numbered_edges(triangles)[1]
    up = directed[:, 0] < directed[:, 1]
    alone = int(np.abs(np.bincount(edge_of, np.where(up, 1, -1))).sum())
    if alone:
        problem = f"the surface must be closed and oriented, but {alone} triangle edge(s) have no counterpart"
        raise InputError("", problem, "fill its holes and run vtkPolyDataNormals with ConsistencyOn")
    # The n-th half-edge forth along an edge pairs with the n-th back.
    forth, back = (half[np.argsort(edge_of[half], kind="stable")] for half in map(np.flatnonzero, (up, ~up)))
    opposite = np.empty(len(directed), dtype=np.int64)
    opposite[forth], opposite[back] = back, forth
    return opposite
