"""Attachment areas without landmarks, from distances between muscle and bones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.attachments.contacts import FAR_END, attached_ends
from vtkmuscle.core.attachments.patches import outline
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.data.attachments import ROLES, AttachmentArea

#: Largest distance between a bone and an attachment [mm]: for 90 % of the points of the areas digitised on
#: the hip of LHDL the distance is below 2.2 to 2.3 mm.
NEAR = 2.5


def estimated_areas(
    muscle: vtkPolyData,
    bones: Mapping[str, vtkPolyData],
    *,
    within: float = NEAR,
    origin: str | None = None,
    insertion: str | None = None,
    bodies: Sequence[Sequence[str]] = (),
) -> list[AttachmentArea]:
    """Return the likely attachment areas of a muscle, by :func:`attached_ends`.

    Parameters
    ----------
    muscle : vtkPolyData
        Triangles, at rest.
    bones : mapping of str to vtkPolyData
        By name, at rest.
    within : float
        Largest distance between a bone and its attachment [mm].
    origin, insertion : str, optional
        Names of the bones. By default the origin is the end with more area.
    bodies : sequence of sequence of str
        Groups of bones that move together; ignored with named bones.

    Raises
    ------
    ValueError
        If a named bone is missing, if fewer than two bones are close, or if an end is far from every bone.
    """
    named = [bone for bone in (origin, insertion) if bone is not None]
    for role, bone in zip(ROLES, (origin, insertion), strict=True):
        if bone is not None and bone not in bones:
            problem = f"{role} is {bone!r}, but the data have no such bone"
            raise InputError("", problem, f"the bones are {', '.join(bones)}")
    if len(named) > len(set(named)):
        raise InputError("", f"origin and insertion are both {origin!r}", "name two bones")
    points, triangles = checked_surface(muscle, "muscle")
    ends = attached_ends(
        points,
        triangles,
        {name: _distances(points, name, bone, FAR_END * within) for name, bone in bones.items()},
        within=within,
        between=named,
        bodies=() if named else bodies,
    )
    if origin == ends[1].bone or insertion == ends[0].bone:
        ends = ends[::-1]
    areas = []
    for role, end in zip(ROLES, ends, strict=True):
        for bone, patch in end.contacts:
            landmarks, closed = outline(points, triangles, patch)
            area = AttachmentArea(role, bone, landmarks, closed, estimated=True, sureness=end.confidence)
            areas.append(area)
    return areas


def _distances(points: Floats, name: str, bone: vtkPolyData, far: float) -> Floats:
    """Return signed distances (n,) to a bone, approximate beyond `far`."""
    low, high = np.array(bone.GetBounds()).reshape(3, 2).T
    outside: Floats = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
    return outside if outside.min() > far else solids_of(*checked_surface(bone, name)).distances(points)
