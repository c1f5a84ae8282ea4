"""A muscle's paths as polylines, and as cell arrays of fibres.

Paths have the point array ``RestPosition`` (3) and the cell arrays ``Lever_COORDINATE``, lever of the pull
(minus change of length per coordinate), ``Squeezed``, missing room between two bones, and ``Sag``, depth to
which straight segments cut into bones. Fibres with path data have the cell arrays of the paths,
``PathLength`` (k,), musculotendon length, and ``PathPoints`` (k, 3 n). Superficial fibres are lines seen on a
muscle's surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, cell_array, names_of, point_array, polylines_of, set_cell_array


def checked_superficial(data: vtkPolyData, where: str) -> Polylines:
    """Return superficial fibres.

    Parameters
    ----------
    data : vtkPolyData
        Polylines.
    where : str
        Name for errors, e.g. ``"SliceMorpher: superficial"``.

    Raises
    ------
    ValueError
        If there are no polylines, a point is not finite, or all lengths are 0.
    """
    lines = polylines_of(data, where)
    if not polyline_lengths(lines.points, lines.offsets).max() > 0.0:
        remedy = "digitise two points or more per fibre"
        raise InputError(where, "all fibres have length 0, so there is no direction", remedy)
    return lines


#: Point array of paths: positions at rest.
REST_POSITION = "RestPosition"
#: Cell arrays of paths, and of fibres with path data.
SQUEEZED, SAG, LEVER = "Squeezed", "Sag", "Lever_"
#: Cell array of paths, and field arrays; lengths and levers of an unsettled sheet are NaN.
LENGTH, UNSETTLED, PATH_STEPS = "Length", "Unsettled", "PathSteps"
#: Cell arrays of fibres with path data.
PATH_LENGTH, PATH_POINTS = "PathLength", "PathPoints"


class PathLines(NamedTuple):
    """Paths with equal numbers of points, at rest and now.

    Attributes
    ----------
    data : vtkPolyData
        The polylines, with their arrays.
    rest, points : (k, n, 3) arrays
        At rest and now, in the unit of the scene.
    """

    data: vtkPolyData
    rest: Floats
    points: Floats


def path_lines_of(data: vtkPolyData, where: str) -> PathLines | None:
    """Return paths, None for an empty data set.

    Raises
    ------
    ValueError
        If the point array ``RestPosition`` is missing, or paths have different numbers of points.
    """
    if not data.GetNumberOfCells():
        return None
    rest = point_array(data, REST_POSITION, where)
    lines = polylines_of(data, where)
    counts = np.unique(np.diff(lines.offsets))
    if len(counts) > 1:
        raise InputError(where, f"paths have {counts[0]} to {counts[-1]} points", "connect TautPaths")
    shape = len(lines), int(counts[0]), 3
    return PathLines(data, np.asarray(rest, dtype=np.float64).reshape(shape), lines.points.reshape(shape))


class Paths(NamedTuple):
    """The paths of a muscle in one pose.

    Attributes
    ----------
    lengths : (k,) array
    points : (k, n, 3) array
    levers : dict of str to (k,) array
        By coordinate: per radian or millimetre, positive if the pull increases the coordinate.
    """

    lengths: Floats
    points: Floats
    levers: dict[str, Floats]


def add_path_arrays(fibres: vtkPolyData, paths: PathLines, where: str) -> None:
    """Add ``PathLength``, ``PathPoints``, ``Squeezed``, ``Sag`` and levers to fibres.

    Raises
    ------
    ValueError
        If the numbers of paths and fibres differ.
    """
    count, cells = fibres.GetNumberOfCells(), paths.data.GetCellData()
    if len(paths.points) != count:
        problem = f"there are {len(paths.points)} paths, but {count} fibres"
        raise InputError(where, problem, "connect TautPaths for the same fibres")
    set_cell_array(fibres, PATH_LENGTH, np.array(cell_array(paths.data, LENGTH, where)))
    set_cell_array(fibres, PATH_POINTS, paths.points.reshape(count, -1))
    for name in (SQUEEZED, SAG, *names_of(LEVER, cells).values()):
        set_cell_array(fibres, name, np.array(cell_array(paths.data, name, where)))


def paths_of(fibres: vtkPolyData, where: str) -> Paths | None:
    """Return the paths stored with fibres, or the paths themselves; else None."""
    lines, data = polylines_of(fibres, where), fibres.GetCellData()
    if data.HasArray(PATH_LENGTH):
        lengths = np.array(cell_array(fibres, PATH_LENGTH, where))
        points = np.array(cell_array(fibres, PATH_POINTS, where))
    elif fibres.GetPointData().HasArray(REST_POSITION):
        lengths, points = np.array(cell_array(fibres, LENGTH, where)), lines.points
    else:
        return None
    levers = {
        name: np.array(cell_array(fibres, array, where)) for name, array in names_of(LEVER, data).items()
    }
    return Paths(lengths, points.reshape(len(lengths), -1, 3), levers)


def levers_over_time(frames: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Return levers (f, k) by coordinate, NaN if missing."""
    shapes = {name: levers.shape for frame in frames for name, levers in frame.items()}
    return {
        name: np.array([frame.get(name, np.full(shape, np.nan)) for frame in frames])
        for name, shape in shapes.items()
    }
