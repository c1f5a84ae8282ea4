"""Aponeuroses as data: one vtkMultiBlockDataSet, a block for each ring on a muscle or surface within it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import (
    Polylines,
    blocks_of,
    checked_surface,
    field_string,
    multiblock_from,
    polylines_from,
    set_field_array,
    surface_from,
)
from vtkmuscle.data.attachments import landmarks_of

#: Which of a muscle's ends an aponeurosis belongs to: that of its origin, or that of its insertion.
SIDES = ("proximal", "distal")


def _no_triangles() -> Ints:
    return np.empty((0, 3), dtype=np.int64)


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
    triangles: Ints = field(default_factory=_no_triangles)

    def __post_init__(self) -> None:
        if self.side not in SIDES:
            raise InputError("Aponeurosis", f"side is {self.side!r}, but must be 'proximal' or 'distal'")

    @property
    def is_ring(self) -> bool:
        """True for landmarks round it, False for a surface of its own."""
        return len(self.triangles) == 0


def aponeurosis_from(data: vtkPolyData, side: str, where: str) -> Aponeurosis:
    """Return the aponeurosis that a data set shows: a surface where it has triangles, else a ring.

    Raises
    ------
    ValueError
        If there is neither a surface of triangles nor a ring of three points or more.
    """
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
        if one.is_ring:
            ring = np.vstack([one.points, one.points[:1]])
            block = polylines_from(Polylines(ring, np.array([0, len(ring)])))
        else:
            block = surface_from(one.points, one.triangles)
        set_field_array(block, "Side", one.side)
        blocks[f"{one.side}_{number}"] = block
    return multiblock_from(blocks)


def aponeuroses_of(data: vtkMultiBlockDataSet, where: str) -> list[Aponeurosis]:
    """Return the aponeuroses of a data set, in the order of its blocks.

    Parameters
    ----------
    data : vtkMultiBlockDataSet
        A block for each: a vtkPolyData with the field array ``Side`` (``"proximal"`` or ``"distal"``) and one
        polyline through landmarks, points alone, or triangles.
    where : str
        Named in errors, e.g. ``"FibreSource: aponeuroses"``.

    Raises
    ------
    ValueError
        For a block that is neither a ring nor a surface, or whose side is missing.
    """
    found = []
    for name, block in blocks_of(data):
        label = f"{where}, block {name!r}"
        if block is None or block.GetNumberOfPoints() == 0:
            raise InputError(label, "there are no points")
        side = field_string(block, "Side")
        if side not in SIDES:
            raise InputError(label, f"the field array 'Side' is {side!r}, but must be 'proximal' or 'distal'")
        found.append(aponeurosis_from(block, side, label))
    return found
