"""What a setting costs and how wrong it is, against the reference."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vtkmuscle.tradeoff.trial import Trial


@dataclass(frozen=True)
class Measure:
    """A column of the table.

    Attributes
    ----------
    name : str
        Of the column.
    words : str
        What it is, with its unit.
    worst : str
        How muscles are taken together: ``"sum"``, ``"rms"`` or ``"max"``.
    figure : str
        Key of a frame's figures in the report whose greatest value over the frames it is; empty where it is
        worked out otherwise.
    """

    name: str
    words: str
    worst: str = "max"
    figure: str = ""


COSTS = (
    Measure("ms_per_frame", "processor time per step of the motion, all muscles [ms]", "sum"),
    Measure("fibre_ms", "the same, to carry and measure their fibres in a frame [ms]", "sum"),
    Measure("fill_s", "processor time to fill the muscles with fibres, once [s]", "sum"),
)

ERRORS = (
    Measure("rms_mm", "distance to the reference, RMS over points, frames and muscles [mm]", "rms"),
    Measure("worst_rms_mm", "the same of the muscle where it is greatest [mm]"),
    Measure("max_mm", "greatest distance to the reference [mm]"),
    Measure("edge_stretch_max", "greatest edge length / length at rest", figure="edge_stretch_max"),
    Measure("edge_stretch_p95", "95th percentile of the same, worst frame", figure="edge_stretch_p95"),
    Measure(
        "dihedral_p95_deg",
        "95th percentile of the change of dihedral angles, worst frame [degrees]",
        figure="dihedral_error_p95_deg",
    ),
    Measure("volume_error_pct", "greatest |V / V0 - 1| [%]"),
    Measure(
        "penetration_p95_mm",
        "95th percentile of the depth of points in bones, worst frame [mm]",
        figure="penetration_p95_mm",
    ),
    Measure("penetration_max_mm", "greatest depth of a point in a bone [mm]", figure="penetration_max_mm"),
    Measure("fibre_length_mm", "error of the mean fibre length, RMS over frames, worst muscle [mm]"),
)

MEASURES = (*COSTS, *ERRORS)


def measured(trials: Mapping[str, Trial | None], reference: Mapping[str, Trial]) -> dict[str, Any]:
    """Return the figures of a setting, JSON-able: ``muscles``, and ``all`` of them together.

    A frame is compared with that of the reference at the same time. The figures of a muscle that failed are
    None, and so are those of all together.
    """
    muscles = {name: _of_muscle(own, reference[name]) for name, own in trials.items()}
    failed = any(own is None for own in trials.values())
    figures = {
        measure.name: None if failed else _together(measure, [of[measure.name] for of in muscles.values()])
        for measure in MEASURES
    }
    return {"all": figures, "muscles": muscles}


def _together(measure: Measure, values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    if measure.worst == "sum":
        return math.fsum(known)
    return math.sqrt(np.mean(np.square(known))) if measure.worst == "rms" else max(known)


def _of_muscle(trial: Trial | None, reference: Trial) -> dict[str, Any]:
    if trial is None:
        return {**dict.fromkeys(measure.name for measure in MEASURES), "frames": []}
    times = [frame["time"] for frame in reference.frames]
    same = [times.index(frame["time"]) for frame in trial.frames]
    distances = np.linalg.norm(trial.points - reference.points[same], axis=2)
    rms = float(np.sqrt((distances**2).mean()))
    # There may be other fibres in the reference: mean lengths are compared.
    lengths: list[float] | list[None] = [None] * len(same)
    error = None
    if trial.lengths.shape[1]:
        means = trial.lengths.mean(axis=1)
        lengths = means.tolist()
        error = float(np.sqrt(np.mean((means - reference.lengths[same].mean(axis=1)) ** 2)))
    return {
        "ms_per_frame": trial.ms,
        "fibre_ms": trial.fibre_ms,
        "fill_s": trial.fill_s,
        "rms_mm": rms,
        "worst_rms_mm": rms,
        "max_mm": float(distances.max()),
        "volume_error_pct": 100.0 * max(abs(frame["volume_ratio"] - 1.0) for frame in trial.frames),
        "fibre_length_mm": error,
        **{m.name: _greatest(trial, m.figure) for m in MEASURES if m.figure},
        "frames": [
            {
                "time": frame["time"],
                "rms_mm": float(np.sqrt((off**2).mean())),
                "length_mm": length,
            }
            for frame, off, length in zip(trial.frames, distances, lengths, strict=True)
        ],
    }


def _greatest(trial: Trial, name: str) -> float | None:
    values = [frame[name] for frame in trial.frames if frame.get(name) is not None]
    return max(values) if values else None
