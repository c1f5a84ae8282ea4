"""FibreTubes: show fibres as tubes."""

from __future__ import annotations

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataSetAttributes, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersCore import vtkTubeFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import filling_radius, room_between
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    Polylines,
    polylines_from,
    set_cell_array,
    set_point_array,
)
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Name of the point array of radii.
RADIUS = "TubeRadius"


class FibreTubes(Filter):
    """Make tubes of fibres, with closed ends.

    By vtkTubeFilter. Point and cell arrays are passed on, so that tubes can be coloured by whatever the
    fibres carry; ``colour_by`` makes one of them the active scalars (``Length``, ``Strain`` and
    ``PennationOrigin`` are FibreMetrics'). A fibre without length gets no tube.

    With ``radius_by="fill"`` tubes have the radius with which they would fill the muscle if they were packed
    like hexagons, sqrt(volume / (2 sqrt(3) total length)), and where fibres are nearer to each other, half
    their distance: so they do not overlap.

    Parameters
    ----------
    fibres
        Polylines.
    muscle
        Its volume is filled with ``radius_by="fill"``.
    radius
        Radius of the tubes.
    radius_by
        The radius: ``radius``, ``radius`` times the values of an array, or what fills the muscle.
    radius_array
        Point or cell array, with ``radius_by="array"``.
    colour_by
        Point or cell array that becomes the active scalars.
    sides
        Number of sides of a tube.
    max_triangles
        Level of detail: no more triangles than this, about, by fewer sides and, with three sides, fewer
        fibres (the first ones, which a template spreads evenly); 0: no limit.

    Attributes
    ----------
    output
        Tubes, triangle strips with normals, with the arrays of the input on points and cells.

    Raises
    ------
    ValueError
        If there are no fibres, a point is not finite, or no fibre has a length; if there is no such array,
        or a radius in it is negative or not finite; if ``radius_by="fill"`` and there is no muscle.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource
    >>> from vtkmuscle.filters import FibreTubes
    >>> fibre = vtkLineSource(point1=(0, 0, 0), point2=(30, 0, 0)).update().output
    >>> FibreTubes(radius=0.5, sides=6)(fibre).GetBounds()[:2]
    (0.0, 30.0)
    """

    radius = Parameter(float, default=1.0, above=0.0, units="mm")
    radius_by = Parameter(str, default="constant", choices=("constant", "array", "fill"))
    radius_array: Parameter[str | None] = Parameter(str, default=None)
    colour_by: Parameter[str | None] = Parameter(str, default=None)
    sides = Parameter(int, default=12, minimum=3, maximum=1000)
    max_triangles = Parameter(int, default=0, minimum=0)

    fibres = ports.Lines()
    muscle = ports.Surface(optional=True)
    output = OutputPort(vtkPolyData)

    def execute(self, fibres: Polylines, muscle: Surface | None) -> vtkPolyData:
        """Return the tubes."""
        # Each line gets points of its own: VTK blends the tubes of lines that share points.
        data = fibres.copy()
        self._check_arrays(data)
        tubes = vtkTubeFilter()
        if self.radius_by != "constant":
            set_point_array(data, RADIUS, self._radii(data, fibres, muscle))
            data.GetPointData().SetActiveScalars(RADIUS)
            tubes.SetVaryRadiusToVaryRadiusByAbsoluteScalar()
        sides, count = self._detail(fibres)
        tubes.SetInputData(_first_lines(data, fibres, count))
        tubes.SetRadius(self.radius)
        tubes.SetNumberOfSides(sides)
        tubes.CappingOn()
        tubes.SetOutputPointsPrecision(vtkAlgorithm.DOUBLE_PRECISION)
        tubes.Update()
        result: vtkPolyData = tubes.GetOutput()
        if result.GetNumberOfPoints() == 0:
            raise InputError("fibres", "none of them has a length, and so none gets a tube")
        if self.colour_by is not None:
            on_points = result.GetPointData().HasArray(self.colour_by)
            owner = result.GetPointData() if on_points else result.GetCellData()
            other = result.GetCellData() if on_points else result.GetPointData()
            other.SetActiveAttribute(-1, vtkDataSetAttributes.SCALARS)
            owner.SetActiveScalars(self.colour_by)
        return result

    def _check_arrays(self, data: vtkPolyData) -> None:
        wanted = {"colour_by": self.colour_by}
        if self.radius_by == "array":
            if self.radius_array is None:
                raise InputError("", "radius_by is 'array', but radius_array names none")
            wanted["radius_array"] = self.radius_array
        owners = (data.GetPointData(), data.GetCellData())
        names = [owner.GetArrayName(i) for owner in owners for i in range(owner.GetNumberOfArrays())]
        for parameter, name in wanted.items():
            if name not in (None, *names):
                have = ", ".join(map(repr, names)) or "(none)"
                raise InputError("", f"{parameter} is {name!r}, but the fibres have the arrays {have}")

    def _radii(self, data: vtkPolyData, lines: Polylines, muscle: Surface | None) -> Floats:
        if self.radius_by == "array" and self.radius_array is not None:
            on_points = data.GetPointData().HasArray(self.radius_array)
            owner = data.GetPointData() if on_points else data.GetCellData()
            values = np.array(vtk_to_numpy(owner.GetArray(self.radius_array)), dtype=np.float64)
            if values.ndim > 1 or not (np.isfinite(values) & (values >= 0)).all():
                raise InputError(
                    "fibres",
                    f"the array {self.radius_array!r} must have one number per point or fibre, finite and "
                    "not negative, to be a radius",
                )
            return self.radius * (values if on_points else np.repeat(values, np.diff(lines.offsets)))
        if muscle is None:
            raise InputError("", "radius_by is 'fill', but the port 'muscle' is not connected")
        volume = abs(signed_volume(muscle.points, muscle.triangles))
        total = float(polyline_lengths(lines.points, lines.offsets).sum())
        if not total > 0.0:
            raise InputError("fibres", "none of them has a length, and so none gets a tube")
        return np.minimum(filling_radius(volume, total), 0.5 * room_between(lines.points, lines.offsets))

    def _detail(self, lines: Polylines) -> tuple[int, int]:
        """Return the number of sides and of fibres that are within the limit of triangles."""
        if not self.max_triangles:
            return self.sides, len(lines)
        # Two triangles per side and segment, one less than two per side for the caps.
        per_side = 2 * np.cumsum(np.diff(lines.offsets))
        sides = int(np.clip(self.max_triangles // per_side[-1], 3, self.sides))
        count = int(np.searchsorted(per_side * sides, self.max_triangles, side="right"))
        return sides, min(max(count, 1), len(lines))


def _first_lines(data: vtkPolyData, lines: Polylines, count: int) -> vtkPolyData:
    """Return the first lines with their arrays."""
    if count == len(lines):
        return data
    n_points = int(lines.offsets[count])
    part = polylines_from(Polylines(lines.points[:n_points], lines.offsets[: count + 1]))
    part.GetFieldData().ShallowCopy(data.GetFieldData())
    for source, put, stop in (
        (data.GetPointData(), set_point_array, n_points),
        (data.GetCellData(), set_cell_array, count),
    ):
        for i in range(source.GetNumberOfArrays()):
            array = source.GetArray(i)
            if array is not None:
                put(part, array.GetName(), vtk_to_numpy(array)[:stop])
    if data.GetPointData().HasArray(RADIUS):
        part.GetPointData().SetActiveScalars(RADIUS)
    return part
