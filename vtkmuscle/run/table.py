"""Tables of results: columns of one length, by name."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.writing import write_text


class Table(Mapping[str, NDArray[Any]]):
    """A table: ``table["length_mm"]`` is a column, ``table.to_frame()`` all of it for pandas.

    Parameters
    ----------
    columns : sequence of str
        Names of the columns.
    rows : iterable of sequence
        A value for each column; None where there is none, which is NaN in the column.

    Examples
    --------
    >>> from vtkmuscle import Table
    >>> table = Table(("muscle", "time", "length_mm"), [("iliacus", 0.0, 101.5), ("iliacus", 2.0, 99.0)])
    >>> table["length_mm"]
    array([101.5,  99. ])
    >>> table.where(muscle="iliacus", time=2.0)["length_mm"]
    array([99.])
    """

    def __init__(self, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
        listed = [[np.nan if value is None else value for value in row] for row in rows]
        self._columns = {name: np.array([row[i] for row in listed]) for i, name in enumerate(columns)}

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self._columns[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        rows = len(next(iter(self._columns.values()), ()))
        return f"Table: {rows} rows of {', '.join(self._columns)}"

    def where(self, **wanted: Any) -> Self:
        """Return the rows in which columns have these values: ``table.where(muscle="iliacus", frame=10)``.

        Raises
        ------
        ValueError
            If there is no such column.
        """
        kept = np.ones(len(next(iter(self._columns.values()), ())), dtype=np.bool_)
        for name, value in wanted.items():
            if name not in self._columns:
                raise InputError("", f"the table has no column {name!r}", suggestion(name, self._columns))
            column = self._columns[name]
            floats = np.issubdtype(column.dtype, np.floating)
            kept &= np.isclose(column, value, rtol=1e-9, atol=1e-9) if floats else column == value
        return type(self)(tuple(self), zip(*(column[kept] for column in self._columns.values()), strict=True))

    def write(self, path: str | PathLike[str], *, digits: int | None = None) -> Path:
        """Write the table as comma-separated values, NaN as nothing, and return the file.

        Parameters
        ----------
        path : path
            Replaced where it exists.
        digits : int, optional
            Of numbers that are not whole; None for as many as keep every bit.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self)
        writer.writerows(zip(*(_cells(column, digits) for column in self._columns.values()), strict=True))
        write_text(Path(path), text.getvalue())
        return Path(path)

    def to_frame(self) -> Any:
        """Return the table as a pandas DataFrame.

        Raises
        ------
        ImportError
            If pandas is not installed; ``dict(table)`` needs none.
        """
        try:
            import pandas  # type: ignore[import-not-found, import-untyped, unused-ignore] # noqa: PLC0415
        except ImportError as error:
            raise ImportError(
                "a DataFrame needs pandas: python -m pip install pandas; dict(table) gives the same as arrays"
            ) from error
        return pandas.DataFrame(self._columns)


def _cells(column: NDArray[Any], digits: int | None) -> Iterable[Any]:
    """Return what is written of a column."""
    values: list[Any] = column.tolist()
    if column.dtype.kind != "f":
        return values
    written = map(repr if digits is None else f"%.{digits}g".__mod__, values)
    return ("" if text == "nan" else text for text in written) if np.isnan(column).any() else written
