"""FibreTubes: show fibres as tubes."""

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersCore import vtkTubeFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import Polylines, output_of
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class FibreTubes(Filter):
    """Turn fibres into tubes with closed ends, by vtkTubeFilter.

    Point and cell arrays are passed on for colours, such as ``Length``, ``Strain`` or ``PennationOrigin`` of
    FibreMetrics. A fibre without length has no tube.

    Parameters
    ----------
    fibres
        Polylines.
    radius
        Radius of the tubes.
    sides
        Number of sides of a tube.

    Attributes
    ----------
    output
        Tubes, triangle strips with normals, with the arrays of the input on points and cells.

    Raises
    ------
    ValueError
        If no fibre has a length.

    Limitations
    -----------
    Tubes are for display. Tubes of strongly curved fibres intersect themselves where the radius of curvature
    is below the tube's radius.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource
    >>> from vtkmuscle.filters import FibreTubes
    >>> fibre = vtkLineSource(point1=(0, 0, 0), point2=(30, 0, 0)).update().output
    >>> FibreTubes(radius=0.5, sides=6)(fibre).GetBounds()[:2]
    (0.0, 30.0)
    """

    radius = Parameter(float, default=1.0, above=0.0, units="mm")
    sides = Parameter(int, default=12, minimum=3, maximum=1000)

    fibres = ports.Lines()
    output = OutputPort(vtkPolyData)

    def execute(self, fibres: Polylines) -> vtkPolyData:
        """Return the tubes."""
        # Points are not shared: VTK blends the tubes of lines with common points.
        data, double = fibres.moved(fibres.points), {"OutputPointsPrecision": vtkAlgorithm.DOUBLE_PRECISION}
        # A tube is round about any normal, but VTK makes none about normals along the line.
        data.GetPointData().SetActiveNormals("")
        sizes = {"Radius": self.radius, "NumberOfSides": self.sides, "Capping": True}
        result = output_of(vtkTubeFilter(), InputData=data, **sizes, **double)
        if result.GetNumberOfPoints() == 0:
            raise InputError("fibres", "all lengths are 0, so there are no tubes")
        return result
