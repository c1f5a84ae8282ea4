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

#: Rows of a table, at most: a hundred seconds at the rate of motion capture systems.
MOST_FRAMES = 20_000

#: What a table without these columns or without rows is told.
_FORM = (
    "a table of transforms has the columns T00, T01, T02, T03, T10 ... T23, row major, rest to pose, and a "
)
_FORM += "line per time"
_LAST_ROW = {"T30": 0.0, "T31": 0.0, "T32": 0.0, "T33": 1.0}

#: Columns that are times or counts; one of another name that is the pipeline's time is a coordinate as well.
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
        A CSV file with a header line; the columns ``T00`` to ``T23`` (and ``T30`` to ``T33``, taken as
        0 0 0 1 where they are missing) are the transform from rest to the pose, row major. Empty lines
        and lines that begin with # are passed over, and so are other columns.
    bone : str
        Name of the bone that moves.
    time : str, optional
        The column that is the pipeline's time; without it the number of the row.
    centre : (3,) array_like, optional
        Joint centre in the rest pose, in the unit of the table.
    coordinates : sequence of str, or mapping of str to mapping, optional
        Columns that are joint coordinates, in degrees; or, per column, ``unit`` and ``positive`` of a
        :class:`~vtkmuscle.core.motion.coordinates.Coordinate`. Without it the column of the time is one,
        unless its name is that of a time (``time``, ``frame`` ...) or it counts the rows. Columns that do
        not change are left out.

    Returns
    -------
    RigidMotion
        Of this one bone, with its coordinates.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a column is missing, a cell is no finite number, times do not ascend or a transform is not
        rigid; the message names the file and the line.

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
        name: Coordinate(np.array(values[name]), kinds[name].get("unit", "deg"), kinds[name]["positive"])
        for name in kinds
    }
    if coordinates is None:
        found = {name: one for name, one in found.items() if not _counts_rows(one.values)}
    return RigidMotion(
        np.array(times),
        {bone: np.array(transforms)},
        None if centre is None else np.asarray(centre, dtype=np.float64),
        {name: one for name, one in found.items() if one.changes},
    )


def motion_columns(path: str | PathLike[str]) -> list[str]:
    """Return the columns of a table of transforms that are not part of a transform.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, or it is no table.
    """
    rows = table_rows(Path(path), most=MOST_FRAMES, remedy=_FORM)
    return [name for name in rows[0][1] if name not in TRANSFORM_COLUMNS]


def write_motion_table(path: str | PathLike[str], motion: RigidMotion, bone: str) -> None:
    """Write the motion of one bone so that :func:`read_motion_table` gives the same numbers back.

    Parameters
    ----------
    path : path
        The CSV file; replaced where it exists.
    motion : RigidMotion
        With a table for the bone.
    bone : str
        Which bone.

    Raises
    ------
    ValueError
        If a coordinate of the motion has the name of another column.
    """
    tables: Mapping[str, Floats] = motion.transforms
    columns = {name: one.values for name, one in motion.coordinates.items()}
    if "time" in columns and np.array_equal(columns["time"], motion.times):
        del columns["time"]
    for name in columns:
        if name in ("time", *TRANSFORM_COLUMNS) or set(name) & set(',"\r\n') or name != name.strip():
            raise InputError(Path(path), f"a coordinate cannot be a column {name!r}", "call it otherwise")
    rows = [
        (time, *transform.ravel(), *values)
        for time, transform, *values in zip(motion.times, tables[bone], *columns.values(), strict=True)
    ]
    head = ("time", *TRANSFORM_COLUMNS, *columns)
    write_rows(Path(path), [head, *([float(value) for value in row] for row in rows)])


def _kinds(
    coordinates: Sequence[str] | Mapping[str, Mapping[str, str]] | None, time: str | None
) -> dict[str, dict[str, str]]:
    """Return the unit and positive direction of each coordinate, by its column."""
    if coordinates is None:
        named = [] if time is None or time.casefold() in _TIMES + _COUNTS else [time]
    else:
        named = list(coordinates)
    given = coordinates if isinstance(coordinates, Mapping) else {}
    return {name: {"positive": "", **given.get(name, {})} for name in named}


def _counts_rows(values: Floats) -> bool:
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
