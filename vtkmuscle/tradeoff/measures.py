"""What a trial costs and how wrong it is, against the trial of the reference."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.tradeoff.trial import MuscleTrial, Trial

Floats = NDArray[np.float64]


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
    """

    name: str
    words: str
    worst: str = "max"


COSTS = (
    Measure("ms_per_frame", "processor time per step of the motion, all muscles [ms]", "sum"),
    Measure("fibre_ms", "the same, to carry and measure their fibres in a frame [ms]", "sum"),
    Measure("fill_s", "processor time to fill the muscles with fibres, once [s]", "sum"),
)

ERRORS = (
    Measure("rms_mm", "distance to the reference, RMS over points, frames and muscles [mm]", "rms"),
    Measure("worst_rms_mm", "the same of the muscle where it is greatest [mm]"),
    Measure("max_mm", "greatest distance to the reference [mm]"),
    Measure("edge_stretch_p95", "95th percentile of edge length / length at rest, worst frame"),
    Measure("edge_stretch_max", "greatest edge length / length at rest"),
    Measure("dihedral_p95_deg", "95th percentile of the change of dihedral angles, worst frame [degrees]"),
    Measure("volume_error_pct", "greatest |V / V0 - 1| [%]"),
    Measure("penetration_p95_mm", "95th percentile of the depth of points in bones, worst frame [mm]"),
    Measure("penetration_max_mm", "greatest depth of a point in a bone [mm]"),
    Measure("fibre_length_mm", "error of the mean fibre length, RMS over frames, worst muscle [mm]"),
)

MEASURES = (*COSTS, *ERRORS)


def measured(trial: Trial, reference: Trial) -> dict[str, Any]:
    """Return the figures of a trial, JSON-able: ``muscles``, and ``all`` of them together.

    Parameters
    ----------
    trial, reference : Trial
        Of the same muscles; a frame of the trial is compared with that of the reference at the same time.
    """
    muscles = {name: _of_muscle(own, reference.muscles[name]) for name, own in trial.muscles.items()}
    figures: dict[str, Any] = {
        measure.name: _together(measure, (muscle[measure.name] for muscle in muscles.values()))
        for measure in MEASURES
    }
    figures["memory_mb"] = trial.memory_mb
    return {"all": figures, "muscles": muscles}


def _together(measure: Measure, values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    if measure.worst == "sum":
        return math.fsum(known)
    return math.sqrt(np.mean(np.square(known))) if measure.worst == "rms" else max(known)


def _of_muscle(trial: MuscleTrial, reference: MuscleTrial) -> dict[str, Any]:
    times = [frame["time"] for frame in reference.frames]
    same = [times.index(frame["time"]) for frame in trial.frames]
    distances = np.linalg.norm(trial.points - reference.points[same], axis=2)
    by_frame = np.sqrt((distances**2).mean(axis=1))
    rms = float(np.sqrt((distances**2).mean()))
    estimates = [frame["estimated_mm"] for frame in trial.frames]
    return {
        "ms_per_frame": trial.ms,
        "fibre_ms": trial.fibre_ms,
        "fill_s": trial.fibres_s,
        "rms_mm": rms,
        "worst_rms_mm": rms,
        "max_mm": float(distances.max()),
        "edge_stretch_p95": _greatest(trial, "edge_stretch_p95"),
        "edge_stretch_max": _greatest(trial, "edge_stretch_max"),
        "dihedral_p95_deg": _greatest(trial, "dihedral_error_p95"),
        "volume_error_pct": 100.0 * max(abs(frame["volume_ratio"] - 1.0) for frame in trial.frames),
        "penetration_p95_mm": _greatest(trial, "penetration_p95_mm"),
        "penetration_max_mm": _greatest(trial, "penetration_max_mm"),
        "fibre_length_mm": _length_error(trial.lengths, reference.lengths[same]),
        "frames": [
            {"time": times[number], "rms_mm": float(error), "estimated_mm": estimate}
            for number, error, estimate in zip(same, by_frame, estimates, strict=True)
        ],
    }


def _greatest(trial: MuscleTrial, name: str) -> float | None:
    values = [frame[name] for frame in trial.frames if frame[name] is not None]
    return max(values) if values else None


def _length_error(lengths: Floats, reference: Floats) -> float | None:
    """Return the error of the mean length (frames, fibres): there may be other fibres in the reference."""
    if not lengths.shape[1]:
        return None
    return float(np.sqrt(np.mean((lengths.mean(axis=1) - reference.mean(axis=1)) ** 2)))
