"""AttachmentEstimator: attachments of a muscle without digitised landmarks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.attachments.contact_areas import AttachedEnd, attached_ends, contact_areas, outline
from vtkmuscle.core.attachments.patches import FACING, approach, outward_normals
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.data.attachments import AttachmentArea, attachments_from
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort
from vtkmuscle.filters.bone_motion import bones_of
from vtkmuscle.filters.fixed_point_detector import in_box

#: Where no distance is given: this part of the diagonal of the muscle's box, 2 to 5 mm about the hip.
DISTANCE_PER_DIAGONAL = 0.015


class AttachmentEstimator(Filter):
    """Propose the attachments of a muscle, from where it touches the bones at rest.

    A point touches a bone within the distance of which it is, and which it faces. A bone beyond which the
    muscle touches others at both its ends is passed over. Of the connected areas of such points on the other
    bones, those two of different bones are the main attachments that are large and far from each other along
    the muscle; other areas of the same bones at the same ends are added. The landmarks are points on the
    areas' boundaries. ``origin`` and ``insertion`` name the bones where you know them.

    It is a start where landmarks are missing, no replacement: what touches a bone without being attached to
    it is fixed with it. How far from the other end an attachment may begin was set to what suits the four
    muscles of one right hip. Look at the areas before you rely on them.

    Raises
    ------
    ValueError
        If the muscle touches fewer than two bones, or not those that ``origin`` and ``insertion`` name.

    Examples
    --------
    >>> from vtkmuscle.filters import AttachmentEstimator
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = AttachmentEstimator().apply(muscle, phantom.bones)
    >>> attachments.keys()
    ['origin_0', 'insertion_1']
    """

    distance: Parameter[float | None] = Parameter(
        float,
        default=None,
        above=0.0,
        units="mm",
        doc="Distance up to which a point touches a bone; None is 1.5 % of the diagonal of the muscle's box.",
    )
    origin: Parameter[str | None] = Parameter(
        str, default=None, doc="Name of the origin's bone; None is the one that is touched more."
    )
    insertion: Parameter[str | None] = Parameter(
        str, default=None, doc="Name of the insertion's bone; None is the other one that is likely."
    )

    muscle = InputPort(vtkPolyData, doc="Triangles, in the rest pose.")
    bones = InputPort(vtkMultiBlockDataSet, doc="Named blocks of vtkPolyData, at rest.")
    output = OutputPort(
        vtkMultiBlockDataSet,
        doc="Attachments: a block per area, a closed polyline through its landmarks, with the field arrays "
        "``Bone``, ``Role``, ``Estimated`` (1) and ``Sureness`` (0 to 1): 0 where the end is as likely on "
        "another bone, or far from the muscle's end.",
    )

    def execute(self, muscle: vtkPolyData, bones: vtkMultiBlockDataSet) -> vtkMultiBlockDataSet:
        """Return the areas."""
        points, triangles = checked_surface(muscle, "AttachmentEstimator: muscle")
        surfaces = bones_of(bones, "AttachmentEstimator: bones")
        within = self.distance
        if within is None:
            used = points[np.unique(triangles)]
            within = DISTANCE_PER_DIAGONAL * float(np.linalg.norm(np.ptp(used, axis=0)))
        touching = []
        for number, bone in enumerate(surfaces.values()):
            touching.append(_touching(points, triangles, bone, within))
            self.report_progress((number + 1) / (len(surfaces) + 1))
        names = list(surfaces)
        named = self._named(names, touching, within)
        contacts = [
            one for one in contact_areas(points, triangles, touching) if not named or names[one.bone] in named
        ]
        ends = attached_ends(points, triangles, contacts)
        ends = self._checked(names, ends, touching, within)
        on = [names[end.contacts[0].bone] for end in ends]
        if self.origin == on[1] or self.insertion == on[0]:
            ends = ends[::-1]
        areas = []
        for role, end in zip(("origin", "insertion"), ends, strict=True):
            for contact in end.contacts:
                landmarks, closed = outline(points, triangles, contact.points)
                on_bone = names[contact.bone]
                areas.append(
                    AttachmentArea(role, on_bone, landmarks, closed, estimated=True, sureness=end.sureness)
                )
        return attachments_from(areas)

    def _named(self, names: list[str], touching: list[NDArray[np.bool_]], within: float) -> set[str]:
        """Return both bones where both are named, none else."""
        for what, bone in (("origin", self.origin), ("insertion", self.insertion)):
            if bone is not None and bone not in names:
                problem = f"{what} is {bone!r}, but there is no such bone"
                raise InputError("AttachmentEstimator", problem, f"the bones are {', '.join(names)}")
            if bone is not None and not touching[names.index(bone)].any():
                raise InputError(
                    "AttachmentEstimator",
                    f"{what} is {bone!r}, but within {within:.4g} the muscle does not touch it",
                    "name another bone, give a larger distance, or landmarks",
                )
        if self.origin is None or self.insertion is None:
            return set()
        if self.origin == self.insertion:
            problem = f"origin and insertion are both {self.origin!r}"
            raise InputError("AttachmentEstimator", problem, "name two bones")
        return {self.origin, self.insertion}

    def _checked(
        self,
        names: list[str],
        ends: tuple[AttachedEnd, AttachedEnd] | None,
        touching: list[NDArray[np.bool_]],
        within: float,
    ) -> tuple[AttachedEnd, AttachedEnd]:
        if ends is None:
            touched = [repr(name) for name, mask in zip(names, touching, strict=True) if mask.any()]
            raise InputError(
                "AttachmentEstimator",
                f"within {within:.4g} the muscle touches "
                f"{'only ' + touched[0] if touched else 'no bone'}, but attachments are estimated between "
                "two bones",
                "give a larger distance, or landmarks",
            )
        found = [names[end.contacts[0].bone] for end in ends]
        for what, bone in (("origin", self.origin), ("insertion", self.insertion)):
            if bone is not None and bone not in found:
                raise InputError(
                    "AttachmentEstimator",
                    f"{what} is {bone!r}, but the muscle seems to be attached to "
                    f"{' and '.join(map(repr, found))}",
                    "name both origin and insertion, or choose another distance",
                )
        return ends


def _touching(
    points: NDArray[np.float64], triangles: NDArray[np.int64], bone: vtkPolyData, within: float
) -> NDArray[np.bool_]:
    touching = np.zeros(len(points), dtype=np.bool_)
    near = in_box(points, bone, within)
    near = near[np.isin(near, triangles)]
    if len(near):
        distance = solids_of(*checked_surface(bone, "AttachmentEstimator: bones")).distances
        near = near[distance(points[near]) <= within]
        normals, step = outward_normals(points, triangles)
        touching[near] = approach(points[near], normals[near], step, distance) >= FACING
    return touching
