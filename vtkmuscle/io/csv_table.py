"""Rows of a CSV file that a user wrote: with empty lines and comments, and numbers to be checked."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.files import check_is_file


def csv_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Give the number of each line and its cells, without empty lines and those that begin with #.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    InputError
        If it is no table in UTF-8.
    """
    check_is_file(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            for number, cells in enumerate(csv.reader(lines), start=1):
                filled = [cell.strip() for cell in cells]
                if any(filled) and not filled[0].startswith("#"):
                    yield number, filled
    except (UnicodeDecodeError, csv.Error) as error:
        why = "it is not text in UTF-8" if isinstance(error, UnicodeDecodeError) else error
        raise InputError(path, f"the file is not a CSV table: {why}", "export it again") from error


def filled_rows(path: Path, most: int | None = None) -> list[tuple[int, list[str]]]:
    """Return the rows of :func:`csv_rows`; an InputError for more than a header and `most` rows."""
    rows = list(islice(csv_rows(path), None if most is None else most + 2))
    if most is not None and len(rows) - 1 > most:
        raise InputError(path, f"the table has more than {most} rows", "leave some out")
    return rows


def finite_number(cell: str, column: str, path: Path, where: str) -> float:
    """Return the number in a cell of a file's table, InputError where there is none."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(path, f"{where}: {column} is {cell!r}, but must be a finite number")
    return value
