"""Curves of a page over the motion."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.io.literature import LiteratureCurve, curves_for, drawn
from vtkmuscle.plotting.views import PALETTE
from vtkmuscle.report.scene3d import Pack

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result

#: Single fibres drawn per muscle, at most.
MOST_FIBRES = 100
#: Change of a measure, relative to its limit, below which words replace the curve.
_FLAT = 1e-3
#: Both sides of an error.
_BOTH = np.array([[-1.0], [1.0]])
#: Minus sign of negative numbers.
MINUS = "\u2212"


class Measure(NamedTuple):
    """A shape measure on a page: key in the rows, check with the limits, titles of curve and column.

    ``factor`` times the value plus ``offset`` has the unit of the limits; ``of_all`` names the function of
    NumPy that gives the value in the table from the sizes in all frames.
    """

    key: str
    check: str = ""
    curve: str = ""
    head: str = ""
    factor: float = 1.0
    offset: float = 0.0
    of_all: str = "max"

    def __call__(self, values: Floats) -> Floats:
        """Return values in the limits' unit."""
        return self.factor * values + self.offset


#: Titles and factors of quantities on a page.
QUANTITIES = tomllib.loads((files("vtkmuscle.report") / "quantities.toml").read_text(encoding="utf-8"))
#: Measures on a page.
MEASURES = tuple(Measure(**row) for row in QUANTITIES["measures"])


def curves_of(run: Result, pack: Pack) -> dict[str, Any]:
    """Return the curves of a page, ready for JSON. Single fibres are added to the pack."""
    time_name, _, unit = run.time_label.partition(" [")
    muscles = [_muscle(run, name, colour_of(index), pack) for index, name in enumerate(run.muscle_names)]
    shown = [each for each in MEASURES if any(each.key in muscle["checks"] for muscle in muscles)]
    return {
        "times": rounded(run.times),
        "timeLabel": run.time_label,
        "timeName": time_name,
        "timeUnit": f" {unit.removesuffix(']')}".rstrip(),
        "muscles": muscles,
        "coordinates": _coordinates(run),
        "checks": [_check(run, measure, run.limits.get(measure.check)) for measure in shown],
    }


def rounded(values: Any) -> Any:
    """Return numbers to five digits, as lists; None for non-finite numbers."""
    array = np.asarray(values, dtype=np.float64)
    return [_short(value) for value in array.tolist()] if array.ndim == 1 else [rounded(row) for row in array]


def _short(value: float) -> float | None:
    return float(f"{value:.5g}") if math.isfinite(value) else None


def label_of(name: str) -> str:
    """Return the name of a muscle or coordinate in words."""
    return name.replace("_", " ")


def colour_of(index: int) -> str:
    """Return a muscle's colour by its index."""
    return PALETTE[index % len(PALETTE)]


def _muscle(run: Result, name: str, colour: str, pack: Pack) -> dict[str, Any]:
    checks, frames = {}, run.report["muscles"][name]["frames"]
    for measure in MEASURES:
        column = np.array([row.get(measure.key) for row in frames], dtype=np.float64)  # None is NaN
        if measure.curve and not np.isnan(column).all():
            values = measure(column)
            checks[measure.key] = rounded(np.where(np.abs(values) < 1e-9, 0.0, values))
    lengths, fibres, arms = run.lengths.get(name), run.fibre_lengths.get(name), run.all_arms.get(name, {})
    published = {axis: curves_for(run.literature.get(name, ()), coordinate=axis) for axis in arms}
    return {
        "name": name,
        "label": label_of(name),
        "colour": colour,
        "lengths": None if lengths is None else _lengths(lengths, pack, run.track(name).errors()["total"]),
        "fibreLengths": None if fibres is None else _lengths(fibres, pack),
        "arms": {axis: _arms(joint, published[axis]) for axis, joint in arms.items()},
        "checks": checks,
    }


def _lengths(lengths: Floats, pack: Pack, error: Floats | float = np.nan) -> dict[str, Any]:
    lower, upper = np.percentile(lengths, (25.0, 75.0), axis=1)
    count = lengths.shape[1]
    drawn = np.unique(np.linspace(0, count - 1, min(count, MOST_FIBRES)).round().astype(int))
    return {
        "mean": rounded(lengths.mean(axis=1)),
        "low": rounded(lengths.min(axis=1)),
        "high": rounded(lengths.max(axis=1)),
        "lower": rounded(lower),
        "upper": rounded(upper),
        "held": rounded(lengths.mean(axis=1) + _BOTH * error),
        "fibres": pack.add(lengths[:, drawn], "f32"),
        "drawn": len(drawn),
    }


def _arms(arms: JointArms, published: Sequence[LiteratureCurve]) -> dict[str, Any]:
    # A sweep up and down repeats values: curves are drawn by ascending value.
    order = np.argsort(arms.values, kind="stable")
    unit = ANGLES.get(arms.unit)
    return {
        "values": rounded(arms.values[order]),
        "mean": rounded(arms.mean[order]),
        "low": rounded(arms.arms.min(axis=1)[order]),
        "high": rounded(arms.arms.max(axis=1)[order]),
        "quartic": None if arms.quartic is None else rounded(arms.quartic.mean(axis=1)[order]),
        "literature": [] if unit is None else published_curves(published, math.pi / 180.0 / unit),
        "held": rounded((arms.mean + _BOTH * arms.errors["total"])[:, order]),
    }


def published_curves(curves: Sequence[LiteratureCurve], per_degree: float = 1.0) -> list[dict[str, Any]]:
    """Return published curves: bands, lines or single values."""
    colours: dict[str, str] = {}
    published = []
    for curve in drawn(curves):
        colour = colours.setdefault(curve.source, PALETTE[-1 - len(colours) % len(PALETTE)])
        sides = {"y": curve.arms} if curve.upper is None else {"low": curve.arms, "high": curve.upper}
        columns = {"x": curve.angles * per_degree, **sides}
        rows = {key: rounded(column) for key, column in columns.items()}
        published.append({"colour": colour, "label": curve.label} | rows)
    return published


def _coordinates(run: Result) -> list[dict[str, Any]]:
    """Return the coordinates of moment arms, with values."""
    every = run.motion.coordinates
    coordinates = {name: every[name] for arms in run.all_arms.values() for name in arms}
    return [
        {
            "name": name,
            "label": label_of(name),
            "unit": coordinate.unit,
            "positive": coordinate.positive,
            "of": "mm" if coordinate.unit in ANGLES else "1",
            "values": rounded(np.asarray(coordinate.values)[list(run.frames)]),
        }
        for name, coordinate in coordinates.items()
    ]


def _check(run: Result, measure: Measure, limit: tuple[float, float] | None) -> dict[str, Any]:
    """Return title, limits and words of a measure."""
    muscles = (run.report["muscles"][name]["frames"] for name in run.muscle_names)
    column = (row.get(measure.key) for frames in muscles for row in frames)
    values = measure(np.array([value for value in column if value is not None], dtype=np.float64))
    check = {"key": measure.key, "label": measure.curve, "flat": None, "look": None, "failed": None}
    if limit is None:
        return check | {"floor": None}
    look, failed = limit
    if len(values) and np.ptp(values) <= _FLAT * abs(look):
        ends = dict.fromkeys(f"{value:.2g}".replace("-", MINUS) for value in (values.min(), values.max()))
        check["flat"] = f"{' to '.join(ends)} in all frames of all muscles; to be checked from {look:g} on."
    floor = [-look, look] if measure.check == "volume" else [look]
    return check | {"look": look, "failed": failed, "floor": floor}
