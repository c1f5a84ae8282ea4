"""What a muscle's surface is like at rest, and how far a deformed one is from that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.constraints import dihedral_angle, volume_and_gradient
from vtkmuscle.core.mesh import edge_lengths
from vtkmuscle.core.topology import MeshTopology

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: A surface of less volume than this part of its box's diagonal cubed encloses nothing.
LEAST_VOLUME = 1e-9


@dataclass(frozen=True)
class ShapeReport:
    """How well a deformed surface keeps what the constraints ask for.

    Attributes
    ----------
    volume_ratio : float
        V / V0.
    edge_stretch_p50, edge_stretch_p95, edge_stretch_max : float
        Median, 95th percentile and maximum of l / l0 over all edges.
    dihedral_error_p50, dihedral_error_p95 : float
        Median and 95th percentile of the absolute change of the angles between neighbouring triangles
        [degrees].
    degenerate_edges : int
        Edges that had an angle between their triangles at rest and have none now, for a triangle beside them
        has collapsed.
    """

    volume_ratio: float
    edge_stretch_p50: float
    edge_stretch_p95: float
    edge_stretch_max: float
    dihedral_error_p50: float
    dihedral_error_p95: float
    degenerate_edges: int


class RestShape:
    """Lengths, angles and volume of a closed surface at rest.

    Parameters
    ----------
    points : (n, 3) array
        Positions at rest [mm].
    topology : MeshTopology
        Of the surface.

    Attributes
    ----------
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

    def __init__(self, points: Floats, topology: MeshTopology) -> None:
        if topology.n_boundary_edges:
            raise ValueError(
                f"the surface is open: {topology.n_boundary_edges} edges belong to one triangle only; "
                "close it (vtkFillHolesFilter), for an open surface has no volume to keep"
            )
        self._topology = topology
        self.lengths: Floats = edge_lengths(points, topology.edges)
        self.angles, self.angle_defined = self._angles(points)
        self.volume_gradient: Floats = np.empty_like(points)
        self.volume: float = volume_and_gradient(points, topology.triangles, self.volume_gradient)
        diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
        if abs(self.volume) <= LEAST_VOLUME * diagonal**3:
            raise ValueError(
                f"the surface encloses no volume ({self.volume:.3g} within a box of diagonal "
                f"{diagonal:.3g}); it must be a closed surface with all triangles facing outward"
            )

    def _angles(self, positions: Floats) -> tuple[Floats, Bools]:
        p1, p2, p3, p4 = (positions[self._topology.quads[:, i]] for i in range(4))
        return dihedral_angle(p1, p2, p3, p4)

    def compare(self, positions: Floats) -> ShapeReport:
        """Return how far a deformed surface, (n, 3) positions [mm], is from rest."""
        volume = volume_and_gradient(positions, self._topology.triangles, np.empty_like(positions))
        long = self.lengths > 0
        stretch = edge_lengths(positions, self._topology.edges[long]) / self.lengths[long]
        median, high = np.percentile(stretch, [50.0, 95.0])
        angles, defined = self._angles(positions)
        change = np.abs(angles - self.angles)[defined & self.angle_defined]
        change = np.degrees(np.minimum(change, 2.0 * math.pi - change))
        errors = np.percentile(change, [50.0, 95.0]) if len(change) else np.zeros(2)
        return ShapeReport(
            volume_ratio=volume / self.volume,
            edge_stretch_p50=float(median),
            edge_stretch_p95=float(high),
            edge_stretch_max=float(stretch.max()),
            dihedral_error_p50=float(errors[0]),
            dihedral_error_p95=float(errors[1]),
            degenerate_edges=int((self.angle_defined & ~defined).sum()),
        )
