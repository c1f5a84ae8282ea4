"""Tables of rigid transforms."""

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, are_rigid
from vtkmuscle.core.types import Floats
from vtkmuscle.io.csv_table import finite_number, table_rows, write_rows

#: Column names, row major. The last four, the row 0 0 0 1, are optional.
TRANSFORM_COLUMNS = tuple(f"T{row}{column}" for row in range(4) for column in range(4))

#: Rows of a table, at most: 100 s of motion capture at 200 Hz.
MOST_FRAMES = 20_000

#: Remedy for a table with missing columns or without rows.
_FORM = "give the columns T00, T01, T02, T03, T10 ... T23, row major, rest to pose, and a line per time"

#: Names of time and count columns; a time column with another name is also a coordinate.
_TIMES = ("time", "times", "t", "s", "ms", "sec", "seconds", "percent", "cycle", "gait", "gait_cycle")
_COUNTS = ("frame", "frames", "row", "rows", "step", "steps", "index", "number", "n")


def read_motion_table(
    path: str | PathLike[str],
    bone: str | None = None,
    *,
    time: str | None = None,
    centre: ArrayLike | None = None,
    coordinates: Sequence[str] | Mapping[str, Mapping[str, str]] | None = None,
) -> RigidMotion:
    """Read the motion of a bone, or of several, from a CSV table.

    Parameters
    ----------
    path : path
        A CSV file with a header line. Columns ``T00`` to ``T23`` (optionally ``T30`` to ``T33``, 0 0 0 1)
        are the transform from rest to the pose, row major. Further columns, empty lines and comments (#)
        are ignored.
    bone : str, optional
        Name of the bone; by default the table has a column ``bone``, and the rows of each bone have the same
        times.
    time : str, optional
        Column of pipeline times; by default rows are numbered from 0.
    centre : (3,) array_like, optional
        Joint centre in the rest pose, in the unit of the table.
    coordinates : sequence of str, or mapping of str to mapping, optional
        Columns of joint coordinates in degrees; or, by column, ``unit`` and ``positive`` of a
        :class:`~vtkmuscle.core.motion.coordinates.Coordinate`. By default the time column, unless called
        ``time``, ``frame`` or similar, or counting rows. Constant columns are omitted.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, a column is missing, a number is not finite, times do not ascend or differ
        from bone to bone, or a transform is not rigid; the message names the file and the line.

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
    needed = [*TRANSFORM_COLUMNS[:12]] + ["bone"] * (bone is None)
    rows = table_rows(path, needed=needed, most=MOST_FRAMES, remedy=_FORM)
    header = list(rows[0][1])
    if time is not None and time not in header:
        raise InputError(path, f"there is no column {time!r} for the time", _further(header))
    kinds = _kinds(coordinates, time)
    for name in kinds:
        if name not in header or name in TRANSFORM_COLUMNS:
            raise InputError(path, f"there is no column {name!r} for a coordinate", _further(header))
    by_bone: dict[str, list[tuple[int, dict[str, str]]]] = {}
    for line, cells in rows:
        by_bone.setdefault(cells["bone"] if bone is None else bone, []).append((line, cells))
    times, values, transforms = np.empty(0), dict[str, Floats](), {}
    for name, lines in by_bone.items():
        moments, transforms[name], numbers = _poses(path, lines, time, kinds)
        if transforms.keys() == {name}:  # the first
            times, values = moments, numbers
        elif not np.array_equal(times, moments):
            problem = f"the times of the bones {next(iter(by_bone))!r} and {name!r} differ"
            raise InputError(path, problem, "give each bone a row per time")
    changing: dict[str, Coordinate] = {}
    for name, kind in kinds.items():
        column = Coordinate(values[name], kind["unit"], kind["positive"])
        first = column.values[0]
        counts_rows = first in (0.0, 1.0) and np.array_equal(column.values, first + np.arange(len(times)))
        if column.changes and not (coordinates is None and counts_rows):
            changing[name] = column
    position = None if centre is None else np.asarray(centre, dtype=np.float64)
    return RigidMotion(times, transforms, position, changing)


def _poses(
    path: Path, rows: Sequence[tuple[int, Mapping[str, str]]], time: str | None, columns: Iterable[str]
) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Return times (t,), transforms (t, 4, 4), and the values of further columns. Of a bone's rows."""
    placed = [(f"line {line} (row {row})", cells) for row, (line, cells) in enumerate(rows)]

    def column(name: str) -> Floats:
        if name not in rows[0][1]:  # of the row 0 0 0 1
            return np.full(len(rows), float(name == "T33"))
        return np.array([finite_number(cells[name], name, path, where) for where, cells in placed])

    times = np.arange(len(rows), dtype=np.float64) if time is None else column(time)
    for row in np.flatnonzero(np.diff(times) <= 0.0) + 1:
        problem = f"the times ({time}) must ascend, but {times[row]:g} comes after {times[row - 1]:g}"
        remedy = "sort the rows, or omit the time column to number the rows"
        raise InputError(path, f"{placed[row][0]}: {problem}", remedy)
    transforms = np.stack([column(name) for name in TRANSFORM_COLUMNS], axis=1).reshape(-1, 4, 4)
    for row in np.flatnonzero(~are_rigid(transforms)):
        problem = f"the transform is not rigid: {_why_not_rigid(transforms[row])}"
        raise InputError(path, f"{placed[row][0]}: {problem}")
    return times, transforms, {name: column(name) for name in columns}


