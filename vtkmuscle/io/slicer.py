"""Landmarks and curves of 3D Slicer: .mrk.json, .fcsv and .nrrd files."""

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

#: Frames of the body with z up: x left and y back, or x right and y front.
FRAMES = ("LPS", "RAS")
#: Names of frames in files; numbers in old files of Slicer.
_FRAME_WORDS = {"LPS": "LPS", "1": "LPS", "RAS": "RAS", "0": "RAS", "IJK": "IJK", "2": "IJK"}
#: Kinds of markups with ordered points, and whether the curve is closed.
_KINDS = {"Fiducial": False, "Line": False, "Curve": False, "ClosedCurve": True}
_FCSV_COLUMNS = ["id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label"]
_AS_SLICER = "save it again with 3D Slicer"
#: Names of number types, and of frames, in .nrrd files.
_TYPES = {"float": "f4", "double": "f8", "int": "i4", "int32": "i4", "short": "i2", "int16": "i2"}
_TYPES |= {"signed char": "i1", "int8": "i1", "uchar": "u1", "unsigned char": "u1", "uint8": "u1"}
_SPACES = {"left-posterior-superior": "LPS", "lps": "LPS", "right-anterior-superior": "RAS", "ras": "RAS"}


@dataclass(frozen=True, eq=False)
class NamedPoints:
    """Points (n, 3) with names, "" for no name.

    ``closed`` tells whether the points form a ring. The frame is ``"LPS"``, ``"RAS"``, or None if
    unspecified.
    """

    names: tuple[str, ...]
    points: Floats
    closed: bool = False
    frame: str | None = None

    def within(self, frame: str) -> Floats:
        """Return the points (n, 3) in a frame.

        Points without a frame stay unchanged.
        """
        if frame not in FRAMES:
            raise InputError("", f"there is no frame {frame!r}; allowed: {', '.join(FRAMES)}")
        converted = self.frame is not None and self.frame != frame
        return self.points * np.array([-1.0, -1.0, 1.0]) if converted else self.points


def markups_of(content: dict[str, Any], path: Path) -> NamedPoints:
    """Return the control points in the content of a .mrk.json file.

    Raises
    ------
    InputError
        Unless there is exactly 1 list of points, all with a position, in a supported frame and unit.
    """
    lists = content.get("markups")
    if not isinstance(lists, list) or len(lists) != 1 or not isinstance(lists[0], dict):
        count = len(lists) if isinstance(lists, list) else 0
        problem = f"the file has {count} lists of markups, but must have 1"
        raise InputError(path, problem, "save each list in a separate file")
    markup = lists[0]
    kind = markup.get("type", "Fiducial")
    if not isinstance(kind, str) or kind not in _KINDS:
        problem = f"markups of type {quoted(kind)} are not supported"
        raise InputError(path, problem, f"supported: {', '.join(_KINDS)}")
    unit = markup.get("coordinateUnits", "mm")
    if unit not in ("mm", ["mm", "mm", "mm"]):
        raise InputError(path, f"coordinates are in {quoted(unit)}, but must be in mm", _AS_SLICER)
    frame = _frame(markup.get("coordinateSystem", "LPS"), path)
    controls = markup.get("controlPoints")
    if not isinstance(controls, list) or not controls:
        raise InputError(path, "the file holds no control points", _AS_SLICER)
    names, points = [], []
    for number, control in enumerate(controls):
        keys = control if isinstance(control, dict) else {}
        names.append(str(keys.get("label", "") or keys.get("id", "") or ""))
        where = f"control point {number} ({quoted(names[-1])})"
        status = keys.get("positionStatus", "defined")
        if status != "defined":
            problem = f"{where} has no position: its status is {quoted(status)}"
            raise InputError(path, problem, "place the point, or remove it")
        points.append(_position(keys.get("position"), where, path))
    return NamedPoints(tuple(names), np.array(points), _KINDS[kind], frame)


def read_fcsv(path: Path) -> NamedPoints:
    """Return the points of a .fcsv file of 3D Slicer."""
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
            row = dict(zip(columns, cells, strict=False))
            points.append(_position([number_in(row.get(name, "")) for name in "xyz"], f"line {number}", path))
            names.append(row.get("label", "") or row.get("id", ""))
    if not points:
        raise InputError(path, "the file holds no landmarks", _AS_SLICER)
    if frame is None:
        problem = "the file does not state its frame, LPS or RAS"
        raise InputError(path, problem, "add a line # CoordinateSystem = LPS, or RAS")
    return NamedPoints(tuple(names), np.array(points), frame=frame)


def _frame(word: Any, path: Path) -> str:
    frame = _FRAME_WORDS.get(str(word).strip().upper())
    if frame not in FRAMES:
        raise InputError(path, f"the frame {quoted(word)} is not supported", "save it in LPS or RAS")
    return frame


def _position(values: Any, where: str, path: Path) -> list[float]:
    numbers = isinstance(values, list) and all(type(value) in (int, float) for value in values)
    position = [number_in(value) for value in values] if numbers else []
    if len(position) != 3 or not np.isfinite(position).all():
        raise InputError(path, f"{where}: {quoted(values)} is not a finite position x, y, z", "correct it")
    return position


def read_nrrd_points(path: Path) -> NamedPoints:
    """Return the points of a .nrrd file of 3 x n numbers.

    The data must be attached.
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
        problem = f"the sizes are {quoted(' '.join(sizes))}, but a list of n points has the sizes 3 n"
        raise InputError(path, problem, "export landmarks, not an image")
    points = _values(fields, rest[0], 3 * int(sizes[1]), path).reshape(-1, 3)
    frame = _SPACES.get(fields.get("space", "").lower())
    if "space" in fields and frame is None:
        raise InputError(
            path, f"the space {quoted(fields['space'])} is not supported", "save it in LPS or RAS"
        )
    return NamedPoints(("",) * len(points), points, frame=frame)


def _values(fields: dict[str, str], body: bytes, count: int, path: Path) -> Floats:
    """Return the numbers of an array."""
    kind, encoding = fields.get("type", ""), fields.get("encoding", "").lower()
    if kind not in _TYPES:
        raise InputError(path, f"numbers of type {quoted(kind)} are not supported", "save it as double")
    if encoding not in ("raw", "gzip", "gz", "ascii", "text", "txt"):
        raise InputError(path, f"the encoding {quoted(encoding)} is not supported", "save it as raw or gzip")
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
