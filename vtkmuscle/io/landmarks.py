"""Read the landmarks of an attachment or an aponeurosis."""

from __future__ import annotations

import json
import warnings
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import Aponeurosis, aponeurosis_from, landmarks_of, ring_aponeurosis
from vtkmuscle.io.csv_table import csv_rows
from vtkmuscle.io.slicer import NamedPoints, markups_of, read_fcsv, read_nrrd_points
from vtkmuscle.io.surfaces import SURFACE_SUFFIXES, read_polydata


def read_landmarks(path: str | PathLike[str], *, frame: str = "LPS") -> tuple[Floats, bool]:
    """Read landmarks in boundary order.

    Parameters
    ----------
    path : path
        A .vtp or .vtk file with 1 polyline or only points; a .csv file of x, y, z or name, x, y, z (a
        header may name the columns; further columns are ignored); a .json file with a list of [x, y, z];
        a .mrk.json or .fcsv file of 3D Slicer; or a .nrrd file of 3 x n numbers. In a ring, the last
        point repeats the first, or the file is a closed curve of Slicer.
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
    landmarks, _ = read_landmarks(path, frame=frame)
    return ring_aponeurosis(landmarks, side, str(path))


def read_named_points(path: str | PathLike[str]) -> NamedPoints:
    """Read points with names and a frame.

    Files are .csv, .json, .mrk.json, .fcsv or .nrrd.

    See :func:`read_landmarks`.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, cannot be read, or has no points.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    readers = {".csv": _from_csv, ".json": _from_json, ".fcsv": read_fcsv, ".nrrd": read_nrrd_points}
    if suffix not in readers:
        allowed = ", ".join([".vtp", ".vtk", *readers])
        raise InputError(path, f"landmarks are read from {allowed} files, not from {path.suffix!r}")
    check_is_file(path, most=MOST_TEXT)
    named = readers[suffix](path)
    finite = np.isfinite(named.points).all(axis=1)
    if not finite.all():
        problem = f"landmark {finite.argmin()} has a coordinate that is not finite"
        raise InputError(path, problem, "correct it")
    return named


def _from_csv(path: Path) -> NamedPoints:
    rows: list[list[float]] = []
    names: list[str] = []
    lines = list(csv_rows(path))
    header = [cell.casefold() for cell in lines[0][1]] if lines else []
    columns = tuple(map(header.index, "xyz")) if all(header.count(name) == 1 for name in "xyz") else None
    if columns or not all(_is_number(header[i]) for i in _columns(header) if i < len(header)):
        del lines[0]
    decimal = "if numbers have a decimal comma, write a point instead"
    for number, cells in lines:
        at = columns or _columns(cells)
        try:
            rows.append([float(cells[i]) for i in at if i < len(cells)])
        except ValueError:
            problem = f"line {number} does not begin with three numbers x, y, z"
            raise InputError(path, problem, "correct it") from None
        if len(rows[-1]) < 3:
            raise InputError(path, f"line {number} has fewer than three numbers", "give x, y, z")
        if len(cells) != len(lines[0][1]):
            problem = f"line {number} has {len(cells)} cells, but earlier lines have {len(lines[0][1])}"
            raise InputError(path, problem, decimal)
        names.append(cells[0] if 0 not in at else "")
    if not rows:
        raise InputError(path, "the file has no landmarks", "give a line x, y, z for each landmark")
    if len(lines[0][1]) >= 6 and all(value == int(value) for row in rows for value in row):
        problem = f"each line has {len(lines[0][1])} cells, beginning with whole numbers"
        warnings.warn(f"{path}: {problem}; {decimal}", stacklevel=4)
    return NamedPoints(tuple(names), np.array(rows, dtype=np.float64))


def _columns(cells: list[str]) -> tuple[int, ...]:
    """Return the columns of x, y and z, possibly after a name."""
    return (1, 2, 3) if len(cells) > 3 and not _is_number(cells[0]) else (0, 1, 2)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _from_json(path: Path) -> NamedPoints:
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
        if isinstance(content, dict) and "markups" in content:
            return markups_of(content, path)
        points = np.array(content, dtype=np.float64)
    except InputError:
        raise
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        why = str(error).partition("\n")[0]
        raise InputError(path, f"the file is not a JSON list of [x, y, z]: {why}") from error
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(path, "the file must hold a list of [x, y, z], one per landmark")
    return NamedPoints(("",) * len(points), points)