def motion_columns(path: str | PathLike[str]) -> list[str]:
    """Return the columns of a motion table outside the transform."""
    rows = table_rows(Path(path), most=MOST_FRAMES, remedy=_FORM)
    return [name for name in rows[0][1] if name not in TRANSFORM_COLUMNS]


def write_motion_table(path: str | PathLike[str], motion: RigidMotion, bone: str | None = None) -> None:
    """Write the motion of a bone, or of all, for :func:`read_motion_table`, with all digits.

    ValueError if a coordinate has the name of another column.
    """
    columns = {name: coordinate.values for name, coordinate in motion.coordinates.items()}
    if "time" in columns and np.array_equal(columns["time"], motion.times):
        del columns["time"]
    for name in columns:
        if name in ("time", "bone", *TRANSFORM_COLUMNS) or set(name) & set(',"\r\n') or name != name.strip():
            raise InputError(Path(path), f"a coordinate cannot be a column {name!r}", "rename it")
    header, rows = ("time", *TRANSFORM_COLUMNS, *columns), list[list[object]]()
    for name, transforms in motion.transforms.items():
        if bone in (None, name):
            numbers = np.column_stack([motion.times, transforms.reshape(-1, 16), *columns.values()]).tolist()
            rows += [[name, *row] for row in numbers] if bone is None else numbers
    write_rows(Path(path), [("bone", *header) if bone is None else header, *rows])


def _kinds(
    coordinates: Sequence[str] | Mapping[str, Mapping[str, str]] | None, time: str | None
) -> dict[str, dict[str, str]]:
    """Return unit and positive direction by coordinate column."""
    if coordinates is None:
        coordinates = [] if time is None or time.casefold() in _TIMES + _COUNTS else [time]
    details = coordinates if isinstance(coordinates, Mapping) else {}
    return {name: {"unit": "deg", "positive": "", **details.get(name, {})} for name in coordinates}


def _further(header: Sequence[str]) -> str:
    return "the other columns are: " + (", ".join(c for c in header if c not in TRANSFORM_COLUMNS) or "none")


def _why_not_rigid(transform: Floats) -> str:
    rotation = transform[:3, :3]
    if not np.array_equal(transform[3], [0.0, 0.0, 0.0, 1.0]):
        return "its last row (T30 to T33) must be 0, 0, 0, 1"
    if np.linalg.det(rotation) <= 0:
        return "its rotation part mirrors; swap the sign of one axis"
    error = np.abs(rotation.T @ rotation - np.eye(3)).max()
    return f"its rotation part scales or shears (R^T R is off by {error:.2g}); give a rotation matrix"
