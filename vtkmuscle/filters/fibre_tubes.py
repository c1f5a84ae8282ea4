"""FibreTubes: show fibres as tubes."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersCore import vtkTubeFilter

from vtkmuscle.filters.arrays import polylines_of, with_polylines
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.parameters import InputPort, OutputPort, Parameter


class FibreTubes(Filter):
    """Make tubes of fibres, with closed ends.

    By vtkTubeFilter. Point and cell arrays are passed on, so that tubes can be coloured by whatever the
    fibres carry. A fibre without length gets no tube.

    Raises
    ------
    ValueError
        If there are no fibres, a point is not finite, or no fibre has a length.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource
    >>> from vtkmuscle.filters import FibreTubes
    >>> fibre = vtkLineSource(point1=(0, 0, 0), point2=(30, 0, 0)).update().output
    >>> FibreTubes(radius=0.5, sides=6)(fibre).GetBounds()[:2]
    (0.0, 30.0)
    """

    radius = Parameter(float, default=1.0, above=0.0, units="mm", doc="Radius of the tubes.")
    sides = Parameter(int, default=12, minimum=3, doc="Number of sides of a tube.")

    fibres = InputPort(vtkPolyData, content="fibres", doc="Polylines.")
    output = OutputPort(
        vtkPolyData,
        doc="Tubes, triangle strips with normals, with the arrays of the input on points and cells.",
    )

    def execute(self, fibres: vtkPolyData) -> vtkPolyData:
        """Return the tubes."""
        tubes = vtkTubeFilter()
        # Each line gets points of its own: VTK blends the tubes of lines that share points.
        tubes.SetInputData(with_polylines(fibres, polylines_of(fibres, "FibreTubes: fibres")))
        tubes.SetRadius(self.radius)
        tubes.SetNumberOfSides(self.sides)
        tubes.CappingOn()
        tubes.SetOutputPointsPrecision(vtkAlgorithm.DOUBLE_PRECISION)
        tubes.Update()
        result: vtkPolyData = tubes.GetOutput()
        if result.GetNumberOfPoints() == 0:
            raise ValueError("FibreTubes: fibres: none of them has a length, and so none gets a tube")
        return result
