"""Rows of a CSV file that a user wrote: with empty lines and comments, and numbers to be checked."""

from __future__ import annotations

import csv
import math
from itertools import islice
from pathlib import Path

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.files import check_is_file


def filled_rows(path: Path, most: int | None = None) -> list[tuple[int, list[str]]]:
    """Return the rows of a file, each with the number of its line, without empty ones and comments (#).

    Parameters
    ----------
    path : Path
        A CSV file in UTF-8.
    most : int, optional
        Rows below the header, at most; as many lines again may be empty or comments.

    Raises
    ------
    InputError
        If the file is no CSV table in UTF-8, or has more rows.
    OSError
        If there is no such file.
    """
    check_is_file(path)
    limit = None if most is None else 2 * most
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            rows = list(enumerate(islice(csv.reader(lines), limit), start=1))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(path, f"the file is not a CSV table in UTF-8: {error}", "export it again") from error
    stripped = ((number, [cell.strip() for cell in cells]) for number, cells in rows)
    filled = [(number, cells) for number, cells in stripped if any(cells) and not cells[0].startswith("#")]
    if most is not None and (len(filled) - 1 > most or len(rows) == limit):
        raise InputError(path, f"the table has more than {most} rows", "leave some out")
    return filled


def finite_number(cell: str, column: str, path: Path, where: str) -> float:
    """Return the number in a cell of a file's table, InputError where there is none."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(path, f"{where}: {column} is {cell!r}, but must be a finite number")
    return value
