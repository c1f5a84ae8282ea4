"""What a .vtp file says of its sizes, compared with what it holds, before VTK's reader believes it."""

from __future__ import annotations

import base64
import binascii
import lzma
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOCore import vtkLZ4DataCompressor

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.messages import vtk_messages

_TYPES = {
    "Int8": "i1",
    "UInt8": "u1",
    "Int16": "i2",
    "UInt16": "u2",
    "Int32": "i4",
    "UInt32": "u4",
    "Int64": "i8",
    "UInt64": "u8",
    "Float32": "f4",
    "Float64": "f8",
}
_CELLS = {
    "Verts": "NumberOfVerts",
    "Lines": "NumberOfLines",
    "Strips": "NumberOfStrips",
    "Polys": "NumberOfPolys",
}

#: No data shrinks to less than this part by zlib (its format does not allow it); others are as good.
_MOST_SHRUNK = 1100

_Bytes = bytes | memoryview


class _FaultError(Exception):
    """What is wrong with a file."""


def check_vtp(path: Path) -> None:
    """Check that a .vtp file is whole: every array is as long as it must be, and cells name points there are.

    Raises
    ------
    ValueError
        If it is not; says what is wrong.
    """
    try:
        _check(path.read_bytes())
    except _FaultError as fault:
        raise InputError(
            path,
            f"the file cannot be read as .vtp: {fault}",
            "export it again, and check that its suffix says what it is",
        ) from None


def _check(content: bytes) -> None:
    at = content.find(b"<AppendedData")
    head = content if at < 0 else content[:at] + b"</VTKFile>"
    if b"<!DOCTYPE" in head or b"<!ENTITY" in head:
        raise _FaultError("it declares entities, which no VTK file does")
    try:
        root = ElementTree.fromstring(head)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise _FaultError(f"it is no XML file: {error}") from None
    if root.tag != "VTKFile" or root.get("type") != "PolyData":
        raise _FaultError(f"it holds {root.get('type') or root.tag!r}, not PolyData")
    if root.get("compressor") not in (None, *_UNPACKERS):
        raise _FaultError(f"it is compressed by {root.get('compressor')!r}, which no VTK file is")
    file = _File(content, root, at)
    for piece in root.iter("Piece"):
        _check_piece(piece, file)
    for parent in root.iter("FieldData"):
        for array in (*parent.iter("DataArray"), *parent.iter("Array")):
            values = _count(array, "NumberOfTuples", 1) * _count(array, "NumberOfComponents", 1)
            least = values * _width(array) // (8 if array.get("type") == "Bit" else 1)
            if file.size(array) < least:
                name = array.get("Name", "without a name")
                raise _FaultError(f"the array {name!r} says that it has {values} values, but holds fewer")


def _check_piece(piece: ElementTree.Element, file: _File) -> None:
    n_points = _count(piece, "NumberOfPoints")
    n_cells = sum(_count(piece, name) for name in _CELLS.values())
    for parent, count in (("PointData", n_points), ("CellData", n_cells), ("Points", n_points)):
        for array in _arrays(piece, parent):
            components = 3 if parent == "Points" else _count(array, "NumberOfComponents", 1)
            _check_length(array, file, count * components)
    if n_points and not _arrays(piece, "Points"):
        raise _FaultError(f"it says that it has {n_points} points, but holds none")
    for kind, number in _CELLS.items():
        count = _count(piece, number)
        arrays = {array.get("Name"): array for array in _arrays(piece, kind)}
        if not count:
            continue
        if not {"connectivity", "offsets"} <= arrays.keys():
            raise _FaultError(f"its {kind} have no connectivity or no offsets")
        _check_length(arrays["offsets"], file, count)
        offsets, points = (file.values(arrays[name]).astype(np.int64) for name in ("offsets", "connectivity"))
        if (np.diff(offsets) < 0).any() or offsets[0] < 0 or offsets[-1] > len(points):
            raise _FaultError(f"the offsets of its {kind} lead beyond their points")
        if len(points) and (points.min() < 0 or points.max() >= n_points):
            worst = points.max() if points.min() >= 0 else points.min()
            raise _FaultError(f"a cell names point {worst}, but there are {n_points} points")


def _arrays(piece: ElementTree.Element, kind: str) -> list[ElementTree.Element]:
    return [array for parent in piece.findall(kind) for array in parent.findall("DataArray")]


def _count(element: ElementTree.Element, name: str, default: int = 0) -> int:
    text = element.get(name, str(default)).strip()
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise _FaultError(f"{name} is {text!r:.40}")
    return int(text)


def _check_length(array: ElementTree.Element, file: _File, values: int) -> None:
    if array.get("type") not in _TYPES:
        return  # texts and bits: VTK's own checks
    found = file.size(array) / np.dtype(_TYPES[str(array.get("type"))]).itemsize
    if found != values:
        name = array.get("Name", "without a name")
        raise _FaultError(f"the array {name!r} holds {found:g} values, where there must be {values}")


