"""Statistics of a cohort: what is unusual, and what results owe to their inputs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.run.table import Table
from vtkmuscle.studies.cohort.table import MEASURES, without_samples
from vtkmuscle.studies.variation import FEWEST

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
