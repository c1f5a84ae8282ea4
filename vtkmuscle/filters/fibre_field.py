"""FibreField: fibre directions on a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkDataSet
from vtkmodules.vtkFiltersCore import vtkCellCenters, vtkMaskPoints

from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fibres.direction_field import AT_ONCE, CANDIDATES, NEIGHBOURS, DirectionField
from vtkmuscle.core.types import Bools, Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, output_of, points_of, shallow_copy
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports

#: Distance from the surface, as a part of the greatest coordinate, that still counts as inside: meshes are
#: often written in single precision, which rounds by half of the distance.
ON_SURFACE = float(np.finfo(np.float32).eps)
#: Distance from a fibre inside of an unknown muscle, in fibre spacings: twice that of a missing fibre.
SPACINGS = 2.0


class FibreField(Filter):
    """Add fibre directions to a mesh, for finite elements.

    A direction is the mean axis of the eight nearest fibres, weighted by inverse distance, continuous, and on
    a fibre equal to the fibre's tangent (:mod:`vtkmuscle.core.fibres.direction_field`). Directions point from
    the first points of fibres to the last: from origin to insertion for the fibres of FibreSource. Outside of
    the muscle, where ``InMuscle`` is 0, the field continues, since a mesh may differ a little from the
    surface. Without ``muscle``, positions farther than two fibre spacings from every fibre count as outside.

    Parameters
    ----------
    mesh
        Cells of any kind (a .vtu of tetrahedra), image data, rectilinear grid, or polydata.
    fibres
        Polylines, each from its origin to its insertion.
    muscle
        The muscle's surface: triangles, closed.
    at
        Position of the directions: cell centres or points.

    Attributes
    ----------
    output
        The mesh with cell or point arrays: ``FibreDirection`` (3, unit vectors, at a cell's centre),
        ``FibreDistance`` to the nearest fibre [mm] and ``InMuscle`` (uint8: 1 in the muscle, 0 outside).

    Raises
    ------
    ValueError
        If no fibre has a length; if the mesh has no cells, or cells without points; if no position is in the
        muscle; if the muscle's surface is open.

    References
    ----------
    Franke, Nielson 1980, *Smooth interpolation of large sets of scattered data*, doi:10.1002/nme.1620151110.

    Limitations
    -----------
    Directions have no meaning outside of the muscle. Fibres of opposite course within a distance of eight
    neighbours are averaged, so a field across an internal tendon is smooth instead of having a jump.

    Examples
    --------
    >>> import pyvista as pv
    >>> from vtkmuscle.filters import FibreField, FibreSource
    >>> from vtkmuscle.phantoms import pennate_block
    >>> phantom = pennate_block()
    >>> muscle, areas = phantom.muscles["block"], phantom.attachments["block"]
    >>> fibres = FibreSource(n_fibres=100)(muscle, areas)
    >>> grid = pv.ImageData(dimensions=(6, 11, 31), spacing=(4, 4, 4))
    >>> field = FibreField().apply(grid, fibres, muscle)
    >>> field["FibreDirection"][:, [0, 2]].mean(axis=0).round(2).tolist(), int(field["InMuscle"].min())
    ([0.32, 0.95], 1)
    """

    at = Parameter(str, default="cells", choices=("cells", "points"))

    mesh = InputPort(vtkDataSet)
    fibres = ports.Lines()
    muscle = ports.Surface(optional=True)
    output = OutputPort(vtkDataSet)

    def execute(self, mesh: vtkDataSet, fibres: Polylines, muscle: Surface | None) -> vtkDataSet:
        """Return the mesh with the directions."""
        with errors_at("fibres"):
            field = DirectionField(fibres.points, fibres.offsets)
        positions = self._positions(mesh)
        directions, distances = np.empty_like(positions), np.empty(len(positions))
        step = AT_ONCE // (CANDIDATES * NEIGHBOURS)  # positions that are searched at once
        for start in range(0, len(positions), step):
            part = slice(start, start + step)
            directions[part], distances[part] = field.at(positions[part])
            self.report_progress(0.9 * min(1.0, part.stop / len(positions)))
        inside = distances <= SPACINGS * field.spacing if muscle is None else _in_muscle(positions, muscle)
        if not inside.any():
            problem = f"no {self.at} of {len(positions)} are in the muscle; the mesh is in {_box(positions)}"
            remedy = "use the same frame and unit for both"
            raise InputError("mesh", f"{problem}, the fibres in {_box(fibres.points)}", remedy)
        arrays: dict[str, NDArray[Any]] = {"FibreDirection": directions, "FibreDistance": distances}
        return add_arrays(shallow_copy(mesh), **{self.at: arrays | {"InMuscle": inside.astype(np.uint8)}})

    def _positions(self, mesh: vtkDataSet) -> Floats:
        """Return cell centres or points (n, 3); grids store neither."""
        if self.at == "cells":
            read, count = output_of(vtkCellCenters(), InputData=mesh), mesh.GetNumberOfCells()
        else:
            every = {"OnRatio": 1, "OutputPointsPrecision": vtkMaskPoints.DOUBLE_PRECISION}
            read, count = output_of(vtkMaskPoints(), InputData=mesh, **every), mesh.GetNumberOfPoints()
        positions = points_of(read)
        if not count:
            raise InputError("mesh", f"the mesh has no {self.at}")
        if len(positions) != count or not np.isfinite(positions).all():
            wrong = "points are not finite" if len(positions) == count else "cells have no points"
            raise InputError("mesh", f"some {wrong}", f"correct or remove the {self.at}")
        return positions


def _in_muscle(positions: Floats, muscle: Surface) -> Bools:
    """Return a mask of positions (n, 3) in a muscle."""
    geometry = muscle.closed("and so no inside")
    inside = geometry.solids.inside(positions)
    outside, rounding = np.flatnonzero(~inside), ON_SURFACE * np.abs(geometry.points).max()
    inside[outside] = geometry.solids.distances(positions[outside]) <= rounding
    return inside


def _box(points: Floats) -> str:
    """Return the range of each coordinate, in words."""
    return " x ".join(f"{a:.4g}..{b:.4g}" for a, b in zip(points.min(0), points.max(0), strict=True))
