"""The tables of a page: architecture, moment arms, quality, errors, and what was run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vtkmuscle.report.curves import MEASURES, MINUS, label_of

#: Architecture: the key in a report, what stands above the column, and the factor to its unit.
ARCHITECTURE = (
    ("muscle_volume_mm3", "volume [cm³]", 1e-3),
    ("pcsa_mm2", "PCSA [cm²]", 1e-2),
    ("pcsa_along_line_of_action_mm2", "PCSA along the line of action [cm²]", 1e-2),
    ("pcsa_without_tendon_mm2", "PCSA without tendon [cm²]", 1e-2),
    ("tendon_length_mm", "tendon [mm]", 1.0),
    ("fascicle_length_mm", "fascicle length [mm]", 1.0),
    ("volume_without_tendon_mm3", "volume without tendon [cm³]", 1e-3),
    ("centroid_path_length_mm", "centroid path [mm]", 1.0),
    ("section_area_mm2", "section area, mean [cm²]", 1e-2),
    ("section_density_per_mm2", "fibres per cm² of section, mean", 1e2),
    ("tendon_volume_share", "part of the volume that is tendon", 1.0),
    ("fascicle_length_normalised_mm", "fascicle length, normalised [mm]", 1.0),
)
#: Measures of fibres in the first frame, likewise.
FIBRES = (
    ("length_mm", "fibre length [mm]", 1.0),
    ("pennation_origin_deg", "pennation, origin [deg]", 1.0),
    ("pennation_insertion_deg", "pennation, insertion [deg]", 1.0),
    ("tortuosity", "length / distance of ends", 1.0),
)

#: Stands where there is no number.
DASH = "\u2013"


class Cell(NamedTuple):
    """A cell that is marked: its text, and ``"look"`` or ``"failed"``, or "" for no mark."""

    text: str
    mark: str


@dataclass(frozen=True)
class Sheet:
    """A table of a page, its head first; ``words`` where its cells are words rather than numbers.

    A cell that is one of the words look and failed is marked by itself.
    """

    title: str
    rows: Sequence[Sequence[str | Cell]]
    note: str = ""
    words: bool = False


def number(value: Any, digits: int = 3) -> str:
    """Return a number as a table has it, with a sign that aligns; a dash where there is none."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return DASH
    size = abs(float(value))
    if size < 5e-7:
        return "0"
    if size >= 10.0 ** (digits - 1):
        return f"{value:,.0f}".replace(",", "\u202f").replace("-", MINUS)
    places = max(0, digits - 1 - int(np.floor(np.log10(size))))
    text = f"{value:.{places}f}" if size >= 1e-3 else f"{value:.1e}"
    return text.replace("-", MINUS)


def tables_of(report: Mapping[str, Any]) -> list[Sheet]:
    """Return the tables of results of a run, from its report: those that there is something for."""
    muscles = report["muscles"]
    sheets = (_architecture(muscles), _moment_arms(muscles), _quality(muscles))
    return [sheet for sheet in sheets if len(sheet.rows) > 1]


def errors_of(report: Mapping[str, Any]) -> list[Sheet]:
    """Return the errors of mean lengths, and the checks that were not made, where there are some."""
    muscles = report["muscles"]
    rows: list[tuple[str, ...]] = [("muscle", "mean of", "segment error [mm]", "sampling error [mm]")]
    rows += [
        (label_of(name), label_of(quantity), *(number(error, 2) for error in errors.values()))
        for name, muscle in muscles.items()
        for quantity, errors in muscle.get("errors", {}).items()
    ]
    note = (
        "Segment error: bound on the length that straight segments miss of a curve. Sampling error: standard "
        "deviation over the fibres / sqrt(number of fibres). Root mean squares over the frames."
    )
    checks = {name: muscle.get("verdict", {}).get("not_checked", {}) for name, muscle in muscles.items()}
    sheets = (Sheet("Errors of mean lengths", rows, note), _reasons("What was not checked", "check", checks))
    return [sheet for sheet in sheets if len(sheet.rows) > 1]


def _reasons(title: str, what: str, of_muscles: Mapping[str, Mapping[str, str]]) -> Sheet:
    muscles: dict[tuple[str, str], list[str]] = {}
    for name, reasons in of_muscles.items():
        for one, why in reasons.items():
            muscles.setdefault((one, str(why)), []).append(label_of(name))
    rows = [
        (label_of(one), why, "all muscles" if len(names) == len(of_muscles) else ", ".join(names))
        for (one, why), names in muscles.items()
    ]
    return Sheet(title, [(what, "why", "of"), *rows], words=True)


