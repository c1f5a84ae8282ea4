"""CSV tables, read with checks and written."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.io.writing import replacing


def csv_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of lines, without comments (#)."""
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


def table_rows(
    path: Path, *, needed: Sequence[str] = (), most: int | None = None, remedy: str = ""
) -> list[tuple[int, dict[str, str]]]:
    """Return line number and cells by column for each row."""
    rows = list(islice(csv_rows(path), None if most is None else most + 2))
    header = rows[0][1] if rows else []
    if twice := sorted({name for name in header if header.count(name) > 1}):
        problem = f"the column(s) {', '.join(twice)} appear twice" if any(twice) else "a column has no name"
        raise InputError(path, problem, "give each column a name of its own")
    if missing := [name for name in needed if name not in header]:
        apart = "separate the columns by commas; " if len(header) == 1 else ""
        raise InputError(path, f"the column(s) {', '.join(missing)} are missing", apart + remedy)
    if len(rows) < 2:
        raise InputError(path, "the table has no rows", remedy)
    if most is not None and len(rows) - 1 > most:
        raise InputError(path, f"the table has more than {most} rows", "leave some out")
    for line, cells in rows[1:]:
        if len(cells) != len(header):
            problem = f"line {line} has {len(cells)} cells, but the header has {len(header)}"
            raise InputError(path, problem, "correct the line")
    return [(line, dict(zip(header, cells, strict=True))) for line, cells in rows[1:]]


def write_rows(path: Path, rows: Iterable[Iterable[object]]) -> None:
    """Write a table, header first, with all digits, all or nothing."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def number_in(cell: object) -> float:
    """Return the number in a cell, or NaN."""
    try:
        return float(cell)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan


def finite_number(cell: str, column: str, path: Path, where: str) -> float:
    """Return the finite number in a cell; otherwise raise an InputError."""
    value = number_in(cell)
    if not math.isfinite(value):
        raise InputError(path, f"{where}: {column} is {cell!r}, but must be a finite number", "correct it")
    return value
