"""Tables of a page: architecture, moment arms, quality, errors and inputs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.report.curves import MEASURES, MINUS, QUANTITIES, label_of
from vtkmuscle.report.sections import Cell, Section

#: Placeholder for a missing number.
DASH = "\u2013"


def number(value: Any, digits: int = 3) -> str:
    """Return a number as text, or a dash."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return DASH
    size = abs(float(value))
    if size < 5e-7:
        return "0"
    if size >= 10.0 ** (digits - 1):
        return f"{value:,.0f}".replace(",", "\u202f").replace("-", MINUS)
    decimals = max(0, digits - 1 - int(np.floor(np.log10(size))))
    text = f"{value:.{decimals}f}" if size >= 1e-3 else f"{value:.1e}"
    return text.replace("-", MINUS)


def tables_of(report: Mapping[str, Any]) -> list[Section]:
    """Return the non-empty tables of results, from a run's report."""
    muscles = report["muscles"]
    sheets = (_architecture(muscles), _moment_arms(muscles), _quality(muscles))
    return [sheet for sheet in sheets if len(sheet.rows) > 1]


def errors_of(report: Mapping[str, Any]) -> list[Section]:
    """Return tables of errors and omitted checks."""
    muscles = report["muscles"]
    rows: list[tuple[str, ...]] = [("muscle", "mean", "error (95 %)", "model", "sampling", "numerical")]
    for name, muscle in muscles.items():
        errors = {"change of length": muscle.get("errors")} | {
            f"moment arm, {label_of(coordinate)}": arms["errors"]
            for coordinate, arms in (muscle.get("moment_arms") or {}).items()
        }
        for quantity, sizes in errors.items():
            if sizes:
                rows.append((label_of(name), quantity, *(number(size, 2) for size in sizes.values())))
    checks = {name: muscle.get("verdict", {}).get("not_checked", {}) for name, muscle in muscles.items()}
    means = Section("Errors of means over the paths [mm]", report["definitions"]["errors"], rows)
    sheets = means, _reasons("Not checked", "check", checks)
    return [sheet for sheet in sheets if len(sheet.rows) > 1]


def _reasons(title: str, what: str, of_muscles: Mapping[str, Mapping[str, str]]) -> Section:
    muscles: dict[tuple[str, str], list[str]] = {}
    for name, reasons in of_muscles.items():
        for check, why in reasons.items():
            muscles.setdefault((check, str(why)), []).append(label_of(name))
    rows = [
        (label_of(check), why, "all muscles" if len(names) == len(of_muscles) else ", ".join(names))
        for (check, why), names in muscles.items()
    ]
    return Section(title, rows=[(what, "why", "muscles"), *rows], words=True)


def run_tables_of(report: Mapping[str, Any]) -> list[Section]:
    """Return the tables of versions, times and input files with hashes."""
    versions = [(name, str(version)) for name, version in report["versions"].items()]
    sheets = [Section("Versions", rows=[("of", "version"), *versions], words=True)]
    if report.get("seconds"):
        seconds = [(name, f"{number(value)} s") for name, value in report["seconds"].items()]
        sheets.append(Section("Time", rows=[("for", "by the clock"), *seconds], words=True))
    if report["files"]:
        hashes = report.get("sha256", {})
        files = [(key, Path(path).name, hashes.get(key, DASH)) for key, path in report["files"].items()]
        rows = [("key of the scene", "file", "SHA-256"), *files]
        note = f"Read from {report['scene_file']}." if report.get("scene_file") else ""
        sheets.append(Section("Inputs", note, rows, words=True))
    return sheets


