"""The table of a study: CSV, Markdown and reStructuredText."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from vtkmuscle.io.writing import write_text
from vtkmuscle.tradeoff.measures import COSTS, MEASURES, Measure
from vtkmuscle.tradeoff.study import Row, Study, in_words

_MEMORY = Measure("memory_mb", "memory added at the peak, of the process [MB]")
COLUMNS = (*COSTS, _MEMORY, *MEASURES[len(COSTS) :])


def write_tables(out: Path, study: Study) -> list[Path]:
    """Write ``tradeoff.csv``, ``tradeoff.md``, ``tradeoff.rst`` and ``estimates.csv``; return their paths."""
    texts = {
        "tradeoff.csv": as_csv(study),
        "tradeoff.md": as_markdown(study),
        "tradeoff.rst": as_rst(study),
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
    lines += [f"- {in_words(doubling)}" for doubling in study.doublings] + [""]
    lines += ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(_cells(row)) + " |" for row in study.rows]
    lines += ["", *(f"- `{column.name}`: {column.words}" for column in COLUMNS)]
    return "\n".join(lines) + "\n"


def as_rst(study: Study) -> str:
    """Return the same as a list-table."""
    names = ["setting", *(column.name for column in COLUMNS)]
    lines = [f"{in_words(doubling)}." for doubling in study.doublings]
    lines += ["", ".. list-table::", "   :header-rows: 1", "   :class: small", ""]
    for cells in (names, *(_cells(row) for row in study.rows)):
        lines += [f"   {'*' if i == 0 else ' '} - {cell}" for i, cell in enumerate(cells)]
    return "\n".join(lines) + "\n"


def _cells(row: Row) -> list[str]:
    figures = row.figures["all"]
    return [row.setting.name, *(_short(figures.get(column.name)) for column in COLUMNS)]


def _exact(value: Any) -> str:
    return "" if value is None else f"{value:.6g}"


def _short(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"
