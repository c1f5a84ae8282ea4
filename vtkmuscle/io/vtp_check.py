"""What a .vtp file says of its sizes, compared with what it holds, before VTK's reader believes it."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from vtkmuscle.core.errors import InputError

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
