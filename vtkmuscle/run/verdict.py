"""Whether the results of a muscle can be used: ok, look or failed, with the reasons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.length_jumps import even_stretches, length_jumps
from vtkmuscle.core.rigid import RigidMotion
from vtkmuscle.filters.arrays import cell_array

Floats = NDArray[np.float64]

OK, LOOK, FAILED = "ok", "look", "failed"
#: Verdicts, the better one first.
VERDICTS = (OK, LOOK, FAILED)

#: Cell array of fibres: the length that each would have pulled taut, in the scene's unit.
TAUT_LENGTH = "TautLength"

#: Limits that are lengths are for muscles of this size or larger (diagonal of the box at rest) [mm]; for
#: smaller ones they are less in proportion.
FULL_SIZE = 100.0

# A muscle exerts no active force below half of its optimal length, nor above 1.6 to 1.7 times of it: Zajac
# 1989, "Muscle and tendon", Crit Rev Biomed Eng 17:359; Gordon, Huxley, Julian 1966,
# doi:10.1113/jphysiol.1966.sp007909 (sarcomeres of 1.27 and 3.65 um, where the optimum is 2.05 to 2.2). Half
# as much again is what no fibre survives.
SHORTEST, LONGEST = 0.5, 1.6
BEYOND = 1.5


@dataclass(frozen=True)
class Check:
    """What is looked at in each frame, and from where on it is said.

    Attributes
    ----------
    look, failed : float
        Limits: beyond the first one the results should be looked at, beyond the other they are of no use.
    unit : str
        Of the limits; those in "mm" are less for muscles smaller than 100 mm.
    says : str
        What is wrong, with the value as ``{}``.
    do : str
        What to do about it.
    smaller : bool
        Whether small values are bad ones.
    """

    look: float
    failed: float
    unit: str
    says: str
    do: str
    smaller: bool = False


_STEPS = "use smaller steps of the motion, more iterations or another solver, and look at its surface there"

#: What is judged. The limits, and why they are what they are:
CHECKS = {
    # P21 (doi:10.1007/978-3-030-72379-8_24), Fig. 11: less than 1 % with few iterations; 5 % is seen by eye.
    "volume": Check(1.0, 5.0, "%", "its volume is off by {}", _STEPS),
    # They are set, not solved for: anything but rounding is a fault.
    "fixed points": Check(
        0.01, 1.0, "mm", "a point that is fixed to a bone is {} off it", "report this: it is a fault"
    ),
    "long edges": Check(
        LONGEST,
        BEYOND * LONGEST,
        "",
        "one in twenty edges is {} times as long as at rest, or more",
        "check its attachments and how far the motion takes them apart; " + _STEPS,
    ),
    "short edges": Check(
        SHORTEST,
        SHORTEST / BEYOND,
        "",
        "one in twenty edges is {} times as long as at rest, or less",
        "look whether it folds there; " + _STEPS,
        smaller=True,
    ),
    # On muscles that move well single edges beside an attachment get up to 2.1 times as long, and 3.1 on a
    # thin tendon of slivers; where one crumples it is 5 to 23.
    "longest edge": Check(
        3.5,
        5.0,
        "",
        "an edge is {} times as long as at rest",
        "look at the surface there: spikes come from badly shaped triangles, so remesh it; " + _STEPS,
    ),
    # Where muscles move well the 95th percentile is up to 20 degrees over 90 of the joint; where they crumple
    # it is 36 to 61.
    "crumpled": Check(
        30.0,
        45.0,
        "deg",
        "the surface is crumpled: one in twenty edges is bent by {} since rest, or more",
        "look at the surface there; " + _STEPS,
    ),
    # An edge whose triangles lie on each other, and did not at rest. Few are a crease, as in a groin.
    "folded": Check(
        0.5,
        3.0,
        "%",
        "{} of its edges are folded back and were not at rest",
        "look at the surface; " + _STEPS,
    ),
    "long fibres": Check(
        LONGEST,
        BEYOND * LONGEST,
        "",
        "one in twenty fibres is {} times as long as at rest, or more",
        "check its attachments, and whether the motion is one that the joint can do",
    ),
    "short fibres": Check(
        SHORTEST,
        SHORTEST / BEYOND,
        "",
        "one in twenty fibres is {} times as long as at rest, or less",
        "check its attachments, and whether the motion is one that the joint can do",
        smaller=True,
    ),
    # A jump of 1 mm from one frame to the next is a moment arm that is wrong by 57 mm at steps of 1 degree.
    # A muscle that buckled made jumps of 18 mm.
    "jumps": Check(
        1.0,
        5.0,
        "mm",
        "a fibre's length jumps by {}: the muscle buckles or snaps over a bone",
        "use smaller steps of the motion, and do not use moment arms about there",
    ),
    # 5 % of a fibre of 100 to 200 mm are 5 to 10 mm that a taut muscle would not have: over 60 degrees a
    # moment arm that is wrong by 5 to 10 mm.
    "slack": Check(
        1.05,
        1.15,
        "",
        "one fibre in ten is {} times as long as one pulled taut, or more: it hangs loose",
        "do not use its lengths and moment arms there; take those of taut fibres, or a stiffer model",
    ),
    # FibreTransport keeps points to rounding inside where the muscle does not fold; at rest 0.5 mm counts as
    # inside. A fibre that is 15 mm off is anywhere.
    "fibres outside": Check(
        0.5,
        15.0,
        "mm",
        "a fibre is {} outside of the muscle",
        "look at the fibres there, and do not use those that are outside",
    ),
    # 15 mm deep is the middle of a femur's shaft.
    "fibres in bone": Check(
        1.0,
        15.0,
        "mm",
        "a fibre is {} deeper in a bone than at rest",
        "look at the fibres there, and do not use those that run through the bone",
    ),
    # The limit is the solver's tolerance where it has one.
    "estimate": Check(
        1.0,
        10.0,
        "mm",
        "it is an estimated {} from where the solve leads to (root mean square)",
        "give it more iterations, a tolerance, or smaller steps of the motion",
    ),
    # What the solver promises is 0.1 mm (95th percentile); a point 5 mm deep has gone through a thin bone.
    "penetration": Check(
        0.5,
        5.0,
        "mm",
        "a point is {} deeper in a bone than at rest",
        "use smaller steps of the motion, or look whether it is squeezed between two bones",
    ),
    "widespread penetration": Check(
        0.1,
        1.0,
        "mm",
        "one in twenty free points is {} deeper in a bone than at rest, or more",
        "use smaller steps of the motion, or look whether it is squeezed between two bones",
    ),
}


@dataclass(frozen=True)
class Reason:
    """Why a verdict is not ok: the worst frame of one check.

    Attributes
    ----------
    check, verdict : str
        What was checked, and what that gives.
    frame, time : int, float
        The worst frame.
    value, limit : float
        What was found there, and the limit that it is beyond.
    unit : str
        Of both.
    says, do : str
        In words, and what to do about it.
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


