"""A muscle's paths as arrays: of fibres, a cell each, or among the field arrays of a deformed muscle.

``PathLength`` (k,) is the length of each path, musculotendon length; ``PathPoints`` (k, 3 n) are its points;
``PathLever_COORDINATE`` (k,) is the lever of its pull, minus the change of its length by the coordinate;
``PathSqueezed`` (k,) is the room that it lacks between two bones. Lines that are paths themselves have no
``PathPoints``. Superficial fibres are lines that a user has seen on a muscle's surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    Polylines,
    array_names,
    array_of,
    cell_array,
    field_array,
    names_of,
    polylines_of,
    set_cell_array,
)


def checked_superficial(data: vtkPolyData, where: str) -> Polylines:
    """Return superficial fibres.

    Parameters
    ----------
    data : vtkPolyData
        Polylines.
    where : str
        Named in the error, e.g. ``"SliceMorpher: superficial"``.

    Raises
    ------
    ValueError
        If there are no polylines, a point is not finite, or none has a length.
    """
    lines = polylines_of(data, where)
    if not polyline_lengths(lines.points, lines.offsets).max() > 0.0:
        raise InputError(
            where,
            "no fibre has a length, so that they have no direction",
            "digitise two points or more of each",
        )
    return lines


PATH_LENGTH, PATH_POINTS, PATH_SQUEEZED = "PathLength", "PathPoints", "PathSqueezed"
PATH_LEVER = "PathLever_"


class Paths(NamedTuple):
    """The paths of a muscle in one pose.

    Attributes
    ----------
    lengths : (k,) array
    points : (k, n, 3) array
    levers : dict of str to (k,) array
        By coordinate: per radian or millimetre of it, positive where the pull drives it up.
    """

    lengths: Floats
    points: Floats
    levers: dict[str, Floats]


def path_arrays(points: Floats, levers: Mapping[str, Floats], squeezed: Floats) -> dict[str, NDArray[Any]]:
    """Return the arrays of paths by their names.

    Parameters
    ----------
    points : (k, n, 3) array
        In the unit of the scene, as all lengths here.
    levers : mapping of str to (k,) array
        By coordinate.
    squeezed : (k,) array
        Room that each path lacks between two bones.
    """
    k, n, _ = points.shape
    lengths = polyline_lengths(points.reshape(-1, 3), n * np.arange(k + 1))
    arrays: dict[str, NDArray[Any]] = {PATH_LENGTH: lengths, PATH_POINTS: points.reshape(k, -1)}
    arrays[PATH_SQUEEZED] = squeezed
    return arrays | {array_of(PATH_LEVER, name): one for name, one in levers.items()}


def add_paths(fibres: vtkPolyData, muscle: Any, taut: vtkPolyData | None, where: str) -> None:
    """Add their paths to fibres: those of the deformed muscle, or else the taut fibres.

    Raises
    ------
    ValueError
        If taut fibres are no paths, or not one for each fibre.
    """
    found: dict[str, NDArray[Any]] = {}
    count = fibres.GetNumberOfCells()
    for name in array_names(muscle.GetFieldData()):
        values = field_array(muscle, name) if name.startswith("Path") else None
        if values is not None and len(values) == count:
            found[name] = values
    if taut is not None:
        paths = paths_of(taut, where)
        if paths is None or len(paths.lengths) != count:
            there = (
                "they have no cell array 'PathLength'" if paths is None else f"there are {len(paths.lengths)}"
            )
            raise InputError(where, there, f"connect TautFibres for the same {count} fibre(s)")
        if not found:
            found = {PATH_LENGTH: paths.lengths, PATH_POINTS: paths.points.reshape(count, -1)}
            found |= {array_of(PATH_LEVER, name): values for name, values in paths.levers.items()}
    for name, values in found.items():
        set_cell_array(fibres, name, np.array(values))


def paths_of(fibres: vtkPolyData, where: str) -> Paths | None:
    """Return the paths that fibres have with them, None where they have none."""
    lines, data = polylines_of(fibres, where), fibres.GetCellData()
    if not data.HasArray(PATH_LENGTH):
        return None
    lengths = np.array(cell_array(fibres, PATH_LENGTH, where))
    points = np.array(cell_array(fibres, PATH_POINTS, where)) if data.HasArray(PATH_POINTS) else lines.points
    levers = {
        name: np.array(cell_array(fibres, array, where)) for name, array in names_of(PATH_LEVER, data).items()
    }
    return Paths(lengths, points.reshape(len(lengths), -1, 3), levers)


def levers_over_time(frames: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Return levers (f, k) by coordinate, NaN in the frames (k,) in which they are not known."""
    known = {name: one for frame in frames for name, one in frame.items()}
    return {
        name: np.array([frame.get(name, np.full_like(one, np.nan)) for frame in frames])
        for name, one in known.items()
    }
