"""The table of a study: CSV and Markdown."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from vtkmuscle.io.writing import write_text
from vtkmuscle.tradeoff.measures import MEASURES
from vtkmuscle.tradeoff.study import Row, Study, in_words


def write_tables(out: Path, study: Study) -> list[Path]:
    """Write ``tradeoff.csv`` and ``tradeoff.md``; return their paths."""
    texts = {"tradeoff.csv": as_csv(study), "tradeoff.md": as_markdown(study)}
    for name, text in texts.items():
        write_text(out / name, text)
    return [out / name for name in texts]


def as_csv(study: Study) -> str:
    """Return a row per setting for all muscles together, then one for each muscle."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["muscle", "group", "setting", *(column.name for column in MEASURES)])
    for muscle in ("all", *study.muscles):
        for row in study.rows:
            figures = row.figures["all"] if muscle == "all" else row.figures["muscles"][muscle]
            values = [_exact(figures[column.name]) for column in MEASURES]
            writer.writerow([muscle, row.setting.group, row.setting.name, *values])
    return text.getvalue()


def as_markdown(study: Study) -> str:
    """Return a table of all muscles together, with what its columns are."""
    names = ["setting", *(column.name for column in MEASURES)]
    lines = [f"# {study.scene}: {', '.join(study.muscles)}", ""]
    lines += [f"- {remark}" for remark in _remarks(study)] + [""]
    lines += ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(_cells(row)) + " |" for row in study.rows]
    lines += ["", *(f"- `{column.name}`: {column.words}" for column in MEASURES)]
    return "\n".join(lines) + "\n"


def _remarks(study: Study) -> list[str]:
    return [in_words(doubling) for doubling in study.doublings]


def _cells(row: Row) -> list[str]:
    figures = row.figures["all"]
    return [row.setting.name, *(_short(figures[column.name]) for column in MEASURES)]


def _exact(value: Any) -> str:
    return "" if value is None else f"{value:.6g}"


def _short(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"
