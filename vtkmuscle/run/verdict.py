"""Verdicts on the results of a muscle.

A verdict is ok, look or failed, with reasons.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.moment_arms.length_jumps import even_stretches, largest_turns, length_jumps
from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, inverse
from vtkmuscle.core.types import Floats
from vtkmuscle.run.limits import CHECKS, FULL_SIZE

OK, LOOK, FAILED = "ok", "look", "failed"
#: Verdicts, the better one first.
VERDICTS = (OK, LOOK, FAILED)

#: Checks of :func:`vtkmuscle.run.report_values.fibres_at_rest`, with factors to per cent or degrees.
_AT_REST = {
    "crossed fibres": ("crossing_share", 100.0),
    "hooked fibres": ("hooked_share", 100.0),
    "winding fibres": ("turning_p95_deg", 1.0),
    "bare": ("bare_share", 100.0),
}
#: The checks that need fibres.
_OF_FIBRES = (
    *("long fibres", "short fibres", "jumps", "widespread jumps"),
    *("slid off", "fibres outside", "fibres in bone", "squeezed", "unsettled"),
)


#: A point of a fibre lies on a bone, with nothing but muscle between them, if it is nearer than this [mm].
_ON_BONE = 12.0
#: Part of a fibre at each end, where it is attached, that is left out.
_ENDS = 0.15


@dataclass(frozen=True)
class Reason:
    """A reason of a verdict: the worst frame of a check.

    ``value`` of the frame is beyond ``limit``, both in ``unit``. ``says`` is the problem in words, and
    ``do`` the remedy.
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
    """A muscle's fibre lengths over the frames [mm].

    Lengths (f, k) and lengths at rest (k,). ``at_rest`` is the result of
    :func:`~vtkmuscle.run.report_values.fibres_at_rest`, ``slides`` the result of :func:`slides_of`.
    """

    lengths: Floats
    rest_lengths: Floats
    at_rest: Mapping[str, Any] | None = None
    slides: Sequence[tuple[float, str] | None] = ()


def judge(
    rows: Sequence[Mapping[str, Any]],
    fibres: FibreHistory | None = None,
    *,
    motion: RigidMotion | None = None,
    n_edges: int = 1,
    size: float = FULL_SIZE,
    failure: tuple[int, float, Exception] | None = None,
) -> dict[str, Any]:
    """Return the verdict on a muscle from report rows.

    A row per frame.

    Parameters
    ----------
    rows : sequence of mapping
        As in the report.
    fibres : FibreHistory, optional
        The fibres in these frames.
    motion : RigidMotion, optional
        At the times of the rows; lengths may turn back where the motion turns back.
    n_edges : int, optional
        Number of edges of the surface.
    size : float, optional
        Diagonal of the muscle's box at rest [mm].
    failure : (int, float, Exception), optional
        Frame and time of the failure to compute the muscle, and the reason.

    Returns
    -------
    dict
        JSON-able: ``verdict``, the worst of the ``reasons``; ``reasons``, :class:`Reason` as mappings,
        the worst first; and ``not_checked``, the omitted checks with reasons.
    """
    values, missing = _series(rows, fibres, motion, n_edges)
    reasons = [
        reason
        for name, series in values.items()
        if (reason := _reason(name, series, rows, min(1.0, size / FULL_SIZE))) is not None
    ]
    for number, reason in enumerate(reasons):
        if reason.check == "slid off":
            slides = () if fibres is None else fibres.slides
            bone = next(one[1] for one in slides if one is not None and one[0] == reason.value)
            reasons[number] = replace(reason, says=reason.says.replace("a bone", f"the bone {bone!r}"))
    if failure is not None:
        frame, time, why = failure
        problem, remedy = fault_of(why, placed=True)
        says = f"it could not be computed: {problem}"
        do = remedy or "look at the frame before it"
        reasons.append(Reason("computed", FAILED, frame, time, 0.0, 0.0, "", says, do))
    reasons.sort(key=lambda reason: -VERDICTS.index(reason.verdict))
    return {
        "verdict": reasons[0].verdict if reasons else OK,
        "reasons": [vars(reason) for reason in reasons],
        "not_checked": missing,
    }


