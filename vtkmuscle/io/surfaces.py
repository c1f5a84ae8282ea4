"""Read surfaces and polylines through VTK's readers, with clear errors."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io.in_child import read_in_child

#: Modules and classes of VTK's readers.
_READERS = {
    ".vtp": ("vtkmodules.vtkIOXML", "vtkXMLPolyDataReader"),
    ".vtk": ("vtkmodules.vtkIOLegacy", "vtkGenericDataObjectReader"),
    ".stl": ("vtkmodules.vtkIOGeometry", "vtkSTLReader"),
    ".obj": ("vtkmodules.vtkIOGeometry", "vtkOBJReader"),
    ".ply": ("vtkmodules.vtkIOPLY", "vtkPLYReader"),
}

#: Remedy for a damaged file.
_DAMAGED = "the file is damaged, export it again"

#: Suffixes of files for :func:`read_surface`.
SURFACE_SUFFIXES = tuple(_READERS)


def read_polydata(path: str | PathLike[str]) -> vtkPolyData:
    """Read points with triangles, polylines and arrays.

    Parameters
    ----------
    path : path
        A .vtp, .vtk (legacy), .stl, .obj or .ply file.

    Returns
    -------
    vtkPolyData
        With points in double precision; triangle strips are split into triangles.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read in the format of its suffix, has no points, or has
        cells with missing points.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SURFACE_SUFFIXES:
        problem = f"the suffix {path.suffix!r} is not one of {', '.join(SURFACE_SUFFIXES)}"
        remedy = "convert the file, e.g. with ParaView or pyvista.read(...).save(...)"
        raise InputError(path, problem, remedy)
    check_is_file(path)
    data = read_in_child(path, *_READERS[suffix])
    if data.GetNumberOfPoints() == 0:
        raise InputError(path, "the file holds no points", "export it again")
    _check_cells(data, path)
    if suffix == ".ply":
        _check_words(data, path)
    if data.GetNumberOfStrips():
        splitter = vtkTriangleFilter()
        splitter.SetInputData(data)
        splitter.Update()
        data = splitter.GetOutput()
    result: vtkPolyData = with_points(data, points_of(data))
    return result


def read_own_polydata(path: Path) -> vtkPolyData:
    """Read a complete .vtp of :func:`vtkmuscle.io.writing.write_polydata`, unchecked.

    Reading in this process takes a tenth of the time of :func:`read_polydata`.
    """
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    data: vtkPolyData = reader.GetOutput()
    return data


def read_surface(path: str | PathLike[str]) -> vtkPolyData:
    """Read a surface: polygons, point and field arrays.

    Loose points and lines are omitted.

    Parameters
    ----------
    path : path
        As in :func:`read_polydata`.

    Returns
    -------
    vtkPolyData
        Points in double precision and polygons, not necessarily triangles.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read, or has no polygons.
    """
    data = read_polydata(path)
    if data.GetNumberOfPolys() == 0:
        remedy = "export the muscle or bone as a surface mesh"
        raise InputError(Path(path), "the file holds no triangles", remedy)
    if data.GetNumberOfPolys() == data.GetNumberOfCells():
        return data
    surface = vtkPolyData()
    surface.SetPoints(data.GetPoints())
    surface.SetPolys(data.GetPolys())
    surface.GetPointData().ShallowCopy(data.GetPointData())
    surface.GetFieldData().ShallowCopy(data.GetFieldData())
    return surface


def _check_cells(data: vtkPolyData, path: Path) -> None:
    """Raise an InputError for a cell without a point, or a polygon with fewer than 3 corners."""
    for cells in (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()):
        ids = vtk_to_numpy(cells.GetConnectivityArray())
        if len(ids) and (ids.min() < 0 or ids.max() >= data.GetNumberOfPoints()):
            wrong = ids.max() if ids.min() >= 0 else ids.min()
            problem = f"a cell names point {wrong}, but there are {data.GetNumberOfPoints()} points"
            raise InputError(path, problem, _DAMAGED)
    sizes = np.diff(vtk_to_numpy(data.GetPolys().GetOffsetsArray()))
    if len(sizes) and sizes.min() < 3:
        raise InputError(path, f"polygon {sizes.argmin()} has {sizes.min()} corners", _DAMAGED)


def _check_words(data: vtkPolyData, path: Path) -> None:
    """Raise an InputError for missing numbers in a text .ply file, which VTK replaces by others."""
    head, _, body = path.read_bytes().partition(b"end_header")
    if b"format ascii" not in head:
        return
    faces = data.GetPolys()
    needed = 3 * data.GetNumberOfPoints() + faces.GetNumberOfConnectivityIds() + faces.GetNumberOfCells()
    try:
        count = np.isfinite(np.array(body.split(), dtype=np.float64)).sum()
    except ValueError:
        raise InputError(path, "the file has a word in place of a number", _DAMAGED) from None
    if count < needed:
        raise InputError(path, f"the header requires {needed} numbers, but the file has {count}", _DAMAGED)
