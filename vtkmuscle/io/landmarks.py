"""Read the landmarks of an attachment, or of an aponeurosis."""

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
    """Read landmarks in boundary order, and whether they form a ring.

    Parameters
    ----------
    path : path
        A .vtp or .vtk file with one polyline (a ring where it ends at its first point, else an open curve) or
        with points alone; a .csv file of x, y, z, or of a name, x, y, z (a header may name the columns;
        further columns are ignored); a .json file with a list of [x, y, z]; a .mrk.json or .fcsv file of 3D
        Slicer; or a .nrrd file of 3 x n numbers. A ring repeats its first point at the end, or is a closed
        curve of Slicer.
    frame : str, optional
        ``"LPS"`` or ``"RAS"``: the frame of the scene. Files that state their frame, as those of Slicer, are
        converted to it. Slicer saves surfaces in LPS.

    Returns
    -------
    landmarks : (k, 3) array
        Each once, in the unit of the file.
    closed : bool
        True for a ring.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, it cannot be read, has no landmarks, more than one polyline, or a coordinate
        that is not finite.
    """
    path = Path(path)
    if path.suffix.lower() in (".vtp", ".vtk"):
        return landmarks_of(read_polydata(path), str(path))
    found = read_named_points(path)
    points = found.within(frame)
    repeated = not found.closed and len(points) > 3 and np.array_equal(points[0], points[-1])
    return (points[:-1] if repeated else points), found.closed or repeated


def read_aponeurosis(path: str | PathLike[str], side: str, *, frame: str = "LPS") -> Aponeurosis:
    """Read an aponeurosis: the landmarks of a ring on a muscle, or a surface of triangles within it.

    Parameters
    ----------
    path : path
        A file of landmarks as for :func:`read_landmarks`, or a .vtp, .vtk, .stl, .obj or .ply file with
        triangles.
    side : str
        ``"proximal"`` or ``"distal"``.
    frame : str, optional
        As of :func:`read_landmarks`.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, it cannot be read, or holds neither triangles nor three landmarks or more.
    """
    path = Path(path)
    if path.suffix.lower() in SURFACE_SUFFIXES:
        return aponeurosis_from(read_polydata(path), side, str(path))
    landmarks, _ = read_landmarks(path, frame=frame)
    return ring_aponeurosis(landmarks, side, str(path))


def read_named_points(path: str | PathLike[str]) -> NamedPoints:
    """Read points with names and a frame from a .csv, .json, .mrk.json, .fcsv or .nrrd file.

    See :func:`read_landmarks`.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, it cannot be read, or has no points.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    readers = {".csv": _from_csv, ".json": _from_json, ".fcsv": read_fcsv, ".nrrd": read_nrrd_points}
    if suffix not in readers:
        allowed = ", ".join([".vtp", ".vtk", *readers])
        raise InputError(path, f"landmarks are read from {allowed} files, not from {path.suffix!r}")
    check_is_file(path, most=MOST_TEXT)
    found = readers[suffix](path)
    points = found.points
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError(path, f"landmark {row} has a coordinate that is not finite", "correct it")
    return found


def _from_csv(path: Path) -> NamedPoints:
    rows: list[list[float]] = []
    names: list[str] = []
    widths: dict[int, int] = {}
    header_passed = False
    places: tuple[int, ...] | None = None
    for number, cells in csv_rows(path):
        at = places or _numbers_in(cells)
        try:
            rows.append([float(cells[i]) for i in at if i < len(cells)])
        except ValueError:
            if rows or header_passed:
                problem = f"line {number} does not begin with three numbers x, y, z"
                raise InputError(path, problem, "correct it") from None
            header_passed = True
            lower = [cell.casefold() for cell in cells]
            if all(lower.count(name) == 1 for name in "xyz"):
                places = tuple(lower.index(name) for name in "xyz")
            continue
        names.append(cells[0] if 0 not in at else "")
        if len(rows[-1]) < 3:
            raise InputError(path, f"line {number} has fewer than three numbers", "give x, y, z")
        widths.setdefault(len(cells), number)
    if len(widths) > 1:
        (usual, _), (other, line) = sorted(widths.items(), key=lambda item: item[1])[:2]
        raise InputError(
            path,
            f"line {line} has {other} cells, but those before it have {usual}",
            "if numbers have a decimal comma, write a point instead",
        )
    if next(iter(widths), 3) >= 6 and all(value == int(value) for row in rows for value in row):
        warnings.warn(
            f"{path}: each line has {next(iter(widths))} cells, the first of them whole numbers; if numbers "
            "have a decimal comma, write a point instead",
            stacklevel=4,
        )
    if not rows:
        raise InputError(path, "the file holds no landmarks", "give a line x, y, z for each")
    return NamedPoints(tuple(names), np.array(rows, dtype=np.float64))


def _numbers_in(cells: list[str]) -> tuple[int, ...]:
    """Return the columns of x, y and z in a line without a header: the first three, or those after a name."""
    try:
        float(cells[0])
    except ValueError:
        return (1, 2, 3) if len(cells) > 3 else (0, 1, 2)
    return (0, 1, 2)


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
