"""Verdicts on the results of a muscle. A verdict is ok, look or failed, with reasons."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.moment_arms.levers import even_stretches, largest_turns, length_jumps
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.scene.sense import FULL_SIZE

_TABLE = files("vtkmuscle.run") / "checks.toml"


@dataclass(frozen=True)
class Check:
    """A check of each frame: beyond ``look`` results need a look, beyond ``failed`` they are useless.

    ``says`` is the problem, with the value as ``{}``, and ``do`` the remedy. With ``smaller``, small values
    are bad. The checked value is ``factor`` times a ``column`` of the report's frames, or, ``at_rest``, a
    number of :func:`~vtkmuscle.run.report_values.fibres_at_rest`; without a column it is measured on lengths.
    """

    look: float
    failed: float
    unit: str
    says: str
    do: str
    smaller: bool = False
    column: str = ""
    factor: float = 1.0
    at_rest: bool = False
    of_fibres: bool = False


#: The checks by name: the limits, with the reasons for them, are in the file.
CHECKS = {name: Check(**row) for name, row in tomllib.loads(_TABLE.read_text(encoding="utf-8")).items()}

#: Ratios of length that a fibre may have, and how far beyond them no fibre survives.
SHORTEST, LONGEST = CHECKS["short fibres"].look, CHECKS["long fibres"].look
BEYOND = 1.5

OK, LOOK, FAILED = "ok", "look", "failed"
#: Verdicts, the better one first.
VERDICTS = (OK, LOOK, FAILED)


@dataclass(frozen=True)
class Reason:
    """A reason of a verdict: the worst frame of a check, its ``value`` and the ``limit`` in ``unit``.

    ``says`` is the problem in words, and ``do`` the remedy.
    """

    check: str
    verdict: str
    frame: int
    time: float
    value: float
    limit: float
    unit: str
    says: str
    do: str

    def __str__(self) -> str:
        limit = _worded(self.limit, self.unit)
        beyond = f" (limit {limit})" if self.limit else ""
        return f"{self.verdict}, frame {self.frame} (time {self.time:g}): {self.says}{beyond}; {self.do}"


@dataclass(frozen=True, eq=False)
class FibreHistory:
    """A muscle's fibre lengths (f, k) over the frames and at rest (k,) [mm].

    ``at_rest`` is the result of :func:`~vtkmuscle.run.report_values.fibres_at_rest`, ``paths`` the lengths of
    the paths (f, k) [mm].
    """

    lengths: Floats
    rest_lengths: Floats
    at_rest: Mapping[str, Any] | None = None
    paths: Floats | None = None


def judge(
    rows: Sequence[Mapping[str, Any]],
    fibres: FibreHistory | None = None,
    *,
    motion: RigidMotion | None = None,
    n_edges: int = 1,
    size: float = FULL_SIZE,
    failure: tuple[int, float, Exception] | None = None,
) -> dict[str, Any]:
    """Return the verdict on a muscle from report rows, a row per frame.

    ``motion`` is at the times of the rows (lengths may turn back where it turns back), ``n_edges`` of the
    surface, ``size`` the cube root of the muscle's volume at rest [mm], and ``failure`` the frame and time
    that could not be computed, and why. JSON-able: ``verdict``, the worst of the ``reasons``; ``reasons``,
    :class:`Reason` as mappings, the worst first; and ``not_checked``, the omitted checks with reasons.
    """
    values, missing = _series(rows, fibres, motion, n_edges)
    reasons = [
        reason
        for name, series in values.items()
        if (reason := _reason(name, series, rows, size / FULL_SIZE)) is not None
    ]
    if failure is not None:
        frame, time, why = failure
        problem, remedy = fault_of(why, placed=True)
        says = f"the frame could not be computed: {problem}"
        do = remedy or "check the frame before"
        reasons.append(Reason("computed", FAILED, frame, time, 0.0, 0.0, "", says, do))
    return with_reasons({"reasons": [], "not_checked": missing}, reasons)


def with_reasons(
    verdict: Mapping[str, Any], reasons: Iterable[Reason], missing: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return a verdict with further reasons, the worst first, and further checks that are missing."""
    every = [*reasons_of(verdict), *reasons]
    every.sort(key=lambda reason: -VERDICTS.index(reason.verdict))
    return {
        "verdict": every[0].verdict if every else OK,
        "reasons": [vars(reason) for reason in every],
        "not_checked": {**verdict["not_checked"], **(missing or {})},
    }


