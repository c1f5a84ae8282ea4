"""FixedPointDetector: which points of a muscle move with which bone."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.attachments.patches import attachment_patch
from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX, MOST_N_EQUAL, build_voxel_grid
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import edge_lengths, unique_edges
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import checked_surface, set_point_array
from vtkmuscle.data.attachments import VIA, AttachmentArea, attachments_of
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports


class FixedPointDetector(Filter):
    """Find the points of a muscle that are fixed to a bone and move with it.

    ``"attachment"`` fixes what the landmarks of the attachment areas enclose when projected onto the
    muscle, on the side that faces the bone, and for areas that are open curves what lies within the
    distance of the curve. ``"proximity"`` fixes the points within the distance of a bone's surface,
    ``"collision"`` those in the boundary or inside voxels of a bone. The last two also fix points that
    should slide along the bone; they are for muscles without landmarks. A point that two bones claim goes to
    the nearer one (by attachment: to the bone with the nearest landmark).

    Landmarks go to the nearest place that faces the bone. Where they lie 10 mm within the muscle, that may be
    another place: large rings keep theirs, but curves and areas of little more than that size lose it.
    Look at the points that are fixed where the landmarks do not come from the muscle's own images.

    Parameters
    ----------
    muscle
        Triangles, in the rest pose.
    bones
        Named blocks of vtkPolyData, at rest.
    attachments
        A block per area; needed for the method ``attachment`` only. Via rings fix nothing.
    method
        How fixed points are found.
    distance
        Distance from a bone (proximity) or from an open curve (attachment); None is the muscle's mean edge
        length.
    n_voxels
        Number of voxels of a bone, about.
    n_voxels_per_axis
        Number of voxels along each axis of a bone's box, instead of n_voxels.

    Attributes
    ----------
    output
        The muscle with the point array ``FixedTo`` (int32): -1 for a free point, else the index of the bone's
        block.

    Raises
    ------
    ValueError
        If no point is found; if the method is ``"attachment"`` and there are no attachments, an area is
        on a bone that is not among the blocks, or its landmarks are too far from the muscle.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*, section 3.3,
    doi:10.1007/978-3-030-72379-8_24.

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
    n_voxels = Parameter(
        int, default=DEFAULT_N_MAX, minimum=1, maximum=MOST_N_EQUAL**3, only_with=("method", "collision")
    )
    n_voxels_per_axis: Parameter[int | None] = Parameter(
        int, default=None, minimum=1, maximum=MOST_N_EQUAL, only_with=("method", "collision")
    )

    muscle = ports.Surface()
    bones = ports.RestBones()
    attachments = InputPort(vtkMultiBlockDataSet, attachments_of, optional=True)
    output = OutputPort(vtkPolyData)

    def execute(
        self, muscle: Surface, bones: dict[str, vtkPolyData], attachments: list[AttachmentArea] | None
    ) -> vtkPolyData:
        """Return the muscle with its fixed points marked."""
        if self.method == "attachment":
            fixed_to = self._by_attachment(muscle, bones, attachments)
        elif self.method == "proximity":
            fixed_to = self._by_proximity(muscle, bones)
        else:
            fixed_to = self._by_collision(muscle.points, bones)
        result = vtkPolyData()
        result.ShallowCopy(muscle.data)
        set_point_array(result, "FixedTo", fixed_to.astype(np.int32))
        return result

    def _by_attachment(
        self, muscle: Surface, bones: dict[str, vtkPolyData], areas: list[AttachmentArea] | None
    ) -> Ints:
        if areas is None:
            raise InputError(
                "",
                "the method 'attachment' needs attachments",
                "connect them, or choose the method 'proximity' or 'collision'",
            )
        names, points = list(bones), muscle.points
        nearest = np.full(len(points), np.inf)
        fixed_to = np.full(len(points), -1)
        solids: dict[str, Solids] = {}
        for number, area in enumerate(areas):
            if area.role == VIA:
                continue
            where = f"attachments, area {number} ({area.role} on {area.bone!r})"
            if area.bone not in bones:
                raise InputError(where, f"the bones are {', '.join(map(repr, names))}", "rename one of them")
            if area.bone not in solids:
                solids[area.bone] = _solids_of(area.bone, bones[area.bone])
            with errors_at(where):
                patch = attachment_patch(
                    points,
                    muscle.triangles,
                    area.landmarks,
                    area.closed,
                    tolerance=self.distance,
                    bone_distance=solids[area.bone].distances,
                )
            offsets = cKDTree(area.landmarks).query(points[patch])[0]
            closer = offsets < nearest[patch]
            nearest[patch[closer]] = offsets[closer]
            fixed_to[patch[closer]] = names.index(area.bone)
            self.report_progress((number + 1) / len(areas))
        return fixed_to

    def _by_proximity(self, muscle: Surface, bones: dict[str, vtkPolyData]) -> Ints:
        within, points = self.distance, muscle.points
        if within is None:
            within = float(edge_lengths(points, unique_edges(muscle.triangles)).mean())
        nearest = np.full(len(points), np.inf)
        fixed_to = np.full(len(points), -1)
        for index, (name, bone) in enumerate(bones.items()):
            reachable = in_box(points, bone, within)
            if len(reachable):
                distances = np.abs(_solids_of(name, bone).distances(points[reachable]))
                closer = (distances <= within) & (distances < nearest[reachable])
                nearest[reachable[closer]] = distances[closer]
                fixed_to[reachable[closer]] = index
            self.report_progress((index + 1) / len(bones))
        if (fixed_to < 0).all():
            raise InputError(
                "",
                f"no point of the muscle is within {within:.4g} of a bone",
                "give a larger distance, or landmarks and the method 'attachment'",
            )
        return fixed_to

    def _by_collision(self, points: Floats, bones: dict[str, vtkPolyData]) -> Ints:
        claimed = np.zeros((len(bones), len(points)), dtype=np.bool_)
        for index, (name, bone) in enumerate(bones.items()):
            reachable = in_box(points, bone, 0.0)
            if len(reachable):
                surface = checked_surface(bone, f"bones, block {name!r}")
                grid = build_voxel_grid(*surface, n_max=self.n_voxels, n_equal=self.n_voxels_per_axis)
                claimed[index, reachable] = grid.contains(points[reachable])
            self.report_progress((index + 1) / len(bones))
        if not claimed.any():
            raise InputError(
                "",
                "no point of the muscle is in the voxels of a bone",
                "lower n_voxels, or use the method 'proximity' or 'attachment'",
            )
        disputed = claimed.sum(axis=0) > 1
        distances = np.where(claimed, 0.0, np.inf)
        for index, (name, bone) in enumerate(bones.items()):
            both = np.flatnonzero(disputed & claimed[index])
            if len(both):
                distances[index, both] = np.abs(_solids_of(name, bone).distances(points[both]))
        return np.where(claimed.any(axis=0), distances.argmin(axis=0), -1)


def _solids_of(name: str, bone: vtkPolyData) -> Solids:
    return solids_of(*checked_surface(bone, f"bones, block {name!r}"))


def in_box(points: Floats, bone: vtkPolyData, margin: float) -> Ints:
    """Return the points in the bone's bounding box, made wider by a margin."""
    bounds = np.array(bone.GetBounds()).reshape(3, 2)
    within = (points >= bounds[:, 0] - margin) & (points <= bounds[:, 1] + margin)
    return np.flatnonzero(within.all(axis=1))
