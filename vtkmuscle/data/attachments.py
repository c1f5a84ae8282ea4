"""Attachment areas and aponeuroses as data, a block for each."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeGuard

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.paths.via_rings import ViaRing, via_ring
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data import arrays

#: Roles of attachment areas at the ends of a muscle.
ROLES = ("origin", "insertion")
#: Role of a ring for a muscle to slide through.
VIA = "via"


@dataclass(frozen=True, eq=False)
class AttachmentArea:
    """Area of a muscle's attachment to a bone, or a via ring.

    Attributes
    ----------
    role : str
        ``"origin"`` or ``"insertion"``; or ``"via"``, for a ring around the muscle that moves with the bone:
        a retinaculum or a pulley.
    bone : str
        Name of the bone's block.
    landmarks : (k, 3) float array
        In boundary order, without repeats, in the rest pose [mm].
    closed : bool
        True for the boundary of an area (a ring), False for an open curve or loose points: the attachment is
        then the part of the muscle close to the curve. A via ring is closed.
    estimated : bool
        True for landmarks computed from contact between muscle and bone, False for digitised landmarks.
    confidence : float or None
        Confidence of an estimate, 0 to 1; see :class:`~vtkmuscle.filters.AttachmentEstimator`.
    """

    role: str
    bone: str
    landmarks: Floats
    closed: bool
    estimated: bool = False
    confidence: float | None = None


Areas = list[AttachmentArea]


def attachments_from(areas: Sequence[AttachmentArea]) -> vtkMultiBlockDataSet:
    """Return areas as a data set: rings are closed polylines, curves open."""
    blocks = {}
    for i, area in enumerate(areas):
        fields = {"Bone": area.bone, "Role": area.role, "Estimated": int(area.estimated)}
        confidence = {} if area.confidence is None else {"Confidence": area.confidence}
        block = _polyline(area.landmarks, closed=area.closed)
        blocks[f"{area.role}_{i}"] = arrays.add_arrays(block, fields=fields | confidence)
    return arrays.multiblock_from(blocks)


def is_areas(value: object) -> TypeGuard[Sequence[AttachmentArea]]:
    """Return whether a value is a list or tuple of areas."""
    areas = value if isinstance(value, list | tuple) else ()
    return len(areas) > 0 and all(isinstance(area, AttachmentArea) for area in areas)


def attachments_of(data: vtkMultiBlockDataSet, where: str) -> list[AttachmentArea]:
    """Return the areas of a data set, by block.

    Parameters
    ----------
    data : vtkMultiBlockDataSet
        A block per area: a vtkPolyData with the field arrays ``Bone`` and ``Role`` and a polyline through the
        landmarks (closed if the last point repeats the first), or points alone; a field array ``Estimated``
        other than 0 marks estimated landmarks.
    where : str
        Named in errors, e.g. ``"TemplateFitter: attachments"``.

    Raises
    ------
    ValueError
        For a block without landmarks, with a coordinate that is not finite, or without its arrays; for an
        open via ring, or a ring refused by :func:`vtkmuscle.core.paths.via_rings.via_ring`.
    """
    areas = []
    for label, block in _blocks(data, where, "landmarks"):
        role, bone = arrays.field_string(block, "Role"), arrays.field_string(block, "Bone")
        if role not in (*ROLES, VIA):
            problem = f"the field array 'Role' is {role!r}, but must be 'origin', 'insertion' or 'via'"
            raise InputError(label, problem)
        if not bone:
            raise InputError(label, "the field array 'Bone' must name a bone")
        landmarks, closed = landmarks_of(block, label)
        if role == VIA:
            if not closed:
                raise InputError(label, "a via ring must be closed", "end the polyline with its first point")
            with errors_at(label):
                via_ring(landmarks)
        estimated, stated = arrays.field_array(block, "Estimated"), arrays.field_array(block, "Confidence")
        is_estimated = estimated is not None and bool(estimated[0])
        confidence = None if stated is None else float(stated[0])
        areas.append(AttachmentArea(role, bone, landmarks, closed, is_estimated, confidence))
    return areas


def end_areas(data: vtkMultiBlockDataSet, where: str) -> list[AttachmentArea]:
    """Return the areas of :func:`attachments_of` without via rings."""
    return [area for area in attachments_of(data, where) if area.role in ROLES]


def areas_of_role(areas: Sequence[AttachmentArea], role: str) -> list[AttachmentArea]:
    """Return the areas of a role; ValueError without an area."""
    role_areas = [area for area in areas if area.role == role]
    if not role_areas:
        raise InputError("attachments", f"there is no area with the role {role!r}", "add its landmarks")
    return role_areas


def via_rings_of(data: vtkMultiBlockDataSet, where: str) -> list[AttachmentArea]:
    """Return the via rings of :func:`attachments_of`, for :func:`vtkmuscle.core.paths.via_rings.via_ring`."""
    return [area for area in attachments_of(data, where) if area.role == VIA]


def rings_by_bone(
    data: vtkMultiBlockDataSet | None, bones: Sequence[str], where: str
) -> tuple[tuple[int, ViaRing], ...]:
    """Return via rings with the indices of their bones."""
    areas = [] if data is None else via_rings_of(data, where)
    names = list(bones)
    for area in areas:
        if area.bone not in names:
            listed = ", ".join(map(repr, names))
            raise InputError(where, f"the bone of a via ring is {area.bone!r}, but the bones are {listed}")
    return tuple((names.index(area.bone), via_ring(area.landmarks)) for area in areas)


def landmarks_of(data: vtkPolyData, where: str) -> tuple[Floats, bool]:
    """Return an area's landmarks, and if they form a ring. ValueError if not finite, or several lines."""
    points = arrays.points_of(data)
    if not np.isfinite(points).all():
        raise InputError(where, "some landmarks are not finite")
    lines = data.GetLines()
    if lines.GetNumberOfCells() == 0:
        return points, False
    if lines.GetNumberOfCells() > 1:
        raise InputError(where, f"{lines.GetNumberOfCells()} polylines, expected one through all landmarks")
    landmarks = points[vtk_to_numpy(lines.GetConnectivityArray())]
    closed = len(landmarks) > 3 and bool(np.array_equal(landmarks[0], landmarks[-1]))
    return (landmarks[:-1] if closed else landmarks), closed


