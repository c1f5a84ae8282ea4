"""The curves of a page: lengths, moment arms and measures of the shape over the motion, as numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.io.literature import LiteratureCurve, curves_for, drawn
from vtkmuscle.plotting.colours import PALETTE
from vtkmuscle.report.contents import MuscleContent, RunContent
from vtkmuscle.report.scene3d import Pack

#: Fibres of a muscle that are drawn one by one, at most.
MOST_FIBRES = 100
#: A measure is given in words where it changes by less than this part of its limit.
_FLAT = 1e-3
#: Digits of numbers in the data of a page.
_DIGITS = 5
#: Stands before a number that is negative.
MINUS = "\u2212"

#: Titles of measures that are long.
_SHARE = "surface out of shape, largest share [%]"
_BENT = "change of angles between triangles, 95th percentile [deg]"
_DEEPER = "depth in a bone that was not there at rest [mm]"
_OUTSIDE = "fibres out of their muscle [mm]"
_IN_BONE = "fibres in bone that were not there at rest [mm]"


def _largest(values: Floats) -> float:
    return float(np.abs(values).max())


class Measure(NamedTuple):
    """A measure of the shape, and how a page shows it.

    Attributes
    ----------
    key, check : str
        Key in the rows of frames, and the check whose limits apply, if any.
    curve, head : str
        Title of its curve and of its column; "" for none.
    factor, offset : float
        ``factor`` times the value plus ``offset`` is in the limits' unit.
    of_all : callable
        Takes the values of all frames, and returns that of the table.
    """

    key: str
    check: str
    curve: str
    head: str
    factor: float = 1.0
    offset: float = 0.0
    of_all: Callable[[Floats], Any] = _largest

    def __call__(self, values: Floats) -> Floats:
        """Return values in the limits' unit."""
        return self.factor * values + self.offset


#: The measures of a page.
MEASURES = (
    Measure(
        "volume_ratio", "volume", "change of the volume [%]", "volume, largest change [%]", 100.0, -100.0
    ),
    Measure("misshapen_area", "misshapen", "surface out of shape, share of its area [%]", _SHARE, 100.0),
    Measure("dihedral_error_p95_deg", "crumpled", _BENT, "angles changed, 95th percentile [deg]"),
    Measure("penetration_new_max_mm", "penetration", _DEEPER, "deeper in a bone than at rest [mm]"),
    Measure("fibres_outside_max_mm", "fibres outside", _OUTSIDE, "fibres out of the muscle [mm]"),
    Measure("fibres_penetration_new_max_mm", "fibres in bone", _IN_BONE, ""),
    Measure("fixed_error_max_mm", "fixed points", "", "fixed points off their bone [mm]"),
    Measure("overlap_max_mm", "", "", "in another muscle [mm]"),
    Measure("iterations", "", "", "iterations, mean", of_all=np.mean),
    Measure("ms", "", "", "time per frame [ms], median", of_all=np.median),
)


def curves_of(run: RunContent, pack: Pack) -> dict[str, Any]:
    """Return the curves of a page over the motion, ready for JSON; single fibres are added to the pack."""
    name, _, unit = run.time_label.partition(" [")
    muscles = [
        _muscle(one, muscle, run.report["muscles"][one]["frames"], colour_of(number), pack)
        for number, (one, muscle) in enumerate(run.muscles.items())
    ]
    return {
        "times": rounded(run.times),
        "timeLabel": run.time_label,
        "timeName": name,
        "timeUnit": f" {unit.removesuffix(']')}".rstrip(),
        "muscles": muscles,
        "coordinates": _coordinates(run),
        "checks": [
            _check(run, one, run.limits.get(one.check))
            for one in MEASURES
            if any(one.key in muscle["checks"] for muscle in muscles)
        ],
    }


def rounded(values: Any) -> Any:
    """Return numbers to five digits, as lists; None for those that are not finite."""
    array = np.asarray(values, dtype=np.float64)
    return [_short(value) for value in array.tolist()] if array.ndim == 1 else [rounded(row) for row in array]


