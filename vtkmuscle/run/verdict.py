"""Verdicts on the results of a muscle. A verdict is ok, look or failed, with reasons."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.moment_arms.levers import distances_moved, even_stretches, largest_turns, length_jumps
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Bools, Floats
from vtkmuscle.data import toml_table
from vtkmuscle.data.anatomy import PERSONAL, Published, published, published_arm
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.scene.data import SceneData, SceneError
from vtkmuscle.scene.sense import FULL_SIZE


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
CHECKS = {name: Check(**row) for name, row in toml_table("vtkmuscle.run", "checks.toml").items()}

OK, LOOK, FAILED = "ok", "look", "failed"
#: Verdicts, the better one first.
VERDICTS = (OK, LOOK, FAILED)


@dataclass(frozen=True)
class Reason:
    """The worst frame of a check. Value and limit have a ``unit``; ``says`` is the problem, ``do`` helps."""

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
        beyond = f" (limit {_worded(self.limit, self.unit)})" if self.limit else ""
        return f"{self.verdict}, frame {self.frame} (time {self.time:g}): {self.says}{beyond}; {self.do}"


def judge(
    track: MuscleTrack, rest_lengths: Floats | None = None, *, motion: RigidMotion | None = None,
    n_edges: int = 1, size: float = FULL_SIZE,
) -> dict[str, Any]:  # fmt: skip
    """Return the verdict on a muscle from the rows of its report and its lengths.

    ``rest_lengths`` (k,) are of fibres [mm], ``motion`` is at the times of the rows (lengths may turn
    back where it does), ``n_edges`` of the surface, and ``size`` the cube root of the volume at rest
    [mm]. JSON-able: ``verdict``, the worst of the ``reasons``; ``reasons``, :class:`Reason` as mappings, the
    worst first; and ``not_checked``, the omitted checks with reasons.
    """
    rows = track.report["frames"]
    values, missing = _series(track, rest_lengths, motion, n_edges)
    candidates = (_reason(name, series, rows, size / FULL_SIZE) for name, series in values.items())
    reasons = [reason for reason in candidates if reason is not None]
    if track.failure is not None:
        frame, time, why = track.failure
        problem, remedy = fault_of(why, placed=True)
        words = f"the frame could not be computed: {problem}", remedy or "check the frame before"
        reasons.append(Reason("computed", FAILED, frame, time, 0.0, 0.0, "", *words))
    return with_reasons({"reasons": [], "not_checked": missing}, reasons)


def with_reasons(
    verdict: Mapping[str, Any], reasons: Iterable[Reason], missing: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return a verdict with further reasons, the worst first, and further checks that are missing."""
    every = [*reasons_of(verdict), *reasons]
    every.sort(key=lambda reason: -VERDICTS.index(reason.verdict))
    worst, not_checked = every[0].verdict if every else OK, {**verdict["not_checked"], **(missing or {})}
    return {"verdict": worst, "reasons": [vars(reason) for reason in every], "not_checked": not_checked}


def reasons_of(verdict: Mapping[str, Any]) -> list[Reason]:
    """Return the reasons of a verdict. The verdict is from :func:`judge` or from a report."""
    return [Reason(**reason) for reason in verdict["reasons"]]


