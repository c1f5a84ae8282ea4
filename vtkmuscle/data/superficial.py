"""Superficial fibres as filters take them: what a user has seen on a muscle's surface."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.data.arrays import Polylines, polylines_of


def checked_superficial(data: vtkPolyData, where: str) -> Polylines:
    """Return superficial fibres.

    Parameters
    ----------
    data : vtkPolyData
        Polylines.
    where : str
        Named in the error, e.g. ``"SliceMorpher: superficial"``.

    Raises
    ------
    ValueError
        If there are no polylines, a point is not finite, or none has a length.
    """
    lines = polylines_of(data, where)
    if not polyline_lengths(lines.points, lines.offsets).max() > 0.0:
        raise InputError(
            where,
            "no fibre has a length, so that they have no direction",
            "digitise two points or more of each",
        )
    return lines
