"""Verdicts on the results of a muscle. A verdict is ok, look or failed, with reasons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.moment_arms.levers import even_stretches, largest_turns, length_jumps
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.scene.sense import FULL_SIZE

# A muscle exerts no active force below half of its optimal length, nor above 1.6 to 1.7 times of it: Zajac
# 1989, "Muscle and tendon", Crit Rev Biomed Eng 17:359; Gordon, Huxley, Julian 1966,
# doi:10.1113/jphysiol.1966.sp007909 (sarcomeres of 1.27 and 3.65 um, where the optimum is 2.05 to 2.2). Half
# as much again is what no fibre survives.
SHORTEST, LONGEST = 0.5, 1.6
BEYOND = 1.5


@dataclass(frozen=True)
class Check:
    """A check of each frame: beyond ``look`` results need a look, beyond ``failed`` they are useless.

    ``says`` is the problem, with the value as ``{}``, and ``do`` the remedy. With ``smaller``, small values
    are bad.
    """

    look: float
    failed: float
    unit: str
    says: str
    do: str
    smaller: bool = False


#: Remedies of several checks.
ROUGH = "check the surface there; quality = 'accurate' or a mesh of even triangles makes the surface smoother"
MOTION = "check the attachments, and whether the joint allows the motion"
FIBRES = "check the attachments, or change the fibres (method = 'harmonic', or aponeuroses)"
CLOSED = "check whether the bone is closed, and whether two bones squeeze the muscle"

#: The limits of each check, with the reasons for them: from where on results need a look, from where on they
#: are of no use, and the unit.
LIMITS = {
    # Kohout and Cervenka 2021 (doi:10.1007/978-3-030-72379-8_24), Fig. 11: less than 1 % with few iterations;
    # 5 % is seen by eye.
    "volume": (1.0, 5.0, "%"),
    # They are set, not solved for: anything but rounding is a fault.
    "fixed points": (0.01, 1.0, "mm"),
    # A surface is stretched and squeezed as the fibres in it. Of muscles that move well up to 3.2 % of the
    # area is beyond what no fibre survives; where they crumpled or have a crease it was 6.6 to 10.4 %.
    "misshapen": (5.0, 25.0, "%"),
    # Where muscles move well the 95th percentile is up to 20 degrees over 90 of the joint; where they crumple
    # it is 36 to 61.
    "crumpled": (30.0, 45.0, "deg"),
    # An edge whose triangles lie on each other, and did not at rest. Few are a crease, as in a groin.
    "folded": (0.5, 3.0, "%"),
    "long fibres": (LONGEST, BEYOND * LONGEST, ""),
    "short fibres": (SHORTEST, SHORTEST / BEYOND, ""),
    # A jump of 1 mm from one frame to the next is a moment arm that is wrong by 57 mm at steps of 1 degree.
    # One fibre of a hundred may snap over an edge, and hardly changes the mean.
    "jumps": (1.0, 100.0, "mm"),
    # A muscle that buckled made jumps of 18 mm in all of its fibres.
    "widespread jumps": (1.0, 5.0, "mm"),
    # Of muscles whose fibres are well by eye up to a sixth of the neighbours change sides, where they run
    # together in a tip; of a sheet whose fibres go to the other edge nine tenths do.
    "crossed fibres": (30.0, 60.0, "%"),
    "hooked fibres": (5.0, 50.0, "%"),
    # A muscle that winds once round a bone turns by 360 degrees, and none does: the iliacus turns by 195.
    "winding fibres": (270.0, 540.0, "deg"),
    # Farther from any fibre than fibres are from each other in an even pattern; a random one leaves 4 %.
    "bare": (15.0, 50.0, "%"),
    # Paths are taut: without a bone or a ring they are straight but for the tissue that they press.
    "hooked paths": (5.0, 50.0, "%"),
    # Both are the same fibres: taut, and carried by the muscle. In four muscles of a hip they differ by up to
    # 1 %, and by 5.4 % if solved by position based dynamics.
    "fibres and paths": (5.0, 25.0, "%"),
    # A path that bends round a bone of 16 mm sinks into it by 0.01 mm; ten times that and it is pressed ten
    # times harder than by its own pull. Of the muscles of a hip, a knee and an elbow none lacks any room; one
    # under a roof of bone lacks 1.1 mm, if the arm is raised and the shoulder blade does not turn with it.
    "squeezed": (0.1, 5.0, "mm"),
    # The straight segments of a path round a bone have levers between the bone's and the bone's less this
    # depth: 2 mm are 5 % of 40 mm, and 5 mm deep a segment goes through a thin bone.
    "coarse": (2.0, 5.0, "mm"),
    # Lengths and moment arms of such a frame are left out: one in twenty leaves the curves whole. Where paths
    # do not come to rest before the motion begins, all frames are left out.
    "unsettled": (0.0, 5.0, "%"),
    # FibreTransport keeps points to rounding inside where the muscle does not fold; at rest 0.5 mm counts as
    # inside. A fibre that is 15 mm off is anywhere.
    "fibres outside": (0.5, 15.0, "mm"),
    # 15 mm deep is the middle of a femur's shaft.
    "fibres in bone": (1.0, 15.0, "mm"),
    # What is promised is 0.1 mm (95th percentile); a point 5 mm deep has gone through a thin bone.
    "penetration": (0.5, 5.0, "mm"),
    "widespread penetration": (0.1, 1.0, "mm"),
}

#: The words of each check: the problem, with the value as ``{}``, and the remedy.
WORDS = {
    "volume": ("the volume has changed by {}", ROUGH),
    "fixed points": ("a fixed point is {} off its position on the bone", "report a fault of vtkmuscle"),
    "misshapen": (
        f"{{}} of the surface is stretched {BEYOND * LONGEST:g} times in a direction, or squeezed to a third",
        "check the surface there; remesh badly shaped triangles, the cause of spikes",
    ),
    "crumpled": ("the surface is crumpled: 5 % of the edges are bent by {} or more since rest", ROUGH),
    "folded": ("{} of the edges have folded over since rest", ROUGH),
    "long fibres": ("5 % of the fibres are {} times as long as at rest, or longer", MOTION),
    "short fibres": ("5 % of the fibres are {} times as long as at rest, or shorter", MOTION),
    "jumps": ("a fibre snaps over a bone: its length jumps by {}", "do not use moment arms near the jump"),
    "widespread jumps": (
        "the lengths of 5 % of the fibres jump by {} or more: the muscle buckles or snaps over a bone",
        "do not use moment arms near the jump; check the attachments, or add a via ring (role = 'via')",
    ),
    "crossed fibres": ("{} of neighbouring fibres change sides at an end of the muscle, at rest", FIBRES),
    "hooked fibres": ("{} of the fibres have a hook at rest", FIBRES),
    "winding fibres": ("5 % of the fibres turn by {} in total at rest, or more", FIBRES),
    "bare": (
        "{} of the volume has no fibres at rest",
        "check the attachments; without aponeuroses take course = 'sections'",
    ),
    "hooked paths": (
        "{} of the paths turn by 60 degrees or more where no bone or ring presses",
        "do not use lengths and moment arms there; check the attachments and the bones",
    ),
    "fibres and paths": (
        "the carried fibres have lengthened by {} more or less than their taut paths",
        "do not use the deformed muscle there; take the deformer 'paths'",
    ),
    "squeezed": (
        "5 % of the paths lack {} or more of room between two bones",
        "check the motion there: a bone may lack motion, or a joint's centre may be wrong",
    ),
    "coarse": (
        "5 % of the paths cut {} or more into the bones: moment arms are wrong by about as much",
        "take more segments (resolution of [paths], or another quality)",
    ),
    "unsettled": (
        "the paths do not come to rest in {} of the frames, and have no lengths and moment arms there",
        "check attachments and bones there: are the bones closed, and do they leave the muscle room?",
    ),
    "fibres outside": (
        "a fibre is {} outside of the muscle",
        "check the fibres there, and do not use fibres outside",
    ),
    "fibres in bone": (
        "a fibre is {} deeper in a bone than at rest",
        "check the fibres there, and do not use fibres in the bone",
    ),
    "penetration": ("a point is {} deeper in a bone than at rest", CLOSED),
    "widespread penetration": (
        "5 % of the free points are {} deeper in a bone than at rest, or more",
        CLOSED,
    ),
}

#: The checks by name; of fibres that are too short small values are bad.
CHECKS = {
    name: Check(*limits, *WORDS[name], smaller=name == "short fibres") for name, limits in LIMITS.items()
}


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
    *("fibres outside", "fibres in bone", "squeezed", "coarse", "unsettled"),
    *("hooked paths", "fibres and paths"),
)


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

    unsettled = column("unsettled")
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
        "coarse": column("sag_p95_mm"),
        "hooked paths": 100.0 * column("hooked_paths"),
        "unsettled": 100.0 * unsettled * unsettled.sum() / max(len(rows), 1),
        "widespread penetration": column("penetration_new_p95_mm"),
    }
    missing = {"penetration": "no bone has an inside", "widespread penetration": "no bone has an inside"}
    if fibres is None or not len(fibres.lengths):
        missing |= dict.fromkeys((*_OF_FIBRES, *_AT_REST), "the muscle has no fibres")
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
        for name, (key, scale) in _AT_REST.items():
            values[name] = np.full(len(rows), scale * fibres.at_rest[key])
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
