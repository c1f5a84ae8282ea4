"""Lists of points in .nrrd files: an array of 3 x n numbers."""

from __future__ import annotations

import re
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


def read_nrrd_points(path: Path) -> NamedPoints:
    """Return the points of a .nrrd file of 3 x n numbers.

    Raises
    ------
    InputError
        If it is another kind of array, its data are in another file, or not understood.
    """
    head, *rest = re.split(rb"\r?\n\r?\n", path.read_bytes(), maxsplit=1)
    lines = head.decode("latin-1").splitlines()
    if not head.startswith(b"NRRD") or not rest:
        raise InputError(path, "the file is not NRRD", "export it again")
    cells = (line.partition(":") for line in lines[1:] if not line.startswith("#"))
    fields = {key.strip().lower(): value.removeprefix("=").strip() for key, colon, value in cells if colon}
    if fields.keys() & {"data file", "datafile"}:
        raise InputError(path, "its data are in another file", "save it with attached data")
    if {fields.get("line skip", "0"), fields.get("byte skip", "0")} != {"0"}:
        raise InputError(path, "its data do not begin after its header", "save it without skips")
    sizes = fields.get("sizes", "").split()
    if sizes[:1] != ["3"] or not re.fullmatch(r"[1-9][0-9]{,6}", " ".join(sizes[1:])):
        problem = f"the sizes are {shown(' '.join(sizes))}, but a list of points has 3 and their number"
        raise InputError(path, problem, "export landmarks, not an image")
    points = _values(fields, rest[0], 3 * int(sizes[1]), path).reshape(-1, 3)
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
    if encoding not in ("raw", "gzip", "gz", "ascii", "text", "txt"):
        raise InputError(path, f"the encoding {shown(encoding)} is not understood", "save it as raw or gzip")
    order = ">" if fields.get("endian", "little").lower() == "big" else "<"
    number = np.dtype(order + _TYPES[kind])
    try:
        if encoding in ("gzip", "gz"):
            body = zlib.decompressobj(31).decompress(body, (count + 1) * number.itemsize)
        if encoding in ("ascii", "text", "txt"):
            values = np.array([float(cell) for cell in body.split()[: count + 1]])
        else:
            values = np.frombuffer(body, number, min(len(body) // number.itemsize, count + 1)).astype(float)
    except (zlib.error, ValueError) as error:
        raise InputError(path, f"its data are damaged: {error}", "export it again") from error
    if len(values) != count:
        raise InputError(path, f"there are {len(values)} numbers, but {count} are said", "export it again")
    return values
