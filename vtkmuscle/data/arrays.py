"""Conversion between VTK data sets and numpy arrays."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import get_numpy_array_type, get_vtk_array_type, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_ID_TYPE, vtkDataArray, vtkPoints, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkDataObject, vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.surface import edge_uses
from vtkmuscle.core.types import Floats, Ints

Data = TypeVar("Data", bound=vtkDataObject)
Made = TypeVar("Made")
#: Arrays by name.
Arrays = Mapping[str, Any]


def points_of(data: Any) -> Floats:
    """Return a data set's points (n, 3) as a float64 copy."""
    points = data.GetPoints()
    return np.array(np.zeros((0, 3)) if points is None else vtk_to_numpy(points.GetData()), dtype=np.float64)


def triangles_of(surface: vtkPolyData, where: str) -> Ints:
    """Return a surface's triangles (m, 3); ValueError at `where` for other faces."""
    polys = surface.GetPolys()
    if polys.GetNumberOfCells() + surface.GetNumberOfStrips() == 0:
        raise InputError(where, "the surface has no triangles")
    if surface.GetNumberOfStrips() or polys.IsHomogeneous() != 3:
        raise InputError(where, "the surface has faces that are not triangles", "run vtkTriangleFilter on it")
    triangles = np.array(vtk_to_numpy(polys.GetConnectivityArray()), dtype=np.int64).reshape(-1, 3)
    if triangles.min() < 0 or triangles.max() >= surface.GetNumberOfPoints():
        raise InputError(where, "a triangle has a corner that is no point", "export the surface again")
    return triangles


def checked_surface(surface: vtkPolyData, where: str) -> tuple[Floats, Ints]:
    """Return points and triangles; ValueError as :func:`triangles_of`, or for NaN."""
    triangles = triangles_of(surface, where)
    points = points_of(surface)
    finite = np.isfinite(points)
    if not finite.all():  # a check row by row is slower
        bad = np.flatnonzero(~finite.all(axis=1))
        problem = f"{len(bad)} point(s) are not finite, the first is point {bad[0]}"
        raise InputError(where, problem, "correct the points")
    return points, triangles


def joined_triangles(surface: vtkPolyData) -> tuple[vtkPolyData, list[str]]:
    """Return a surface of triangles with shared corners, and the changes in words.

    Polygons and strips are split. Exactly equal points are joined if this closes open edges, so that closed
    pieces that touch stay apart.
    """
    changes: list[str] = []
    count = surface.GetNumberOfPolys() + surface.GetNumberOfStrips()
    if not count:
        return surface, changes
    if surface.GetNumberOfStrips() or surface.GetPolys().IsHomogeneous() != 3:
        surface = output_of(vtkTriangleFilter(), InputData=surface, PassVerts=False, PassLines=False)
        changes.append(f"{count} polygons were split into {surface.GetNumberOfPolys()} triangles")
    points, triangles = points_of(surface), triangles_of(surface, "")
    n_open = int((edge_uses(triangles) == 1).sum())
    if not n_open:
        return surface, changes
    _, first, group = np.unique(points, axis=0, return_index=True, return_inverse=True)
    kept, number = np.unique(first[group.reshape(-1)], return_inverse=True)
    joined = number[triangles]
    faces = np.flatnonzero((joined != np.roll(joined, 1, axis=1)).all(axis=1))
    if len(kept) == len(points) or (edge_uses(joined[faces]) == 1).sum() >= n_open:
        return surface, changes
    result = surface_from(points[kept], joined[faces])
    copied = [("Point", kept)]
    if surface.GetNumberOfCells() == len(triangles):
        copied.append(("Cell", faces))
    for kind, ids in copied:
        _copy_tuples(ids, *(getattr(data, f"Get{kind}Data")() for data in (surface, result)))
    result.GetFieldData().ShallowCopy(surface.GetFieldData())
    return result, [*changes, f"{len(points)} points were joined to {len(kept)} by equal coordinates"]


def vtk_points(points: Floats) -> vtkPoints:
    """Return vtkPoints with a double copy of an (n, 3) array."""
    return with_settings(vtkPoints(), Data=vtk_array(np.asarray(points, dtype=np.float64)))


def state_of(data: vtkDataObject) -> object:
    """Return the modification times of a data object and its blocks."""
    if not isinstance(data, vtkMultiBlockDataSet):
        return data.GetMTime()
    blocks = [data.GetBlock(i) for i in range(data.GetNumberOfBlocks())]
    return data.GetMTime(), [None if block is None else state_of(block) for block in blocks]


