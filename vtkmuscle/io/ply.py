"""Read .ply files; VTK's reader believes what a file says of its size, and may end the process."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

from vtkmuscle.core.errors import InputError

#: Numbers in a file, by their names.
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

#: A header is some lines; what has none within this is no .ply file [bytes].
_LONGEST_HEADER = 65536


@dataclass
class _Element:
    """What the header says of vertices, faces or something else."""

    name: str
    count: int
    #: Name, kind of number, and kind of the count before it where it is a list.
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)

    @property
    def is_plain(self) -> bool:
        return all(counted is None for _, _, counted in self.properties)


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
        reader = _Words(content[start:]) if order == "" else _Bytes(content[start:], order)
        rows = {element.name: _rows(reader, element) for element in elements}
        return _polydata(rows)
    except _FaultError as fault:
        raise InputError(path, f"the file cannot be read as .ply: {fault}", "export it again") from None


class _FaultError(Exception):
    """What is wrong with a file."""


def _header(content: bytes) -> tuple[str, list[_Element], int]:
    """Return the order of bytes (empty for text), the elements, and where they begin."""
    end = content.find(b"end_header", 0, _LONGEST_HEADER)
    stop = content.find(b"\n", end)
    if not content.startswith(b"ply") or end < 0 or stop < 0:
        raise _FaultError("it has no header that begins with 'ply' and ends with 'end_header'")
    order: str | None = None
    elements: list[_Element] = []
    for line in content[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) > 1 and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isascii() and words[2].isdigit():
            elements.append(_Element(words[1], int(words[2][:18])))
        elif words[0] == "property" and elements and len(words) == 3 and words[1] in _TYPES:
            elements[-1].properties.append((words[2], _TYPES[words[1]], None))
        elif words[:2] == ["property", "list"] and elements and len(words) == 5:
            if words[2] not in _TYPES or words[3] not in _TYPES:
                raise _FaultError(f"there is no such kind of number: {line!r:.80}")
            elements[-1].properties.append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
        else:
            raise _FaultError(f"its header has a line that means nothing: {line!r:.80}")
    if order is None:
        raise _FaultError("its header does not say 'format ascii' or 'format binary_...'")
    names = [element.name for element in elements]
    if len(set(names)) < len(names) or "vertex" not in names:
        raise _FaultError(f"its header must name vertices once, but names {', '.join(names) or 'nothing'}")
    return order, elements, stop + 1


class _Words:
    """Numbers as text."""

    def __init__(self, content: bytes) -> None:
        self._words = content.split()
        self._at = 0

    def left(self) -> int:
        return len(self._words) - self._at

    def least(self, element: _Element) -> int:
        """Return how many words a row takes at least."""
        return len(element.properties)

    def table(self, element: _Element) -> dict[str, NDArray[Any]]:
        width = len(element.properties)
        words = self._take(element.count * width)
        try:
            values = np.array(words, dtype="S").astype(np.float64).reshape(element.count, width)
        except ValueError as error:
            raise _FaultError(f"a {element.name} has something else than a number: {error}") from None
        return {name: values[:, k] for k, (name, _, _) in enumerate(element.properties)}

    def lists_alike(self, element: _Element) -> NDArray[Any] | None:
        """Return lists of as many numbers each as an array, None where they are not so."""
        start, first = self._at, self._words[self._at]
        width = 1 + int(first) if first.isdigit() and len(first) < 4 else 0
        if not width or element.count * width > self.left():
            return None
        try:
            rows = np.array(self._take(element.count * width), dtype="S").astype(np.int64)
        except (ValueError, OverflowError):
            rows = np.full(element.count * width, -1)
        rows = rows.reshape(element.count, width)
        if (rows[:, 0] == width - 1).all():
            return rows[:, 1:]
        self._at = start
        return None

    def numbers(self, kind: str, count: int) -> list[float]:
        words = self._take(count)
        try:
            return [int(word) for word in words] if kind[0] in "iu" else [float(word) for word in words]
        except ValueError as error:
            raise _FaultError(f"something else than a number: {error}") from None

    def _take(self, count: int) -> list[bytes]:
        if count > self.left():
            raise _FaultError("it ends too early")
        self._at += count
        return self._words[self._at - count : self._at]


class _Bytes:
    """Numbers as bytes."""

    def __init__(self, content: bytes, order: str) -> None:
        self._content, self._order = content, order
        self._at = 0

    def left(self) -> int:
        return len(self._content) - self._at

    def least(self, element: _Element) -> int:
        """Return how many bytes a row takes at least."""
        return sum(np.dtype(counted or kind).itemsize for _, kind, counted in element.properties)

    def table(self, element: _Element) -> dict[str, NDArray[Any]]:
        dtype = np.dtype([(f"{k}", self._order + kind) for k, (_, kind, _) in enumerate(element.properties)])
        rows = np.frombuffer(self._content, dtype, element.count, self._at)
        self._at += rows.nbytes
        return {name: rows[f"{k}"] for k, (name, _, _) in enumerate(element.properties)}

    def lists_alike(self, element: _Element) -> NDArray[Any] | None:
        """Return lists of as many numbers each as an array, None where they are not so."""
        _, kind, counted = element.properties[0]
        one = np.dtype(self._order + str(counted))
        first = int(np.frombuffer(self._content, one, 1, self._at)[0])
        if not 0 < first < 256:
            return None
        row = np.dtype([("count", one), ("numbers", self._order + kind, (first,))])
        if element.count * row.itemsize > self.left():
            return None
        rows = np.frombuffer(self._content, row, element.count, self._at)
        if not (rows["count"] == first).all():
            return None
        self._at += rows.nbytes
        found: NDArray[Any] = rows["numbers"]
        return found

    def numbers(self, kind: str, count: int) -> list[float]:
        dtype = np.dtype(self._order + kind)
        if count * dtype.itemsize > self.left():
            raise _FaultError("it ends too early")
        values: list[float] = np.frombuffer(self._content, dtype, count, self._at).tolist()
        self._at += count * dtype.itemsize
        return values


def _rows(reader: _Words | _Bytes, element: _Element) -> dict[str, Any]:
    """Return the values of an element's properties: an array each, or a list of lists."""
    least = reader.least(element)
    if element.count * max(least, 1) > reader.left():
        raise _FaultError(
            f"its header says {element.count} of {element.name!r}, but it is too short for these"
        )
    if element.is_plain:
        return dict(reader.table(element)) if element.properties else {}
    if len(element.properties) == 1 and element.count:
        alike = reader.lists_alike(element)
        if alike is not None:
            return {element.properties[0][0]: alike}
    values: dict[str, Any] = {name: [] for name, _, _ in element.properties}
    for number in range(element.count):
        for name, kind, counted in element.properties:
            count = 1 if counted is None else int(reader.numbers(counted, 1)[0])
            if count < 0 or count > reader.left():
                raise _FaultError(f"{element.name} {number} has a list of {count} numbers")
            numbers = reader.numbers(kind, count)
            values[name].append(numbers if counted else numbers[0])
    return values


