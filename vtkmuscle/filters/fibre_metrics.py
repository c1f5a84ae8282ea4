"""FibreMetrics: measure fibres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import mutable
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkStaticCellLocator

from vtkmuscle.core.mesh import triangle_normals
from vtkmuscle.core.polylines import end_directions, polyline_lengths
from vtkmuscle.filters.arrays import (
    Polylines,
    cell_array,
    checked_surface,
    polylines_of,
    set_cell_array,
    set_field_array,
    surface_from,
    with_polylines,
)
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.parameters import InputPort, OutputPort

Floats = NDArray[np.float64]


class FibreMetrics(Filter):
    """Measure fibres: length, strain, tortuosity, pennation.

    Only what the inputs allow is measured: strain where the fibres carry ``RestLength`` (FibreTransport
    adds it), pennation where there is a muscle. A pennation angle is the one between a fibre's end segment
    and the surface of the muscle there, that is 90 degrees less the angle to the normal of the triangle
    nearest to the fibre's end: 0 for a fibre that runs along the surface, 90 for one at right angles to it.
    For a fibre that ends on an aponeurosis that is its angle to the aponeurosis.

    Raises
    ------
    ValueError
        If there are no fibres, or a coordinate is not finite; if ``RestLength`` has a negative value or one
        that is not finite; if the muscle is no triangle mesh.

    References
    ----------
    Lieber, Friden 2000, *Functional and clinical significance of skeletal muscle architecture*,
    doi:10.1002/1097-4598(200011)23:11<1647::AID-MUS1>3.0.CO;2-M.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource
    >>> from vtkmuscle.filters import FibreMetrics
    >>> fibre = vtkLineSource(point1=(0, 0, 0), point2=(3, 4, 0)).update().output
    >>> FibreMetrics()(fibre).GetCellData().GetArray("Length").GetValue(0)
    5.0
    """

    fibres = InputPort(
        vtkPolyData, content="fibres", doc="Polylines; the cell array ``RestLength`` [mm] where there is one."
    )
    muscle = InputPort(
        vtkPolyData, content="muscle", optional=True, doc="The surface that the fibres end on."
    )
    output = OutputPort(
        vtkPolyData,
        doc="The fibres with the cell arrays ``Length`` [mm], ``Tortuosity`` (length / distance of ends), "
        "``Strain`` (length / rest length - 1, 0 for rest length 0), ``PennationOrigin`` and "
        "``PennationInsertion`` [degrees, 0 to 90], and the field arrays ``LengthMean`` and ``LengthSD`` "
        "(of the population) [mm].",
    )

    def execute(self, fibres: vtkPolyData, muscle: vtkPolyData | None) -> vtkPolyData:
        """Return the fibres with their measures."""
        lines = polylines_of(fibres, "FibreMetrics: fibres")
        lengths = polyline_lengths(lines.points, lines.offsets)
        result = with_polylines(fibres, lines)
        set_cell_array(result, "Length", lengths)
        set_cell_array(result, "Tortuosity", _tortuosity(lines, lengths))
        if fibres.GetCellData().HasArray("RestLength"):
            set_cell_array(result, "Strain", _strain(fibres, lengths))
        if muscle is not None:
            origin, insertion = _pennation(lines, muscle)
            set_cell_array(result, "PennationOrigin", origin)
            set_cell_array(result, "PennationInsertion", insertion)
        set_field_array(result, "LengthMean", lengths.mean())
        set_field_array(result, "LengthSD", lengths.std())
        return result


def _tortuosity(lines: Polylines, lengths: Floats) -> Floats:
    chords = np.linalg.norm(lines.points[lines.offsets[1:] - 1] - lines.points[lines.offsets[:-1]], axis=1)
    # A fibre that returns to its start gets a huge number rather than infinity, one without length 1.
    floor = np.maximum(chords, np.finfo(np.float64).eps * lengths)
    ratio: Floats = np.divide(lengths, floor, out=np.ones_like(lengths), where=floor > 0)
    return np.maximum(ratio, 1.0)


def _strain(fibres: vtkPolyData, lengths: Floats) -> Floats:
    rest = np.asarray(cell_array(fibres, "RestLength", "FibreMetrics: fibres"), dtype=np.float64)
    if rest.shape != lengths.shape:
        raise ValueError(
            f"FibreMetrics: fibres: the cell array 'RestLength' has the shape {rest.shape}, but there are "
            f"{len(lengths)} fibres"
        )
    bad = np.flatnonzero(~(np.isfinite(rest) & (rest >= 0)))
    if len(bad):
        raise ValueError(f"FibreMetrics: fibres: the rest length of fibre {bad[0]} is {rest[bad[0]]}")
    strain: Floats = np.divide(lengths - rest, rest, out=np.zeros_like(lengths), where=rest > 0)
    return strain


def _pennation(lines: Polylines, muscle: vtkPolyData) -> tuple[Floats, Floats]:
    points, triangles = checked_surface(muscle, "FibreMetrics: muscle")
    normals = triangle_normals(points, triangles)
    proper = np.linalg.norm(normals, axis=1) > 0
    normals = normals[proper]
    locator = vtkStaticCellLocator()
    locator.SetDataSet(surface_from(points, triangles[proper]))
    locator.BuildLocator()
    ends = (lines.points[lines.offsets[:-1]], lines.points[lines.offsets[1:] - 1])
    directions = end_directions(lines.points, lines.offsets)
    angles = []
    found, cell, part, distance = [0.0] * 3, mutable(0), mutable(0), mutable(0.0)
    for places, runs in zip(ends, directions, strict=True):
        sines = np.zeros(len(places))
        for i, (place, run) in enumerate(zip(places, runs, strict=True)):
            locator.FindClosestPoint(place, found, cell, part, distance)  # type: ignore[call-overload]
            normal = normals[int(cell)]
            sines[i] = abs(run @ normal) / np.linalg.norm(normal)
        angles.append(np.degrees(np.arcsin(np.clip(sines, 0.0, 1.0))))
    return angles[0], angles[1]
