"""Motion tables of OpenSim and SIMM: .mot and .sto files."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.io.csv_table import finite_number
from vtkmuscle.io.motion_table import MOST_FRAMES
from vtkmuscle.io.xml_elements import decoded
from vtkmuscle.joints.tree import KinematicTree

#: Lines of a header, at most.
_LONGEST_HEADER = 1000
#: Header keys that are read; OpenSim and SIMM use different keys for rows and columns.
_KEYS = ("nrows", "datarows", "ncolumns", "datacolumns", "indegrees", "version", "datatype")


@dataclass(frozen=True, eq=False)
class MotionFile:
    """The table of a .mot or .sto file.

    Attributes
    ----------
    path : Path
        The file.
    times : (f,) array
        Ascending [s].
    labels : tuple of str
        Labels of the further columns, possibly repeated.
    table : (f, k) array
        The further columns.
    degrees : bool or None
        Whether angles are in degrees; None if unspecified.
    """

    path: Path
    times: Floats
    labels: tuple[str, ...]
    table: Floats
    degrees: bool | None

    def values(self, tree: KinematicTree, *, degrees: bool | None = None) -> dict[str, Floats]:
        """Return the values (f,) of a tree's coordinates.

        Angles are in radians, translations as in the file. The label of a column is the coordinate's name,
        or the coordinate's path in the model (``/jointset/knee_r/knee_angle_r/value``); further columns are
        ignored. ``degrees`` tells whether the file's angles are in degrees; by default the header decides.

        Raises
        ------
        ValueError
            If no column is a coordinate, two columns are the same coordinate, or the unit of angles is
            unknown.
        """
        kinds = {coordinate.name: coordinate for coordinate in tree.coordinates}
        result: dict[str, Floats] = {}
        in_degrees = self.degrees if degrees is None else degrees
        for label, column in zip(self.labels, self.table.T, strict=True):
            parts = label.split("/")
            name = parts[-2] if len(parts) > 2 and parts[-1] == "value" else parts[-1]
            if name not in kinds or (len(parts) > 1 and parts[-1] not in ("value", name)):
                continue
            if name in result:
                raise InputError(self.path, f"two columns are the coordinate {name!r}", "remove one")
            if kinds[name].is_angle and in_degrees is None:
                problem = "the header lacks the unit of angles"
                raise InputError(self.path, problem, "add a line inDegrees=yes, or inDegrees=no")
            result[name] = np.radians(column) if kinds[name].is_angle and in_degrees else column
        if not result:
            problem = f"no column is a coordinate; the columns are {', '.join(self.labels[:8])}"
            raise InputError(self.path, problem, f"the coordinates are {', '.join(kinds) or 'none'}")
        return result


def read_motion_file(path: str | PathLike[str]) -> MotionFile:
    r"""Read a .mot or .sto file of OpenSim or SIMM.

    The header may have the lines of either program; labels follow ``endheader``, rows follow the labels. A
    warning reports a wrong count of rows or columns. As in OpenSim, a file without a version has angles in
    degrees.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    MotionFile
        The table.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the file is no such table, a number is not finite, or times do not ascend; the message names
        the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> from vtkmuscle.opensim import read_motion_file
    >>> file = Path(mkdtemp()) / "knee.mot"
    >>> _ = file.write_text("knee\ninDegrees=yes\nendheader\ntime knee_angle\n0 10\n0.1 20\n")
    >>> read_motion_file(file).table.tolist()
    [[10.0], [20.0]]
    """
    path = Path(path)
    lines = decoded(path).splitlines()
    header, start = _header(lines, path)
    labels = _labels(lines, start, path)
    shown = list(map(quoted, labels))
    rows: list[list[float]] = []
    for number, line in enumerate(lines[start + 1 :], start=start + 2):
        cells = line.replace(",", " ").split()
        if not cells:
            continue
        where = f"line {number}"
        if len(cells) != len(labels):
            problem = f"{where} has {len(cells)} numbers, but there are {len(labels)} labels"
            raise InputError(path, problem, "correct it")
        if len(rows) == MOST_FRAMES:
            raise InputError(path, f"the table has more than {MOST_FRAMES} rows", "leave some out")
        row = [finite_number(cell, label, path, where) for cell, label in zip(cells, shown, strict=True)]
        if rows and row[0] <= rows[-1][0]:
            problem = f"{where}: time {row[0]:g} comes after {rows[-1][0]:g}"
            raise InputError(path, problem, "sort the rows, each time once")
        rows.append(row)
    if not rows:
        raise InputError(path, "the table has no rows", "export it again")
    for what, count in (("rows", len(rows)), ("columns", len(labels))):
        for key in (f"n{what}", f"data{what}"):
            if header.get(key, str(count)) != str(count):
                words = f"the header says {key}={header[key]}, but the file has {count} {what}; all were read"
                warnings.warn(f"{path}: {words}", stacklevel=2)
    table = np.array(rows)
    return MotionFile(path, table[:, 0], tuple(labels[1:]), table[:, 1:], _in_degrees(header, path))


def _header(lines: list[str], path: Path) -> tuple[dict[str, str], int]:
    """Return header values by lower-case key, and the number of lines."""
    header: dict[str, str] = {}
    for number, line in enumerate(lines[:_LONGEST_HEADER]):
        plain = line.strip()
        if plain.lower() == "endheader":
            return header, number + 1
        key, _, value = plain.partition("=" if "=" in plain else " ")
        if key.strip().lower() in _KEYS:
            header[key.strip().lower()] = value.strip()
    raise InputError(path, "there is no line 'endheader'", "export it again as a .mot or .sto file")


def _labels(lines: list[str], start: int, path: Path) -> list[str]:
    line = lines[start].strip() if start < len(lines) else ""
    labels = [label.strip() for label in (line.split("\t") if "\t" in line else line.split())]
    where = f"line {start + 1}"
    if len(labels) < 2 or labels[0].lower() != "time":
        problem = f"{where}: the labels begin with {quoted(line[:40])}, but must be time and further labels"
        raise InputError(path, problem, "export it again, without empty lines after the header")
    if "" in labels:
        raise InputError(path, f"{where}: a label is empty", "correct it")
    return labels


def _in_degrees(header: dict[str, str], path: Path) -> bool | None:
    kind = header.get("datatype", "double")
    if kind.lower() != "double":
        raise InputError(path, f"the file holds {quoted(kind)}, but numbers are read", "export joint angles")
    word = header.get("indegrees")
    if word is None:
        return None if "version" in header else True
    if word.lower() not in ("yes", "no", "true", "false"):
        raise InputError(path, f"inDegrees is {quoted(word)}, but must be yes or no")
    return word.lower() in ("yes", "true")
