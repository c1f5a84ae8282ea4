"""What a muscle's surface is like at rest, with the angles at its edges, and how far another is from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vtkmuscle.core.jit import lane, vector_kernel
from vtkmuscle.core.mesh.enclosed_volume import volume_and_gradient
from vtkmuscle.core.mesh.surface import MeshTopology, check_volume, edge_lengths, signed_volume
from vtkmuscle.core.types import Bools, Floats, Ints

#: Triangles whose corner at the edge has a tangent below this have no normal worth speaking of.
DEGENERATE_TANGENT = 1e-9
#: Triangles this much less high than long are slivers: a thousandth of their length turns them over.
SLIVER = 1e-3


@lane
def hinge(
    x1: float, y1: float, z1: float,
    x2: float, y2: float, z2: float,
    x3: float, y3: float, z3: float,
    x4: float, y4: float, z4: float,
) -> tuple[Any, ...]:  # fmt: skip
    """Return the geometry of two triangles (p1, p2, p3) and (p2, p1, p4) that share the edge e = p2 - p1.

    The signed angle phi between their normals n1 = e x (p3 - p1) and n2 = (p4 - p1) x e has
    sin phi = (n1 x n2) . e / (|e| |n1| |n2|) and cos phi = n1 . n2 / (|n1| |n2|): it is 0 where flat,
    positive where convex. As n1 is normal to e, (n1 x n2) . e = -|e|^2 n1 . (p4 - p1).

    Returns
    -------
    proper : bool
        Whether both triangles have a normal, of which the tangent of the corner at p1 decides.
    sine, cosine : float
        Both times |n1| |n2|.
    ee, ae, be : float
        |e|^2, (p3 - p1) . e, (p4 - p1) . e.
    n11, n22 : float
        |n1|^2, |n2|^2.
    n1x, n1y, n1z, n2x, n2y, n2z : float
        The normals.
    """
    ex, ey, ez = x2 - x1, y2 - y1, z2 - z1
    ax, ay, az = x3 - x1, y3 - y1, z3 - z1
    bx, by, bz = x4 - x1, y4 - y1, z4 - z1
    n1x, n1y, n1z = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    n2x, n2y, n2z = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
    ee = ex * ex + ey * ey + ez * ez
    ae = ax * ex + ay * ey + az * ez
    be = bx * ex + by * ey + bz * ez
    n11 = n1x * n1x + n1y * n1y + n1z * n1z
    n22 = n2x * n2x + n2y * n2y + n2z * n2z
    least = DEGENERATE_TANGENT * DEGENERATE_TANGENT
    proper = (n11 > least * (ae * ae)) & (n22 > least * (be * be)) & (n11 * n22 > 0.0)
    sine = -math.sqrt(ee) * (n1x * bx + n1y * by + n1z * bz)
    cosine = n1x * n2x + n1y * n2y + n1z * n2z
    return proper, sine, cosine, ee, ae, be, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z


def dihedral_angles(points: Floats, quads: Ints) -> tuple[Floats, Bools]:
    """Return the signed angles (q,) between neighbouring triangles, and False where one is not defined, (q,).

    0 where flat, positive where convex, in (-pi, pi]; see :func:`hinge`.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    quads : (q, 4) int array
        As in :class:`~vtkmuscle.core.mesh.surface.MeshTopology`.

    Returns
    -------
    angles : (q,) array
        Radians; 0 where the angle is not defined.
    defined : (q,) bool array
        False where one of the triangles is degenerate.
    """
    angles, defined = np.zeros(len(quads)), np.zeros(len(quads), dtype=np.bool_)
    _hinges(points, quads, angles, defined)
    return angles, defined


@vector_kernel
def _hinges(p: Floats, quads: Ints, angles: Floats, defined: Bools) -> None:
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        found = hinge(
            p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2],
            p[k, 0], p[k, 1], p[k, 2], p[m, 0], p[m, 1], p[m, 2],
        )  # fmt: skip
        proper, sine, cosine = found[0], found[1], found[2]
        if proper:
            angle = math.atan2(sine, cosine)
            angles[q], defined[q] = angle if angle > -math.pi else math.pi, True


def beside_slivers(points: Floats, quads: Ints) -> Bools:
    """Return which edges (q,) have a sliver of a triangle beside them: its angle says nothing of a shape.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    quads : (q, 4) int array
        As in :class:`~vtkmuscle.core.mesh.surface.MeshTopology`.
    """
    found = np.zeros(len(quads), dtype=np.bool_)
    for corners in (points[quads[:, :3]], points[quads[:, [0, 1, 3]]]):
        sides = np.roll(corners, -1, axis=1) - corners
        doubled = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        found |= doubled < SLIVER * (sides**2).sum(axis=2).max(axis=1)
    return found


_Spread = tuple[float, float, float]

#: Edges run along the fibres where |u . v| is more than the cosine of 18 degrees, across them where it is
#: less than that of 72 degrees.
ALONG, ACROSS = math.cos(math.radians(18.0)), math.cos(math.radians(72.0))


@dataclass(frozen=True)
class ShapeReport:
    """How well a deformed surface keeps the shape that it has at rest.

    Attributes
    ----------
    volume_ratio : float
        V / V0.
    edge_stretch_p95, edge_stretch_max : float
        95th percentile and maximum of l / l0 over all edges.
    dihedral_error_p95 : float
        95th percentile of the absolute change of the angles between neighbouring triangles, none of them a
        sliver at rest [degrees].
    degenerate_edges : int
        Edges that had an angle between their triangles at rest and have none now, for a triangle beside them
        has collapsed.
    along, across : (3,) tuple or None
        5th percentile, median and 95th percentile of l / l0 of the edges within 18 degrees of the fibres, and
        of those over 72 degrees from them; None where no directions were given or no such edges exist.
    """

    volume_ratio: float
    edge_stretch_p95: float
    edge_stretch_max: float
    dihedral_error_p95: float
    degenerate_edges: int
    along: tuple[float, float, float] | None = None
    across: tuple[float, float, float] | None = None


class RestShape:
    """Lengths, angles and volume of a closed surface at rest.

    Parameters
    ----------
    points : (n, 3) array
        Positions at rest [mm].
    topology : MeshTopology
        Of the surface.
    directions : (k, 3) array, optional
        Unit direction of the fibres at each edge, 0 where there is none: edges along and across them are
        compared apart.

    Attributes
    ----------
    points, topology
        As given.
    lengths : (k,) array
        Of the edges [mm].
    angles, angle_defined : (q,) arrays
        Signed dihedral angles of the quadruples [radians], and False beside degenerate triangles.
    volume : float
        [mm^3].
    volume_gradient : (n, 3) array
        dV / dp [mm^2].

    Raises
    ------
    ValueError
        If the surface is open or encloses no volume.
    """

    def __init__(self, points: Floats, topology: MeshTopology, directions: Floats | None = None) -> None:
        if topology.n_boundary_edges:
            raise ValueError(
                f"the surface is open: {topology.n_boundary_edges} edges belong to one triangle only; "
                "close it (vtkFillHolesFilter), for an open surface has no volume to keep"
            )
        self.points, self.topology = points, topology
        self.lengths: Floats = edge_lengths(points, topology.edges)
        long = self.lengths > 0
        self._long_edges = np.ascontiguousarray(topology.edges[long])
        self._long_lengths: Floats = self.lengths[long]
        self.angles, self.angle_defined = dihedral_angles(points, topology.quads)
        bent = self.angle_defined & ~beside_slivers(points, topology.quads)
        self._bent_quads, self._bent_angles = np.ascontiguousarray(topology.quads[bent]), self.angles[bent]
        self.volume_gradient: Floats = np.empty_like(points)
        self.volume: float = volume_and_gradient(points, topology.triangles, self.volume_gradient)
        check_volume(points, self.volume)
        self._directed = None if directions is None else self._along_and_across(directions[long])

    def _along_and_across(self, v: Floats) -> tuple[Ints, Ints]:
        """Return which of the long edges run along and across directions v (k, 3) of the fibres."""
        ends = self.points[self._long_edges]
        u = (ends[:, 1] - ends[:, 0]) / self._long_lengths[:, None]
        cosines = np.abs(np.einsum("ij,ij->i", u, v))
        known = (v != 0.0).any(axis=1)
        return np.flatnonzero(known & (cosines > ALONG)), np.flatnonzero(known & (cosines < ACROSS))

    def compare(self, positions: Floats) -> ShapeReport:
        """Return how far a deformed surface, of positions (n, 3) [mm], is from rest."""
        stretch = edge_lengths(positions, self._long_edges) / self._long_lengths
        angles, defined = dihedral_angles(positions, self._bent_quads)
        turns = np.abs(angles - self._bent_angles)[defined]
        turns = np.minimum(turns, 2.0 * np.pi - turns)
        along, across = self._directed or (None, None)
        return ShapeReport(
            volume_ratio=signed_volume(positions, self.topology.triangles) / self.volume,
            edge_stretch_p95=float(np.percentile(stretch, 95.0)),
            edge_stretch_max=float(stretch.max()),
            dihedral_error_p95=math.degrees(np.percentile(turns, 95.0)) if len(turns) else 0.0,
            degenerate_edges=len(defined) - len(turns),
            along=_spread(stretch, along),
            across=_spread(stretch, across),
        )


def _spread(stretch: Floats, edges: Ints | None) -> _Spread | None:
    if edges is None or not len(edges):
        return None
    low, median, high = np.percentile(stretch[edges], (5.0, 50.0, 95.0)).tolist()
    return low, median, high
