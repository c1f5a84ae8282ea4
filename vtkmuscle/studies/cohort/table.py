"""The table of a cohort: a row per group of fibres and value of a coordinate, and one for a failure."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.io.writing import plain_cell, replacing
from vtkmuscle.run.table import Table
from vtkmuscle.studies.case import Case, Outcome
from vtkmuscle.studies.cohort.subjects import ID, Study
from vtkmuscle.studies.variation import FEWEST

#: Columns that identify a curve over the values of a coordinate.
CURVE = ("subject", "motion", "setting", "sample", "muscle", "fibre_group", "coordinate")
#: Columns of the table, before those of the table of subjects. Errors are the parts known without further
#: solves, with 95 % confidence; the message of a muscle stands in its first row.
COLUMNS = (
    *("subject", "motion", "setting", "sample", "muscle", "fibre_group", "fibres"),
    *("coordinate", "unit", "value", "frame", "time", "length_mm", "length_err_mm", "fibre_length_mm"),
    *("moment_arm_mm", "moment_arm_err_mm", "slope_mm", "verdict", "flags", "message"),
)
#: The measures that are compared.
MEASURES = ("length_mm", "moment_arm_mm")
#: A value is unusual if it is farther from the median, in robust standard deviations (Iglewicz, Hoaglin 1993,
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
#: Arrays ``value``, ``length_mm`` and ``moment_arm_mm``.
Curve = Mapping[str, Floats]
#: Rows of the table: by column an array, or one value for all of them; None where it is not known.
Rows = Mapping[str, Any]


def rows_of(study: Study, outcomes: Iterable[tuple[Case, Outcome]]) -> Iterator[Rows]:
    """Give the rows of each case, group of fibres and coordinate.

    A column of the table of subjects whose name is taken gets the prefix ``subject_``.
    """
    names = {name: f"subject_{name}" if name in COLUMNS else name for name in study.columns}
    subjects = {
        row[ID]: {names[name]: kind(row[name]) if row[name] else None for name, kind in study.columns.items()}
        for row in study.subjects
    }
    unknown = dict.fromkeys((*COLUMNS, *names.values()))
    for case, outcome in outcomes:
        message = outcome.message
        for rows in _rows_of(case, outcome):
            messages = np.array([message, *[""] * (np.size(rows.get("frame", 0)) - 1)])
            yield unknown | rows | subjects[case.labels["subject"]] | {"message": messages}
            message = ""


def _rows_of(case: Case, outcome: Outcome) -> Iterator[dict[str, Any]]:
    values = outcome.values
    row: dict[str, Any] = {**case.labels, "muscle": case.muscle}
    if outcome.failure:
        yield row | {"verdict": "failed", "flags": "not computed"}
        return
    row |= {"verdict": values["verdict"], "flags": "; ".join(one["check"] for one in values["reasons"])}
    if "lengths" not in values or not values["frames"]:
        yield row
        return
    for group, fibres in enumerate(values["fibres"]):
        of_group = row | {"fibre_group": group, "fibres": fibres}
        in_frames = {
            "frame": np.array(values["frames"]),
            "time": np.array(values["times"]),
            "length_mm": values["lengths"][:, group],
            "length_err_mm": values["length_errors"][:, group],
            "fibre_length_mm": values["fibre_lengths"][:, group],
        }
        if not values["arms"]:
            yield of_group | in_frames
        for name, one in outcome.arms.items():
            by_value = {
                "coordinate": name,
                "unit": one.unit,
                "value": one.values,
                "moment_arm_mm": one.arms[:, group],
                "moment_arm_err_mm": values["arm_errors"][name][:, group],
                "slope_mm": one.slopes[:, group],
            }
            yield of_group | {key: cells[one.frames] for key, cells in in_frames.items()} | by_value


def write_csv(path: Path, rows: Iterable[Rows]) -> None:
    """Write rows below each other; unknown values are empty cells."""
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        for number, block in enumerate(rows):
            if number == 0:
                writer.writerow(map(plain_cell, block))
            columns = np.broadcast_arrays(*block.values())
            writer.writerows(zip(*(map(_cell, column.ravel().tolist()) for column in columns), strict=True))


def _cell(value: Any) -> Any:
    return None if value != value else plain_cell(value)  # noqa: PLR0124 -- NaN alone


def curves(rows: Iterable[Rows]) -> dict[Key, Curve]:
    """Return curves over the values of a coordinate by :data:`CURVE`, without those of failed muscles."""
    columns = ("value", *MEASURES)
    return {
        tuple(block[name] for name in CURVE): dict(
            zip(columns, np.broadcast_arrays(*(block[name] for name in columns)), strict=True)
        )
        for block in rows
        if block["verdict"] != "failed" and block["coordinate"] is not None
    }


def by_subject(found: Mapping[Key, Curve]) -> dict[Key, dict[str, Curve]]:
    """Return the curves with unchanged inputs by all but the subject and the sample, then by subject."""
    alike: dict[Key, dict[str, Curve]] = defaultdict(dict)
    for (subject, motion, setting, sample, *which), curve in found.items():
        if not sample:
            alike[motion, setting, *which][subject] = curve
    return alike


def _comparable(ones: Collection[Curve]) -> bool:
    return len(ones) >= FEWEST and len({len(one["value"]) for one in ones}) == 1


def outliers(found: Mapping[Key, Curve]) -> Table:
    """Return the curves that differ most from those of the other subjects, the most unusual first.

    A curve counts by its worst value, in robust standard deviations from the median over the subjects.
    """
    rows: list[Key] = []
    for which, ones in by_subject(found).items():
        if not _comparable(ones.values()):
            continue
        for measure in MEASURES:
            values = np.array([one[measure] for one in ones.values()])
            median = np.median(values, axis=0)
            spread = np.median(np.abs(values - median), axis=0)
            scores = _MAD * np.abs(values - median) / np.maximum(spread, 1e-9)
            for (subject, one), score in zip(ones.items(), scores, strict=True):
                if (worst := score[at := int(score.argmax())]) > UNUSUAL:
                    worst_of = one["value"][at], one[measure][at], median[at], worst
                    rows.append((subject, *which, measure, *map(float, worst_of)))
    return Table(OUTLIERS, sorted(rows, key=lambda row: -row[-1]))


def spreads(found: Mapping[Key, Curve]) -> Table:
    """Return standard deviations over the samples of each cause, the causes ranked by moment arm."""
    gathered: dict[Key, dict[str, list[Curve]]] = defaultdict(lambda: defaultdict(list))
    for (subject, motion, setting, sample, *which), curve in found.items():
        if sample:
            gathered[subject, motion, setting, *which][sample.partition(" ")[0]].append(curve)
    rows: list[Key] = []
    for key, causes in gathered.items():
        ranked: list[Key] = []
        for cause, samples in causes.items():
            if _comparable(samples):
                measured = ([one[measure] for one in samples] for measure in MEASURES)
                deviations = [float(np.std(values, axis=0, ddof=1).mean()) for values in measured]
                ranked.append((cause, len(samples), *deviations))
        ranked.sort(key=lambda one: one[-1], reverse=True)
        rows += [(*key, *one, rank + 1) for rank, one in enumerate(ranked)]
    return Table(SPREADS, rows)