def run_tables_of(report: Mapping[str, Any]) -> list[Sheet]:
    """Return the versions that a run was made with, and its files with their hashes."""
    versions = [(name, str(version)) for name, version in report["versions"].items()]
    sheets = [Sheet("Versions", [("of", "version"), *versions], words=True)]
    if report.get("seconds"):
        seconds = [(name, f"{number(value)} s") for name, value in report["seconds"].items()]
        sheets.append(Sheet("Time", [("for", "by the clock"), *seconds], words=True))
    if report["files"]:
        hashes = report.get("sha256", {})
        files = [(key, Path(path).name, hashes.get(key, DASH)) for key, path in report["files"].items()]
        rows = [("key of the scene", "file", "SHA-256"), *files]
        note = f"Read from {report['scene_file']}." if report.get("scene_file") else ""
        sheets.append(Sheet("Inputs", rows, note, words=True))
    return sheets


def settings_of(report: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return all parameters of muscles, those that several share once."""
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


def _architecture(muscles: Mapping[str, Any]) -> Sheet:
    known = {name: muscle.get("architecture") or {} for name, muscle in muscles.items()}
    measures = {name: (muscle.get("fibre_measures") or [{}])[0] for name, muscle in muscles.items()}
    columns = [column for column in ARCHITECTURE if any(column[0] in one for one in known.values())]
    of_fibres = [column for column in FIBRES if any(column[0] in one for one in measures.values())]
    rows: list[tuple[str, ...]] = [("muscle", "fibres", *(head for _, head, _ in (*columns, *of_fibres)))]
    for name, muscle in muscles.items():
        count = (muscle.get("fibres") or {}).get("fibres")
        if not (known[name] or count):
            continue
        cells = [
            number(_mean(known[name][key]) * scale) if key in known[name] else DASH
            for key, _, scale in columns
        ]
        for key, _, scale in of_fibres:
            one = measures[name].get(key)
            cells.append(f"{number(one['mean'] * scale)} ± {number(one['sd'] * scale, 2)}" if one else DASH)
        rows.append((label_of(name), str(count or DASH), *cells))
    note = (
        "Of the muscle at rest; lengths, pennation and tortuosity in the first frame, mean ± standard "
        "deviation over the fibres."
    )
    return Sheet("Architecture", rows, note)


def _mean(value: Any) -> float:
    return float(value["mean"]) if isinstance(value, Mapping) else float(value)


def _moment_arms(muscles: Mapping[str, Any]) -> Sheet:
    ends = ("mean", "least", "largest", "sampling error", "difference from -dl/dq", "left by a quartic")
    rows: list[tuple[str, ...]] = [("muscle", "coordinate", "range", *ends)]
    for name, muscle in muscles.items():
        for coordinate, found in (muscle.get("moment_arms") or {}).items():
            low, high = map(number, found["values"])
            rows.append(
                (
                    label_of(name),
                    f"{label_of(coordinate)} [{found['unit']}]",
                    f"{low} to {high}",
                    *(number(found[key]) for key in ("mean_mm", "min_mm", "max_mm")),
                    number(found["sampling_error_mm"], 2),
                    number(found["slope_difference_mm"], 2),
                    number(found.get("quartic_residual_mean_mm"), 2),
                )
            )
    note = (
        "Levers of the pulls of all paths in all frames; positive where the muscle drives the coordinate up. "
        "-dl/dq is taken between frames; the difference is a root mean square."
    )
    return Sheet("Moment arms [mm]", rows, note)


def _quality(muscles: Mapping[str, Any]) -> Sheet:
    listed = [one for one in MEASURES if one.head]
    series = {
        name: {one: one(_column(muscle["frames"], one.key)) for one in listed}
        for name, muscle in muscles.items()
    }
    columns = [one for one in listed if any(len(found[one]) for found in series.values())]
    rows: list[tuple[str | Cell, ...]] = [("muscle", "frames", *(one.head for one in columns))]
    for name, muscle in muscles.items():
        reasons = muscle.get("verdict", {}).get("reasons", ())
        marks = {reason["check"]: reason["verdict"] for reason in reasons}
        cells = [
            Cell(number(float(one.of_all(values))), marks.get(one.check, ""))
            if len(values := series[name][one])
            else DASH
            for one in columns
        ]
        rows.append((label_of(name), str(len(muscle["frames"])), *cells))
    note = "The worst of all frames where nothing else is said; coloured where it is a reason to look."
    return Sheet("Quality", rows, note)


def _column(frames: Iterable[Mapping[str, Any]], key: str) -> Any:
    return np.array([row[key] for row in frames if row.get(key) is not None], dtype=np.float64)
