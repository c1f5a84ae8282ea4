"""Read and write tables of rigid transforms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, is_rigid
from vtkmuscle.core.types import Floats
from vtkmuscle.io.csv_table import finite_number, table_rows, write_rows

#: Column names, row major. The last four may be missing: a rigid transform ends with 0 0 0 1.
TRANSFORM_COLUMNS = tuple(f"T{row}{column}" for row in range(4) for column in range(4))

#: Most rows of a table: a hundred seconds of motion capture.
MOST_FRAMES = 20_000

#: The remedy for a table without these columns or without rows.
_FORM = "give the columns T00, T01, T02, T03, T10 ... T23, row major, rest to pose, and a line per time"
_LAST_ROW = {"T30": 0.0, "T31": 0.0, "T32": 0.0, "T33": 1.0}

#: Names of times and counts; a column of another name that is the pipeline's time is a coordinate as well.
_TIMES = ("time", "times", "t", "s", "ms", "sec", "seconds", "percent", "cycle", "gait", "gait_cycle")
_COUNTS = ("frame", "frames", "row", "rows", "step", "steps", "index", "number", "n")


def read_motion_table(
    path: str | PathLike[str],
    bone: str,
    *,
    time: str | None = None,
    centre: ArrayLike | None = None,
    coordinates: Sequence[str] | Mapping[str, Mapping[str, str]] | None = None,
) -> RigidMotion:
    """Read how a bone moves from a CSV table, one row per time.

    Parameters
    ----------
    path : path
        A CSV file with a header line; the columns ``T00`` to ``T23`` (and optionally ``T30`` to ``T33``, 0 0
        0 1) are the transform from rest to the pose, row major. Other columns, empty lines and lines that
        begin with # are ignored.
    bone : str
        Name of the bone that moves.
    time : str, optional
        The column that is the pipeline's time; by default rows are numbered from 0.
    centre : (3,) array_like, optional
        Joint centre in the rest pose, in the unit of the table.
    coordinates : sequence of str, or mapping of str to mapping, optional
        Columns that are joint coordinates, in degrees; or, per column, ``unit`` and ``positive`` of a
        :class:`~vtkmuscle.core.motion.coordinates.Coordinate`. By default the column of the time, unless it
        is called ``time``, ``frame`` or the like, or counts the rows. Columns that do not change are left
        out.

    Returns
    -------
    RigidMotion
        Of this one bone, with its coordinates.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, a column is missing, a cell is no finite number, times do not ascend or a
        transform is not rigid; the message names the file and the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> from vtkmuscle.core.motion.rigid import hinge
    >>> from vtkmuscle.io import read_motion_table, write_motion_table
    >>> table = Path(mkdtemp()) / "knee.csv"
    >>> write_motion_table(table, hinge("tibia", (0, 0, 0), (1, 0, 0), [0, 10, 20]), "tibia")
    >>> read_motion_table(table, "tibia", time="time").times.tolist()
    [0.0, 10.0, 20.0]
    """
    path = Path(path)
    needed = [name for name in TRANSFORM_COLUMNS if name not in _LAST_ROW]
    rows = table_rows(path, needed=needed, most=MOST_FRAMES, remedy=_FORM)
    header = list(rows[0][1])
    if time is not None and time not in header:
        raise InputError(path, f"there is no column {time!r} for the time", _others(header))
    kinds = _kinds(coordinates, time)
    for name in kinds:
        if name not in header or name in TRANSFORM_COLUMNS:
            raise InputError(path, f"there is no column {name!r} for a coordinate", _others(header))
    times, transforms = [], []
    values: dict[str, list[float]] = {name: [] for name in kinds}
    for row, (line, given) in enumerate(rows):
        where = f"line {line} (row {row})"
        times.append(float(row) if time is None else finite_number(given[time], time, path, where))
        if row and times[-1] <= times[-2]:
            raise InputError(
                path,
                f"{where}: the times ({time}) must ascend, but {times[-1]:g} comes after {times[-2]:g}",
                "sort the rows, or leave out the time column so that rows are numbered",
            )
        transform = np.array(
            [
                finite_number(given[name], name, path, where) if name in given else _LAST_ROW[name]
                for name in TRANSFORM_COLUMNS
            ]
        ).reshape(4, 4)
        if not is_rigid(transform):
            raise InputError(path, f"{where}: the transform is not rigid: {_why_not_rigid(transform)}")
        transforms.append(transform)
        for name in kinds:
            values[name].append(finite_number(given[name], name, path, where))
    found = {
        name: Coordinate(np.array(values[name]), kind["unit"], kind["positive"])
        for name, kind in kinds.items()
        if coordinates is not None or not _counts_rows(values[name])
    }
    return RigidMotion(
        np.array(times),
        {bone: np.array(transforms)},
        None if centre is None else np.asarray(centre, dtype=np.float64),
        {name: one for name, one in found.items() if one.changes},
    )


def motion_columns(path: str | PathLike[str]) -> list[str]:
    """Return the columns of a table of transforms that are not part of a transform."""
    rows = table_rows(Path(path), most=MOST_FRAMES, remedy=_FORM)
    return [name for name in rows[0][1] if name not in TRANSFORM_COLUMNS]


def write_motion_table(path: str | PathLike[str], motion: RigidMotion, bone: str) -> None:
    """Write the motion of one bone so that :func:`read_motion_table` gives the same numbers back.

    Raises
    ------
    ValueError
        If a coordinate of the motion has the name of another column.
    """
    columns = {name: one.values for name, one in motion.coordinates.items()}
    if "time" in columns and np.array_equal(columns["time"], motion.times):
        del columns["time"]
    for name in columns:
        if name in ("time", *TRANSFORM_COLUMNS) or set(name) & set(',"\r\n') or name != name.strip():
            raise InputError(Path(path), f"a coordinate cannot be a column {name!r}", "rename it")
    rows = [
        (time, *transform.ravel(), *values)
        for time, transform, *values in zip(
            motion.times, motion.transforms[bone], *columns.values(), strict=True
        )
    ]
    head = ("time", *TRANSFORM_COLUMNS, *columns)
    write_rows(Path(path), [head, *([float(value) for value in row] for row in rows)])


def _kinds(
    coordinates: Sequence[str] | Mapping[str, Mapping[str, str]] | None, time: str | None
) -> dict[str, dict[str, str]]:
    """Return the unit and positive direction of each coordinate, by its column."""
    if coordinates is None:
        coordinates = [] if time is None or time.casefold() in _TIMES + _COUNTS else [time]
    given = coordinates if isinstance(coordinates, Mapping) else {}
    return {name: {"unit": "deg", "positive": "", **given.get(name, {})} for name in coordinates}


def _counts_rows(values: Sequence[float]) -> bool:
    return any(np.array_equal(values, np.arange(first, first + len(values))) for first in (0, 1))


def _others(header: Sequence[str]) -> str:
    return "the other columns are: " + (", ".join(c for c in header if c not in TRANSFORM_COLUMNS) or "none")


def _why_not_rigid(transform: Floats) -> str:
    rotation = transform[:3, :3]
    if not np.array_equal(transform[3], [0.0, 0.0, 0.0, 1.0]):
        return "its last row (T30 to T33) must be 0, 0, 0, 1"
    if np.linalg.det(rotation) <= 0:
        return "its rotation part mirrors; swap the sign of one axis"
    error = np.abs(rotation.T @ rotation - np.eye(3)).max()
    return f"its rotation part scales or shears (R^T R is off by {error:.2g}); give a rotation matrix"
