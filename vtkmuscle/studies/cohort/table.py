"""The table of a cohort: a row per group of fibres and value of a coordinate, and one for what failed."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.types import Floats
from vtkmuscle.io.writing import plain_cell, replacing
from vtkmuscle.run.table import Table
from vtkmuscle.studies.case import Case, Outcome
from vtkmuscle.studies.cohort.subjects import ID, Study
from vtkmuscle.studies.study import outcome_of
from vtkmuscle.studies.variation import FEWEST

#: Columns of the table; after them come those of the table of subjects. Errors are
#: all that is known of them without further solves, with 95 % confidence; the message of a muscle stands in
#: its first row.
COLUMNS = (
    *("subject", "motion", "setting", "sample", "muscle", "fibre_group", "fibres"),
    *("coordinate", "unit", "value", "frame", "time", "length_mm", "length_err_mm", "fibre_length_mm"),
    *("moment_arm_mm", "moment_arm_err_mm", "slope_mm", "verdict", "flags", "message"),
)
#: The measures that are compared.
MEASURES = ("length_mm", "moment_arm_mm")


def tables_of(study: Study, folder: Path) -> Iterator[Table]:
    """Give the rows of each case that has ended; a subject's column whose name is taken gets a prefix."""
    names = {name: f"subject_{name}" if name in COLUMNS else name for name in study.columns}
    subjects = {
        row[ID]: {names[name]: kind(row[name]) if row[name] else None for name, kind in study.columns.items()}
        for row in study.subjects
    }
    unknown = dict.fromkeys((*COLUMNS, *names.values()))
    for case in chain.from_iterable(study.cases()):
        own = subjects[case.labels["subject"]]
        parts = [unknown | part | own for part in _parts(case, outcome_of(case, folder))]
        # A table for each: in one alone all rows know the same columns, so that each is of one kind.
        table = Table.stacked(tuple(unknown), parts)
        table["message"][1:] = ""
        yield table


def write_csv(path: Path, tables: Iterable[Table]) -> None:
    """Write tables of the same columns below each other, all or nothing; nothing for what is not known."""
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        for number, table in enumerate(tables):
            if number == 0:
                writer.writerow(map(plain_cell, table))
            writer.writerows(zip(*map(_cells, table.values()), strict=True))


def _cells(column: NDArray[Any]) -> Iterator[Any]:
    return (None if one != one else plain_cell(one) for one in column.tolist())  # noqa: PLR0124 -- NaN alone


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


def curves(tables: Iterable[Table]) -> dict[tuple[Any, ...], dict[str, Any]]:
    """Return what is measured over the values of a coordinate, by subject, motion, setting, sample and more.

    Parameters
    ----------
    tables : iterable of Table
        Those of a study's cases, as :func:`tables_of` gives them.

    Returns
    -------
    dict
        By (subject, motion, setting, sample, muscle, fibre group, coordinate): arrays ``value``,
        ``length_mm`` and ``moment_arm_mm``. Muscles with the verdict "failed" are left out.
    """
    names = ("subject", "motion", "setting", "sample", "muscle", "fibre_group", "coordinate")
    found: dict[tuple[Any, ...], list[tuple[float, ...]]] = {}
    for table in tables:
        keys = zip(*(table[name].tolist() for name in names), strict=True)
        rows = zip(*(table[name].tolist() for name in ("value", *MEASURES)), strict=True)
        for key, row, verdict in zip(keys, rows, table["verdict"].tolist(), strict=True):
            if verdict != "failed" and key[-1] is not None:
                found.setdefault(key, []).append(row)
    columns = ("value", *MEASURES)
    return {key: dict(zip(columns, np.array(rows).T, strict=True)) for key, rows in found.items()}


def without_samples(found: Mapping[tuple[Any, ...], Any]) -> dict[tuple[Any, ...], Any]:
    """Return the curves of runs with inputs as they are."""
    return {key: curve for key, curve in found.items() if not key[3]}


#: A value is unusual where it is so many robust standard deviations from the median (Iglewicz, Hoaglin 1993,
#: "How to detect and handle outliers": 3.5, with 0.6745 MAD in place of the standard deviation).
UNUSUAL, _MAD = 3.5, 0.6745

#: Columns of the unusual curves.
OUTLIERS = (
    *("subject", "motion", "setting", "muscle", "fibre_group", "coordinate"),
    *("measure", "at", "value", "median", "score"),
)
#: Columns of sensitivity.csv.
SPREADS = (
    *("subject", "motion", "setting", "muscle", "fibre_group", "coordinate", "cause", "samples"),
    *("sd_length_mm", "sd_moment_arm_mm", "rank"),
)

Key = tuple[Any, ...]
Curve = Mapping[str, Floats]


def outliers(found: Mapping[Key, Curve]) -> Table:
    """Return the curves that differ most from those of the other subjects, the most unusual first.

    A curve counts by its worst value, in robust standard deviations from the median over the subjects.
    """
    alike: dict[Key, dict[str, Curve]] = defaultdict(dict)
    for (subject, *rest), curve in without_samples(found).items():
        alike[tuple(rest)][subject] = curve
    rows: list[Key] = []
    for (motion, setting, _, *which), by_subject in alike.items():
        if len(by_subject) < FEWEST or len({len(one["value"]) for one in by_subject.values()}) != 1:
            continue
        for measure in MEASURES:
            values = np.array([one[measure] for one in by_subject.values()])
            median = np.median(values, axis=0)
            spread = np.median(np.abs(values - median), axis=0)
            scores = _MAD * np.abs(values - median) / np.maximum(spread, 1e-9)
            for (subject, one), score in zip(by_subject.items(), scores, strict=True):
                if (worst := score[at := int(score.argmax())]) > UNUSUAL:
                    worst_of = one["value"][at], one[measure][at], median[at], worst
                    rows.append((subject, motion, setting, *which, measure, *map(float, worst_of)))
    return Table(OUTLIERS, sorted(rows, key=lambda row: -row[-1]))


def spreads(found: Mapping[Key, Curve]) -> Table:
    """Return standard deviations over the samples of each cause, the causes ranked by moment arm."""
    gathered: dict[Key, dict[str, list[Curve]]] = defaultdict(lambda: defaultdict(list))
    for (subject, motion, setting, sample, *which), curve in found.items():
        if sample:
            gathered[subject, motion, setting, *which][sample.partition(" ")[0]].append(curve)
    rows: list[Sequence[Any]] = []
    for key, causes in gathered.items():
        ranked = []
        for cause, samples in causes.items():
            if len(samples) >= FEWEST and len({len(one["value"]) for one in samples}) == 1:
                length, arm = (
                    float(np.std([one[measure] for one in samples], axis=0, ddof=1).mean())
                    for measure in MEASURES
                )
                ranked.append((cause, len(samples), length, arm))
        ranked.sort(key=lambda one: one[3], reverse=True)
        rows += [(*key, *one, rank + 1) for rank, one in enumerate(ranked)]
    return Table(SPREADS, rows)