def _series(
    track: MuscleTrack, rest_lengths: Floats | None, motion: RigidMotion | None, n_edges: int
) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return the values of each check, a value per row, and the checks without values."""
    rows = track.report["frames"]

    def column(name: str) -> Floats:
        return np.array([row.get(name) for row in rows], dtype=np.float64)  # None is NaN

    own = {name: check for name, check in CHECKS.items() if check.column and not check.at_rest}
    values = {name: check.factor * column(check.column) for name, check in own.items()}
    values["volume"] = 100.0 * np.abs(column("volume_ratio") - 1.0)
    values["folded"] /= n_edges
    values["unsettled"] *= column("unsettled").sum() / max(len(rows), 1)
    missing = {"penetration": "no bone has an inside", "widespread penetration": "no bone has an inside"}
    missing |= dict.fromkeys(("jumps", "widespread jumps"), "no step has three even steps beside it")
    if not track.lengths:
        of_paths = "squeezed", "coarse", "passed paths", "hooked paths", "unsettled"
        missing |= dict.fromkeys(of_paths, "there are no paths; a table [paths] adds them")
    if rest_lengths is None or not track.fibre_lengths:
        needing = (name for name, check in CHECKS.items() if check.of_fibres or check.at_rest)
        missing |= dict.fromkeys(needing, "the muscle has no fibres")
    else:
        lengths, at_rest = np.array(track.fibre_lengths), track.report.get("fibres", {})
        ratios = lengths / np.maximum(rest_lengths, 1e-12)
        values["short fibres"], values["long fibres"] = np.percentile(ratios, (5, 95), axis=1)
        at = np.array([row["time"] for row in rows]) if motion is None else distances_moved(motion)
        of_motion = () if motion is None else (even_stretches(motion), largest_turns(motion))
        jumps = np.pad(length_jumps(lengths, at, *of_motion), ((1, 0), (0, 0)), constant_values=np.nan)
        values["jumps"], values["widespread jumps"] = np.percentile(jumps, (100, 95), axis=1)
        for name, check in CHECKS.items():  # the same in all frames: the first is named
            if check.at_rest and at_rest:
                values[name] = np.full(len(rows), check.factor * at_rest[check.column])
    values = {name: series for name, series in values.items() if not np.isnan(series).all()}
    return values, {name: missing.get(name, "not measured") for name in CHECKS if name not in values}


def _reason(name: str, series: Floats, rows: Sequence[Mapping[str, Any]], scale: float) -> Reason | None:
    """Return the reason of a failed check, else None."""
    check = CHECKS[name]
    look, failed = (limit * (scale if check.unit == "mm" else 1.0) for limit in (check.look, check.failed))
    side = -1.0 if check.smaller else 1.0
    worst = int(np.nanargmax(side * series))
    value = float(series[worst])
    fails = side * value > side * failed or not np.isfinite(value)
    if not fails and side * value <= side * look:
        return None
    verdict, limit = (FAILED, failed) if fails else (LOOK, look)
    words = check.unit, check.says.format(_worded(value, check.unit)), check.do
    value = value if np.isfinite(value) else np.finfo(np.float64).max  # JSON knows no infinity
    frame, time = int(rows[worst]["frame"]), float(rows[worst]["time"])
    return Reason(name, verdict, frame, time, value, limit, *words)


def _worded(value: float, unit: str) -> str:
    if not unit:
        return f"{value:.2f}"
    if unit == "%":
        return f"{value:.2g} %" if value < 99.5 else f"{value:.0f} %"
    return f"{value:.3g} {unit.replace('deg', 'degrees')}"


#: Part of a muscle's path that an optimal fibre length may be: 0.105 to 1.33 in 68 published muscles.
SHORTEST_FIBRE, LONGEST_FIBRE = 0.1, 2.0
#: Margin of published moment arms [mm]: the ranges are of single generic models, and from model to model
#: their edges move by as much.
MARGIN = 15.0


@dataclass(frozen=True, eq=False)
class Judged:
    """A muscle of a scene with its results."""

    name: str
    scene: SceneData
    track: MuscleTrack
    arms: Mapping[str, JointArms]

    @property
    def anatomical(self) -> str:
        """Name for published numbers."""
        return self.scene.muscles[self.name].muscle or self.name

    @property
    def path(self) -> float:
        """Mean length of the fibres at rest, tendon included [mm]; 0 without fibres."""
        if self.track.rest_fibres is None:
            return 0.0
        return float(polylines_of(self.track.rest_fibres, "fibres").lengths.mean()) * self.scene.millimetres


def further_reasons(muscle: Judged, odd: Sequence[SceneError]) -> Iterator[Reason]:
    """Yield reasons for a look at a muscle; ``odd`` are the implausible parts of the scene."""
    for error in odd:
        if _concerns(error.key, muscle):
            yield _look(muscle, "plausible", (0.0, 0.0, ""), f"{error.key}: {error.problem}", error.remedy)
    if muscle.path > 0.0:
        yield from _hill(muscle)
        yield from _fascicles(muscle)
        for arms in muscle.arms.values():
            yield from _arms(muscle, arms)


def _concerns(key: str, muscle: Judged) -> bool:
    """Return whether a key concerns a muscle."""
    own = key.removeprefix("guessed.")
    if own.startswith("muscles.") or key.startswith("units"):  # the scale is no property of a muscle
        return own.startswith(f"muscles.{muscle.name}.")
    crossed = muscle.scene.muscles[muscle.name].crosses
    moved = muscle.scene.joints.get(key.removeprefix("guessed.joints.").partition(".")[0])
    return not moved or crossed is None or not {*crossed}.isdisjoint(moved)


def missing_checks(muscle: Judged) -> dict[str, str]:
    """Return omitted checks of moment arms, and why."""
    of_arms = "published arms", "arm and length", "arm and slope"
    missing = {} if muscle.arms else dict.fromkeys(of_arms, "there are no moment arms")
    if by := [name for name, arms in muscle.arms.items() if _published_arm(muscle, arms) is None]:
        missing["published arms"] = (
            f"no moment arms of the muscle by {', '.join(by)} are published in these poses; "
            "coordinates match by joint and direction, as knee_flexion"
        )
    if "architecture" not in muscle.track.report:
        missing["fascicles"] = "the architecture was not computed"
    if published(muscle.anatomical):
        return missing
    why = 'no published muscle has the name; if it has another name there, write muscle = "THAT NAME"'
    return missing | {"published arms": why, "fascicles": why}


def _published_arm(muscle: Judged, arms: JointArms) -> Published | None:
    """Return a muscle's published moment arms. None if there are none in the poses."""
    arm = published_arm(muscle.anatomical, arms.coordinate, arms.positive) if arms.unit in ANGLES else None
    return arm if arm and _within(arm, arms).any() else None


