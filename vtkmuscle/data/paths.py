"""A muscle's paths as polylines, and as cell arrays of fibres.

Paths have the point array ``RestPosition`` (3) and the cell arrays ``Lever_COORDINATE``, lever of the pull
(minus change of length per coordinate), ``Squeezed``, missing room between two bones, ``Sag``, depth to which
straight segments cut into bones, and ``Bow`` and ``BowLever_COORDINATE``, parts of length and lever that are
of a bow off the bones. Fibres with path data have the cell arrays of the paths,
``PathLength`` and ``PathRestLength`` (k,), musculotendon length now and at rest, and ``PathPoints`` (k, 3 n).
Superficial fibres are lines seen on a muscle's surface.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, cell_array, names_of, point_array, polylines_of


def checked_superficial(data: vtkPolyData, where: str) -> Polylines:
    """Return superficial fibres; ValueError as :func:`polylines_of`, or if all lengths are 0."""
    lines = polylines_of(data, where)
    if not lines.lengths.max() > 0.0:
        remedy = "digitise two points or more per fibre"
        raise InputError(where, "all fibres have length 0, so there is no direction", remedy)
    return lines


#: Point array of paths: positions at rest.
REST_POSITION = "RestPosition"
#: Cell arrays of paths, and of fibres with path data.
SQUEEZED, SAG, LEVER, BOW, BOW_LEVER = "Squeezed", "Sag", "Lever_", "Bow", "BowLever_"
#: Cell arrays of paths.
LENGTH, REST_LENGTH = "Length", "RestLength"
#: Field arrays of paths; lengths and levers of an unsettled sheet are NaN.
UNSETTLED, PATH_STEPS, PASSED = "Unsettled", "PathSteps", "Passed"
#: Cell arrays of fibres with path data.
PATH_LENGTH, PATH_REST, PATH_POINTS = "PathLength", "PathRestLength", "PathPoints"


class PathLines(NamedTuple):
    """Paths with their arrays, and their points (k, n, 3) at rest and now."""

    data: vtkPolyData
    rest: Floats
    points: Floats


def path_lines_of(data: vtkPolyData, where: str) -> PathLines | None:
    """Return paths, None for an empty data set."""
    if not data.GetNumberOfCells():
        return None
    lines = polylines_of(data, where)  # with point arrays in the order of the lines
    rest = point_array(lines.data, REST_POSITION, where)
    points = lines.stacked(where, "connect TautPaths")
    return PathLines(data, np.asarray(rest, dtype=np.float64).reshape(points.shape), points)


class Paths(NamedTuple):
    """A muscle's paths in a pose. Lengths and rest lengths (k,), points (k, n, 3) and levers (k,).

    Levers are by coordinate, per radian or millimetre, positive if the pull increases the coordinate. Bows
    (k,) are the parts of lengths, by "", and of levers, by coordinate, of :mod:`~vtkmuscle.core.paths.bows`.
    """

    lengths: Floats
    rest_lengths: Floats
    points: Floats
    levers: dict[str, Floats]
    bows: dict[str, Floats]


def add_path_arrays(fibres: vtkPolyData, paths: PathLines, where: str) -> None:
    """Add lengths, points, ``Squeezed``, ``Sag``, levers and bows of paths to fibres, one for each path."""
    count, cells = fibres.GetNumberOfCells(), paths.data.GetCellData()
    if len(paths.points) != count:
        problem = f"there are {len(paths.points)} paths, but {count} fibres"
        raise InputError(where, problem, "connect TautPaths for the same fibres")
    bows = [BOW] * cells.HasArray(BOW)
    kept = SQUEEZED, SAG, *bows, *names_of(LEVER, cells).values(), *names_of(BOW_LEVER, cells).values()
    names = {PATH_LENGTH: LENGTH, PATH_REST: REST_LENGTH, **dict(zip(kept, kept, strict=True))}
    arrays = {own: cell_array(paths.data, name, where) for own, name in names.items()}
    add_arrays(fibres, cells=arrays | {PATH_POINTS: paths.points.reshape(count, -1)})


def paths_of(fibres: vtkPolyData, where: str) -> Paths | None:
    """Return the paths stored with fibres, or the paths themselves; else None."""
    lines, data = polylines_of(fibres, where), fibres.GetCellData()

    def values(name: str) -> Floats:
        return np.array(cell_array(fibres, name, where))

    if data.HasArray(PATH_LENGTH):
        lengths, rest, points = values(PATH_LENGTH), values(PATH_REST), values(PATH_POINTS)
    elif fibres.GetPointData().HasArray(REST_POSITION):
        lengths, rest, points = values(LENGTH), values(REST_LENGTH), lines.points
    else:
        return None
    levers = {name: values(array) for name, array in names_of(LEVER, data).items()}
    bows = {name: values(array) for name, array in names_of(BOW_LEVER, data).items()}
    if data.HasArray(BOW):
        bows[""] = values(BOW)
    return Paths(lengths, rest, points.reshape(len(lengths), -1, 3), levers, bows)


def levers_over_time(frames: Sequence[Mapping[str, Floats | float]]) -> dict[str, Floats]:
    """Return levers (f, k), or means (f,), by coordinate, NaN if missing."""
    shapes = {name: np.shape(levers) for frame in frames for name, levers in frame.items()}
    missing = {name: np.full(shape, np.nan) for name, shape in shapes.items()}
    return {name: np.array([frame.get(name, nan) for frame in frames]) for name, nan in missing.items()}