def reasons_of(verdict: Mapping[str, Any]) -> list[Reason]:
    """Return the reasons of a verdict. The verdict is from :func:`judge` or from a report."""
    return [Reason(**reason) for reason in verdict["reasons"]]


def _series(
    rows: Sequence[Mapping[str, Any]], fibres: FibreHistory | None, motion: RigidMotion | None, n_edges: int
) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return the values of each check, a value per row.

    NaN for unknown values. The second result has the reasons for checks without values.
    """

    def column(name: str) -> Floats:
        found = [row.get(name) for row in rows]
        return np.array([np.nan if value is None else float(value) for value in found], dtype=np.float64)

    own = {name: check for name, check in CHECKS.items() if check.column and not check.at_rest}
    values = {name: check.factor * column(check.column) for name, check in own.items()}
    values["volume"] = 100.0 * np.abs(column("volume_ratio") - 1.0)
    values["folded"] /= n_edges
    values["unsettled"] *= column("unsettled").sum() / max(len(rows), 1)
    missing = {"penetration": "no bone has an inside", "widespread penetration": "no bone has an inside"}
    if fibres is None or not len(fibres.lengths):
        needing = (name for name, check in CHECKS.items() if check.of_fibres or check.at_rest)
        missing |= dict.fromkeys(needing, "the muscle has no fibres")
    else:
        ratios = fibres.lengths / np.maximum(fibres.rest_lengths, 1e-12)
        values["long fibres"] = np.percentile(ratios, 95, axis=1)
        values["short fibres"] = np.percentile(ratios, 5, axis=1)
        if fibres.paths is not None:  # the first frame may be bent at rest, as its fibres are
            ratio = fibres.lengths.mean(axis=1) / fibres.paths.mean(axis=1)
            values["fibres and paths"] = 100.0 * np.abs(ratio / ratio[0] - 1.0)
        times = np.array([row["time"] for row in rows], dtype=np.float64)
        of_motion = () if motion is None else (even_stretches(motion), largest_turns(motion))
        jumps = length_jumps(fibres.lengths, times, *of_motion)
        for name, share in (("jumps", 100), ("widespread jumps", 95)):
            values[name] = np.zeros(len(times))
            values[name][1:] = np.percentile(jumps, share, axis=1) if len(jumps) else 0.0
    if fibres is not None and fibres.at_rest is not None:  # the same in all frames: the first is named
        for name, check in CHECKS.items():
            if check.at_rest:
                values[name] = np.full(len(rows), check.factor * fibres.at_rest[check.column])
    unknown = [name for name in CHECKS if name not in values or np.isnan(values[name]).all()]
    values = {name: series for name, series in values.items() if name not in unknown}
    return values, {name: missing.get(name, "not measured") for name in unknown}


def _reason(name: str, series: Floats, rows: Sequence[Mapping[str, Any]], scale: float) -> Reason | None:
    """Return the reason of a failed check, else None.

    A check fails with ``look`` or ``failed``; infinite values are beyond all limits.
    """
    check = CHECKS[name]
    known = np.array([i for i, value in enumerate(series) if not np.isnan(value)], dtype=np.int64)
    if not len(known):
        return None
    look, failed = (limit * (scale if check.unit == "mm" else 1.0) for limit in (check.look, check.failed))
    side = -1.0 if check.smaller else 1.0
    worst = int(known[np.argmax(side * series[known])])
    value = float(series[worst])
    if side * value > side * failed or not np.isfinite(value):
        verdict, limit = FAILED, failed
    elif side * value > side * look:
        verdict, limit = LOOK, look
    else:
        return None
    row = rows[worst]
    says = check.says.format(_worded(value, check.unit))
    value = value if np.isfinite(value) else np.finfo(np.float64).max  # JSON knows no infinity
    return Reason(
        name, verdict, int(row["frame"]), float(row["time"]), value, limit, check.unit, says, check.do
    )


def _worded(value: float, unit: str) -> str:
    if not unit:
        return f"{value:.2f}"
    if unit == "%":
        return f"{value:.2g} %" if value < 99.5 else f"{value:.0f} %"
    return f"{value:.3g} {unit.replace('deg', 'degrees')}"