def _within(arm: Published, arms: JointArms) -> Bools:
    """Return which poses are among the published ones."""
    return (arms.angles >= arm.values[0]) & (arms.angles <= arm.values[1]) & np.isfinite(arms.mean)


def _look(
    muscle: Judged, check: str, measured: tuple[float, float, str], says: str, do: str, at: int = 0
) -> Reason:
    """Return a reason for a look: value, limit and unit, ``at`` a kept frame."""
    row = muscle.track.report["frames"][at] if muscle.track.report["frames"] else {"frame": 0, "time": 0.0}
    value, limit, unit = measured
    return Reason(check, LOOK, int(row["frame"]), row["time"], float(value), float(limit), unit, says, do)


def _hill(muscle: Judged) -> Iterator[Reason]:
    """Yield Hill's parameters that do not fit the muscle's own path."""
    hill, path = muscle.scene.muscles[muscle.name].hill, muscle.path
    fibre = "optimal_fibre_length", SHORTEST_FIBRE, LONGEST_FIBRE
    for key, least, most in (fibre, ("tendon_slack_length", 0.0, 1.0)):
        ratio = hill.get(key, np.nan) * muscle.scene.millimetres / path
        if ratio < least or ratio > most:
            says = f"{key} is {ratio * path:.3g} mm, but the muscle's path is {path:.3g} mm long"
            do = f"check the unit; {least:g} to {most:g} of the path is plausible"
            yield _look(muscle, "hill", (ratio, most if ratio > most else least, ""), says, do)


