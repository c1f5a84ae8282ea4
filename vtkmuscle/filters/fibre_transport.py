"""FibreTransport: carry fibres along with the muscle they are in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mean_value import mean_value_coordinates, transport
from vtkmuscle.core.polylines import polyline_lengths
from vtkmuscle.filters.arrays import (
    Polylines,
    checked_surface,
    polylines_of,
    set_cell_array,
    with_polylines,
)
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.parameters import InputPort, OutputPort
from vtkmuscle.filters.pipeline_times import times_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Fibre points whose weights are computed together: bounds the steps of progress and the time to abort.
_BLOCK = 256
#: Weights are kept up to this size [bytes]; beyond it they are computed again for each frame.
_LARGEST_CACHE = 2**31


@dataclass(frozen=True, eq=False)
class _Rest:
    """What weights belong to, and the weights of each block of fibre points that were kept."""

    fibre_points: Floats
    points: Floats
    triangles: Ints
    weights: dict[int, Floats]

    def is_of(self, fibre_points: Floats, points: Floats, triangles: Ints) -> bool:
        return (
            np.array_equal(self.fibre_points, fibre_points)
            and np.array_equal(self.points, points)
            and np.array_equal(self.triangles, triangles)
        )


class FibreTransport(Filter):
    """Carry fibres from a muscle at rest into the deformed muscle.

    Each fibre point is expressed by mean value coordinates in the vertices of the muscle at rest; the same
    weighted mean of the deformed vertices is where it has moved. The weights are kept for as long as the rest
    fibres and the rest muscle are the same (in content), so that a frame costs one matrix product. Fibre
    points outside of the muscle are carried along as well.

    Raises
    ------
    ValueError
        If there are no fibres, if a muscle is no triangle mesh or the rest muscle is not closed, if a
        coordinate is not finite, or if the deformed muscle has not as many points as the muscle at rest.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*, eq. 8,
    doi:10.1007/978-3-030-72379-8_24; Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular
    meshes*, doi:10.1145/1073204.1073229.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource, vtkSphereSource
    >>> from vtkmuscle.filters import FibreTransport
    >>> rest = vtkSphereSource(radius=10.0).update().output
    >>> thinner = vtkSphereSource(radius=5.0).update().output
    >>> fibre = vtkLineSource(point1=(-4, 0, 0), point2=(4, 0, 0)).update().output
    >>> moved = FibreTransport()(fibre, rest, thinner)
    >>> round(moved.GetPoint(1)[0], 6)
    2.0
    """

    rest_fibres = InputPort(vtkPolyData, content="fibres", doc="Polylines in the muscle at rest.")
    rest_muscle = InputPort(vtkPolyData, content="muscle", doc="The muscle at rest, closed, triangles.")
    deformed_muscle = InputPort(
        vtkPolyData, content="deformed muscle", doc="The same points as the muscle at rest, moved."
    )
    output = OutputPort(
        vtkPolyData,
        doc="The moved polylines, with the arrays of the rest fibres and the cell array ``RestLength`` "
        "(n_fibres,) [mm].",
    )

    _rest: _Rest | None = None

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Pass on the times of the deformed muscle: the rest state has none."""
        return times_of(inputs_information[2]) or None

    def execute(
        self, rest_fibres: vtkPolyData, rest_muscle: vtkPolyData, deformed_muscle: vtkPolyData
    ) -> vtkPolyData:
        """Return the fibres in the deformed muscle."""
        lines = polylines_of(rest_fibres, "FibreTransport: rest_fibres")
        points, triangles = checked_surface(rest_muscle, "FibreTransport: rest_muscle")
        deformed, _ = checked_surface(deformed_muscle, "FibreTransport: deformed_muscle")
        if len(deformed) != len(points):
            raise ValueError(
                f"FibreTransport: deformed_muscle has {len(deformed)} points, but rest_muscle has "
                f"{len(points)}; both must be the same mesh, before and after the deformation"
            )
        moved = np.empty_like(lines.points)
        for first in range(0, len(moved), _BLOCK):
            rows = slice(first, first + _BLOCK)
            moved[rows] = transport(self._weights(first, lines.points, points, triangles), deformed)
            self.report_progress(min(first + _BLOCK, len(moved)) / len(moved))
        result = with_polylines(rest_fibres, Polylines(moved, lines.offsets))
        set_cell_array(result, "RestLength", polyline_lengths(lines.points, lines.offsets))
        return result

    def _weights(self, first: int, fibre_points: Floats, points: Floats, triangles: Ints) -> Floats:
        """Return the weights of the block of fibre points from number `first` on."""
        # Comparing content costs a hundredth of a frame, and unlike comparing modification times it is right
        # for inputs that were copied, or changed behind VTK's back through a numpy view.
        if first == 0 and (self._rest is None or not self._rest.is_of(fibre_points, points, triangles)):
            self._rest = _Rest(fibre_points, points, triangles, {})
        kept = self._rest.weights if self._rest is not None else {}
        weights = kept.get(first)
        if weights is None:
            weights = mean_value_coordinates(points, triangles, fibre_points[first : first + _BLOCK])
            if (first + _BLOCK) * len(points) * weights.itemsize <= _LARGEST_CACHE:
                kept[first] = weights
        return weights
