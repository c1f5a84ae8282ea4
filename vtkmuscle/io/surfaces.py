"""Read surfaces and polylines through VTK's readers, with one clear error instead of VTK's noise."""

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

#: The remedy for a damaged file.
_DAMAGED = "the file is damaged, export it again"

#: Suffixes of the files that :func:`read_surface` reads.
SURFACE_SUFFIXES = tuple(_READERS)


def read_polydata(path: str | PathLike[str]) -> vtkPolyData:
    """Read points with their triangles, polylines and arrays.

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
        If there is no such file, it cannot be read as its suffix says, has no points, or its cells name
        points that it does not have.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SURFACE_SUFFIXES:
        raise InputError(
            path,
            f"the suffix {path.suffix!r} is not one of {', '.join(SURFACE_SUFFIXES)}",
            "convert the file, e.g. with ParaView or pyvista.read(...).save(...)",
        )
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
    """Read a .vtp that :func:`vtkmuscle.io.writing.write_polydata` has written and that is known to be whole.

    It is read in this process and not checked, which takes a tenth of the time of :func:`read_polydata`.
    """
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    data: vtkPolyData = reader.GetOutput()
    return data


def read_surface(path: str | PathLike[str]) -> vtkPolyData:
    """Read a surface: its polygons, point and field arrays; loose points and lines are left out.

    Parameters
    ----------
    path : path
        As of :func:`read_polydata`.

    Returns
    -------
    vtkPolyData
        Points in double precision and polygons, not necessarily triangles.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, it cannot be read, or holds no polygon.
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
    """Raise an InputError where a cell names a missing point, or a polygon has fewer than three corners."""
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
    """Raise an InputError for a .ply file of text with fewer numbers than it says, or a word among them.

    VTK replaces what is missing by zeros, or by what it has read last.
    """
    head, _, body = path.read_bytes().partition(b"end_header")
    if b"format ascii" not in head:
        return
    faces = data.GetPolys()
    needed = 3 * data.GetNumberOfPoints() + faces.GetNumberOfConnectivityIds() + faces.GetNumberOfCells()
    try:
        held = np.isfinite(np.array(body.split(), dtype=np.float64)).sum()
    except ValueError:
        raise InputError(path, "the file has a word where a number belongs", _DAMAGED) from None
    if held < needed:
        raise InputError(path, f"the file says that it has {needed} numbers, but has {held}", _DAMAGED)
