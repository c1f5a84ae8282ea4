"""Statistics of a study: what is unusual, what results owe to their inputs, and how two groups differ."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from vtkmuscle.cohort.study import BY_SETTING, ID, Study
from vtkmuscle.cohort.tables import read_table
from vtkmuscle.core.types import Floats
from vtkmuscle.run.table import Table

#: The measures that are compared.
MEASURES = ("length_mm", "moment_arm_mm")
#: A value is unusual where it is so many robust standard deviations from the median (Iglewicz, Hoaglin 1993,
#: "How to detect and handle outliers": 3.5, with 0.6745 MAD in place of the standard deviation).
UNUSUAL, _MAD = 3.5, 0.6745
#: Fewest subjects of which something can be said.
_FEWEST = 3

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


def write_statistics(study: Study, out: Path) -> None:
    """Write comparison.csv and sensitivity.csv, where the study asks for them; remove old ones else."""
    for name, wanted, make in (
        ("comparison.csv", study.compare, compared),
        ("sensitivity.csv", study.sensitivity, spreads),
    ):
        if wanted is None:
            (out / name).unlink(missing_ok=True)
        else:
            make(study, out).write(out / name)


def curves(out: Path, *, samples: bool = False) -> dict[Key, dict[str, Floats]]:
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
    table = read_table(out / "cohort.parquet").to_pydict()
    found: dict[Key, list[tuple[float, ...]]] = defaultdict(list)
    names = ("subject", "motion", "setting", "sample", "muscle", "fibre_group", "coordinate")
    for i, verdict in enumerate(table["verdict"]):
        if verdict == "failed" or table["coordinate"][i] is None or (table["sample"][i] and not samples):
            continue
        numbers = tuple(table[name][i] for name in ("value", *MEASURES))
        found[tuple(table[name][i] for name in names)].append(numbers)
    columns = ("value", *MEASURES)
    return {
        key: {name: np.array(rows)[:, i] for i, name in enumerate(columns)} for key, rows in found.items()
    }


def outliers(found: Mapping[Key, Mapping[str, Floats]]) -> list[dict[str, Any]]:
    """Return the curves that differ most from those of the other subjects, the most unusual first.

    A curve counts by its worst value, in robust standard deviations from the median over the subjects.
    """
    alike: dict[Key, dict[str, Mapping[str, Floats]]] = defaultdict(dict)
    for (subject, *rest), curve in found.items():
        alike[tuple(rest)][subject] = curve
    listed = []
    for rest_of, by_subject in alike.items():
        lengths = {len(one["value"]) for one in by_subject.values()}
        if len(by_subject) < _FEWEST or len(lengths) != 1:
            continue
        for measure in MEASURES:
            values = np.array([one[measure] for one in by_subject.values()])
            median = np.median(values, axis=0)
            spread = np.median(np.abs(values - median), axis=0)
            scores = _MAD * np.abs(values - median) / np.maximum(spread, 1e-9)
            for subject, score in zip(by_subject, scores, strict=True):
                at = int(score.argmax())
                if score[at] > UNUSUAL:
                    motion, setting, _, muscle, group, coordinate = rest_of
                    listed.append(
                        {
                            "subject": subject,
                            "motion": motion,
                            "setting": setting,
                            "muscle": muscle,
                            "fibre_group": group,
                            "coordinate": coordinate,
                            "measure": measure,
                            "at": float(by_subject[subject]["value"][at]),
                            "value": float(by_subject[subject][measure][at]),
                            "median": float(median[at]),
                            "score": float(score[at]),
                        }
                    )
    return sorted(listed, key=lambda one: -one["score"])


def compared(study: Study, out: Path) -> Table:
    """Return how two groups, or two settings, differ at each value of each coordinate.

    Settings are paired by subject, groups by the column ``pair`` of the study where it has one: mean and
    standard deviation of the differences (second - first), the 95 % interval of the mean, Student's paired t
    and Wilcoxon's signed ranks. Groups that are not paired: difference of the means, Welch's t and interval,
    and the ranks of Mann and Whitney. The effect size is Cohen's d. p values are not corrected for the number
    of values that are compared.
    """
    assert study.compare is not None
    grouped: dict[Key, dict[str, dict[str, list[tuple[str, Mapping[str, Floats]]]]]] = defaultdict(
        lambda: {"": defaultdict(list)}
    )
    by, pair = study.compare.by, study.compare.pair
    rows_of = {row[ID]: row for row in study.subjects}
    names = list(study.settings) if by == BY_SETTING else sorted({row[by] for row in study.subjects})
    for (subject, motion, setting, _, muscle, group, coordinate), curve in curves(out).items():
        of = setting if by == BY_SETTING else rows_of[subject][by]
        mate = subject if by == BY_SETTING else rows_of[subject][pair] if pair else subject
        key = motion, muscle, group, coordinate, "" if by == BY_SETTING else setting
        grouped[key][""][of].append((mate, curve))
    paired = by == BY_SETTING or pair is not None
    rows: list[Sequence[Any]] = []
    for (motion, muscle, group, coordinate, _), by_group in grouped.items():
        first, second = (by_group[""][name] for name in names)
        rows += [
            (motion, muscle, group, coordinate, *row)
            for row in _differences(names, first, second, paired=paired)
        ]
    return Table(COMPARED, rows)


def _differences(
    names: Sequence[str],
    first: Sequence[tuple[str, Mapping[str, Floats]]],
    second: Sequence[tuple[str, Mapping[str, Floats]]],
    *,
    paired: bool,
) -> Iterator[Sequence[Any]]:
    """Give a row per value and measure, at the values that all curves have."""
    everything = [*first, *second]
    if not first or not second:
        return
    shared = [
        value
        for value in everything[0][1]["value"]
        if all(np.isclose(one["value"], value).any() for _, one in everything)
    ]
    if paired:
        known = dict(second)
        first = [(mate, curve) for mate, curve in first if mate in known]
        second = [(mate, known[mate]) for mate, _ in first]
    for value in shared:
        for measure in MEASURES:
            a, b = (
                np.array([one[measure][np.argmin(np.abs(one["value"] - value))] for _, one in side])
                for side in (first, second)
            )
            if min(len(a), len(b)) >= _FEWEST:
                yield (float(value), measure, *names, *_test(a, b, paired=paired))


def _test(a: Floats, b: Floats, *, paired: bool) -> tuple[float | None, ...]:
    """Return what COMPARED has from ``n_first`` on; None where nothing differs, and nothing can be tested."""
    difference = float(b.mean() - a.mean())
    if paired:
        between = b - a
        sd = float(between.std(ddof=1))
        if sd == 0.0:
            tests: tuple[float | None, ...] = (difference, difference, None, None, None, None)
        else:
            t = stats.ttest_rel(b, a)
            low, high = t.confidence_interval(0.95)
            ranks = stats.wilcoxon(between)
            tests = low, high, t.statistic, t.pvalue, ranks.pvalue, difference / sd
    else:
        sd = float(np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / 2.0))
        if sd == 0.0:
            tests = (difference, difference, None, None, None, None)
        else:
            t = stats.ttest_ind(b, a, equal_var=False)
            low, high = t.confidence_interval(0.95)
            tests = low, high, t.statistic, t.pvalue, stats.mannwhitneyu(b, a).pvalue, difference / sd
    numbers = tuple(None if one is None else float(one) for one in tests)
    return len(a), len(b), float(a.mean()), float(b.mean()), difference, sd, *numbers


def spreads(study: Study, out: Path) -> Table:
    """Return standard deviations over the samples of each cause, the causes ranked by moment arm."""
    gathered: dict[Key, dict[str, list[Mapping[str, Floats]]]] = defaultdict(lambda: defaultdict(list))
    for (subject, motion, setting, sample, muscle, group, coordinate), curve in curves(
        out, samples=True
    ).items():
        if sample:
            cause = sample.partition(" ")[0]
            gathered[subject, motion, setting, muscle, group, coordinate][cause].append(curve)
    rows: list[Sequence[Any]] = []
    for key, causes in gathered.items():
        found = []
        for cause, samples in causes.items():
            if len(samples) < _FEWEST or len({len(one["value"]) for one in samples}) != 1:
                continue
            length, arm = (
                float(np.std([one[measure] for one in samples], axis=0, ddof=1).mean())
                for measure in MEASURES
            )
            found.append((cause, len(samples), length, arm))
        found.sort(key=lambda one: -one[3])
        rows += [(*key, *one, rank + 1) for rank, one in enumerate(found)]
    return Table(SPREADS, rows)
