"""FixedPointDetector: points of a muscle that move with a bone."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.attachments.patches import attachment_patch
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import edge_lengths, unique_edges
from vtkmuscle.core.pbd.voxels import build_voxel_grid
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import add_arrays, checked_surface, shallow_copy
from vtkmuscle.data.attachments import VIA, Areas, attachments_of
from vtkmuscle.data.moving_bones import FIXED_TO_BONES
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports
from vtkmuscle.filters.deformer import N_VOXELS, N_VOXELS_PER_AXIS

#: Index of a bone, ids of the claimed points, distances of the points [mm].
Claim = tuple[int, Ints, Floats]
Bones = dict[str, vtkPolyData]


class FixedPointDetector(Filter):
    """Find the points of a muscle that are fixed to a bone.

    ``"attachment"`` fixes the points within an area's landmarks, projected to the muscle on the side of the
    bone; an open curve fixes the points within the distance of the curve. ``"proximity"`` fixes points within
    the distance of a bone's surface, ``"collision"`` points in the boundary or inside voxels of a bone. A
    point claimed by two bones belongs to the nearer bone (for attachments, the bone with the nearest
    landmark).

    Parameters
    ----------
    muscle
        Triangles, in the rest pose.
    bones
        Named blocks of vtkPolyData, at rest.
    attachments
        A block per area; only for the method ``attachment``. Via rings fix no points.
    method
        Criterion for fixed points.
    distance
        Distance from a bone (proximity) or from an open curve (attachment); None is the muscle's mean edge.
    n_voxels
        Approximate number of voxels of a bone.
    n_voxels_per_axis
        Number of voxels along each axis of a bone's box, instead of n_voxels.

    Attributes
    ----------
    output
        The muscle with the point array ``FixedTo`` (int32): -1 for a free point, else the bone's index; and
        the field array ``FixedToBones``, the bones' names.

    Raises
    ------
    ValueError
        If a bone has moved; if no point is fixed; for the method ``"attachment"``, if there are no
        attachments, an area is on a bone that is not among the blocks, or landmarks are too far from the
        muscle.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*, section 3.3,
    doi:10.1007/978-3-030-72379-8_24.

    Limitations
    -----------
    ``proximity`` and ``collision`` also fix points that should slide along a bone; use them without landmarks
    only. Landmarks more than 10 mm within the muscle may be projected to the wrong side: large rings keep
    their position, but curves and areas of about 10 mm lose it. Check fixed points if landmarks come from
    other images than the muscle.

    Examples
    --------
    >>> from vtkmuscle.filters import FixedPointDetector
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fixed = FixedPointDetector().apply(muscle, phantom.bones, phantom.attachments[name])
    >>> sorted(set(fixed["FixedTo"].tolist()))
    [-1, 0, 1]
    """

    method = Parameter(str, default="attachment", choices=("attachment", "proximity", "collision"))
    distance: Parameter[float | None] = Parameter(float, default=None, minimum=0.0, units="mm")
    n_voxels = N_VOXELS(only_with=("method", "collision"))
    n_voxels_per_axis: Parameter[int | None] = N_VOXELS_PER_AXIS(only_with=("method", "collision"))

    muscle = ports.RestSurface()
    bones = ports.Bones()
    attachments = InputPort(vtkMultiBlockDataSet, attachments_of, optional=True)
    output = OutputPort(vtkPolyData)

    def execute(self, muscle: Surface, bones: Bones, attachments: Areas | None) -> vtkPolyData:
        """Return the muscle with its fixed points marked."""
        by_area = self.method == "attachment"
        claims = self._by_areas(muscle, bones, attachments) if by_area else self._by_distance(muscle, bones)
        fixed_to = np.full(len(muscle.points), -1, dtype=np.int32)
        nearest = np.full(len(muscle.points), np.inf)
        for bone, ids, distances in claims:
            closer = distances < nearest[ids]
            nearest[ids[closer]] = distances[closer]
            fixed_to[ids[closer]] = bone
        if not by_area and (fixed_to < 0).all():
            problem = f"no point of the muscle is within {self._within(muscle):.4g} of a bone"
            remedy = "give a larger distance, or landmarks and the method 'attachment'"
            if self.method == "collision":
                problem = "no point of the muscle is in the voxels of a bone"
                remedy = "lower n_voxels, or use the method 'proximity' or 'attachment'"
            raise InputError("", problem, remedy)
        fields = {FIXED_TO_BONES: list(bones)}
        return add_arrays(shallow_copy(muscle.data), points={"FixedTo": fixed_to}, fields=fields)

    def _by_areas(self, muscle: Surface, bones: Bones, areas: Areas | None) -> Iterator[Claim]:
        """Yield the points of each area, with distances to the nearest landmark."""
        if areas is None:
            remedy = "connect attachments, or choose the method 'proximity' or 'collision'"
            raise InputError("", "the method 'attachment' needs attachments", remedy)
        names = list(bones)
        for number, area in enumerate(areas):
            if area.role == VIA:
                continue
            where = f"attachments, area {number} ({area.role} on {area.bone!r})"
            if area.bone not in bones:
                raise InputError(where, f"the bones are {', '.join(map(repr, names))}", "rename one of them")
            surface = checked_surface(bones[area.bone], f"bones, block {area.bone!r}")
            with errors_at(where):
                landmarks, to_bone = (area.landmarks, area.closed), solids_of(*surface).distances
                mesh = muscle.points, muscle.triangles
                patch = attachment_patch(*mesh, *landmarks, tolerance=self.distance, bone_distance=to_bone)
            ids, near = patch.points, cKDTree(area.landmarks)
            yield names.index(area.bone), ids, near.query(muscle.points[ids])[0]
            self.report_progress((number + 1) / len(areas))

    def _by_distance(self, muscle: Surface, bones: Bones) -> Iterator[Claim]:
        """Yield the points within the distance, or in the voxels, of each bone."""
        within = self._within(muscle)
        for index, (name, bone) in enumerate(bones.items()):
            low, high = np.array(bone.GetBounds()).reshape(3, 2).T
            beyond = np.maximum(low - muscle.points, muscle.points - high)
            reachable = np.flatnonzero(beyond.max(axis=1) <= within)
            if len(reachable):
                points = muscle.points[reachable]
                surface = checked_surface(bone, f"bones, block {name!r}")
                distances = np.abs(solids_of(*surface).distances(points))
                fixed = distances <= within
                if self.method == "collision":
                    grid = build_voxel_grid(*surface, n_max=self.n_voxels, n_equal=self.n_voxels_per_axis)
                    fixed = grid.contains(points)
                yield index, reachable[fixed], distances[fixed]
            self.report_progress((index + 1) / len(bones))

    def _within(self, muscle: Surface) -> float:
        """Return the largest distance of fixed points from a bone, or from its voxels [mm]."""
        own = 0.0 if self.method == "collision" else self.distance
        return (
            float(edge_lengths(muscle.points, unique_edges(muscle.triangles)).mean()) if own is None else own
        )
