"""The table of a cohort: a row per group of fibres and value of a coordinate, and one for what failed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.run.table import Table
from vtkmuscle.studies.case import Case
from vtkmuscle.studies.cohort.subjects import ID, Study
from vtkmuscle.studies.outcome import Outcome
from vtkmuscle.studies.study import outcome_of
from vtkmuscle.studies.table import write_csv, write_parquet

#: Columns of the table, and what kind each is; after them come those of the table of subjects. Errors are
#: all that is known of them without further solves, with 95 % confidence; the message of a muscle stands in
#: its first row.
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
    "length_err_mm": float,
    "fibre_length_mm": float,
    "moment_arm_mm": float,
    "moment_arm_err_mm": float,
    "slope_mm": float,
    "verdict": str,
    "flags": str,
    "message": str,
}
#: The measures that are compared.
MEASURES = ("length_mm", "moment_arm_mm")


def columns_of(study: Study) -> dict[str, type]:
    """Return the columns of a study's table; a name that is taken gets a prefix."""
    return COLUMNS | {_column(name): kind for name, kind in study.columns.items()}


def _column(name: str) -> str:
    return f"subject_{name}" if name in COLUMNS else name


def write_tables(study: Study, folder: Path, out: Path) -> None:
    """Write ``cohort.csv`` and ``cohort.parquet``, in the order of the study, all or nothing each."""
    write_csv(out / "cohort.csv", _tables(study, folder))
    write_parquet(out / "cohort.parquet", _tables(study, folder), columns_of(study))


def _tables(study: Study, folder: Path) -> Iterator[Table]:
    columns, subjects = columns_of(study), {}
    for row in study.subjects:
        cells = {
            _column(name): kind(row[name]) if row[name] else None for name, kind in study.columns.items()
        }
        subjects[row[ID]] = cells
    unknown = dict.fromkeys(columns)
    for case in chain.from_iterable(study.cases()):
        own = subjects[case.labels["subject"]]
        parts = [unknown | part | own for part in _parts(case, outcome_of(case, folder))]
        # A table for each: in one alone all rows know the same columns, so that each is of one kind.
        table = Table.stacked(tuple(columns), parts)
        table["message"][1:] = ""
        yield table


def _parts(case: Case, outcome: Outcome) -> Iterator[dict[str, Any]]:
    """Give the rows of a case, from what came out, a column of them or one value for all at a time."""
    facts, arrays = outcome.facts, outcome.arrays
    row: dict[str, Any] = {**case.labels, "muscle": case.muscle, "message": outcome.message}
    if outcome.failure:
        yield row | {"verdict": "failed", "flags": "not computed"}
        return
    row |= {"verdict": facts["verdict"], "flags": "; ".join(one["check"] for one in facts["reasons"])}
    if "lengths" not in arrays or not facts["frames"]:
        yield row
        return
    for group, fibres in enumerate(facts["fibres"]):
        of_group = row | {"fibre_group": group, "fibres": fibres}
        in_frames = {
            "frame": np.array(facts["frames"]),
            "time": np.array(facts["times"]),
            "length_mm": arrays["lengths"][:, group],
            "length_err_mm": arrays["length_errors"][:, group],
            "fibre_length_mm": arrays["fibre_lengths"][:, group],
        }
        if not facts["coordinates"]:
            yield of_group | in_frames
        for name, one in outcome.arms.items():
            by_value = {
                "coordinate": name,
                "unit": one.unit,
                "value": one.values,
                "moment_arm_mm": one.arms[:, group],
                "moment_arm_err_mm": outcome.arm_errors(name)[:, group],
                "slope_mm": one.slopes[:, group],
            }
            yield of_group | {key: cells[one.frames] for key, cells in in_frames.items()} | by_value


def read_table(path: Path) -> Any:
    """Return a study's ``cohort.parquet`` as a pyarrow table."""
    from pyarrow import parquet  # noqa: PLC0415 -- of the extra `cohort`

    return parquet.read_table(path)


def curves(out: Path, *, samples: bool = False) -> dict[tuple[Any, ...], dict[str, Any]]:
    """Return what is measured over the values of a coordinate, by subject, motion, setting, sample and more.

    Parameters
    ----------
    out : Path
        Folder of a study's results.
    samples : bool, optional
        Whether runs with inputs moved about are among them.

    Returns
    -------
    dict
        By (subject, motion, setting, sample, muscle, fibre group, coordinate): arrays ``value``,
        ``length_mm`` and ``moment_arm_mm``. Muscles with the verdict "failed" are left out.
    """
    names = ("subject", "motion", "setting", "sample", "muscle", "fibre_group", "coordinate")
    columns = ("value", *MEASURES)
    table = read_table(out / "cohort.parquet").to_pydict()
    found: dict[tuple[Any, ...], list[tuple[float, ...]]] = {}
    for i, verdict in enumerate(table["verdict"]):
        if verdict == "failed" or table["coordinate"][i] is None or (table["sample"][i] and not samples):
            continue
        key = tuple(table[name][i] for name in names)
        found.setdefault(key, []).append(tuple(table[name][i] for name in columns))
    return {key: dict(zip(columns, np.array(rows).T, strict=True)) for key, rows in found.items()}
