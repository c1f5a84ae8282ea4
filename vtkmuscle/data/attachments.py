"""Attachment areas and aponeuroses as data: a vtkMultiBlockDataSet each, a block for every one of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.paths.via_rings import ViaRing, via_ring
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import (
    Polylines,
    blocks_of,
    checked_surface,
    field_array,
    field_string,
    multiblock_from,
    points_of,
    polylines_from,
    set_field_array,
    surface_from,
)

#: Roles of areas where a muscle is attached: its ends.
ROLES = ("origin", "insertion")
#: Role of a ring that a muscle passes through, slides along in, and does not leave.
VIA = "via"


@dataclass(frozen=True, eq=False)
class AttachmentArea:
    """Where a muscle is attached to a bone, or held by it.

    Attributes
    ----------
    role : str
        ``"origin"`` or ``"insertion"``; or ``"via"``, for a ring that the muscle passes through: a
        retinaculum or a pulley, which moves with the bone.
    bone : str
        Name of the bone's block.
    landmarks : (k, 3) float array
        In boundary order, each once, mm, in the rest pose.
    closed : bool
        True where the landmarks are the boundary of an area (a ring), False for an open curve or loose
        points: then the attachment is the part of the muscle near the curve. A via ring is closed.
    estimated : bool
        True where the landmarks were not digitised but made from where the muscle touches the bone.
    sureness : float or None
        Sureness of an estimate, 0 to 1; see :class:`~vtkmuscle.filters.AttachmentEstimator`.
    """

    role: str
    bone: str
    landmarks: NDArray[np.float64]
    closed: bool
    estimated: bool = False
    sureness: float | None = None


def attachments_from(areas: Sequence[AttachmentArea]) -> vtkMultiBlockDataSet:
    """Return areas as the data set that filters take; a ring is a closed polyline, a curve an open one."""
    blocks = {}
    for i, area in enumerate(areas):
        block = _polyline(area.landmarks, closed=area.closed)
        set_field_array(block, "Bone", area.bone)
        set_field_array(block, "Role", area.role)
        set_field_array(block, "Estimated", int(area.estimated))
        if area.sureness is not None:
            set_field_array(block, "Sureness", area.sureness)
        blocks[f"{area.role}_{i}"] = block
    return multiblock_from(blocks)


def is_areas(value: object) -> TypeGuard[Sequence[AttachmentArea]]:
    """Return whether a value is a list or tuple of areas."""
    if not isinstance(value, (list, tuple)) or not value:
        return False
    return all(isinstance(area, AttachmentArea) for area in value)


def attachments_of(data: vtkMultiBlockDataSet, where: str) -> list[AttachmentArea]:
    """Return the areas of a data set.

    Parameters
    ----------
    data : vtkMultiBlockDataSet
        A block per area: a vtkPolyData with the field arrays ``Bone`` and ``Role`` and one polyline
        through the landmarks (closed if its last point repeats its first), or points alone; where the
        field array ``Estimated`` is not 0, the landmarks are an estimate.
    where : str
        Named in errors, e.g. ``"TemplateFitter: attachments"``.

    Returns
    -------
    list of AttachmentArea
        In the order of the blocks.

    Raises
    ------
    ValueError
        For a block without landmarks, with a coordinate that is not finite, or without its arrays; for a via
        ring that is not closed, or that :func:`vtkmuscle.core.paths.via_rings.via_ring` refuses.
    """
    areas = []
    for label, block in _blocks(data, where, "landmarks"):
        role, bone = field_string(block, "Role"), field_string(block, "Bone")
        if role not in (*ROLES, VIA):
            raise InputError(
                label, f"the field array 'Role' is {role!r}, but must be 'origin', 'insertion' or 'via'"
            )
        if not bone:
            raise InputError(label, "the field array 'Bone' must name a bone")
        landmarks, closed = landmarks_of(block, label)
        if role == VIA:
            if not closed:
                remedy = "end its polyline with the point that it begins with"
                raise InputError(label, "a via ring must be closed", remedy)
            with errors_at(label):
                via_ring(landmarks)
        estimated, sureness = field_array(block, "Estimated"), field_array(block, "Sureness")
        areas.append(
            AttachmentArea(
                role,
                bone,
                landmarks,
                closed,
                estimated is not None and bool(estimated[0]),
                None if sureness is None else float(sureness[0]),
            )
        )
    return areas


def end_areas(data: vtkMultiBlockDataSet, where: str) -> list[AttachmentArea]:
    """Return the areas where a muscle is attached, as :func:`attachments_of` does, but no via rings."""
    return [area for area in attachments_of(data, where) if area.role in ROLES]


def via_rings_of(data: vtkMultiBlockDataSet, where: str) -> list[AttachmentArea]:
    """Return the rings that a muscle passes through, as :func:`attachments_of` does, but no ends.

    Their planes and polygons: :func:`vtkmuscle.core.paths.via_rings.via_ring`.
    """
    return [area for area in attachments_of(data, where) if area.role == VIA]


def rings_by_bone(
    data: vtkMultiBlockDataSet | None, bones: Sequence[str], where: str
) -> tuple[tuple[int, ViaRing], ...]:
    """Return the via rings among attachments, each with the number of its bone, which must be known."""
    areas = [] if data is None else via_rings_of(data, where)
    names = list(bones)
    for area in areas:
        if area.bone not in names:
            known = ", ".join(map(repr, names))
            raise InputError(where, f"a via ring goes with the bone {area.bone!r}, but the bones are {known}")
    return tuple((names.index(area.bone), via_ring(area.landmarks)) for area in areas)


def landmarks_of(data: vtkPolyData, where: str) -> tuple[NDArray[np.float64], bool]:
    """Return the landmarks of an area in boundary order, and whether they close to a ring.

    Raises a ValueError if a coordinate is not finite, or there is more than one polyline.
    """
    points = points_of(data)
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


#: Which of a muscle's ends an aponeurosis belongs to: that of its origin, or that of its insertion.
SIDES = ("proximal", "distal")


@dataclass(frozen=True, eq=False)
class Aponeurosis:
    """A sheet of tendon that fibres end on, on a muscle's surface or within the muscle; it moves with that.

    Attributes
    ----------
    side : str
        ``"proximal"``, where fibres begin, or ``"distal"``. Several may share a side.
    points : (n, 3) float array
        Landmarks of a ring round it on the muscle's surface, in order, each once; or the points of a surface
        [mm, in the rest pose].
    triangles : (m, 3) int array
        Point ids of a surface within the muscle; none for a ring.
    """

    side: str
    points: Floats
    triangles: Ints = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))

    def __post_init__(self) -> None:
        if self.side not in SIDES:
            raise InputError("Aponeurosis", f"side is {self.side!r}, but must be 'proximal' or 'distal'")

    @property
    def is_ring(self) -> bool:
        """True for landmarks round it, False for a surface of its own."""
        return len(self.triangles) == 0


def aponeurosis_from(data: vtkPolyData, side: str, where: str) -> Aponeurosis:
    """Return the aponeurosis in a data set: a surface where it has triangles, else a ring."""
    if data.GetNumberOfPolys():
        return Aponeurosis(side, *checked_surface(data, where))
    return ring_aponeurosis(landmarks_of(data, where)[0], side, where)


def ring_aponeurosis(landmarks: Floats, side: str, where: str) -> Aponeurosis:
    """Return the aponeurosis within a ring of landmarks (k, 3); ValueError for fewer than three."""
    if len(landmarks) < 3:
        raise InputError(
            where,
            "an aponeurosis is a ring of three points or more, or a surface, but there are "
            f"{len(landmarks)} points",
            "give the points round it, in order",
        )
    return Aponeurosis(side, landmarks)


def aponeuroses_data(aponeuroses: Sequence[Aponeurosis]) -> vtkMultiBlockDataSet:
    """Return aponeuroses as the data set that filters take."""
    blocks = {}
    for number, one in enumerate(aponeuroses):
        is_ring = one.is_ring
        block = _polyline(one.points, closed=True) if is_ring else surface_from(one.points, one.triangles)
        set_field_array(block, "Side", one.side)
        blocks[f"{one.side}_{number}"] = block
    return multiblock_from(blocks)


def aponeuroses_of(data: vtkMultiBlockDataSet, where: str) -> list[Aponeurosis]:
    """Return the aponeuroses of a data set, in the order of its blocks.

    Each block is a vtkPolyData with the field array ``Side`` (``"proximal"`` or ``"distal"``) and one
    polyline through landmarks, points alone, or triangles. Raises a ValueError for any other.
    """
    aponeuroses = []
    for label, block in _blocks(data, where, "points"):
        side = field_string(block, "Side")
        if side not in SIDES:
            raise InputError(label, f"the field array 'Side' is {side!r}, but must be 'proximal' or 'distal'")
        aponeuroses.append(aponeurosis_from(block, side, label))
    return aponeuroses


def _blocks(data: vtkMultiBlockDataSet, where: str, content: str) -> Iterator[tuple[str, Any]]:
    """Yield each block with its place for errors; ValueError for one without points."""
    for name, block in blocks_of(data):
        label = f"{where}, block {name!r}"
        if block is None or block.GetNumberOfPoints() == 0:
            raise InputError(label, f"there are no {content}")
        yield label, block


def _polyline(points: Floats, *, closed: bool) -> vtkPolyData:
    """Return one line through points (k, 3); a closed one ends at a copy of its first point."""
    points = np.vstack([points, points[:1]]) if closed else points
    return polylines_from(Polylines(points, np.array([0, len(points)])))
