"""Read landmarks of areas and aponeuroses, also those of 3D Slicer."""

import json
import re
import zlib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.data.attachments import Aponeurosis, aponeurosis_from, landmarks_of, ring_aponeurosis
from vtkmuscle.io.csv_table import csv_rows, number_in
from vtkmuscle.io.surfaces import FORMATS, SURFACE_SUFFIXES, read_polydata

#: Frames of the body with z up: x left and y back, or x right and y front.
FRAMES = ("LPS", "RAS")
#: Names of columns of coordinates, with their frame.
_AXES = {"xyz": None, "lps": "LPS", "ras": "RAS"}
_AS_SLICER = "save it again with 3D Slicer"
_DECIMAL = "separate numbers by commas, and write decimals with a point"


@dataclass(frozen=True, eq=False)
class NamedPoints:
    """Points (n, 3) with names or "". Perhaps a closed ring; the frame is ``"LPS"``, ``"RAS"`` or unknown."""

    names: tuple[str, ...]
    points: Floats
    closed: bool = False
    frame: str | None = None

    def within(self, frame: str) -> Floats:
        """Return the points (n, 3) in a frame; without an own frame unchanged."""
        if frame not in FRAMES:
            raise InputError("", f"there is no frame {frame!r}; allowed: {', '.join(FRAMES)}")
        return self.points * (1.0 if self.frame in (None, frame) else np.array([-1.0, -1.0, 1.0]))


def read_landmarks(path: str | PathLike[str], *, frame: str = "LPS") -> tuple[Floats, bool]:
    """Read landmarks in boundary order.

    Parameters
    ----------
    path : path
        A .vtp or .vtk file with 1 polyline or only points; a .csv file of x, y, z or name, x, y, z (a
        header may name the columns x, y, z, or l, p, s or r, a, s as Slicer's tables; further columns are
        ignored); a .json file with a list of [x, y, z]; a .mrk.json or .fcsv file of 3D Slicer; or a .nrrd
        file of 3 x n numbers. In a ring, the last point repeats the first, or the file is a closed curve.
    frame : str, optional
        ``"LPS"`` or ``"RAS"``: the frame of the scene. Files with a frame, such as Slicer's, are
        converted. Slicer saves surfaces in LPS.

    Returns
    -------
    landmarks : (k, 3) array
        Without repetition, in the unit of the file.
    closed : bool
        Whether the landmarks form a ring.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read, has no landmarks, more than one polyline, or a
        coordinate that is not finite.
    """
    path = Path(path)
    if path.suffix.lower() in (".vtp", ".vtk"):
        return landmarks_of(read_polydata(path), str(path))
    named = read_named_points(path)
    points = named.within(frame)
    repeated = not named.closed and len(points) > 3 and np.array_equal(points[0], points[-1])
    return (points[:-1] if repeated else points), named.closed or repeated


def read_aponeurosis(path: str | PathLike[str], side: str, *, frame: str = "LPS") -> Aponeurosis:
    """Read an aponeurosis as a ring of landmarks or a surface.

    Parameters
    ----------
    path : path
        A file for :func:`read_landmarks`, or a .vtp, .vtk, .stl, .obj or .ply file with triangles.
    side : str
        ``"proximal"`` or ``"distal"``.
    frame : str, optional
        As in :func:`read_landmarks`.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read, or has neither triangles nor 3 landmarks.
    """
    path = Path(path)
    if path.suffix.lower() in SURFACE_SUFFIXES:
        return aponeurosis_from(read_polydata(path), side, str(path))
    return ring_aponeurosis(read_landmarks(path, frame=frame)[0], side, str(path))


