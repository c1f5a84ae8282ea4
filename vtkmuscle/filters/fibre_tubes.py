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
    """Make tubes of fibres, with closed ends, by vtkTubeFilter.

    Point and cell arrays are passed on, to colour tubes by; ``colour_by`` makes one of them the active
    scalars, such as ``Length``, ``Strain`` or ``PennationOrigin`` of FibreMetrics. A fibre without length
    gets no tube.

    With ``radius_by="fill"`` tubes have the radius with which they would fill the muscle if they were packed
    like hexagons, sqrt(volume / (2 sqrt(3) total length)). Where fibres are nearer to each other it is half
    their distance, so that tubes do not overlap.

    Parameters
    ----------
    fibres
        Polylines.
    muscle
        Its volume is filled with ``radius_by="fill"``.
    radius
        Radius of the tubes.
    radius_by
        How the radius is chosen: it is ``radius``, or fills the muscle.
    colour_by
        Point or cell array that becomes the active scalars.
    sides
        Number of sides of a tube.

    Attributes
    ----------
    output
        Tubes, triangle strips with normals, with the arrays of the input on points and cells.

    Raises
    ------
    ValueError
        If no fibre has a length; if there is no array ``colour_by``; if ``radius_by="fill"`` and there is no
        muscle.

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
        # Each line gets points of its own: VTK blends the tubes of lines that share points.
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
            raise InputError("fibres", "none of them has a length, and so none gets a tube")
        if self.colour_by is not None:
            owner, other = result.GetPointData(), result.GetCellData()
            if not owner.HasArray(self.colour_by):
                owner, other = other, owner
            other.SetActiveAttribute(-1, vtkDataSetAttributes.SCALARS)
            owner.SetActiveScalars(self.colour_by)
        return result

    def _check_colours(self, data: vtkPolyData) -> None:
        owners = (data.GetPointData(), data.GetCellData())
        names = [name for owner in owners for name in array_names(owner)]
        if self.colour_by not in (None, *names):
            have = ", ".join(map(repr, names)) or "(none)"
            raise InputError("", f"colour_by is {self.colour_by!r}, but the fibres have the arrays {have}")


def _filling_radii(lines: Polylines, muscle: Surface | None) -> Floats:
    """Return the radius (n,) at each point with which tubes fill the muscle and do not overlap."""
    if muscle is None:
        raise InputError("", "radius_by is 'fill', but the port 'muscle' is not connected")
    volume = abs(signed_volume(muscle.points, muscle.triangles))
    total = float(polyline_lengths(lines.points, lines.offsets).sum())
    if not total > 0.0:
        raise InputError("fibres", "none of them has a length, and so none gets a tube")
    return np.minimum(filling_radius(volume, total), 0.5 * room_between(lines.points, lines.offsets))
