"""Landmarks and curves of 3D Slicer: .mrk.json, .fcsv and .nrrd files, in LPS or RAS."""

from __future__ import annotations

import csv
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.io.csv_table import number_in

#: Frames of the body: x to the left and y to the back, or x to the right and y to the front; z up.
FRAMES = ("LPS", "RAS")
#: What files call them; Slicer's old ones by numbers.
_FRAME_WORDS = {"LPS": "LPS", "1": "LPS", "RAS": "RAS", "0": "RAS", "IJK": "IJK", "2": "IJK"}
#: Kinds of markups that are points in order, and whether they close.
_KINDS = {"Fiducial": False, "Line": False, "Curve": False, "ClosedCurve": True}
_FCSV_COLUMNS = ["id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label"]
_AS_SLICER = "save it again with 3D Slicer"
#: Kinds of numbers, and of frames, in .nrrd files.
_TYPES = {"float": "f4", "double": "f8", "int": "i4", "int32": "i4", "short": "i2", "int16": "i2"}
_TYPES |= {"signed char": "i1", "int8": "i1", "uchar": "u1", "unsigned char": "u1", "uint8": "u1"}
_SPACES = {"left-posterior-superior": "LPS", "lps": "LPS", "right-anterior-superior": "RAS", "ras": "RAS"}


@dataclass(frozen=True, eq=False)
class NamedPoints:
    """Points (n, 3) of a file with their names, "" for none; a ring if ``closed``.

    The frame is ``"LPS"`` or ``"RAS"``; None where the file does not state it.
    """

    names: tuple[str, ...]
    points: Floats
    closed: bool = False
    frame: str | None = None

    def within(self, frame: str) -> Floats:
        """Return the points (n, 3) in a frame; unchanged where the file does not state its own."""
        if frame not in FRAMES:
            raise InputError("", f"there is no frame {frame!r}; allowed: {', '.join(FRAMES)}")
        turned = self.frame is not None and self.frame != frame
        return self.points * np.array([-1.0, -1.0, 1.0]) if turned else self.points


def markups_of(content: dict[str, Any], path: Path) -> NamedPoints:
    """Return the control points in the content of a .mrk.json file.

    An InputError is raised if it has more or fewer than one list of points, a point has no position, or its
    frame or unit is unknown.
    """
    lists = content.get("markups")
    if not isinstance(lists, list) or len(lists) != 1 or not isinstance(lists[0], dict):
        count = len(lists) if isinstance(lists, list) else 0
        problem = f"the file has {count} lists of markups, but must have one"
        raise InputError(path, problem, "save each of them in a file of its own")
    markup = lists[0]
    kind = markup.get("type", "Fiducial")
    if not isinstance(kind, str) or kind not in _KINDS:
        problem = f"markups of type {quoted(kind)} are not understood"
        raise InputError(path, problem, f"understood: {', '.join(_KINDS)}")
    unit = markup.get("coordinateUnits", "mm")
    if unit not in ("mm", ["mm", "mm", "mm"]):
        raise InputError(path, f"coordinates are in {quoted(unit)}, but must be in mm", _AS_SLICER)
    frame = _frame(markup.get("coordinateSystem", "LPS"), path)
    controls = markup.get("controlPoints")
    if not isinstance(controls, list) or not controls:
        raise InputError(path, "the file holds no control points", _AS_SLICER)
    names, points = [], []
    for number, control in enumerate(controls):
        found = control if isinstance(control, dict) else {}
        names.append(str(found.get("label", "") or found.get("id", "") or ""))
        where = f"control point {number} ({quoted(names[-1])})"
        status = found.get("positionStatus", "defined")
        if status != "defined":
            problem = f"{where} has no position: its status is {quoted(status)}"
            raise InputError(path, problem, "place it, or remove it")
        points.append(_position(found.get("position"), where, path))
    return NamedPoints(tuple(names), np.array(points), _KINDS[kind], frame)


def read_fcsv(path: Path) -> NamedPoints:
    """Return the points of a .fcsv file, of any version of 3D Slicer, which must state its frame."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(path, "the file is not text in UTF-8", _AS_SLICER) from error
    frame, columns = None, _FCSV_COLUMNS
    names, points = [], []
    for number, line in enumerate(lines, start=1):
        header = re.match(r"#\s*(CoordinateSystem|columns)\s*=\s*(.*)", line)
        if header is not None and header[1] == "CoordinateSystem":
            frame = _frame(header[2].strip(), path)
        elif header is not None:
            columns = [name.strip() for name in header[2].split(",")]
            missing = [name for name in "xyz" if name not in columns]
            if missing:
                raise InputError(path, f"line {number}: there is no column {missing[0]!r}", _AS_SLICER)
        elif line.strip() and not line.startswith("#"):
            try:
                cells = next(csv.reader([line]))
            except csv.Error as error:
                raise InputError(path, f"line {number}: {error}", _AS_SLICER) from error
            given = dict(zip(columns, cells, strict=False))
            place = [number_in(given.get(name, "")) for name in "xyz"]
            points.append(_position(place, f"line {number}", path))
            names.append(given.get("label", "") or given.get("id", ""))
    if not points:
        raise InputError(path, "the file holds no landmarks", _AS_SLICER)
    if frame is None:
        problem = "the file does not say whether it is in LPS or RAS"
        raise InputError(path, problem, "add a line # CoordinateSystem = LPS, or RAS")
    return NamedPoints(tuple(names), np.array(points), frame=frame)


def _frame(word: Any, path: Path) -> str:
    frame = _FRAME_WORDS.get(str(word).strip().upper())
    if frame not in FRAMES:
        raise InputError(path, f"the frame {quoted(word)} is not understood", "save it in LPS or RAS")
    return frame


def _position(values: Any, where: str, path: Path) -> list[float]:
    numbers = isinstance(values, list) and all(type(value) in (int, float) for value in values)
    place = [number_in(value) for value in values] if numbers else []
    if len(place) != 3 or not np.isfinite(place).all():
        raise InputError(path, f"{where}: {quoted(values)} is not a finite position x, y, z", "correct it")
    return place


def read_nrrd_points(path: Path) -> NamedPoints:
    """Return the points of a .nrrd file of 3 x n numbers, with its data in the same file."""
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
        problem = f"the sizes are {quoted(' '.join(sizes))}, but a list of points has 3 and their number"
        raise InputError(path, problem, "export landmarks, not an image")
    points = _values(fields, rest[0], 3 * int(sizes[1]), path).reshape(-1, 3)
    frame = _SPACES.get(fields.get("space", "").lower())
    if "space" in fields and frame is None:
        problem = f"the space {quoted(fields['space'])} is not understood"
        raise InputError(path, problem, "save it in LPS or RAS")
    return NamedPoints(("",) * len(points), points, frame=frame)


def _values(fields: dict[str, str], body: bytes, count: int, path: Path) -> Floats:
    """Return the numbers of an array."""
    kind, encoding = fields.get("type", ""), fields.get("encoding", "").lower()
    if kind not in _TYPES:
        raise InputError(path, f"numbers of type {quoted(kind)} are not understood", "save it as double")
    if encoding not in ("raw", "gzip", "gz", "ascii", "text", "txt"):
        raise InputError(path, f"the encoding {quoted(encoding)} is not understood", "save it as raw or gzip")
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
        problem = f"the file has {len(values)} numbers, but its header says {count}"
        raise InputError(path, problem, "export it again")
    return values
