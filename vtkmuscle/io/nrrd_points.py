"""Lists of points in .nrrd files: an array of 3 x n numbers."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import shown
from vtkmuscle.io.slicer import NamedPoints

_TYPES = {"float": "f4", "double": "f8", "int": "i4", "int32": "i4", "short": "i2", "int16": "i2"}
_TYPES |= {"signed char": "i1", "int8": "i1", "uchar": "u1", "unsigned char": "u1", "uint8": "u1"}
_SPACES = {"left-posterior-superior": "LPS", "lps": "LPS", "right-anterior-superior": "RAS", "ras": "RAS"}
#: Points of a list, at most.
_MOST_POINTS = 1_000_000


def read_nrrd_points(path: Path) -> NamedPoints:
    """Return the points of a .nrrd file of 3 x n numbers.

    Raises
    ------
    InputError
        If it is another kind of array, its data are in another file, or not understood.
    """
    data = path.read_bytes()
    head, blank, body = data.replace(b"\r\n", b"\n", 50).partition(b"\n\n")
    lines = head.decode("latin-1").split("\n")
    if not lines[0].startswith("NRRD") or not blank:
        raise InputError(path, "the file is not NRRD", "export it again")
    fields: dict[str, str] = {}
    for line in lines[1:]:
        key, colon, value = line.partition(":")
        if colon and not line.startswith("#"):
            fields[key.strip().lower()] = value.strip().removeprefix("=").strip()
    for key in ("data file", "datafile"):
        if key in fields:
            raise InputError(path, "its data are in another file", "save it with attached data")
    sizes = fields.get("sizes", "").split()
    if (
        len(sizes) != 2
        or sizes[0] != "3"
        or not sizes[1].isdecimal()
        or not 0 < int(sizes[1]) <= _MOST_POINTS
    ):
        problem = f"the sizes are {shown(' '.join(sizes))}, but a list of points has 3 and their number"
        raise InputError(path, problem, "export landmarks, not an image")
    points = _values(fields, body, 3 * int(sizes[1]), path).reshape(-1, 3)
    frame = _SPACES.get(fields.get("space", "").lower())
    if "space" in fields and frame is None:
        raise InputError(
            path, f"the space {shown(fields['space'])} is not understood", "save it in LPS or RAS"
        )
    return NamedPoints(("",) * len(points), points, frame=frame)


def _values(fields: dict[str, str], body: bytes, count: int, path: Path) -> Floats:
    """Return the numbers of an array."""
    kind, encoding = fields.get("type", ""), fields.get("encoding", "").lower()
    if kind not in _TYPES:
        raise InputError(path, f"numbers of type {shown(kind)} are not understood", "save it as double")
    order = ">" if fields.get("endian", "little").lower() == "big" else "<"
    number = np.dtype(order + _TYPES[kind])
    if encoding in ("gzip", "gz"):
        unpacker = zlib.decompressobj(31)
        try:
            body = unpacker.decompress(body, count * number.itemsize + 1)
        except zlib.error as error:
            raise InputError(path, f"its data are damaged: {error}", "export it again") from error
    if encoding in ("ascii", "text", "txt"):
        try:
            values = np.array([float(cell) for cell in body.split()[: count + 1]])
        except ValueError as error:
            raise InputError(path, f"its data are damaged: {error}", "export it again") from error
    elif encoding in ("raw", "gzip", "gz"):
        whole = len(body) // number.itemsize
        values = np.frombuffer(body[: whole * number.itemsize], dtype=number)[: count + 1].astype(np.float64)
    else:
        raise InputError(path, f"the encoding {shown(encoding)} is not understood", "save it as raw or gzip")
    if len(values) != count:
        raise InputError(path, f"there are {len(values)} numbers, but {count} are said", "export it again")
    return values
