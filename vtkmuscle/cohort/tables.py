"""The table of a study: a row per group of fibres and value of a coordinate, and one for what failed."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.cohort.study import Study, Task
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import replacing

#: Columns of the table, and what kind each is.
COLUMNS = {
    "subject": str,
    "motion": str,
    "setting": str,
    "sample": str,
    "muscle": str,
    "fibre_group": int,
    "fibres": int,
    "coordinate": str,
    "unit": str,
    "value": float,
    "frame": int,
    "time": float,
    "length_mm": float,
    "fibre_length_mm": float,
    "moment_arm_mm": float,
    "slope_mm": float,
    "verdict": str,
    "flags": str,
    "message": str,
}


def rows_of(task: Task, part: Part) -> Iterator[dict[str, Any]]:
    """Give the rows of a task, from what it has made."""
    facts = part.facts
    row: dict[str, Any] = dict.fromkeys(COLUMNS) | {
        "subject": task.subject,
        "motion": task.motion,
        "setting": task.setting,
        "sample": task.sample,
        "muscle": task.muscle,
    }
    if "failure" in facts:
        yield row | {"verdict": "failed", "flags": "not computed", "message": facts["failure"]}
        return
    arrays = part.arrays
    row |= {"verdict": facts["verdict"], "flags": "; ".join(one["check"] for one in facts["reasons"])}
    row["message"] = "; ".join(one["says"] for one in facts["reasons"]) or None
    if "lengths" not in arrays or not len(arrays["lengths"]):
        yield row
        return
    lengths, frames, times = (arrays[name].tolist() for name in ("lengths", "frames", "times"))
    of_fibres = arrays["fibre_lengths"].tolist()
    for group, fibres in enumerate(facts["fibres"]):
        of_group = row | {"fibre_group": group, "fibres": fibres}
        if not facts["coordinates"]:
            for frame, time, one, other in zip(frames, times, lengths, of_fibres, strict=True):
                found = {"length_mm": one[group], "fibre_length_mm": other[group]}
                yield of_group | {"frame": frame, "time": time, **found}
        for number, (coordinate, unit, _) in enumerate(facts["coordinates"]):
            at, values, arms, slopes = (
                arrays[f"{name}{number}"] for name in ("rows", "values", "arms", "slopes")
            )
            for i, value, arm, slope in zip(
                at.tolist(), values.tolist(), arms[:, group].tolist(), slopes[:, group].tolist(), strict=True
            ):
                yield of_group | {
                    "coordinate": coordinate,
                    "unit": unit,
                    "value": value,
                    "frame": frames[i],
                    "time": times[i],
                    "length_mm": lengths[i][group],
                    "fibre_length_mm": of_fibres[i][group],
                    "moment_arm_mm": arm,
                    "slope_mm": slope,
                }


def write_tables(study: Study, parts: Parts, out: Path) -> list[Path]:
    """Write ``cohort.csv`` and ``cohort.parquet``, all or nothing each, and return them.

    Rows are in the order of the study, whatever the order was in which they were made; a subject is read at
    a time.
    """
    return [
        _write_csv(study, parts, out / "cohort.csv"),
        _write_parquet(study, parts, out / "cohort.parquet"),
    ]


def _by_subject(study: Study, parts: Parts) -> Iterator[list[dict[str, Any]]]:
    for tasks in study.tasks():
        yield [row for task in tasks for row in rows_of(task, part_of(task, parts))]


def part_of(task: Task, parts: Parts) -> Part:
    """Return what a task that has ended has made.

    Raises
    ------
    FileNotFoundError
        If it is gone.
    """
    part = parts.read(task.name)
    if part is None:
        words = "it was removed or damaged while the study ran; the same command makes it again"
        raise FileNotFoundError(f"{parts.path(task.name)}: {words}")
    return part


def _write_csv(study: Study, parts: Parts, path: Path) -> Path:
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for rows in _by_subject(study, parts):
            writer.writerows([_cell(row[name]) for name in COLUMNS] for row in rows)
    return path


def _cell(value: Any) -> Any:
    return "" if value is None or (isinstance(value, float) and np.isnan(value)) else value


def _write_parquet(study: Study, parts: Parts, path: Path) -> Path:
    import pyarrow  # noqa: PLC0415 -- of the extra `cohort`
    from pyarrow import parquet  # noqa: PLC0415

    kinds = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
    with replacing(path) as beside, parquet.ParquetWriter(beside, schema, compression="zstd") as writer:
        for rows in _by_subject(study, parts):
            columns = {name: [row[name] for row in rows] for name in COLUMNS}
            writer.write_table(pyarrow.table(columns, schema=schema))
    return path


def read_table(path: Path, columns: Iterable[str] | None = None) -> Any:
    """Return a study's ``cohort.parquet`` as a pyarrow table."""
    from pyarrow import parquet  # noqa: PLC0415

    return parquet.read_table(path, columns=None if columns is None else list(columns))