def settings_of(report: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the parameters of muscles, grouped by equal parameters."""
    groups: dict[str, list[str]] = {}
    for name, muscle in report["muscles"].items():
        parameters = json.dumps(muscle.get("parameters", {}), sort_keys=True, default=str)
        groups.setdefault(parameters, []).append(label_of(name))
    return [(", ".join(names), list(_flat(json.loads(text)))) for text, names in groups.items()]


def _flat(values: Mapping[str, Any], before: str = "") -> Iterable[tuple[str, str]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", "none" if value is None else str(value)


def _architecture(muscles: Mapping[str, Any]) -> Section:
    wholes = {name: muscle.get("architecture") or {} for name, muscle in muscles.items()}
    measures = {name: (muscle.get("fibre_measures") or [{}])[0] for name, muscle in muscles.items()}
    columns = [
        column for column in QUANTITIES["architecture"] if any(column[0] in keys for keys in wholes.values())
    ]
    of_fibres = [
        column for column in QUANTITIES["fibres"] if any(column[0] in keys for keys in measures.values())
    ]
    rows: list[tuple[str, ...]] = [("muscle", "fibres", *(head for _, head, _ in (*columns, *of_fibres)))]
    for name, muscle in muscles.items():
        count = (muscle.get("fibres") or {}).get("fibres")
        whole, spreads = wholes[name], measures[name]
        if not (whole or count):
            continue
        of_muscle = (whole, columns), (spreads, of_fibres)
        cells = [_ranged(found, key, scale) for found, listed in of_muscle for key, _, scale in listed]
        rows.append((label_of(name), str(count or DASH), *cells))
    note = "At rest; fibres in the first frame. In brackets: range over the fibres, or of the estimate."
    return Section("Architecture", note, rows)


def _ranged(measures: Mapping[str, Any], key: str, scale: float) -> str:
    """Return a measure, or its mean, and its range as text."""
    found, ends = measures.get(key), measures.get(key.replace("_mm", "_range_mm"))
    if isinstance(found, Mapping):
        found, ends = found["mean"], ends or [found["min"], found["max"]]
    sides = ends if isinstance(ends, list) else []
    text, *sides = [number(each and each * scale) for each in (found, *sides)]
    return f"{text} ({' to '.join(sides)})" if len({*sides}) > 1 else text


def _moment_arms(muscles: Mapping[str, Any]) -> Section:
    ends = ("error of the mean (95 %)", "difference from -dl/dq", "residual of a quartic")
    rows: list[tuple[str, ...]] = [("muscle", "coordinate", "range", "mean", "least", "largest", *ends)]
    for name, muscle in muscles.items():
        for coordinate, arms in (muscle.get("moment_arms") or {}).items():
            low, high = map(number, arms["values"])
            sizes = [number(arms[key]) for key in ("mean_mm", "min_mm", "max_mm")]
            errors = (
                arms["errors"]["total_mm"],
                arms["slope_difference_mm"],
                arms["quartic_residual_mean_mm"],
            )
            sizes += [number(error, 2) for error in errors]
            names = (label_of(name), f"{label_of(coordinate)} [{arms['unit']}]", f"{low} to {high}")
            rows.append((*names, *sizes))
    note = (
        "Levers of all paths in all frames; positive for a muscle that increases the coordinate. "
        "-dl/dq is taken between frames; the difference is a root mean square."
    )
    return Section("Moment arms [mm]", note, rows)


def _quality(muscles: Mapping[str, Any]) -> Section:
    listed = [measure for measure in MEASURES if measure.head]
    series = {
        name: {measure: measure(_column(muscle["frames"], measure.key)) for measure in listed}
        for name, muscle in muscles.items()
    }
    columns = [measure for measure in listed if any(len(values[measure]) for values in series.values())]
    rows: list[tuple[str | Cell, ...]] = [("muscle", "frames", *(measure.head for measure in columns))]
    for name, muscle in muscles.items():
        reasons = muscle.get("verdict", {}).get("reasons", ())
        marks = {reason["check"]: reason["verdict"] for reason in reasons}
        cells = [
            Cell(number(float(getattr(np, measure.of_all)(np.abs(values)))), marks.get(measure.check, ""))
            if len(values := series[name][measure])
            else DASH
            for measure in columns
        ]
        rows.append((label_of(name), str(len(muscle["frames"])), *cells))
    return Section("Quality", "Worst frame unless stated otherwise; a coloured value needs a check.", rows)


def _column(frames: Iterable[Mapping[str, Any]], key: str) -> Any:
    return np.array([row[key] for row in frames if row.get(key) is not None], dtype=np.float64)