def judge(
    rows: Sequence[Mapping[str, Any]],
    *,
    lengths: Floats | None = None,
    rest_lengths: Floats | None = None,
    slackness: Floats | None = None,
    motion: RigidMotion | None = None,
    n_edges: int = 1,
    size: float = FULL_SIZE,
    tolerance: float | None = None,
    failure: tuple[int, float, str] | None = None,
) -> dict[str, Any]:
    """Return the verdict on a muscle, from what was measured of its frames.

    Parameters
    ----------
    rows : sequence of mapping
        Per frame, as in the report.
    lengths : (f, k) array, optional
        Of the fibres in these frames [mm].
    rest_lengths : (k,) array, optional
        At rest [mm].
    slackness : (f, k) array, optional
        Length / length pulled taut.
    motion : RigidMotion, optional
        At the times of the rows: where it turns back, lengths may too.
    n_edges : int, optional
        Of the surface.
    size : float, optional
        Diagonal of the muscle's box at rest [mm].
    tolerance : float, optional
        Of the solver [mm]; 0 or None where it has none.
    failure : (int, float, str), optional
        Frame and time at which the muscle could not be computed, and why.

    Returns
    -------
    dict
        JSON-able: ``verdict``, the worst of its ``reasons``, which are those of :class:`Reason` from the
        worst on, and ``not_checked``, what was not judged and why.
    """
    values, missing = _series(rows, lengths, rest_lengths, slackness, motion, n_edges)
    reasons = [
        reason
        for name, series in values.items()
        if (reason := _reason(name, series, rows, min(1.0, size / FULL_SIZE), tolerance)) is not None
    ]
    if failure is not None:
        frame, time, why = failure
        problem, _, mend = why.partition("; ")
        says = f"it could not be computed: {problem}"
        do = mend or _STEPS
        reasons.append(Reason("computed", FAILED, frame, time, 0.0, 0.0, "", says, do))
    reasons.sort(key=lambda reason: -VERDICTS.index(reason.verdict))
    return {
        "verdict": reasons[0].verdict if reasons else OK,
        "reasons": [vars(reason) for reason in reasons],
        "not_checked": missing,
    }


