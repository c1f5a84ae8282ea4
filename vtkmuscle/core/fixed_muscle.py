"""Muscle at rest: surface, fixed points, and fibres."""

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh import surface
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.types import SAME, Floats, Ints

#: Points (n, 3) of polylines in sequence [mm]; the first point of each, and n, (k + 1,).
Lines = tuple[Floats, Ints]


#: Via rings, each with the number of its bone.
BoneRings = tuple[tuple[int, ViaRing], ...]


class FixedMuscle(NamedTuple):
    """A muscle at rest, with fixed points and fibres."""

    points: Floats  # (n, 3) [mm]
    triangles: Ints  # (m, 3), a closed surface that faces outward
    fixed_to: Ints  # (n,), index of the bone each point is fixed to, -1 for free points
    fibres: Lines | None = None
    #: That the fibres pass through.
    rings: BoneRings = ()

    def topology(self) -> surface.MeshTopology:
        """Return the surface's edges. One without volume, open or of two sides raises a ValueError."""
        points, corners = self.points, self.triangles
        surface.check_volume(points, surface.signed_volume(points, corners))
        topology = surface.mesh_topology(len(points), corners)
        if topology.n_boundary_edges:
            problem = f"the surface is open: {topology.n_boundary_edges} edges belong to one triangle only"
            raise InputError("", problem, "close it (vtkFillHolesFilter), as an open surface has no volume")
        surface.opposite_half_edges(corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)])
        return topology

    def check_lines(self, lines: Floats) -> None:
        """Raise a ValueError for lines off the muscle. No point of lines (f, n, 3) is in or on it."""
        away = solids_of(self.points, self.triangles).distances(lines.reshape(-1, 3)).min()
        if away > SAME * surface.extent(self.points):  # points on the surface may be on either side
            raise InputError("", "no path passes through the muscle at rest", "connect its own; check units")
