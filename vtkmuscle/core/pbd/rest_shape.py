"""What a muscle's surface is like at rest, and how far a deformed one is from that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.mesh.surface import check_volume, edge_lengths, signed_volume
from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.pbd.constraints import hinge, volume_and_gradient
from vtkmuscle.core.types import Bools, Floats, Ints

_Spread = tuple[float, float, float]

#: Edges run along the fibres where |u . v| is more than the cosine of 18 degrees, across them where it is
#: less than that of 72 degrees.
ALONG, ACROSS = math.cos(math.radians(18.0)), math.cos(math.radians(72.0))


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
    along, across : (3,) tuple or None
        5th percentile, median and 95th percentile of l / l0 of the edges within 18 degrees of the fibres, and
        of those over 72 degrees from them; None where no directions were given or no such edges exist.
    """

    volume_ratio: float
    edge_stretch_p50: float
    edge_stretch_p95: float
    edge_stretch_max: float
    dihedral_error_p50: float
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

    Attributes
    ----------
    lengths : (k,) array
        Of the edges [mm].
    angles, angle_defined : (q,) arrays
        Signed dihedral angles of the quadruples [radians], and False beside degenerate triangles.
    angle_squares : (q,) array
        Length scales of the quadruples: the sum of the squares of the angle's gradients where both triangles
        are as tall as the longest of their edges at rest [1 / mm^2].
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
        self._rest = points
        self.lengths: Floats = edge_lengths(points, topology.edges)
        self._long = self.lengths > 0
        self._long_edges = np.ascontiguousarray(topology.edges[self._long])
        self._long_lengths: Floats = self.lengths[self._long]
        self.angles, self.angle_defined = dihedral_angles(points, topology.quads)
        self.angle_squares: Floats = _angle_squares(points, topology.quads)
        self._cosines, self._sines = np.cos(self.angles), np.sin(self.angles)
        #: Directions of fibres, and which of the long edges are along and across them.
        self._directed: tuple[Floats | None, Ints, Ints] = None, np.empty(0, np.int64), np.empty(0, np.int64)
        self.volume_gradient: Floats = np.empty_like(points)
        self.volume: float = volume_and_gradient(points, topology.triangles, self.volume_gradient)
        check_volume(points, self.volume)

    def compare(self, positions: Floats, directions: Floats | None = None) -> ShapeReport:
        """Return how far a deformed surface is from rest.

        Parameters
        ----------
        positions : (n, 3) array
            Now [mm].
        directions : (k, 3) array, optional
            Unit direction of the fibres at each edge at rest, 0 where there is none.
        """
        stretch = edge_lengths(positions, self._long_edges) / self._long_lengths
        median, high = _percentiles(stretch, 50.0, 95.0)
        cosines, sines, defined = _cosines_and_sines(positions, self._topology.quads)
        both = self.angle_defined & defined
        # The chord tells small angles apart, which the cosine does not.
        chords = np.hypot(cosines[both] - self._cosines[both], sines[both] - self._sines[both])
        errors = _percentiles(chords, 50.0, 95.0) if len(chords) else np.zeros(2)
        errors = np.degrees(2.0 * np.arcsin(np.minimum(0.5 * errors, 1.0)))
        return ShapeReport(
            volume_ratio=signed_volume(positions, self._topology.triangles) / self.volume,
            edge_stretch_p50=float(median),
            edge_stretch_p95=float(high),
            edge_stretch_max=float(stretch.max()),
            dihedral_error_p50=float(errors[0]),
            dihedral_error_p95=float(errors[1]),
            degenerate_edges=int((self.angle_defined & ~defined).sum()),
            **self._by_direction(stretch, directions),
        )

    def _by_direction(self, stretch: Floats, directions: Floats | None) -> dict[str, _Spread | None]:
        """Return the spread of the stretches of edges along and across the fibres."""
        if directions is None:
            return {}
        if directions is not self._directed[0]:
            edges, v = self._long_edges, directions[self._long]
            u = (self._rest[edges[:, 1]] - self._rest[edges[:, 0]]) / self._long_lengths[:, None]
            cosines = np.abs(np.einsum("ij,ij->i", u, v))
            known = (v != 0.0).any(axis=1)
            along, across = known & (cosines > ALONG), known & (cosines < ACROSS)
            self._directed = directions, np.flatnonzero(along), np.flatnonzero(across)
        _, along, across = self._directed
        return {"along": _spread(stretch[along]), "across": _spread(stretch[across])}


def _percentiles(values: Floats, *percents: float) -> Floats:
    """Return percentiles of values (n,), interpolated linearly, (p,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        found: Floats = np.percentile(values, percents)
    return found


def _spread(values: Floats) -> _Spread | None:
    if not len(values):
        return None
    low, median, high = _percentiles(values, 5.0, 50.0, 95.0).tolist()
    return low, median, high


def dihedral_angles(points: Floats, quads: Ints) -> tuple[Floats, Bools]:
    """Return the signed angles (q,) between neighbouring triangles, and False where one is not defined, (q,).

    0 where flat, positive where convex, in (-pi, pi]; see :func:`~vtkmuscle.core.pbd.constraints.hinge`.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    quads : (q, 4) int array
        As in :class:`~vtkmuscle.core.mesh.topology.MeshTopology`.

    Returns
    -------
    angles : (q,) array
        Radians; 0 where the angle is not defined.
    defined : (q,) bool array
        False where one of the triangles is degenerate.
    """
    cosines, sines, defined = _cosines_and_sines(points, quads)
    angles = np.arctan2(sines, cosines)
    return np.where(angles == -np.pi, np.pi, angles), defined


def _cosines_and_sines(points: Floats, quads: Ints) -> tuple[Floats, Floats, Bools]:
    """Return cosines and sines of the angles of quadruples (q, 4), 1 and 0 where one is not defined."""
    cosines, sines = np.ones(len(quads)), np.zeros(len(quads))
    defined = np.zeros(len(quads), dtype=np.bool_)
    _hinges(points, quads, cosines, sines, defined)
    return cosines, sines, defined


@vector_kernel
def _hinges(p: Floats, quads: Ints, cosines: Floats, sines: Floats, defined: Bools) -> None:
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        found = hinge(
            p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2],
            p[k, 0], p[k, 1], p[k, 2], p[m, 0], p[m, 1], p[m, 2],
        )  # fmt: skip
        proper, sine, cosine = found[0], found[1], found[2]
        if proper:
            size = math.sqrt(sine * sine + cosine * cosine)
            cosines[q], sines[q], defined[q] = cosine / size, sine / size, True


def _angle_squares(p: Floats, quads: Ints) -> Floats:
    """Return 2 / L^2 of the longest edges L of quadruples (q, 4), 0 where all four points are one."""
    corners = p[quads]
    sides = corners[:, [0, 0, 0, 1, 1]] - corners[:, [1, 2, 3, 2, 3]]
    longest = np.einsum("qsk,qsk->qs", sides, sides).max(axis=1)
    squares: Floats = np.divide(2.0, longest, out=np.zeros(len(quads)), where=longest > 0.0)
    return squares
