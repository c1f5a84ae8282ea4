"""Read .ply files; VTK's reader believes a file's sizes, and takes what is no number for one."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import vtk_points

#: Numbers in a file, by their names.
_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float": "f4",
    "double": "f8",
    "float32": "f4",
    "float64": "f8",
}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}

#: A header is some lines; what has none within this is no .ply file [bytes].
_LONGEST_HEADER = 65536


@dataclass
class _Element:
    """What the header says of vertices, faces or something else."""

    name: str
    count: int
    #: Name, kind of number, and kind of the count before it where it is a list.
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)


def read_ply(path: Path) -> vtkPolyData:
    """Read the vertices and faces of a .ply file, ASCII or binary.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    vtkPolyData
        Points in double precision, polygons, and the other properties of vertices as point arrays.

    Raises
    ------
    ValueError
        If the file holds less than its header says, a face names a vertex that there is not, or it is no
        .ply file; says what is wrong.
    """
    content = path.read_bytes()
    try:
        order, elements, start = _header(content)
        if order == "=":  # words become numbers of one kind, and are read as such
            content, start = np.array([float(word) for word in content[start:].split()]).tobytes(), 0
        values = {}
        for element in elements:
            values[element.name], start = _values(element, content, start, order)
        return _polydata(values)
    except (ValueError, OverflowError) as error:
        raise InputError(path, f"the file cannot be read as .ply: {error}", "export it again") from None


def _header(content: bytes) -> tuple[str, list[_Element], int]:
    """Return the order of bytes, the elements, and where they begin."""
    end = content.find(b"end_header", 0, _LONGEST_HEADER)
    stop = content.find(b"\n", end)
    if not content.startswith(b"ply") or end < 0 or stop < 0:
        raise ValueError("it has no header that begins with 'ply' and ends with 'end_header'")
    order = ""
    elements: list[_Element] = []
    for line in content[:end].decode("latin-1").splitlines()[1:]:
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", word, *_] if word in _ORDERS:
                order = _ORDERS[word]
            case ["element", name, count] if count.isascii() and count.isdigit():
                elements.append(_Element(name, int(count[:18])))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append((name, _TYPES[kind], None))
            case ["property", "list", counted, kind, name] if elements and {counted, kind} <= _TYPES.keys():
                elements[-1].properties.append((name, _TYPES[kind], _TYPES[counted]))
            case _:
                raise ValueError(f"its header has a line that means nothing: {line!r:.80}")
    if not order:
        raise ValueError("its header does not say 'format ascii' or 'format binary_...'")
    if order == "=":
        for element in elements:
            element.properties = [(name, "f8", counted and "f8") for name, _, counted in element.properties]
    names = [element.name for element in elements]
    if len(set(names)) < len(names) or "vertex" not in names:
        raise ValueError(f"its header must name vertices once, but names {', '.join(names) or 'nothing'}")
    return order, elements, stop + 1


def _values(element: _Element, content: bytes, start: int, order: str) -> tuple[dict[str, Any], int]:
    """Return an element's properties, an array or a list of arrays each, and where the next one begins."""
    least = sum(np.dtype(counted or kind).itemsize for _, kind, counted in element.properties)
    if element.count * max(least, 1) > len(content) - start:
        raise ValueError(
            f"its header says {element.count} of {element.name!r}, but it is too short for these"
        )
    if not element.count or not element.properties:
        return {name: [] for name, _, _ in element.properties}, start
    # Nearly always all rows are laid out as the first one.
    row, end = _row(element, content, start, order)
    rows = np.frombuffer(content, row, min(element.count, (len(content) - start) // row.itemsize), start)
    lists = [name for name, _, counted in element.properties if counted]
    if len(rows) == element.count and all(
        (rows[f"n {name}"] == rows[f"n {name}"][0]).all() for name in lists
    ):
        return {name: rows[name] for name, _, _ in element.properties}, start + rows.nbytes
    values: dict[str, Any] = {name: [] for name, _, _ in element.properties}
    for _ in range(element.count):
        row, end = _row(element, content, start, order)
        one = np.frombuffer(content, row, 1, start)[0]
        for name, column in values.items():
            column.append(one[name])
        start = end
    return values, start


def _row(element: _Element, content: bytes, start: int, order: str) -> tuple[np.dtype[Any], int]:
    """Return the layout of the row of an element that begins at a byte, and where it ends."""
    layout: list[tuple[Any, ...]] = []
    end = start
    for name, kind, counted in element.properties:
        size = 1
        if counted:
            if end + np.dtype(counted).itemsize > len(content):
                raise ValueError("it ends too early")
            layout.append((f"n {name}", order + counted))
            number = np.frombuffer(content, order + counted, 1, end)[0]
            size, end = int(number), end + number.nbytes
            if not 0 <= size <= len(content) or size != number:
                raise ValueError(f"a {element.name} has a list of {number:g} numbers")
        layout.append((name, order + kind, (size,)) if counted else (name, order + kind))
        end += size * np.dtype(kind).itemsize
    if end > len(content):
        raise ValueError("it ends too early")
    return np.dtype(layout), end


def _polydata(values: dict[str, dict[str, Any]]) -> vtkPolyData:
    vertices = {name: np.array(rows) for name, rows in values["vertex"].items() if np.ndim(rows) == 1}
    if not {"x", "y", "z"} <= vertices.keys():
        raise ValueError("its vertices have no x, y and z")
    data = vtkPolyData()
    data.SetPoints(vtk_points(np.column_stack([vertices.pop(name) for name in "xyz"])))
    for name, column in vertices.items():
        array = numpy_to_vtk(column.astype(column.dtype.newbyteorder("=")), deep=True)
        array.SetName(name)
        data.GetPointData().AddArray(array)
    faces = values.get("face", {})
    listed = faces.get("vertex_indices", faces.get("vertex_index"))
    if faces and listed is None:
        raise ValueError("its faces have no list 'vertex_indices'")
    if listed is not None and len(listed):
        data.SetPolys(_cells(listed, data.GetNumberOfPoints()))
    return data


def _cells(faces: Any, n_points: int) -> vtkCellArray:
    """Return the cells of faces: an array of as many corners each, or a list of arrays."""
    if isinstance(faces, np.ndarray):
        sizes, given = np.full(len(faces), faces.shape[1]), faces.reshape(-1)
    else:
        sizes, given = np.array([len(face) for face in faces]), np.concatenate(faces)
    if sizes.min() < 3:
        raise ValueError(f"face {sizes.argmin()} has {sizes.min()} corners")
    with np.errstate(invalid="ignore"):
        connectivity = given.astype(np.int64)
    if (given != connectivity).any():
        raise ValueError("a face names a vertex by something else than a whole number")
    if connectivity.min() < 0 or connectivity.max() >= n_points:
        worst = connectivity.max() if connectivity.max() >= n_points else connectivity.min()
        raise ValueError(f"a face names vertex {worst}, but there are {n_points}")
    cells = vtkCellArray()
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    cells.SetData(*(numpy_to_vtkIdTypeArray(ids, deep=True) for ids in (offsets, connectivity)))
    return cells
