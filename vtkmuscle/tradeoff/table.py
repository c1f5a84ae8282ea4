"""The table of a study: CSV, Markdown and reStructuredText."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vtkmuscle.io.writing import write_text
from vtkmuscle.tradeoff.estimates import estimates_in_words
from vtkmuscle.tradeoff.measures import COSTS, MEASURES, Measure
from vtkmuscle.tradeoff.settings import CENTRE
from vtkmuscle.tradeoff.study import Row, Study, in_words

_MEMORY = Measure("memory_mb", "memory added at the peak, of the process [MB]")
#: What the table of the presets shows, and its headings.
_OF_PRESETS = {
    "ms_per_frame": "ms per step",
    "rms_mm": "RMS distance [mm]",
    "max_mm": "greatest distance [mm]",
    "volume_error_pct": "volume error [%]",
    "penetration_p95_mm": "depth in bones, p95 [mm]",
    "penetration_max_mm": "greatest depth [mm]",
    "fibre_length_mm": "error of the mean fibre length [mm]",
}
COLUMNS = (*COSTS, _MEMORY, *MEASURES[len(COSTS) :])


def write_tables(out: Path, study: Study) -> list[Path]:
    """Write ``tradeoff.csv``, ``.md``, ``.rst``, ``presets.rst``, ``estimates.csv``; return their paths."""
    texts = {
        "tradeoff.csv": as_csv(study),
        "tradeoff.md": as_markdown(study),
        "tradeoff.rst": as_rst(study),
        "presets.rst": presets_as_rst(study),
        "estimates.csv": estimates_as_csv(study),
    }
    paths = []
    for name, text in texts.items():
        write_text(out / name, text)
        paths.append(out / name)
    return paths


def as_csv(study: Study) -> str:
    """Return a row per setting for all muscles together, then one for each muscle."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["muscle", "group", "setting", *(column.name for column in COLUMNS)])
    for muscle in ("all", *study.muscles):
        for row in study.rows:
            figures = row.figures["all"] if muscle == "all" else row.figures["muscles"][muscle]
            values = [_exact(figures.get(column.name)) for column in COLUMNS]
            writer.writerow([muscle, row.setting.group, row.setting.name, *values])
    return text.getvalue()


def estimates_as_csv(study: Study) -> str:
    """Return the estimated and the true distance to the reference for each setting, muscle and frame."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["setting", "muscle", "time", "estimated_mm", "true_mm"])
    for row in study.rows:
        for muscle, figures in row.figures["muscles"].items():
            for frame in figures["frames"]:
                if frame["estimated_mm"] is not None:
                    values = map(_exact, (frame["estimated_mm"], frame["rms_mm"]))
                    writer.writerow([row.setting.name, muscle, frame["time"], *values])
    return text.getvalue()


def as_markdown(study: Study) -> str:
    """Return a table of all muscles together, with what its columns are."""
    names = ["setting", *(column.name for column in COLUMNS)]
    lines = [f"# {study.scene}: {', '.join(study.muscles)}", ""]
    lines += [f"- {remark}" for remark in _remarks(study)] + [""]
    lines += ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(_cells(row)) + " |" for row in study.rows]
    lines += ["", *(f"- `{column.name}`: {column.words}" for column in COLUMNS)]
    return "\n".join(lines) + "\n"


def as_rst(study: Study) -> str:
    """Return the same as a list-table."""
    names = ["setting", *(column.name for column in COLUMNS)]
    lines = [f"{remark}." for remark in _remarks(study)]
    return "\n".join([*lines, "", *_list_table([names, *(_cells(row) for row in study.rows)])]) + "\n"


def presets_as_rst(study: Study) -> str:
    """Return the presets and the reference, muscle by muscle, as a list-table."""
    shown = [measure for measure in MEASURES if measure.name in _OF_PRESETS]
    cells = [["preset", "muscle", "processor time / that of balanced", *(_OF_PRESETS[m.name] for m in shown)]]
    rows = [row for row in study.rows if row.setting.group in ("presets", "reference")]
    centre = next((row for row in rows if row.setting.name == CENTRE), None)
    for row in rows:
        for muscle in (*study.muscles, "all"):
            of = {r: r.figures["all"] if muscle == "all" else r.figures["muscles"][muscle] for r in rows}
            ratio = None if centre is None else of[row]["ms_per_frame"] / of[centre]["ms_per_frame"]
            values = [ratio, *(of[row][measure.name] for measure in shown)]
            cells.append([row.setting.name, muscle, *map(_short, values)])
    return "\n".join(_list_table(cells)) + "\n"


def _remarks(study: Study) -> list[str]:
    told = [in_words(doubling) for doubling in study.doublings]
    return told + [words for words in [estimates_in_words(study)] if words]


def _list_table(rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [".. list-table::", "   :header-rows: 1", "   :class: small", ""]
    for cells in rows:
        lines += [f"   {'*' if i == 0 else ' '} - {cell}".rstrip() for i, cell in enumerate(cells)]
    return lines


def _cells(row: Row) -> list[str]:
    figures = row.figures["all"]
    return [row.setting.name, *(_short(figures.get(column.name)) for column in COLUMNS)]


def _exact(value: Any) -> str:
    return "" if value is None else f"{value:.6g}"


def _short(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"
