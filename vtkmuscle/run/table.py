"""Tables of results: columns of one length, by name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


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
    >>> from vtkmuscle.run.table import Table
    >>> table = Table(("muscle", "length_mm"), [("iliacus", 101.5), ("iliacus", 99.0)])
    >>> table["length_mm"]
    array([101.5,  99. ])
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