def with_settings(made: Made, **settings: Any) -> Made:
    """Return a VTK object with settings, made in order; ParaView's VTK 9.2 has no keywords."""
    for name, value in settings.items():
        getattr(made, f"Set{name}")(value)
    return made


def output_of(algorithm: Any, **settings: Any) -> vtkPolyData:
    """Return the output of a VTK algorithm with settings."""
    with_settings(algorithm, **settings).Update()
    output: vtkPolyData = algorithm.GetOutput()
    return output


def shallow_copy(data: Data) -> Data:
    """Return a data object with shared arrays."""
    copy: Data = data.NewInstance()
    copy.ShallowCopy(data)
    return copy


def with_points(data: vtkPolyData, points: Floats) -> vtkPolyData:
    """Return a shallow copy with new points, without normals."""
    copy = with_settings(shallow_copy(data), Points=vtk_points(points))
    for attributes in (copy.GetPointData(), copy.GetCellData()):
        attributes.SetNormals(None)
    return copy


def surface_from(points: Floats, triangles: Ints) -> vtkPolyData:
    """Return a vtkPolyData of triangles."""
    cells = _cells(np.arange(0, 3 * len(triangles) + 1, 3), np.asarray(triangles).reshape(-1))
    return with_settings(vtkPolyData(), Points=vtk_points(points), Polys=cells)


@dataclass(frozen=True, eq=False)
class Polylines:
    """Polylines: line i is points[offsets[i] : offsets[i + 1]].

    Offsets (k + 1,) are the first point of each line, and n; ``data`` is the source, with its arrays,
    point arrays in the order of the points.
    """

    points: Floats
    offsets: Ints
    data: vtkPolyData | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def lengths(self) -> Floats:
        """Length of each line (k,)."""
        return polyline_lengths(self.points, self.offsets)

    def stacked(self, where: str, remedy: str) -> Floats:
        """Return the points (k, n, 3) of lines with equal numbers; ValueError at `where` for others."""
        counts = np.diff(self.offsets)
        if np.ptp(counts):
            problem = f"lines have {counts.min()} to {counts.max()} points, but must have equal numbers"
            raise InputError(where, problem, remedy)
        return self.points.reshape(len(self), int(counts[0]), 3)

    def line(self, i: int) -> Floats:
        """Return the points of line i, a view."""
        return self.points[self.offsets[i] : self.offsets[i + 1]]

    def moved(self, points: Floats, offsets: Ints | None = None) -> vtkPolyData:
        """Return lines with new points and the source's arrays. With new offsets, without point arrays."""
        data: Any = self.data
        result: vtkPolyData = with_settings(shallow_copy(data), Points=vtk_points(points))
        if offsets is not None:
            result.SetLines(_cells(offsets, np.arange(len(points))))
            result.GetPointData().Initialize()
        return result


def polylines_of(data: vtkPolyData, where: str) -> Polylines:
    """Return a data set's polylines without shared points."""
    lines = data.GetLines()
    if lines.GetNumberOfCells() == 0:
        raise InputError(where, "there are no polylines")
    if n_other := data.GetNumberOfCells() - lines.GetNumberOfCells():
        raise InputError(where, f"{n_other} cell(s) are not polylines", "keep the lines only")
    order = vtk_to_numpy(lines.GetConnectivityArray())
    points = points_of(data).take(order, axis=0)
    if not np.isfinite(points).all():
        raise InputError(where, "some points are not finite", "correct the points")
    offsets = np.array(vtk_to_numpy(lines.GetOffsetsArray()), dtype=np.int64)
    if not np.diff(offsets).all():
        raise InputError(where, "a polyline has no points", "remove the cell")
    if not np.array_equal(order, np.arange(data.GetNumberOfPoints())):
        source, data = data.GetPointData(), Polylines(points, offsets, data).moved(points, offsets)
        _copy_tuples(order, source, data.GetPointData())
    return Polylines(points, offsets, data)


def polylines_from(lines: Polylines) -> vtkPolyData:
    """Return polylines as a vtkPolyData."""
    cells = _cells(lines.offsets, np.arange(len(lines.points)))
    return with_settings(vtkPolyData(), Points=vtk_points(lines.points), Lines=cells)


def add_arrays(
    data: Data, *, points: Arrays | None = None, cells: Arrays | None = None, fields: Arrays | None = None
) -> Data:
    """Add copies of arrays by name. A field is an array, a number, a string or a list of strings."""
    for owner, arrays in (("Point", points), ("Cell", cells)):
        for name, values in (arrays or {}).items():
            getattr(data, f"Get{owner}Data")().AddArray(vtk_array(np.asarray(values), name))
    for name, values in (fields or {}).items():
        strings = [values] if isinstance(values, str) else values
        is_text = isinstance(strings, list)
        array = string_array(name, strings) if is_text else vtk_array(np.atleast_1d(values), name)
        data.GetFieldData().AddArray(array)
    return data


