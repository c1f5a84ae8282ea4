"""A muscle's paths as arrays: of fibres, a cell each, or among the field arrays of a deformed muscle.

``PathLength`` (k,) is the length of each path, musculotendon length; ``PathPoints`` (k, 3 n) are its points;
``PathWrench_BONE`` (k, 6) is the force [1] and the moment about the origin that it exerts, at a tension of 1,
on a bone; ``PathSqueezed`` (k,) is the room that it lacks between two bones. Lines that are paths themselves
have no ``PathPoints``. Superficial fibres are lines that a user has seen on a muscle's surface.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, cell_array, field_array, polylines_of, set_cell_array


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
PATH_WRENCH = "PathWrench_"


class Paths(NamedTuple):
    """The paths of a muscle in one pose.

    Attributes
    ----------
    lengths : (k,) array
    points : (k, n, 3) array
    wrenches : dict of str to (k, 6) array
        By bone; on others there is none.
    """

    lengths: Floats
    points: Floats
    wrenches: dict[str, Floats]


def path_arrays(
    points: Floats, wrenches: Floats, bones: Sequence[str], squeezed: Floats
) -> dict[str, NDArray[Any]]:
    """Return the arrays of paths by their names.

    Parameters
    ----------
    points : (k, n, 3) array
        In the unit of the scene, as all lengths here.
    wrenches : (k, b, 6) array
        On each bone; those that no path touches have no array.
    bones : sequence of str
        Names of the b bones.
    squeezed : (k,) array
        Room that each path lacks between two bones.
    """
    k, n, _ = points.shape
    lengths = polyline_lengths(points.reshape(-1, 3), n * np.arange(k + 1))
    arrays: dict[str, NDArray[Any]] = {PATH_LENGTH: lengths, PATH_POINTS: points.reshape(k, -1)}
    arrays[PATH_SQUEEZED] = squeezed
    for number, bone in enumerate(bones):
        if wrenches[:, number].any():
            arrays[PATH_WRENCH + bone] = np.ascontiguousarray(wrenches[:, number])
    return arrays


def add_paths(fibres: vtkPolyData, muscle: Any, taut: vtkPolyData | None, where: str) -> None:
    """Add their paths to fibres: those of the deformed muscle, or else the taut fibres.

    Raises
    ------
    ValueError
        If taut fibres are no paths, or not one for each fibre.
    """
    found: dict[str, NDArray[Any]] = {}
    count = fibres.GetNumberOfCells()
    for name in _names(muscle.GetFieldData()):
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
            found |= {PATH_WRENCH + bone: values for bone, values in paths.wrenches.items()}
    for name, values in found.items():
        set_cell_array(fibres, name, np.array(values))


def _names(data: Any) -> list[str]:
    return [str(data.GetArrayName(i)) for i in range(data.GetNumberOfArrays())]


def paths_of(fibres: vtkPolyData, where: str) -> Paths | None:
    """Return the paths that fibres have with them, None where they have none."""
    lines, data = polylines_of(fibres, where), fibres.GetCellData()
    if not data.HasArray(PATH_LENGTH):
        return None
    lengths = np.array(cell_array(fibres, PATH_LENGTH, where))
    points = np.array(cell_array(fibres, PATH_POINTS, where)) if data.HasArray(PATH_POINTS) else lines.points
    wrenches = {
        name.removeprefix(PATH_WRENCH): np.array(cell_array(fibres, name, where))
        for name in _names(data)
        if name.startswith(PATH_WRENCH)
    }
    return Paths(lengths, points.reshape(len(lengths), -1, 3), wrenches)


def wrenches_over_time(frames: Iterable[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Return wrenches (f, k, 6) by bone, of frames that each have those (k, 6) on the bones touched then."""
    given = list(frames)
    names = dict.fromkeys(bone for frame in given for bone in frame)
    shape = next((one.shape for frame in given for one in frame.values()), (0, 6))
    none = np.zeros(shape)
    return {bone: np.array([frame.get(bone, none) for frame in given]) for bone in names}