def reasons_of(verdict: Mapping[str, Any]) -> list[Reason]:
    """Return the reasons of a verdict, as :func:`judge` gives it or a report has it."""
    return [Reason(**reason) for reason in verdict["reasons"]]


def slackness_of(
    frames: Iterable[Any], lengths: Sequence[Floats], rest: Any, millimetres: float
) -> Floats | None:
    """Return length / taut length of fibres (f, k), where each frame has the cell array ``TautLength``.

    Where the fibres at rest have it too, their own slackness is divided out: a fibre that winds through its
    muscle at rest does not hang loose.

    Parameters
    ----------
    frames : iterable of vtkPolyData
        Fibres of each frame.
    lengths : sequence of (k,) array
        Their lengths [mm].
    rest : vtkPolyData or None
        Fibres at rest, with the cell array ``Length`` beside.
    millimetres : float
        Millimetres per unit of length.
    """
    taut = [_taut(fibres, millimetres) for fibres in frames]
    if not taut or any(one is None for one in taut):
        return None
    ratio: Floats = np.array(lengths) / np.maximum(np.array(taut), 1e-12)
    rested = None if rest is None else _taut(rest, millimetres)
    if rested is not None and rest.GetCellData().HasArray("Length"):
        own = (
            np.asarray(cell_array(rest, "Length", "fibres at rest")) * millimetres / np.maximum(rested, 1e-12)
        )
        ratio = ratio / np.maximum(own, 1.0)
    return ratio


def _taut(fibres: Any, millimetres: float) -> Floats | None:
    if not fibres.GetCellData().HasArray(TAUT_LENGTH):
        return None
    return np.asarray(cell_array(fibres, TAUT_LENGTH, "fibres"), dtype=np.float64) * millimetres


def _series(
    rows: Sequence[Mapping[str, Any]],
    lengths: Floats | None,
    rest_lengths: Floats | None,
    slackness: Floats | None,
    motion: RigidMotion | None,
    n_edges: int,
) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return per check a value for each row (NaN where there is none), and why checks have none."""

    def column(name: str) -> Floats:
        found = [row.get(name) for row in rows]
        return np.array([np.nan if value is None else float(value) for value in found], dtype=np.float64)

    values = {
        "volume": 100.0 * np.abs(column("volume_ratio") - 1.0),
        "fixed points": column("fixed_error_max_mm"),
        "long edges": column("edge_stretch_p95"),
        "short edges": column("edge_stretch_p5"),
        "longest edge": column("edge_stretch_floored_max"),
        "crumpled": column("dihedral_error_p95_deg"),
        "folded": 100.0 * column("folded_edges") / n_edges,
        "estimate": column("estimated_distance_mm"),
        "fibres outside": column("fibres_outside_max_mm"),
        "fibres in bone": column("fibres_penetration_new_max_mm"),
        "penetration": column("penetration_new_max_mm"),
        "widespread penetration": column("penetration_new_p95_mm"),
    }
    missing = {
        "penetration": "no bone has an inside",
        "estimate": "the solver gave none",
    }
    missing = {name: why for name, why in missing.items() if np.isnan(values[name]).all()}
    if lengths is None or rest_lengths is None or not len(lengths):
        missing["fibres"] = "it has none"
    else:
        ratios = lengths / np.maximum(rest_lengths, 1e-12)
        values["long fibres"] = np.percentile(ratios, 95, axis=1)
        values["short fibres"] = np.percentile(ratios, 5, axis=1)
        times = np.array([row["time"] for row in rows], dtype=np.float64)
        stretches = None if motion is None else even_stretches(motion)
        jumps = length_jumps(lengths, times, stretches)
        values["jumps"] = np.concatenate([[0.0], jumps.max(axis=1)]) if len(jumps) else np.zeros(len(times))
        if slackness is None:
            missing["slack"] = f"the fibres have no array {TAUT_LENGTH}"
        else:
            values["slack"] = np.percentile(slackness, 90, axis=1)
    return values, missing


def _reason(
    name: str,
    series: Floats,
    rows: Sequence[Mapping[str, Any]],
    scale: float,
    tolerance: float | None,
) -> Reason | None:
    """Return why a check is not ok, None where it is; a value that is not finite is beyond all limits."""
    check = CHECKS[name]
    known = np.array([i for i, value in enumerate(series) if not np.isnan(value)], dtype=np.int64)
    if not len(known):
        return None
    look, failed = (limit * (scale if check.unit == "mm" else 1.0) for limit in (check.look, check.failed))
    if name == "estimate" and tolerance:
        look, failed = tolerance, max(failed, 10.0 * tolerance)
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
    return f"{value:.2g} %" if unit == "%" else f"{value:.3g} {unit.replace('deg', 'degrees')}"
