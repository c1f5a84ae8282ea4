"""Read the landmarks of an attachment."""

from __future__ import annotations

import json
import warnings
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.files import MOST_TEXT, check_is_file
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import landmarks_of
from vtkmuscle.io.csv_table import csv_rows
from vtkmuscle.io.surfaces import read_polydata


def read_landmarks(path: str | PathLike[str]) -> tuple[Floats, bool]:
    """Read landmarks in boundary order, and whether they close to a ring.

    Parameters
    ----------
    path : path
        A .vtp or .vtk file with one polyline (a ring where it ends at the point it began with, an open
        curve otherwise) or with points alone; a .csv file of x, y, z (a header line and further columns
        are passed over); or a .json file with a list of [x, y, z]. A .csv or .json ring repeats its first
        point at the end.

    Returns
    -------
    landmarks : (k, 3) array
        Each once, in the unit of the file.
    closed : bool
        True for a ring.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read, has no landmarks, more than one polyline, or a coordinate that is
        not finite.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in (".vtp", ".vtk"):
        return landmarks_of(read_polydata(path), str(path))
    if suffix not in (".csv", ".json"):
        raise InputError(
            path, f"landmarks are read from .vtp, .vtk, .csv or .json files, not from {path.suffix!r}"
        )
    check_is_file(path, most=MOST_TEXT)
    points = _from_csv(path) if suffix == ".csv" else _from_json(path)
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError(path, f"landmark {row} has a coordinate that is not finite", "correct it")
    closed = len(points) > 3 and bool(np.array_equal(points[0], points[-1]))
    return (points[:-1] if closed else points), closed


def _from_csv(path: Path) -> Floats:
    rows: list[list[float]] = []
    widths: dict[int, int] = {}
    header_passed = False
    for number, cells in csv_rows(path):
        try:
            rows.append([float(cell) for cell in cells[:3]])
        except ValueError:
            if rows or header_passed:
                problem = f"line {number} does not begin with three numbers x, y, z"
                raise InputError(path, problem, "correct it") from None
            header_passed = True
            continue
        if len(cells) < 3:
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
    return np.array(rows, dtype=np.float64)


def _from_json(path: Path) -> Floats:
    try:
        points = np.array(json.loads(path.read_text(encoding="utf-8-sig")), dtype=np.float64)
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        why = str(error).partition("\n")[0]
        raise InputError(path, f"the file is not a JSON list of [x, y, z]: {why}") from error
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(path, "the file must hold a list of [x, y, z], one per landmark")
    return points