def _polydata(rows: dict[str, dict[str, Any]]) -> vtkPolyData:
    vertices = rows["vertex"]
    if not {"x", "y", "z"} <= vertices.keys():
        raise _FaultError("its vertices have no x, y and z")
    if not all(isinstance(vertices[name], np.ndarray) for name in "xyz"):
        vertices = {name: np.array(values, dtype=np.float64) for name, values in _plain(vertices)}
    points = np.column_stack([vertices[name] for name in "xyz"]).astype(np.float64)
    data, positions = vtkPolyData(), vtkPoints()
    positions.SetData(numpy_to_vtk(points, deep=True))
    data.SetPoints(positions)
    for name, values in vertices.items():
        if name not in ("x", "y", "z"):
            array = numpy_to_vtk(
                np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("=")), deep=True
            )
            array.SetName(name)
            data.GetPointData().AddArray(array)
    faces = rows.get("face", {})
    listed = faces.get("vertex_indices", faces.get("vertex_index"))
    if faces and listed is None:
        raise _FaultError("its faces have no list 'vertex_indices'")
    if listed is not None and len(listed):
        data.SetPolys(_cells(listed, len(points)))
    return data


def _plain(columns: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Give the columns that are no lists of lists."""
    for name, values in columns.items():
        if isinstance(values, np.ndarray) or not values or not isinstance(values[0], list):
            yield name, values


def _cells(faces: Any, n_points: int) -> vtkCellArray:
    """Return the cells of faces: an array of as many corners each, or a list of lists."""
    try:
        if isinstance(faces, np.ndarray):
            sizes = np.full(len(faces), faces.shape[1], dtype=np.int64)
            connectivity = faces.astype(np.int64).reshape(-1)
        else:
            sizes = np.array([len(face) for face in faces], dtype=np.int64)
            connectivity = np.array([int(point) for face in faces for point in face], dtype=np.int64)
    except (ValueError, OverflowError):
        raise _FaultError("a face names a vertex by something else than a whole number") from None
    if sizes.min() < 3:
        number = int(sizes.argmin())
        raise _FaultError(f"face {number} has {sizes[number]} corners")
    if connectivity.min() < 0 or connectivity.max() >= n_points:
        worst = connectivity.max() if connectivity.max() >= n_points else connectivity.min()
        raise _FaultError(f"a face names vertex {worst}, but there are {n_points}")
    cells = vtkCellArray()
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    cells.SetData(*(numpy_to_vtkIdTypeArray(ids, deep=True) for ids in (offsets, connectivity)))
    return cells