#: Side of an aponeurosis: at the muscle's origin or insertion.
SIDES = ("proximal", "distal")


@dataclass(frozen=True, eq=False)
class Aponeurosis:
    """A tendon sheet at fibre ends at rest: a ring on a muscle's surface, or triangles within a muscle.

    The side is ``"proximal"`` at the fibres' origins, or ``"distal"``; several aponeuroses may share a side.
    A ring has its landmarks in order, without repeats, and no triangles.
    """

    side: str
    points: Floats
    triangles: Ints = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))


def aponeurosis_from(data: vtkPolyData, side: str, where: str) -> Aponeurosis:
    """Return a data set's aponeurosis, a surface or a ring."""
    if data.GetNumberOfPolys():
        return Aponeurosis(side, *arrays.checked_surface(data, where))
    return ring_aponeurosis(landmarks_of(data, where)[0], side, where)


def ring_aponeurosis(landmarks: Floats, side: str, where: str) -> Aponeurosis:
    """Return the aponeurosis within landmarks (k, 3), k >= 3."""
    if len(landmarks) < 3:
        problem = f"an aponeurosis is a surface or a ring of at least 3 points, not {len(landmarks)} points"
        raise InputError(where, problem, "list the points around the aponeurosis in order")
    return Aponeurosis(side, landmarks)


def aponeuroses_data(aponeuroses: Sequence[Aponeurosis]) -> vtkMultiBlockDataSet:
    """Return aponeuroses as a data set for filters."""
    blocks = {}
    for number, sheet in enumerate(aponeuroses):
        side, ring = sheet.side, _polyline(sheet.points, closed=True)
        block = arrays.surface_from(sheet.points, sheet.triangles) if len(sheet.triangles) else ring
        blocks[f"{side}_{number}"] = arrays.add_arrays(block, fields={"Side": side})
    return arrays.multiblock_from(blocks)


def aponeuroses_of(data: vtkMultiBlockDataSet, where: str) -> list[Aponeurosis]:
    """Return the aponeuroses of a data set, in block order."""
    aponeuroses = []
    for label, block in _blocks(data, where, "points"):
        side = arrays.field_string(block, "Side")
        if side not in SIDES:
            raise InputError(label, f"the field array 'Side' is {side!r}, but must be 'proximal' or 'distal'")
        aponeuroses.append(aponeurosis_from(block, side, label))
    return aponeuroses


def _blocks(data: vtkMultiBlockDataSet, where: str, content: str) -> Iterator[tuple[str, Any]]:
    """Yield each block with its name for errors; ValueError for empty blocks."""
    for name, block in arrays.blocks_of(data):
        label = f"{where}, block {name!r}"
        if block is None or block.GetNumberOfPoints() == 0:
            raise InputError(label, f"there are no {content}")
        yield label, block


def _polyline(points: Floats, *, closed: bool) -> vtkPolyData:
    """Return an open or closed line through points (k, 3)."""
    points = np.vstack([points, points[:1]]) if closed else points
    return arrays.polylines_from(arrays.Polylines(points, np.array([0, len(points)])))