def string_array(name: str, values: Iterable[str]) -> vtkStringArray:
    """Return a named array of strings."""
    array = with_settings(vtkStringArray(), Name=name)
    for value in values:
        array.InsertNextValue(value)
    return array


def point_array(data: Any, name: str, where: str) -> NDArray[Any]:
    """Return a read-only point array; ValueError if missing."""
    return _existing(data.GetPointData(), "point", name, where)


def cell_array(data: Any, name: str, where: str) -> NDArray[Any]:
    """Return a read-only cell array; ValueError if missing."""
    return _existing(data.GetCellData(), "cell", name, where)


def field_array(data: Any, name: str) -> NDArray[Any] | None:
    """Return a numeric field array as a read-only view, None if missing."""
    array = data.GetFieldData().GetArray(name)
    return None if array is None else _view(array)


def field_string(data: Any, name: str) -> str | None:
    """Return the first value of a string field array, None if missing."""
    return next(iter(field_strings(data, name)), None)


def field_strings(data: Any, name: str) -> list[str]:
    """Return the values of a string field array, [] if missing."""
    array = data.GetFieldData().GetAbstractArray(name)
    if not isinstance(array, vtkStringArray):
        return []
    return [str(array.GetValue(i)) for i in range(array.GetNumberOfValues())]


def blocks_of(data: vtkMultiBlockDataSet) -> list[tuple[str, Any]]:
    """Return (name, data set) of each block; unnamed blocks are numbered."""
    blocks = []
    for i in range(data.GetNumberOfBlocks()):
        name = vtkMultiBlockDataSet.NAME().Get(data.GetMetaData(i)) if data.HasMetaData(i) else None
        blocks.append((str(i) if name is None else name, data.GetBlock(i)))
    return blocks


def multiblock_from(blocks: dict[str, Any]) -> vtkMultiBlockDataSet:
    """Return named blocks as a vtkMultiBlockDataSet."""
    data = vtkMultiBlockDataSet()
    for i, (name, block) in enumerate(blocks.items()):
        data.SetBlock(i, block)
        vtkMultiBlockDataSet.NAME().Set(data.GetMetaData(i), name)
    return data


#: Characters lost in array names of VTK's XML files, and their escapes.
_ESCAPES = {ord(character): f"%{ord(character):02X}" for character in "%<>&\"'"}


def array_of(kind: str, name: str) -> str:
    """Return the array name of a kind and a name."""
    return kind + name.translate(_ESCAPES)


def names_of(kind: str, attributes: Any) -> dict[str, str]:
    """Return the array names of a kind, "" for all, by plain name, see :func:`array_of`."""
    names = [str(attributes.GetArrayName(i)) for i in range(attributes.GetNumberOfArrays())]
    return {unquote(array.removeprefix(kind)): array for array in names if array.startswith(kind)}


def vtk_array(values: NDArray[Any], name: str | None = None, kind: int | None = None) -> Any:
    """Return a VTK array with a copy of values."""
    kind = get_vtk_array_type(values.dtype) if kind is None else kind
    width = values.shape[1] if values.ndim > 1 else 1
    sizes = {"NumberOfComponents": width, "NumberOfTuples": len(values)}
    array: Any = with_settings(vtkDataArray.CreateDataArray(kind), Name=name, **sizes)
    if values.size:
        # Not vtk_to_numpy, which takes ten times as long.
        np.frombuffer(array, get_numpy_array_type(kind))[...] = values.reshape(-1)
    return array


def _copy_tuples(ids: Ints, source: Any, target: Any) -> None:
    target.CopyAllOn()
    target.CopyAllocate(source, len(ids))
    for new, old in enumerate(ids.tolist()):
        target.CopyData(source, old, new)


def _existing(owner: Any, kind: str, name: str, where: str) -> NDArray[Any]:
    array = owner.GetArray(name)
    if array is None:
        remedy = "run FixedPointDetector on the muscle" if name == "FixedTo" else ""
        raise InputError(where, f"the {kind} array {name!r} is missing", remedy)
    return _view(array)


def _view(array: Any) -> NDArray[Any]:
    view: NDArray[Any] = vtk_to_numpy(array).view()
    view.setflags(write=False)
    return view


def _cells(offsets: NDArray[Any], connectivity: NDArray[Any]) -> vtkCellArray:
    cells = vtkCellArray()
    cells.SetData(*(vtk_array(ids, kind=VTK_ID_TYPE) for ids in (offsets, connectivity)))
    return cells
