"""Landmarks and curves of 3D Slicer: .mrk.json and .fcsv files, in LPS or RAS."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import shown
from vtkmuscle.io.csv_table import number_in

#: Frames of the body: x to the left and y to the back, or x to the right and y to the front; z up.
FRAMES = ("LPS", "RAS")
#: What files call them; Slicer's old ones by numbers.
_FRAME_WORDS = {"LPS": "LPS", "1": "LPS", "RAS": "RAS", "0": "RAS", "IJK": "IJK", "2": "IJK"}
#: Kinds of markups that are points in order, and whether they close.
_KINDS = {"Fiducial": False, "Line": False, "Curve": False, "ClosedCurve": True}
_FCSV_COLUMNS = ["id", "x", "y", "z"]
_AS_SLICER = "save it again with 3D Slicer"


@dataclass(frozen=True, eq=False)
class NamedPoints:
    """Points with names, as a file has them.

    Attributes
    ----------
    names : tuple of str
        One for each point; "" where there is none.
    points : (n, 3) array
        In the file's frame.
    closed : bool
        Whether they are a ring.
    frame : str or None
        ``"LPS"`` or ``"RAS"``; None where the file does not say.
    """

    names: tuple[str, ...]
    points: Floats
    closed: bool = False
    frame: str | None = None

    def within(self, frame: str) -> Floats:
        """Return the points (n, 3) in a frame; as they are where the file does not say its own."""
        if frame not in FRAMES:
            raise InputError("", f"there is no frame {frame!r}; allowed: {', '.join(FRAMES)}")
        turned = self.frame is not None and self.frame != frame
        return self.points * np.array([-1.0, -1.0, 1.0]) if turned else self.points


def markups_of(content: dict[str, Any], path: Path) -> NamedPoints:
    """Return the control points of a .mrk.json file.

    Parameters
    ----------
    content : dict
        What the JSON says.
    path : Path
        The file, for errors.

    Raises
    ------
    InputError
        If it has other than one list of points, one of them has no place, or its frame or unit is not
        understood.
    """
    lists = content.get("markups")
    if not isinstance(lists, list) or len(lists) != 1 or not isinstance(lists[0], dict):
        count = len(lists) if isinstance(lists, list) else 0
        problem = f"the file has {count} lists of markups, but must have one"
        raise InputError(path, problem, "save each of them in a file of its own")
    markup = lists[0]
    kind = markup.get("type", "Fiducial")
    if not isinstance(kind, str) or kind not in _KINDS:
        problem = f"markups of type {shown(kind)} are not understood"
        raise InputError(path, problem, f"understood: {', '.join(_KINDS)}")
    unit = markup.get("coordinateUnits", "mm")
    if unit not in ("mm", ["mm", "mm", "mm"]):
        raise InputError(path, f"coordinates are in {shown(unit)}, but must be in mm", _AS_SLICER)
    frame = _frame(markup.get("coordinateSystem", "LPS"), path)
    controls = markup.get("controlPoints")
    if not isinstance(controls, list) or not controls:
        raise InputError(path, "the file holds no control points", _AS_SLICER)
    names, points = [], []
    for number, control in enumerate(controls):
        found = control if isinstance(control, dict) else {}
        name = str(found.get("label", "") or found.get("id", "") or "")
        status = found.get("positionStatus", "defined")
        place = found.get("position")
        if status != "defined":
            problem = f"control point {number} ({shown(name)}) has no place: its status is {shown(status)}"
            raise InputError(path, problem, "place it, or remove it")
        points.append(_place(place, f"control point {number} ({shown(name)})", path))
        names.append(name)
    return NamedPoints(tuple(names), np.array(points), _KINDS[kind], frame)


def read_fcsv(path: Path) -> NamedPoints:
    """Return the points of a .fcsv file, of any version of 3D Slicer.

    Raises
    ------
    InputError
        If it does not say its frame, or a line is not one of points.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(path, "the file is not text in UTF-8", _AS_SLICER) from error
    frame, columns = None, [*_FCSV_COLUMNS, "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label"]
    names, points = [], []
    for number, line in enumerate(lines, start=1):
        said = re.match(r"#\s*(CoordinateSystem|columns)\s*=\s*(.*)", line)
        if said is not None and said[1] == "CoordinateSystem":
            frame = _frame(said[2].strip(), path)
        elif said is not None:
            columns = [name.strip() for name in said[2].split(",")]
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
            points.append(_place(place, f"line {number}", path))
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
        raise InputError(path, f"the frame {shown(word)} is not understood", "save it in LPS or RAS")
    return frame


def _place(values: Any, where: str, path: Path) -> list[float]:
    good = isinstance(values, list) and len(values) == 3
    if not good or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        raise InputError(path, f"{where}: {shown(values)} is no place x, y, z", "correct it")
    place = [number_in(v) for v in values]
    if not np.isfinite(place).all():
        raise InputError(path, f"{where}: {shown(values)} is not finite", "correct it")
    return place
