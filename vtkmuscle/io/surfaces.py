"""Read surfaces and polylines through VTK's readers, with one clear error instead of VTK's noise."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.files import check_is_file
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io.in_child import read_in_child
from vtkmuscle.io.ply import read_ply

_CELLS = ("Verts", "Lines", "Strips", "Polys")

#: No data shrinks to less than this part by zlib (its format does not allow it); others are as good.
_MOST_SHRUNK = 1100


def check_vtp(path: Path) -> None:
    """Check that every array of a .vtp file is as long as the file says.

    What is in the arrays is for VTK's reader, in a process of its own.

    Raises
    ------
    ValueError
        If one is not, or the file is no XML file of poly data; says what is wrong.
    """
    try:
        _check(path.read_bytes())
    except (ElementTree.ParseError, ValueError, LookupError, TypeError) as error:
        raise InputError(
            path,
            f"the file cannot be read as .vtp: {error}",
            "export it again, and check that its suffix says what it is",
        ) from None


def _check(content: bytes) -> None:
    at = content.find(b"<AppendedData")
    head = content if at < 0 else content[:at] + b"</VTKFile>"
    if b"<!DOCTYPE" in head:
        raise ValueError("it declares entities, which no VTK file does")
    root = ElementTree.fromstring(head)
    if root.tag != "VTKFile" or root.get("type") != "PolyData":
        raise ValueError(f"it holds {root.get('type') or root.tag!r}, not PolyData")
    start = content.find(b"_", content.find(b">", at)) + 1 if at >= 0 else 0
    arrays = _Arrays(root, memoryview(content)[start:], b'"raw"' in content[max(at, 0) : start])
    for piece in root.iter("Piece"):
        counts = {kind: _count(piece, f"NumberOf{kind}", 0) for kind in ("Points", *_CELLS)}
        counts |= {"PointData": counts["Points"], "CellData": sum(counts[kind] for kind in _CELLS)}
        for group in piece:
            for array in group:
                if group.tag not in _CELLS or array.get("Name") == "offsets":
                    arrays.check(array, counts[group.tag])
    for group in root.iter("FieldData"):
        for array in group:
            arrays.check(array, _count(array, "NumberOfTuples", 1))


def _count(element: ElementTree.Element, name: str, default: int) -> int:
    text = element.get(name, str(default)).strip()
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise ValueError(f"{name} is {text!r:.40}")
    return int(text)


@dataclass
class _Arrays:
    """Where the arrays of a file are."""

    root: ElementTree.Element
    appended: memoryview
    is_raw: bool

    def check(self, array: ElementTree.Element, tuples: int) -> None:
        """Check the length of an array of numbers; a text has a byte or more."""
        needed = tuples * _count(array, "NumberOfComponents", 1)
        kind = array.get("type", "")
        bits = int("".join(filter(str.isdigit, kind)) or 8)
        if array.get("format") == "ascii":
            held = len((array.text or "").split()) * bits // 8
        else:
            held = self._bytes_of(array)
        if held < needed if kind in ("String", "Bit") else 8 * held != needed * bits:
            raise ValueError(f"the array {array.get('Name')!r} is not of {needed} values, as the file says")

    def _bytes_of(self, array: ElementTree.Element) -> int:
        """Return how many bytes an array has when it is unpacked."""
        order = "<" if self.root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        number = np.dtype(order + ("u8" if self.root.get("header_type") == "UInt64" else "u4"))
        stream, raw = memoryview((array.text or "").strip().encode()), False
        if array.get("format") == "appended":
            stream, raw = self.appended[_count(array, "offset", 0) :], self.is_raw
        head = bytes(stream[: 3 * number.itemsize]) if raw else base64.b64decode(stream[:32])
        if self.root.get("compressor") is None:
            held, most = int(np.frombuffer(head, number, 1)[0]), len(stream)
        else:
            blocks, length, last = (int(n) for n in np.frombuffer(head, number, 3))
            held, most = blocks * length - (length - last if last else 0), _MOST_SHRUNK * len(stream)
        if held > most:
            raise ValueError(f"the array {array.get('Name')!r} is cut short")
        return held


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