def read_named_points(path: str | PathLike[str]) -> NamedPoints:
    """Read points with names and a frame from .csv, .json, .mrk.json, .fcsv or .nrrd.

    See :func:`read_landmarks`.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read, or has no points.
    """
    path = Path(path)
    readers = {".csv": _from_csv, ".json": _from_json, ".fcsv": _from_fcsv, ".nrrd": _from_nrrd}
    if path.suffix.lower() not in readers:
        allowed = ", ".join([".vtp", ".vtk", *readers])
        raise InputError(path, f"landmarks are read from {allowed}, not {path.suffix!r}", "save it as .csv")
    check_is_file(path, most=MOST_TEXT)
    named = readers[path.suffix.lower()](path)
    finite = np.isfinite(named.points).all(axis=1)
    if not finite.all():
        raise InputError(path, f"landmark {finite.argmin()} has a coordinate that is not finite")
    return named


def _from_csv(path: Path) -> NamedPoints:
    lines = list(csv_rows(path))
    header = [cell.casefold() for cell in lines[0][1]] if lines else []
    axes = next((axes for axes in _AXES if all(header.count(name) == 1 for name in axes)), "")
    columns = tuple(map(header.index, axes))
    if columns or not any(_is_number(header[i]) for i in _columns(header) if i < len(header)):
        del lines[0]
    rows: list[list[float]] = []
    names: list[str] = []
    for number, cells in lines:
        at = columns or _columns(cells)
        try:
            rows.append([float(cells[i]) for i in at if i < len(cells)])
        except ValueError:
            problem = f"line {number}, {quoted(','.join(cells))}, does not begin with three numbers x, y, z"
            raise InputError(path, problem, _DECIMAL) from None
        if len(rows[-1]) < 3:
            raise InputError(path, f"line {number} has fewer than three numbers", "give x, y, z")
        if len(cells) != len(lines[0][1]):
            problem = f"line {number} has {len(cells)} cells, but earlier lines have {len(lines[0][1])}"
            raise InputError(path, problem, _DECIMAL)
        if not columns and (count := sum(map(_is_number, cells))) > 3:
            problem = f"line {number} has {count} numbers, and no column is named x, y or z"
            raise InputError(path, problem, f"begin with a line x,y,z of names; {_DECIMAL}")
        names.append(cells[0] if 0 not in at else "")
    if not rows:
        raise InputError(path, "the file has no landmarks", "give a line x, y, z for each landmark")
    return NamedPoints(tuple(names), np.array(rows, dtype=np.float64), frame=_AXES.get(axes))


def _columns(cells: list[str]) -> tuple[int, ...]:
    """Return the columns of x, y and z, possibly after a name."""
    return (1, 2, 3) if len(cells) > 3 and not _is_number(cells[0]) else (0, 1, 2)


def _is_number(cell: str) -> bool:
    return not np.isnan(number_in(cell)) or cell.strip().casefold().lstrip("+-") == "nan"


def _from_json(path: Path) -> NamedPoints:
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
        is_markups = isinstance(content, dict) and "markups" in content
        points = np.empty(0) if is_markups else np.array(content, dtype=np.float64)
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        why = str(error).partition("\n")[0]
        raise InputError(path, f"the file is not a JSON list of [x, y, z]: {why}") from error
    if is_markups:
        return _from_markups(content, path)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(path, "the file must hold a list of [x, y, z], one per landmark")
    return NamedPoints(("",) * len(points), points)


def _from_markups(content: dict[str, Any], path: Path) -> NamedPoints:
    """Return the control points of the only list in a .mrk.json file."""
    lists = content.get("markups")
    if not isinstance(lists, list) or len(lists) != 1 or not isinstance(lists[0], dict):
        raise InputError(path, "the file must have 1 list of markups", "save each list in a separate file")
    kind, kinds = lists[0].get("type", "Fiducial"), FORMATS["markups"]
    if not isinstance(kind, str) or kind not in kinds:
        problem = f"markups of type {quoted(kind)} are not supported"
        raise InputError(path, problem, f"supported: {', '.join(kinds)}")
    unit = lists[0].get("coordinateUnits", "mm")
    if unit not in ("mm", ["mm", "mm", "mm"]):
        raise InputError(path, f"coordinates are in {quoted(unit)}, but must be in mm", _AS_SLICER)
    controls = lists[0].get("controlPoints")
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
    frame = _frame(lists[0].get("coordinateSystem", "LPS"), path)
    return NamedPoints(tuple(names), np.array(points), kinds[kind], frame)