def _short(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None


def label_of(name: str) -> str:
    """Return the name of a muscle or coordinate in words."""
    return name.replace("_", " ")


def colour_of(number: int) -> str:
    """Return the colour of a muscle by its place in the scene."""
    return PALETTE[number % len(PALETTE)]


def _muscle(
    name: str, muscle: MuscleContent, frames: Sequence[Mapping[str, Any]], colour: str, pack: Pack
) -> dict[str, Any]:
    checks = {}
    for one in MEASURES:
        values = [row.get(one.key) for row in frames]
        if one.curve and any(value is not None for value in values):
            found = one(np.array(values, dtype=np.float64))  # None is NaN
            checks[one.key] = rounded(np.where(np.abs(found) < 1e-9, 0.0, found))
    lengths, fibres = muscle.lengths, muscle.fibre_lengths
    found_arms = {
        axis: _arms(one, curves_for(muscle.literature, coordinate=axis)) for axis, one in muscle.arms.items()
    }
    return {
        "name": name,
        "label": label_of(name),
        "colour": colour,
        "lengths": None if lengths is None else _lengths(lengths, pack),
        "fibreLengths": None if fibres is None else _lengths(fibres, pack),
        "arms": found_arms,
        "checks": checks,
    }


def _lengths(lengths: Floats, pack: Pack) -> dict[str, Any]:
    lower, upper = np.percentile(lengths, (25.0, 75.0), axis=1)
    count = lengths.shape[1]
    drawn = np.unique(np.linspace(0, count - 1, min(count, MOST_FIBRES)).round().astype(int))
    return {
        "mean": rounded(lengths.mean(axis=1)),
        "low": rounded(lengths.min(axis=1)),
        "high": rounded(lengths.max(axis=1)),
        "lower": rounded(lower),
        "upper": rounded(upper),
        "fibres": pack.add(lengths[:, drawn], "f32"),
        "drawn": len(drawn),
    }


def _arms(found: JointArms, published: Sequence[LiteratureCurve]) -> dict[str, Any]:
    # A sweep up and down has values twice: curves are drawn by ascending value.
    order = np.argsort(found.values, kind="stable")
    quartic = None if found.quartic is None else rounded(found.quartic.mean(axis=1)[order])
    unit = ANGLES.get(found.unit)
    return {
        "values": rounded(found.values[order]),
        "mean": rounded(found.mean[order]),
        "low": rounded(found.arms.min(axis=1)[order]),
        "high": rounded(found.arms.max(axis=1)[order]),
        "quartic": quartic,
        "literature": [] if unit is None else published_curves(published, math.pi / 180.0 / unit),
    }


def published_curves(curves: Sequence[LiteratureCurve], per_degree: float = 1.0) -> list[dict[str, Any]]:
    """Return published curves: bands where a source has two sides, else lines or single values."""
    colours: dict[str, str] = {}
    found = []
    for one in drawn(curves):
        colour = colours.setdefault(one.source, PALETTE[-1 - len(colours) % len(PALETTE)])
        sides = {"y": one.arms} if one.upper is None else {"low": one.arms, "high": one.upper}
        sides = {"x": one.angles * per_degree, **sides}
        found.append({"colour": colour, "label": one.label} | {k: rounded(side) for k, side in sides.items()})
    return found


def _coordinates(run: RunContent) -> list[dict[str, Any]]:
    """Return the coordinates that there are moment arms by, and their values in the kept frames."""
    coordinates = {
        name: run.motion.coordinates[name] for muscle in run.muscles.values() for name in muscle.arms
    }
    return [
        {
            "name": name,
            "label": label_of(name),
            "unit": one.unit,
            "positive": one.positive,
            "of": "mm" if one.unit in ANGLES else "1",
            "values": rounded(np.asarray(one.values)[list(run.frames)]),
        }
        for name, one in coordinates.items()
    ]


def _check(run: RunContent, measure: Measure, limit: tuple[float, float] | None) -> dict[str, Any]:
    """Return a measure's title and limits, and a sentence in place of its curve where it hardly changes."""
    muscles = (run.report["muscles"][name]["frames"] for name in run.muscles)
    found = (row.get(measure.key) for frames in muscles for row in frames)
    values = measure(np.array([value for value in found if value is not None], dtype=np.float64))
    check = {"key": measure.key, "label": measure.curve, "flat": None, "look": None, "failed": None}
    if limit is None:
        return check | {"floor": None}
    look, failed = limit
    if len(values) and np.ptp(values) <= _FLAT * abs(look):
        ends = dict.fromkeys(f"{value:.2g}".replace("-", MINUS) for value in (values.min(), values.max()))
        words = f"{' to '.join(ends)} in all frames of all muscles; looked at from {look:g} on."
        check["flat"] = words
    floor = [-look, look] if measure.check == "volume" else [look]
    return check | {"look": look, "failed": failed, "floor": floor}
