"""AttachmentEstimator: attachments of a muscle without digitised landmarks."""

from collections.abc import Mapping, Sequence

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.attachments.contacts import FAR_END, attached_ends
from vtkmuscle.core.attachments.patches import outline
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.data.attachments import ROLES, AttachmentArea, attachments_from
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports

#: Largest distance between a bone and an attachment [mm]: for 90 % of the points of the areas digitised on
#: the hip of LHDL the distance is below 2.2 to 2.3 mm.
NEAR = 2.5
#: Highest confidence of an estimated area: the measured overlap with a digitised area on the same bone, see
#: vtkmuscle.core.attachments.contacts.
OVERLAP = 0.64


class AttachmentEstimator(Filter):
    """Propose a muscle's attachments from distances to bones.

    The two ends are the points close to two bones that lie farthest apart along the muscle. An attachment is
    the part of the muscle close to the bone, or inside the bone, in the half of the muscle nearer to the end.
    The smaller attachment is limited to the last quarter of the distance from the larger: muscles arise from
    broad areas, and insert by tendons that slide over bone first. Landmarks are muscle points on the boundary
    of an area.

    Parameters
    ----------
    muscle
        Triangles, in the rest pose.
    bones
        Named blocks of vtkPolyData, at rest.
    distance
        Largest distance between a bone and its attachment; half a muscle edge where half an edge is longer.
    origin
        Name of the origin's bone; None takes the bone of the larger area.
    insertion
        Name of the insertion's bone; None takes the bone of the smaller area.

    Attributes
    ----------
    output
        Attachments: a block per area, a closed polyline through the landmarks, with the field arrays
        ``Bone``, ``Role``, ``Estimated`` (1) and ``Confidence``: 0 if a second bone is equally likely, 0.64
        (the overlap with digitised areas) if no second bone is close.

    Raises
    ------
    ValueError
        If a bone has moved; if the muscle is close to fewer than two bones, or far from the bones of
        ``origin`` and ``insertion``; if an end is far from any bone, as of a belly whose tendon is a separate
        surface.

    Limitations
    -----------
    Areas include parts of the muscle that lie on a bone at an end without attachment. Only two areas are
    proposed, on two bones: muscles with several heads need landmarks. Check the areas before use.

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

    distance: Parameter[float] = Parameter(float, default=NEAR, above=0.0, units="mm")
    origin: Parameter[str | None] = Parameter(str, default=None)
    insertion: Parameter[str | None] = Parameter(str, default=None)

    muscle = InputPort(vtkPolyData)
    bones = ports.Bones()
    output = OutputPort(vtkMultiBlockDataSet)

    def execute(self, muscle: vtkPolyData, bones: dict[str, vtkPolyData]) -> vtkMultiBlockDataSet:
        """Return the areas."""
        origin, insertion = self.origin, self.insertion
        areas = estimated_areas(muscle, bones, within=self.distance, origin=origin, insertion=insertion)
        return attachments_from(areas)


def estimated_areas(
    muscle: vtkPolyData, bones: Mapping[str, vtkPolyData], *, within: float = NEAR, origin: str | None = None,
    insertion: str | None = None, bodies: Sequence[Sequence[str]] = (),
) -> list[AttachmentArea]:  # fmt: skip
    """Return the likely attachment areas of a muscle, by :func:`attached_ends`.

    ``within`` is the largest distance between a bone and its attachment [mm]; ``bodies`` are groups of bones
    that move together, ignored with named bones. ValueError if a named bone is missing, if fewer than two
    bones are close, or if an end is far from every bone.
    """
    named = [bone for bone in (origin, insertion) if bone is not None]
    for role, bone in zip(ROLES, (origin, insertion), strict=True):
        if bone is not None and bone not in bones:
            problem = f"{role} is {bone!r}, but the data have no such bone"
            raise InputError("", problem, f"the bones are {', '.join(bones)}")
    if len(named) > len(set(named)):
        raise InputError("", f"origin and insertion are both {origin!r}", "name two bones")
    points, triangles = checked_surface(muscle, "muscle")
    distances = {name: _distances(points, name, bone, FAR_END * within) for name, bone in bones.items()}
    bodies = () if named else bodies
    ends = attached_ends(points, triangles, distances, within=within, between=named, bodies=bodies)
    if origin == ends[1].bone or insertion == ends[0].bone:
        ends = ends[::-1]
    areas = []
    for role, end in zip(ROLES, ends, strict=True):
        for bone, patch in end.contacts:
            landmarks, closed = outline(points, triangles, patch)
            areas.append(AttachmentArea(role, bone, landmarks, closed, True, OVERLAP * end.confidence))
    return areas


def _distances(points: Floats, name: str, bone: vtkPolyData, far: float) -> Floats:
    """Return signed distances (n,) to a bone, approximate beyond `far`."""
    low, high = np.array(bone.GetBounds()).reshape(3, 2).T
    outside: Floats = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
    return outside if outside.min() > far else solids_of(*checked_surface(bone, name)).distances(points)