def reasons_of(verdict: Mapping[str, Any]) -> list[Reason]:
    """Return the reasons of a verdict.

    The verdict is from :func:`judge` or from a report.
    """
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

    values = {
        "volume": 100.0 * np.abs(column("volume_ratio") - 1.0),
        "fixed points": column("fixed_error_max_mm"),
        "misshapen": 100.0 * column("misshapen_area"),
        "crumpled": column("dihedral_error_p95_deg"),
        "folded": 100.0 * column("folded_edges") / n_edges,
        "fibres outside": column("fibres_outside_max_mm"),
        "fibres in bone": column("fibres_penetration_new_max_mm"),
        "penetration": column("penetration_new_max_mm"),
        "squeezed": column("squeezed_p95_mm"),
        "unsettled": 100.0 * column("unsettled") * column("unsettled").mean(),
        "widespread penetration": column("penetration_new_p95_mm"),
    }
    missing = {"penetration": "no bone has an inside", "widespread penetration": "no bone has an inside"}
    if fibres is None or not len(fibres.lengths):
        missing |= dict.fromkeys((*_OF_FIBRES, *_AT_REST), "it has no fibres")
    else:
        ratios = fibres.lengths / np.maximum(fibres.rest_lengths, 1e-12)
        values["long fibres"] = np.percentile(ratios, 95, axis=1)
        values["short fibres"] = np.percentile(ratios, 5, axis=1)
        times = np.array([row["time"] for row in rows], dtype=np.float64)
        of_motion = () if motion is None else (even_stretches(motion), largest_turns(motion))
        jumps = length_jumps(fibres.lengths, times, *of_motion)
        for name, share in (("jumps", 100), ("widespread jumps", 95)):
            values[name] = np.zeros(len(times))
            values[name][1:] = np.percentile(jumps, share, axis=1) if len(jumps) else 0.0
        values["slid off"] = np.array(
            [0.0 if one is None else one[0] for one in fibres.slides or [None] * len(times)]
        )
    if fibres is not None and fibres.at_rest is not None:  # the same in all frames: the first is named
        for name, (key, scale) in _AT_REST.items():
            values[name] = np.full(len(rows), scale * fibres.at_rest[key])
    unknown = [name for name in CHECKS if name not in values or np.isnan(values[name]).all()]
    values = {name: series for name, series in values.items() if name not in unknown}
    return values, {name: missing.get(name, "it was not measured") for name in unknown}


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


def slides_of(
    lengths: Floats,
    lines: Callable[[int], Floats],
    motion: RigidMotion,
    shapes: Mapping[str, Bone],
    *,
    jump: float,
    millimetres: float = 1.0,
) -> list[tuple[float, str] | None]:
    """Return the sideways slides of fibres on bones.

    Frame by frame; in each step the fibre with the largest jump in length counts.

    Parameters
    ----------
    lengths : (f, k) array
        Lengths of the fibres in each frame [mm].
    lines : callable
        From the position of a frame to the points (k, n, 3) of the fibres, in the scene's unit.
    motion : RigidMotion
        At the times of the frames.
    shapes : mapping of str to Bone
        The bones at rest.
    jump : float
        Jump in length [mm]; steps without a larger jump are left out.
    millimetres : float, optional
        Length of the scene's unit.

    Returns
    -------
    list of (float, str) or None
        Per frame millimetres since the frame before, and the bone; None without a jump in length, or for a
        fibre off the bones.
    """
    found: list[tuple[float, str] | None] = [None] * len(lengths)
    jumps = length_jumps(lengths, motion.times, even_stretches(motion), largest_turns(motion))
    for step in np.flatnonzero(jumps.max(axis=1, initial=0.0) > jump).tolist():
        fibre = int(jumps[step].argmax())
        before, after = (motion.at(time) for time in motion.times[step : step + 2])
        old, new = lines(step)[fibre], lines(step + 1)[fibre]
        slid = {}
        for bone, shape in shapes.items():
            here = apply_transform(inverse(before.get(bone, np.eye(4))), old)
            there = apply_transform(inverse(after.get(bone, np.eye(4))), new)
            slid[bone] = millimetres * _aside(here, there, shape, _ON_BONE / millimetres)
        if slid and max(slid.values()) > 0.0:
            bone = max(slid, key=lambda name: slid[name])
            found[step + 1] = slid[bone], bone
    return found


def _aside(before: Floats, after: Floats, shape: Bone, near: float) -> float:
    """Return the sideways movement of points (n, 3).

    The movement of points of a line on a bone, across the line and along the bone. Both positions are in the
    frame of the bone. A line may slide lengthwise and lift off the bone.
    """
    skip = int(np.ceil(_ENDS * len(before)))
    inner = slice(skip, len(before) - skip)
    low, high = shape.box
    places = before[inner]
    if ((places < low - near) | (places > high + near)).any(axis=1).all():
        return 0.0
    apart, outward = shape.exact(places)
    on = (np.abs(apart) < near) & (apart != 0.0)
    if not on.any():
        return 0.0
    along = np.gradient(before, axis=0)[inner][on]
    aside = np.cross(along, outward[on])
    sizes = np.linalg.norm(aside, axis=1)
    moved = (after[inner] - places)[on]
    steps = np.abs(np.einsum("ij,ij->i", moved, aside)) / np.maximum(sizes, 1e-300)
    return float(steps[sizes > 0.0].max(initial=0.0))