def _fascicles(muscle: Judged) -> Iterator[Reason]:
    """Yield fascicles that are too long or too short for the muscle's name."""
    ratio = published(muscle.anatomical, "fibre_to_path")
    architecture = muscle.track.report.get("architecture")
    if ratio is None or architecture is None:
        return
    shortest, longest = architecture["fascicle_length_range_mm"]
    low, high = ratio.low / PERSONAL, ratio.high * PERSONAL
    if longest < low * muscle.path or shortest > high * muscle.path:
        mean = architecture["fascicle_length_mm"]["mean"]
        says = f"the fascicles are {mean:.3g} mm long, {mean / muscle.path:.2f} of the path; published: "
        says += _span(ratio.low, ratio.high, source=ratio.source)
        limit = high if shortest > high * muscle.path else low
        do = "give aponeuroses, or tendon_slack_length under hill; do not use PCSA and fascicle lengths"
        yield _look(muscle, "fascicles", (mean / muscle.path, limit, ""), says, do)


def _arms(muscle: Judged, arms: JointArms) -> Iterator[Reason]:
    """Yield moment arms that fit neither the muscle nor published ones."""
    mean, frames = arms.mean, arms.frames.tolist()
    if arms.unit not in ANGLES or not np.isfinite(mean).any():
        return
    longer = np.nan_to_num(np.abs(mean) / np.mean(muscle.track.lengths, axis=1)[frames])
    worst = int(longer.argmax())
    if longer[worst] > 1.0:
        says = f"the moment arm by {arms.coordinate} is {mean[worst]:.3g} mm, longer than the muscle"
        do = "check the coordinate's unit, the joint's centre and the attachments"
        yield _look(muscle, "arm and length", (longer[worst], 1.0, ""), says, do, frames[worst])
    # Differences over steps h of a pulley's cosine are off by h^2 / 6.
    errors, step = arms.errors, np.radians(np.abs(np.diff(arms.angles)).max(initial=0.0))
    off, parts = np.nan_to_num(np.abs(mean - arms.mean_slope)), ("model", "sampling", "bow")
    allowed = np.linalg.norm([errors[part] for part in parts], axis=0) + np.nan_to_num(arms.sags)
    allowed += step**2 / 6.0 * np.nanmax(np.abs(mean))
    if np.count_nonzero(off > allowed) > 0.5 * len(off):
        worst = int(np.nanargmax(off - allowed))
        says = f"the mean moment arm by {arms.coordinate} is {mean[worst]:.3g} mm, but "
        says += f"{arms.mean_slope[worst]:.3g} mm by the change of the lengths"
        do = "check that the coordinate and the motion of the bones are of the same joint"
        yield _look(muscle, "arm and slope", (off[worst], allowed[worst], "mm"), says, do, frames[worst])
    arm, length = _published_arm(muscle, arms), published(muscle.anatomical, "path_length")
    if arm is None or length is None:
        return
    size = muscle.path / np.array([length.high * PERSONAL, length.low / PERSONAL])
    low, high = ((arm.low - MARGIN) * size).min(), ((arm.high + MARGIN) * size).max()
    own = np.where(_within(arm, arms), mean, np.nan)
    worst, sweep = int(np.nanargmax(np.maximum(low - own, own - high))), float(np.nanmean(own))
    certain = arm.low * arm.high > 0.0 and max(abs(arm.low), abs(arm.high)) > MARGIN
    opposite = certain and sweep * arm.low < 0.0
    if opposite or not low <= own[worst] <= high:
        limit = 0.0 if opposite else low if own[worst] < low else high
        whole = f", of the other sign over the whole motion ({sweep:.3g} mm)" if opposite else ""
        says = f"the mean moment arm by {arms.coordinate} is {mean[worst]:.3g} mm at "
        says += f"{arms.angles[worst]:.3g} degrees{whole}; published [mm]: "
        says += _span(arm.low, arm.high, source=arm.source)
        do = "check the attachments, the axis and the surface there"
        yield _look(muscle, "published arms", (mean[worst], limit, "mm"), says, do, frames[worst])


def _span(low: float, high: float, *, source: str) -> str:
    return f"{low:g} to {high:g} ({source})" if low < high else f"{low:g} ({source})"
