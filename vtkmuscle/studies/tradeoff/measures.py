"""What a setting costs and how wrong it is, against the reference."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.studies.outcome import POINTS, Outcome


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
    Measure("edge_stretch_max", "greatest edge length / length at rest", "max", "edge_stretch_max"),
    Measure("edge_stretch_p95", "95th percentile of the same, worst frame", "max", "edge_stretch_p95"),
    Measure(
        "dihedral_p95_deg", "the same of dihedral angles' change [degrees]", "max", "dihedral_error_p95_deg"
    ),
    Measure("volume_error_pct", "greatest |V / V0 - 1| [%]"),
    Measure("penetration_p95_mm", "95th percentile of depths in bones [mm]", "max", "penetration_p95_mm"),
    Measure("penetration_max_mm", "greatest depth of a point in a bone [mm]", "max", "penetration_max_mm"),
    Measure("fibre_length_mm", "error of the mean fibre length, RMS over frames, worst muscle [mm]"),
)
MEASURES = (*COSTS, *ERRORS)

Figures = Mapping[str, float | None]

#: Part of the frames left out at either end of their times, in the mean.
_TRIMMED = 0.1


def together(muscles: Mapping[str, Figures]) -> Figures:
    """Return the figures of all muscles together; None each where one muscle has none at all."""
    if any(set(of.values()) == {None} for of in muscles.values()):
        return _nothing()
    return {one.name: _together(one, [of[one.name] for of in muscles.values()]) for one in MEASURES}


def _nothing() -> Figures:
    return dict.fromkeys(one.name for one in MEASURES)


def _together(measure: Measure, values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    if measure.worst == "sum":
        return math.fsum(known)
    return math.sqrt(np.mean(np.square(known))) if measure.worst == "rms" else max(known)


def measured(outcome: Outcome, reference: Outcome) -> Figures:
    """Return the figures of a muscle; None each where it failed.

    A frame is compared with that of the reference at the same time.
    """
    facts = outcome.facts
    if outcome.failure or not facts["complete"]:
        return _nothing()
    same = [reference.facts["points_at"].index(time) for time in facts["points_at"]]
    distances = np.linalg.norm(outcome.arrays[POINTS] - reference.arrays[POINTS][same], axis=2)
    rms = float(np.sqrt((distances**2).mean()))
    compared = [row for row in facts["rows"] if row["time"] in facts["points_at"]]
    timed = facts["rows"][1:] or facts["rows"]  # the first frame makes what the others use
    found: dict[str, float | None] = {
        "ms_per_frame": trimmed_mean([row["ms"] for row in timed]),
        "fibre_ms": trimmed_mean([row.get("ms_fibres", 0.0) for row in timed]),
        "fill_s": facts["seconds"].get("fibres", 0.0),
        "rms_mm": rms,
        "worst_rms_mm": rms,
        "max_mm": float(distances.max()),
        "volume_error_pct": 100.0 * max(abs(row["volume_ratio"] - 1.0) for row in compared),
        "fibre_length_mm": None,
    }
    means = mean_lengths(outcome)
    if len(means):  # there may be other fibres in the reference: mean lengths are compared
        off = means - mean_lengths(reference)[same]
        found["fibre_length_mm"] = float(np.sqrt(np.mean(off**2)))
    for one in MEASURES:
        if one.figure:
            values = [row[one.figure] for row in compared if row.get(one.figure) is not None]
            found[one.name] = max(values, default=None)
    return found


def mean_lengths(outcome: Outcome) -> Floats:
    """Return the mean length of the fibres in the frames whose points are kept, (f,) [mm]; none without."""
    if "fibre_lengths" not in outcome.arrays:
        return np.empty(0)
    kept = [outcome.facts["times"].index(time) for time in outcome.facts["points_at"]]
    means: Floats = outcome.arrays["fibre_lengths"][kept].mean(axis=1)
    return means


def trimmed_mean(values: Sequence[float]) -> float:
    """Return the mean of values without the tenth at either end: what else the machine does is in those."""
    ordered = np.sort(np.asarray(values))
    cut = int(_TRIMMED * len(ordered))
    return float(ordered[cut : len(ordered) - cut].mean())