def _from_fcsv(path: Path) -> NamedPoints:
    """Return the points of an older list of 3D Slicer."""
    rows, text = list(csv_rows(path)), path.read_text(encoding="utf-8-sig")
    header = dict(re.findall(r"^#\s*(CoordinateSystem|columns)\s*=\s*(.*?)\s*$", text, re.MULTILINE))
    columns = re.split(r"\s*,\s*", header.get("columns", "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label"))
    names, points = [], []
    for number, cells in rows:
        row = dict(zip(columns, cells, strict=False))
        points.append(_position([number_in(row.get(name, "")) for name in "xyz"], f"line {number}", path))
        names.append(row.get("label", "") or row.get("id", ""))
    if not points:
        raise InputError(path, "the file holds no landmarks", _AS_SLICER)
    if "CoordinateSystem" not in header:
        problem = "the file does not state its frame, LPS or RAS"
        raise InputError(path, problem, "add a line # CoordinateSystem = LPS, or RAS")
    return NamedPoints(tuple(names), np.array(points), frame=_frame(header["CoordinateSystem"], path))


def _from_nrrd(path: Path) -> NamedPoints:
    """Return the points of a .nrrd file of 3 x n numbers after the header."""
    head, *bodies = re.split(rb"\r?\n\r?\n", path.read_bytes(), maxsplit=1)
    pairs = re.findall(r"^([a-z ]+):(?!=)(.*)$", head.decode("latin-1").casefold(), re.MULTILINE)
    keys = {name.replace(" ", ""): value.strip() for name, value in pairs}
    sizes = re.fullmatch(r"3\s+([1-9][0-9]{,6})", keys.get("sizes", ""))
    if not head.startswith(b"NRRD") or not bodies or sizes is None:
        raise InputError(path, "the file is not NRRD with the sizes 3 n", "export landmarks, not an image")
    for name, words in FORMATS["nrrd"].items():
        if (value := keys.get(name, "")) not in words:
            remedy = "save numbers of type double after the header, raw or by gzip, in LPS or RAS"
            raise InputError(path, f"{name}: {quoted(value)} is not supported", remedy)
    kind, encoding, order, frame, *_ = (words[keys.get(name, "")] for name, words in FORMATS["nrrd"].items())
    number, count = np.dtype(order + kind), 3 * int(sizes[1])
    try:
        body = bodies[0]
        if encoding == "gzip":
            body = zlib.decompressobj(31).decompress(body, (count + 1) * number.itemsize)
        whole = body[: len(body) // number.itemsize * number.itemsize]
        cells: Any = body.split(maxsplit=count) if encoding == "text" else np.frombuffer(whole, number)
        points = np.array(cells, dtype=np.float64)
    except (zlib.error, ValueError) as error:
        raise InputError(path, f"the numbers are damaged: {error}", "export it again") from error
    if len(points) != count:
        problem = f"the file has {len(points)} numbers, but the header says {count}"
        raise InputError(path, problem, "export it again")
    return NamedPoints(("",) * (count // 3), points.reshape(-1, 3), frame=frame or None)


def _frame(word: Any, path: Path) -> str:
    frame: str | None = FORMATS["frames"].get(str(word).strip().upper())
    if frame is None:
        raise InputError(path, f"the frame {quoted(word)} is not supported", "save it in LPS or RAS")
    return frame


def _position(values: Any, where: str, path: Path) -> list[float]:
    numbers = isinstance(values, list) and all(type(value) in (int, float) for value in values)
    position = [number_in(value) for value in values] if numbers else []
    if len(position) != 3 or not np.isfinite(position).all():
        raise InputError(path, f"{where}: {quoted(values)} is not a finite position x, y, z", "correct it")
    return position
