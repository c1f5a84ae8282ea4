"""FibreTubes: show fibres as tubes."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataSetAttributes, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersCore import vtkTubeFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import filling_radius, room_between
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, array_names, set_point_array
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Name of the point array of radii.
RADIUS = "TubeRadius"


class FibreTubes(Filter):
    """Turn fibres into tubes with closed ends, by vtkTubeFilter.

    Point and cell arrays are passed on for colours; ``colour_by`` sets the active scalars, such as
    ``Length``, ``Strain`` or ``PennationOrigin`` of FibreMetrics. A fibre without length has no tube.

    With ``radius_by="fill"`` the radius is sqrt(volume / (2 sqrt(3) total length)): hexagonally packed tubes
    would fill the muscle. Between closer fibres the radius is half their distance, so that tubes do not
    overlap.

    Parameters
    ----------
    fibres
        Polylines.
    muscle
        The muscle to fill with ``radius_by="fill"``.
    radius
        Radius of the tubes.
    radius_by
        Choice of the radius: ``radius``, or the radius that fills the muscle.
    colour_by
        Point or cell array for the active scalars.
    sides
        Number of sides of a tube.

    Attributes
    ----------
    output
        Tubes, triangle strips with normals, with the arrays of the input on points and cells.

    Raises
    ------
    ValueError
        If no fibre has a length; if the array ``colour_by`` is missing; if ``radius_by="fill"`` lacks a
        muscle.

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
    radius_by = Parameter(str, default="constant", choices=("constant", "fill"))
    colour_by: Parameter[str | None] = Parameter(str, default=None)
    sides = Parameter(int, default=12, minimum=3, maximum=1000)

    fibres = ports.Lines()
    muscle = ports.Surface(optional=True)
    output = OutputPort(vtkPolyData)

    def execute(self, fibres: Polylines, muscle: Surface | None) -> vtkPolyData:
        """Return the tubes."""
        # Points are not shared: VTK blends the tubes of lines with common points.
        data = fibres.copy()
        self._check_colours(data)
        tubes = vtkTubeFilter()
        if self.radius_by == "fill":
            set_point_array(data, RADIUS, _filling_radii(fibres, muscle))
            data.GetPointData().SetActiveScalars(RADIUS)
            tubes.SetVaryRadiusToVaryRadiusByAbsoluteScalar()
        tubes.SetInputData(data)
        tubes.SetRadius(self.radius)
        tubes.SetNumberOfSides(self.sides)
        tubes.CappingOn()
        tubes.SetOutputPointsPrecision(vtkAlgorithm.DOUBLE_PRECISION)
        tubes.Update()
        result: vtkPolyData = tubes.GetOutput()
        if result.GetNumberOfPoints() == 0:
            raise InputError("fibres", "all lengths are 0, so there are no tubes")
        if self.colour_by is not None:
            owner, unused = result.GetPointData(), result.GetCellData()
            if not owner.HasArray(self.colour_by):
                owner, unused = unused, owner
            unused.SetActiveAttribute(-1, vtkDataSetAttributes.SCALARS)
            owner.SetActiveScalars(self.colour_by)
        return result

    def _check_colours(self, data: vtkPolyData) -> None:
        owners = (data.GetPointData(), data.GetCellData())
        names = [name for owner in owners for name in array_names(owner)]
        if self.colour_by not in (None, *names):
            have = ", ".join(map(repr, names)) or "(none)"
            raise InputError("", f"colour_by is {self.colour_by!r}, but the fibres have the arrays {have}")


def _filling_radii(lines: Polylines, muscle: Surface | None) -> Floats:
    """Return radii (n,) of tubes that fill the muscle without overlap."""
    if muscle is None:
        raise InputError("", "radius_by is 'fill', but the port 'muscle' is not connected")
    volume = abs(signed_volume(muscle.points, muscle.triangles))
    total = float(polyline_lengths(lines.points, lines.offsets).sum())
    if not total > 0.0:
        raise InputError("fibres", "all lengths are 0, so there are no tubes")
    return np.minimum(filling_radius(volume, total), 0.5 * room_between(lines.points, lines.offsets))
