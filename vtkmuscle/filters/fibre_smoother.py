"""FibreSmoother: take the noise out of fibres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.polylines import polyline_lengths, smooth_polylines
from vtkmuscle.filters.arrays import Polylines, polylines_of, set_cell_array, with_polylines
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.muscle_geometry import muscle_geometry
from vtkmuscle.filters.parameters import InputPort, OutputPort, Parameter
from vtkmuscle.filters.surface_distance import SurfaceDistance

Floats = NDArray[np.float64]


class FibreSmoother(Filter):
    """Smooth fibres by a three-point weighted mean that keeps their end points.

    Each pass moves the inner points to (p_{i-1} + k p_i + p_{i+1}) / (k + 2). Passes straighten fibres, and
    so draw them out of a curved muscle on its hollow side. Where the muscle is connected, points that leave
    it are put back on its surface after each pass.

    Raises
    ------
    ValueError
        If there are no polylines, or a point is not finite.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4,
    extended in doi:10.1007/978-3-642-38241-3_3.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource
    >>> fibres = FibreTemplateSource(kind="fan", n_fibres=4) >> FibreSmoother(iterations=2)
    >>> fibres.update().output.GetNumberOfCells()
    4
    """

    iterations = Parameter(int, default=5, minimum=0, doc="Number of smoothing passes.")
    k = Parameter(float, default=4.0, minimum=0.0, doc="Weight of the middle point.")

    fibres = InputPort(vtkPolyData, content="fibres", doc="Polylines, any number of points each.")
    muscle = InputPort(
        vtkPolyData, content="muscle", optional=True, doc="Closed triangles that the fibres stay in."
    )
    output = OutputPort(
        vtkPolyData,
        doc="The smoothed polylines, with the arrays of the input, and the cell array ``LengthChange`` "
        "(n_fibres,): length after less length before [mm].",
    )

    def execute(self, fibres: vtkPolyData, muscle: vtkPolyData | None) -> vtkPolyData:
        """Return the smoothed fibres."""
        lines = polylines_of(fibres, "FibreSmoother: fibres")
        if muscle is None:
            points = smooth_polylines(lines.points, lines.offsets, self.k, self.iterations)
        else:
            points = self._in_muscle(lines, muscle_geometry(muscle, "FibreSmoother: muscle").distance)
        result = with_polylines(fibres, Polylines(points, lines.offsets))
        before = polyline_lengths(lines.points, lines.offsets)
        set_cell_array(result, "LengthChange", polyline_lengths(points, lines.offsets) - before)
        return result

    def _in_muscle(self, lines: Polylines, surface: SurfaceDistance) -> Floats:
        """Return smoothed points of which the inner ones are put back into the muscle after each pass."""
        inner = np.ones(len(lines.points), dtype=np.bool_)
        inner[lines.offsets[:-1]] = inner[lines.offsets[1:] - 1] = False
        points = lines.points
        for done in range(self.iterations):
            points = smooth_polylines(points, lines.offsets, self.k, 1)
            points[inner] = surface.into(points[inner])
            self.report_progress((done + 1) / self.iterations)
        return points
