"""What a muscle's surface is like at rest, and how far a deformed one is from that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.mesh.enclosed_volume import volume_and_gradient
from vtkmuscle.core.mesh.hinges import dihedral_angles
from vtkmuscle.core.mesh.surface import check_volume, edge_lengths, signed_volume
from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.types import Floats, Ints

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
        95th percentile of the absolute change of the angles between neighbouring triangles [degrees].
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
        self._bent_quads = np.ascontiguousarray(topology.quads[self.angle_defined])
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
        turns = np.abs(angles - self.angles[self.angle_defined])[defined]
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
