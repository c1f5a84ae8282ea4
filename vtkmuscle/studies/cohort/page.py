"""The page of a cohort: subjects, problems, unusual curves, distributions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from vtkmuscle.report.sections import Section, shown_rows, svg_of, write_page
from vtkmuscle.run.table import Table
from vtkmuscle.run.verdict import FAILED, VERDICTS
from vtkmuscle.studies.case import Case, Outcome
from vtkmuscle.studies.cohort.subjects import FOLDER, ID, Study
from vtkmuscle.studies.cohort.table import UNUSUAL, Curve, Key, by_subject, outliers

#: Most unusual curves that are listed, curves that are drawn, and subjects that a legend names.
_OUTLIERS, _DRAWN, _NAMED = 50, 200, 10


def write_cohort(
    study: Study,
    muscles: Sequence[tuple[Case, Outcome]],
    measured: Mapping[Key, Curve],
    spread: Table | None,
    path: Path,
) -> Path:
    """Write the page; with the spread of samples, if the study asks for sensitivity."""
    verdicts = Counter(_verdict(one) for case, one in muscles if not case.variation.name)
    counts = ", ".join(f"{verdicts[word]} {word}" for word in VERDICTS)
    files = "cohort.csv" if spread is None else "cohort.csv, sensitivity.csv"
    rows, flags, warned = shown_rows(outliers(measured)), _flags(muscles), _warnings(muscles)
    unusual = f"More than {UNUSUAL} robust standard deviations from the subjects' median, at their worst"
    thin = (
        "A thin line per subject, named where the pointer is on it; the median; and the band from the 5th to "
        "the 95th percentile. Muscles that failed are left out."
    )
    sections = [
        Section("Subjects", "Worst verdicts", list(_subjects(study, muscles)), words=True),
        Section("What to look at", "Failures first" if flags else "Nothing.", flags, words=True),
        *([Section("Warnings", rows=warned, words=True)] if warned else ()),
        Section(
            "Unusual curves", unusual if rows[1:] else "None.", rows[: _OUTLIERS + 1] if rows[1:] else ()
        ),
        Section("Distributions", thin, drawings=list(_bands(measured))),
        *(() if spread is None else [Section("Sensitivity", rows=shown_rows(spread))]),
    ]
    lead = f"{len(study.subjects)} subjects. Muscles: {counts}. All numbers are in {files}."
    return write_page(path, study.name, "cohort", lead, sections)


def _verdict(one: Outcome) -> str:
    return str(one.values.get("verdict", FAILED))


def _subjects(study: Study, muscles: Sequence[tuple[Case, Outcome]]) -> Iterator[list[str]]:
    """Give the table of subjects, with the worst verdict of each of their muscles."""
    worst: dict[tuple[str, str], str] = {}
    for case, one in muscles:
        key = case.labels["subject"], case.muscle or "all muscles"
        worst[key] = max(worst.get(key, VERDICTS[0]), _verdict(one), key=VERDICTS.index)
    names = list(dict.fromkeys(muscle for _, muscle in worst))
    columns = [name for name in study.subjects[0] if name not in (ID, FOLDER)]
    yield ["subject", *columns, *names]
    for row in study.subjects:
        told = [worst.get((row[ID], name), "") for name in names]
        yield [row[ID], *(row[name] for name in columns), *told]


def _flags(muscles: Sequence[tuple[Case, Outcome]]) -> list[Sequence[str]]:
    """Return the table of problems: failures first, then values by how far they are beyond their limit."""
    flags: list[tuple[str, float, Sequence[str]]] = []
    for case, one in muscles:
        who = (*case.labels.values(), case.muscle)
        if one.failure:
            flags.append((FAILED, np.inf, (*who, one.failure)))
        for reason in one.values.get("reasons", ()):
            limit, value = float(reason["limit"]), float(reason["value"])
            beyond = max(value / limit, limit / value) if limit > 0 and value > 0 else np.inf
            flags.append((reason["verdict"], beyond, (*who, f"{reason['says']}; {reason['do']}")))
    flags.sort(key=lambda flag: (-VERDICTS.index(flag[0]), -flag[1]))
    head = "verdict", "subject", "motion", "setting", "sample", "muscle", "what"
    return [head, *((level, *row) for level, _, row in flags)] if flags else []


def _warnings(muscles: Sequence[tuple[Case, Outcome]]) -> list[Sequence[str]]:
    counts = Counter(remark for _, one in muscles for remark in one.values.get("remarks", ()))
    rows = [(words, str(count)) for words, count in counts.most_common()]
    return [("warning", "times"), *rows] if rows else []


def _bands(measured: Mapping[Key, Curve]) -> Iterator[tuple[str, str]]:
    """Give titles and drawings, each of lengths and moment arms over all subjects."""
    for (motion, setting, muscle, group, coordinate), ones in by_subject(measured).items():
        words = muscle, motion, setting, f"group {group}" if group else ""
        title = f"{', '.join(part for part in words if part)} ({len(ones)} subjects)"
        yield title.replace("_", " "), _drawn(coordinate, ones)


def _drawn(coordinate: str, curves: Mapping[str, Curve]) -> str:
    """Return an SVG: each curve thin, the median, and the band that holds 90 % of them."""
    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    ones = list(curves.values())
    same = len({one["value"].tobytes() for one in ones}) == 1 and len(ones) >= 3
    few = len(ones) <= _NAMED
    names: dict[str, str] = {}
    measures = (("length_mm", "length [mm]"), ("moment_arm_mm", "moment arm [mm]"))
    for axes, (measure, label) in zip(figure.subplots(1, 2), measures, strict=True):
        for number, (subject, one) in enumerate(list(curves.items())[:_DRAWN]):
            style = (
                {"color": f"C{number}", "linewidth": 1.2} if few else {"color": "#4a6b8a", "linewidth": 0.6}
            )
            gid = f"{measure}-{number}"
            axes.plot(one["value"], one[measure], alpha=0.9 if few else 0.4, label=subject, gid=gid, **style)
            names[gid] = subject
        if same:
            low, middle, high = np.percentile([one[measure] for one in ones], (5, 50, 95), axis=0)
            axes.fill_between(ones[0]["value"], low, high, color="#4a6b8a", alpha=0.2, linewidth=0)
            axes.plot(ones[0]["value"], middle, color="#16324f", linewidth=1.8)
        axes.set_xlabel(coordinate.replace("_", " "), fontsize=8)
        axes.set_ylabel(label, fontsize=8)
        axes.tick_params(labelsize=7)
    if few:
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", fontsize=7, frameon=False)
    return svg_of(figure, coordinate, names)
