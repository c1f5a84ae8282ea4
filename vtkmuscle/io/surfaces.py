"""Read surfaces and polylines through VTK's readers, with one clear error instead of VTK's noise."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.files import check_is_file
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io.in_child import read_in_child
from vtkmuscle.io.ply import read_ply
from vtkmuscle.io.vtp_check import check_vtp

#: Modules and classes of VTK's readers; .ply files are read by :mod:`vtkmuscle.io.ply`.
_READERS = {
    ".vtp": ("vtkmodules.vtkIOXML", "vtkXMLPolyDataReader"),
    ".vtk": ("vtkmodules.vtkIOLegacy", "vtkGenericDataObjectReader"),
    ".stl": ("vtkmodules.vtkIOGeometry", "vtkSTLReader"),
    ".obj": ("vtkmodules.vtkIOGeometry", "vtkOBJReader"),
}

#: Suffixes of the files that :func:`read_surface` reads.
SURFACE_SUFFIXES = (*_READERS, ".ply")


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
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read as its suffix says, has no points, or its cells name points that it
        does not have.
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
    if suffix == ".vtp":
        check_vtp(path)
    data = read_ply(path) if suffix == ".ply" else read_in_child(path, *_READERS[suffix])
    if data.GetNumberOfPoints() == 0:
        raise InputError(path, "the file holds no points", "export it again")
    _check_point_ids(data, path)
    if data.GetNumberOfStrips():
        data = _without_strips(data)
    result: vtkPolyData = with_points(data, points_of(data))
    return result


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
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read, or holds no polygon.
    """
    data = read_polydata(path)
    if data.GetNumberOfPolys() == 0:
        raise InputError(
            Path(path), "the file holds no triangles", "export the muscle or bone as a surface mesh"
        )
    if data.GetNumberOfPolys() == data.GetNumberOfCells():
        return data
    surface = vtkPolyData()
    surface.SetPoints(data.GetPoints())
    surface.SetPolys(data.GetPolys())
    surface.GetPointData().ShallowCopy(data.GetPointData())
    surface.GetFieldData().ShallowCopy(data.GetFieldData())
    return surface


def _check_point_ids(data: vtkPolyData, path: Path) -> None:
    for cells in (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()):
        ids = vtk_to_numpy(cells.GetConnectivityArray())
        if len(ids) and (ids.min() < 0 or ids.max() >= data.GetNumberOfPoints()):
            raise InputError(
                path,
                f"a cell names point {(ids.max() if ids.min() >= 0 else ids.min())}, but there are "
                f"{data.GetNumberOfPoints()} points",
                "the file is damaged, export it again",
            )


def _without_strips(data: vtkPolyData) -> vtkPolyData:
    splitter = vtkTriangleFilter()
    splitter.SetInputData(data)
    splitter.Update()
    result: vtkPolyData = splitter.GetOutput()
    return result