@dataclass
class _File:
    """Where the values of a file are."""

    content: bytes
    root: ElementTree.Element
    at: int

    def __post_init__(self) -> None:
        order = "<" if self.root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        self._header = np.dtype(order + ("u8" if self.root.get("header_type") == "UInt64" else "u4"))
        self._order = order
        self._unpack = _UNPACKERS.get(self.root.get("compressor", ""))
        self._appended, self._is_raw = memoryview(b""), False
        if self.at >= 0:
            close = self.content.find(b">", self.at)
            tag = self.content[self.at : close]
            start = self.content.find(b"_", close) + 1
            if close < 0 or start <= 0:
                raise _FaultError("it ends before its data")
            self._is_raw = b"raw" in tag
            end = len(self.content) if self._is_raw else self.content.find(b"<", start)
            self._appended = memoryview(self.content)[start : end if end >= 0 else len(self.content)]

    def size(self, array: ElementTree.Element) -> int:
        """Return the number of bytes that an array has when it is unpacked."""
        if array.get("format") == "ascii":
            return len((array.text or "").split()) * _width(array)
        sizes, _ = self._blocks(array)
        return sum(unpacked for unpacked, _ in sizes)

    def values(self, array: ElementTree.Element) -> NDArray[Any]:
        """Return the values of an array."""
        kind = np.dtype(self._order + _TYPES.get(str(array.get("type")), "u1"))
        try:
            if array.get("format") == "ascii":
                return np.array((array.text or "").split(), dtype=kind.newbyteorder("="))
            sizes, packed = self._blocks(array)
            content = b"".join(self._unpacked(sizes, packed))
            return np.frombuffer(content, kind)
        except (ValueError, OverflowError) as error:
            raise _FaultError(f"the array {array.get('Name')!r} cannot be read: {error}") from None

    def _unpacked(self, sizes: list[tuple[int, int]], packed: _Bytes) -> Iterator[_Bytes]:
        at = 0
        for unpacked, length in sizes:
            block = packed[at : at + length]
            at += length
            if self._unpack is not None:
                try:
                    block = self._unpack(block, unpacked)
                except (zlib.error, lzma.LZMAError, ValueError) as error:
                    raise _FaultError(f"its data are damaged: {error}") from None
            if len(block) != unpacked:
                raise _FaultError("its data are damaged")
            yield block

    def _blocks(self, array: ElementTree.Element) -> tuple[list[tuple[int, int]], _Bytes]:
        """Return the sizes of an array's blocks, unpacked and as they are, and the bytes of these."""
        raw = self._is_raw
        if array.get("format") == "appended":
            offset = _count(array, "offset")
            if offset >= len(self._appended):
                raise _FaultError(f"the array {array.get('Name')!r} begins behind the end of the file")
            stream = self._appended[offset:]
        else:
            stream, raw = memoryview((array.text or "").strip().encode("ascii", "replace")), False
        width = self._header.itemsize
        if self._unpack is None:
            head, rest = _split(stream, width, raw)
            length = int(np.frombuffer(head, self._header)[0])
            if length > len(rest):
                raise _FaultError(f"the array {array.get('Name')!r} is cut short")
            return [(length, length)], rest if raw else _decoded(stream, width + length)[width:]
        head, _ = _split(stream, 3 * width, raw)
        count, block, last = (int(number) for number in np.frombuffer(head, self._header))
        if count * width > len(stream):
            raise _FaultError(f"the array {array.get('Name')!r} is cut short")
        head, rest = _split(stream, (3 + count) * width, raw)
        lengths = np.frombuffer(head, self._header)[3:].tolist()
        unpacked = [block] * count
        if count and last:
            unpacked[-1] = last
        needed = sum(lengths)
        if needed > len(rest) or sum(unpacked) > _MOST_SHRUNK * max(needed, 1):
            raise _FaultError(f"the array {array.get('Name')!r} is cut short")
        return list(zip(unpacked, lengths, strict=True)), rest if raw else _decoded(rest, needed)


def _split(stream: _Bytes, count: int, raw: bool) -> tuple[_Bytes, _Bytes]:
    """Return the first `count` bytes, decoded, and the rest of the stream as it is in the file."""
    if raw:
        head, rest = stream[:count], stream[count:]
    else:
        letters = 4 * -(-count // 3)
        head, rest = _decoded(stream[:letters], count), stream[letters:]
    if len(head) != count:
        raise _FaultError("an array is cut short")
    return head, rest


def _decoded(stream: _Bytes, count: int) -> _Bytes:
    try:
        return base64.b64decode(stream[: 4 * -(-count // 3)])[:count]
    except binascii.Error as error:
        raise _FaultError(f"its data are not base64: {error}") from None


def _width(array: ElementTree.Element) -> int:
    return np.dtype(_TYPES.get(str(array.get("type")), "u1")).itemsize


def _zlib(block: _Bytes, size: int) -> bytes:
    return zlib.decompressobj().decompress(block, size + 1)


def _lzma(block: _Bytes, size: int) -> bytes:
    return lzma.LZMADecompressor().decompress(block, size + 1)


def _lz4(block: _Bytes, size: int) -> bytes:
    with vtk_messages():
        found = vtkLZ4DataCompressor().Uncompress(block, len(block), size)
    if found is None:
        raise ValueError("LZ4 cannot unpack them")
    return bytes(vtk_to_numpy(found))


_UNPACKERS = {"vtkZLibDataCompressor": _zlib, "vtkLZMADataCompressor": _lzma, "vtkLZ4DataCompressor": _lz4}
