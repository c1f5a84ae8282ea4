"""Read surfaces and polylines through VTK's readers, with clear errors; series of them over time (.pvd)."""

import re
import warnings
from collections.abc import Mapping
from html import escape  # that of xml.sax would load an HTTP client
from os import PathLike
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.data import arrays, toml_table
from vtkmuscle.data.arrays import joined_triangles, output_of, points_of, with_points
from vtkmuscle.io.in_child import read_in_child, vtk_messages
from vtkmuscle.io.writing import insert_before, write_polydata, write_text
from vtkmuscle.io.xml_elements import read_xml

#: Readers of surfaces, and words in landmark files.
FORMATS = toml_table("vtkmuscle.io", "formats.toml")

#: Remedy for a damaged file.
_DAMAGED = "the file is damaged, export it again"

#: Suffixes of files for :func:`read_surface`.
SURFACE_SUFFIXES = tuple(FORMATS["readers"])


def read_polydata(path: str | PathLike[str]) -> vtkPolyData:
    """Read points in double precision with triangles, polylines and arrays.

    Parameters
    ----------
    path : path
        A .vtp, .vtk (legacy), .vtu, .stl, .obj, .ply, .off, .glb or .gltf file. Volume meshes are read as
        their outer surface.

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
        raise InputError(path, problem, FORMATS["remedies"].get(suffix, FORMATS["remedies"]["other"]))
    check_is_file(path)
    data = read_in_child(path, *FORMATS["readers"][suffix])
    if data.GetNumberOfPoints() == 0:
        raise InputError(path, "the file holds no points", "export it again")
    _check_cells(data, path)
    if suffix == ".ply":
        _check_words(data, path)
    return with_points(data, points_of(data))


def read_own_polydata(path: Path) -> vtkPolyData:
    """Read a complete .vtp of ``write_polydata`` unchecked: a tenth of the time of :func:`read_polydata`."""
    return output_of(vtkXMLPolyDataReader(), FileName=str(path))


def read_surface(path: str | PathLike[str]) -> vtkPolyData:
    """Read a surface: triangles, point and field arrays.

    Loose lines are omitted. A warning reports split polygons and joined points.

    Parameters
    ----------
    path : path
        As in :func:`read_polydata`.

    Returns
    -------
    vtkPolyData
        Points in double precision and triangles; equal points are joined where open edges close, as between
        the corners of flat normals.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read, or has no polygons.
    """
    data = read_polydata(path)
    if data.GetNumberOfPolys() + data.GetNumberOfStrips() == 0:
        remedy = "export the muscle or bone as a surface mesh"
        raise InputError(str(path), "the file holds no triangles", remedy)
    if data.GetNumberOfVerts() + data.GetNumberOfLines():
        data = arrays.shallow_copy(data)
        arrays.with_settings(data, Verts=vtkCellArray(), Lines=vtkCellArray())
        data.GetCellData().Initialize()
    with vtk_messages():
        result, changes = joined_triangles(data)
    if changes:
        warnings.warn(f"{path}: {'; '.join(changes)}", stacklevel=2)
    return result


def stated_frame(path: Path) -> str | None:
    """Return the frame in a mesh's header, ``"LPS"`` or ``"RAS"`` as 3D Slicer writes, or None."""
    with path.open("rb") as file:
        match = re.search(rb"SPACE=(LPS|RAS)", file.read(1000))
    return match[1].decode() if match else None


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


#: Begin and end of a ParaView collection.
_COLLECTION = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">
  <Collection>
"""
_COLLECTION_END = "  </Collection>\n</VTKFile>\n"


class Series:
    """Data over time: a ParaView collection ``NAME.pvd`` of files ``NAME/NAME_0000.vtp``.

    The collection is complete after each step; the first step replaces an existing file.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.name, self.path = name, folder / f"{name}.pvd"
        self._begun = False

    def add(self, frame: int, time: float, data: vtkPolyData) -> Path:
        """Write and list the data of a frame; return the file."""
        path = self.path.with_suffix("") / f"{self.name}_{frame:04d}.vtp"
        write_polydata(path, data)
        self.add_parts(time, {self.name: path})
        return path

    def add_parts(self, time: float, parts: Mapping[str, Path]) -> None:
        """List existing files of a time step by name, in or below the folder of the .pvd."""
        entries = ""
        for number, (name, file) in enumerate(parts.items()):
            relative = file.relative_to(self.path.parent).as_posix()
            names = f'part="{number}" name="{escape(name)}" file="{escape(relative)}"'
            entries += f'    <DataSet timestep="{float(time)!r}" {names}/>\n'
        if self._begun:
            insert_before(self.path, entries, _COLLECTION_END)
        else:
            write_text(self.path, f"{_COLLECTION}{entries}{_COLLECTION_END}")
        self._begun = True


def steps_in(collection: Path) -> int:
    """Return the number of time steps in a ParaView collection."""
    entries = read_xml(collection).need("Collection").children
    return len({entry.attributes.get("timestep") for entry in entries})
