"""The table of a study: rows as :class:`vtkmuscle.Table` has them, written one case after the other."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.io.writing import plain_cell, replacing
from vtkmuscle.run.table import Table


def write_csv(path: Path, tables: Iterable[Table]) -> Path:
    """Write tables of the same columns below each other, all or nothing; nothing for what is not known."""
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        for number, table in enumerate(tables):
            if number == 0:
                writer.writerow(map(plain_cell, table))
            cells = (map(plain_cell, _cells(column, "")) for column in table.values())
            writer.writerows(zip(*cells, strict=True))
    return path


def write_parquet(path: Path, tables: Iterable[Table], kinds: Mapping[str, type]) -> Path:
    """Write the same, of columns of these kinds, as Parquet."""
    import pyarrow  # noqa: PLC0415 -- of the extra `cohort`
    from pyarrow import parquet  # noqa: PLC0415

    known = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    schema = pyarrow.schema([(name, known[kind]) for name, kind in kinds.items()])
    with replacing(path) as beside, parquet.ParquetWriter(beside, schema, compression="zstd") as writer:
        for table in tables:
            columns = {
                name: [None if cell is None else kinds[name](cell) for cell in _cells(column, None)]
                for name, column in table.items()
            }
            writer.write_table(pyarrow.table(columns, schema=schema))
    return path


def _cells(column: np.ndarray[Any, Any], nothing: Any) -> Iterator[Any]:
    return (nothing if one != one else one for one in column.tolist())  # noqa: PLR0124 -- NaN alone does
