"""FibreSmoother: take the noise out of fibres."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.polylines import smooth_polylines
from vtkmuscle.filters.arrays import Polylines, polylines_of, with_polylines
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.parameters import InputPort, OutputPort, Parameter


class FibreSmoother(Filter):
    """Smooth fibres by a three-point weighted mean that keeps their end points.

    Each pass moves the inner points to (p_{i-1} + k p_i + p_{i+1}) / (k + 2).

    Raises
    ------
    ValueError
        If there are no polylines, or a point is not finite.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4,
    doi:10.5220/0003827200580066.

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
    output = OutputPort(vtkPolyData, doc="The smoothed polylines, with the arrays of the input.")

    def execute(self, fibres: vtkPolyData) -> vtkPolyData:
        """Return the smoothed fibres."""
        lines = polylines_of(fibres, "FibreSmoother: fibres")
        points = smooth_polylines(lines.points, lines.offsets, self.k, self.iterations)
        return with_polylines(fibres, Polylines(points, lines.offsets))
