"""Muscle at rest: surface, fixed points, and fibres."""

from typing import NamedTuple

from vtkmuscle.core.mesh.surface import MeshTopology, check_volume, mesh_topology, signed_volume
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.types import Floats, Ints

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

    def topology(self) -> MeshTopology:
        """Return the surface's edges; a surface without volume raises a ValueError."""
        check_volume(self.points, signed_volume(self.points, self.triangles))
        return mesh_topology(len(self.points), self.triangles)
