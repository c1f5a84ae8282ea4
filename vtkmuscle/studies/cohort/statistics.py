"""Statistics of a cohort: what is unusual, what results owe to their inputs, and how two groups differ."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from vtkmuscle.core.types import Floats
from vtkmuscle.run.table import Table
from vtkmuscle.studies.cohort.subjects import BY_SETTING, ID, Study
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
#: Columns of comparison.csv.
COMPARED = (
    *("motion", "muscle", "fibre_group", "coordinate", "value", "measure"),
    *("first", "second", "n_first", "n_second", "mean_first", "mean_second", "difference", "sd"),
    *("low_95", "high_95", "t", "p_t", "p_rank", "effect_size"),
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


def compared(study: Study, found: Mapping[Key, Curve]) -> Table:
    """Return how two groups, or two settings, differ at each value of each coordinate.

    Settings are paired by subject, groups by the column ``pair`` of the study where it has one: mean and
    standard deviation of the differences (second - first), the 95 % interval of the mean, Student's paired t
    and Wilcoxon's signed ranks. Groups that are not paired: difference of the means, Welch's t and interval,
    and the ranks of Mann and Whitney. The effect size is Cohen's d. p values are not corrected for the number
    of values that are compared.
    """
    asked = study.table.compare
    assert asked is not None
    by, pair = asked.by, asked.pair
    rows_of = {row[ID]: row for row in study.subjects}
    names = list(study.table.settings) if by == BY_SETTING else sorted({row[by] for row in study.subjects})
    sides: dict[Key, dict[str, list[tuple[str, Curve]]]] = defaultdict(lambda: defaultdict(list))
    for (subject, motion, setting, _, *which), curve in without_samples(found).items():
        row = rows_of[subject]
        if by == BY_SETTING:
            sides[motion, *which, ""][setting].append((subject, curve))
        else:
            sides[motion, *which, setting][row[by]].append((row[pair] if pair else subject, curve))
    paired = by == BY_SETTING or pair is not None
    rows: list[Sequence[Any]] = []
    for (*which, _), by_name in sides.items():
        first, second = (by_name[name] for name in names)
        rows += [(*which, *row) for row in _differences(names, first, second, paired=paired)]
    return Table(COMPARED, rows)


def _differences(
    names: Sequence[str],
    first: Sequence[tuple[str, Curve]],
    second: Sequence[tuple[str, Curve]],
    *,
    paired: bool,
) -> Iterator[Sequence[Any]]:
    """Give a row per value and measure, at the values that all curves have."""
    everything = [curve["value"] for _, curve in (*first, *second)]
    if not first or not second:
        return
    if paired:
        known = dict(second)
        first = [(mate, curve) for mate, curve in first if mate in known]
        second = [(mate, known[mate]) for mate, _ in first]
    if min(len(first), len(second)) < FEWEST:
        return
    for value in everything[0]:
        if all(np.isclose(one, value).any() for one in everything):
            for measure in MEASURES:
                a, b = (
                    np.array([one[measure][np.argmin(np.abs(one["value"] - value))] for _, one in side])
                    for side in (first, second)
                )
                yield (float(value), measure, *names, *_test(a, b, paired=paired))


def _test(a: Floats, b: Floats, *, paired: bool) -> tuple[float | None, ...]:
    """Return what COMPARED has from ``n_first`` on; None where nothing differs, and nothing can be tested."""
    difference = float(b.mean() - a.mean())
    sd = float((b - a).std(ddof=1) if paired else np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / 2.0))
    shown = len(a), len(b), float(a.mean()), float(b.mean()), difference, sd
    if sd == 0.0:
        return *shown, difference, difference, None, None, None, None
    t = stats.ttest_rel(b, a) if paired else stats.ttest_ind(b, a, equal_var=False)
    ranks = stats.wilcoxon(b - a) if paired else stats.mannwhitneyu(b, a)
    found = *t.confidence_interval(0.95), t.statistic, t.pvalue, ranks.pvalue, difference / sd
    return *shown, *map(float, found)


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
