"""What a study keeps of a muscle that was run: lengths, moment arms, their errors, and the verdict."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import group_fibres
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import points_of, polylines_of
from vtkmuscle.io.parts import Part
from vtkmuscle.run.result import Result
from vtkmuscle.scene.data import MILLIMETRES

#: Arrays that are kept where they are asked for.
POINTS, PICTURE = "points", "picture"


@dataclass(frozen=True, eq=False)
class Outcome:
    """A muscle in the frames that it has finished.

    Attributes
    ----------
    facts : dict
        JSON-able: ``failure``, why there is nothing else; or ``verdict``, ``reasons``, ``remarks``,
        ``times``, ``frames`` (numbers), ``complete`` (whether these are all), ``fibres`` (of each group),
        ``coordinates`` (name, unit, positive direction), ``volume_mm3``, ``seconds``; with points ``rows``
        (of the report) and ``points_at``, their times.
    arrays : dict of str to array
        ``lengths``, ``length_errors``, ``fibre_lengths`` (f, k) and ``rest`` (1, k) of the groups of fibres
        [mm], none of a muscle without; of the i-th coordinate ``armsI`` and so on; ``points`` (f, n, 3) [mm]
        and ``picture``, where they were asked for.
    """

    facts: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(
        cls, result: Result, name: str, groups: int | None, points_at: Collection[float], *, picture: bool
    ) -> Self:
        """Return that of a muscle of a run; parameters as of :class:`~vtkmuscle.studies.case.Case`."""
        report, count = result.report["muscles"][name], result.finished(name)
        facts: dict[str, Any] = {
            "verdict": report["verdict"]["verdict"],
            "reasons": report["verdict"]["reasons"],
            "frames": list(result.frames[:count]),
            "times": list(result.times[:count]),
            "complete": count == len(result.frames),
            "volume_mm3": report["volume_mm3"],
            "seconds": report["seconds"],
            "coordinates": [],
            "fibres": [],
        }
        arrays: dict[str, NDArray[Any]] = {}
        if name in result.fibre_lengths:
            fibres, paths, errors = result.fibre_lengths[name], result.lengths.get(name), result.errors[name]
            labels = np.arange(fibres.shape[1])
            if groups is not None:
                labels = group_fibres(fibres if paths is None else paths, groups)
            facts["fibres"] = np.bincount(labels).tolist()
            rested = polylines_of(result.plain().rest_fibres(name), "fibres")
            rest = polyline_lengths(rested.points, rested.offsets) * MILLIMETRES[result.units]
            measured = {"rest": rest[None], "fibre_lengths": fibres}
            if paths is not None:
                measured |= {"lengths": paths, "length_errors": _total(errors.get("each_length"), paths)}
            for number, one in enumerate(_arms(result, name)):
                facts["coordinates"].append([one.coordinate, one.unit, one.positive])
                off = _total(errors.get(f"each_moment_arm_{one.coordinate}"), one.arms)
                measured |= {f"arms{number}": one.arms, f"slopes{number}": one.slopes, f"errors{number}": off}
                arrays |= {f"frames{number}": np.asarray(one.frames, np.int64), f"values{number}": one.values}
            arrays |= {key: _grouped(values, labels) for key, values in measured.items()}
        if points_at:
            kept = [time for time in facts["times"] if time in points_at]
            facts |= {"rows": report["frames"], "points_at": kept}
            shapes = [points_of(result.plain().muscle(name, time=time)) for time in kept]
            arrays[POINTS] = np.array(shapes) * MILLIMETRES[result.units]
        if picture:
            from vtkmuscle.studies.pictures import strip  # noqa: PLC0415 -- matplotlib is slow to import

            arrays[PICTURE] = np.frombuffer(strip(result.plain(), name), dtype=np.uint8)
        return cls(facts, arrays)

    @classmethod
    def read(cls, part: Part) -> Self:
        """Return what was kept as a part."""
        return cls(part.facts, part.arrays)

    @property
    def failure(self) -> str:
        """Why there is nothing; "" where there is something."""
        return str(self.facts.get("failure", ""))

    @property
    def message(self) -> str:
        """Why there is nothing, or what is to be looked at."""
        return self.failure or "; ".join(one["says"] for one in self.facts["reasons"])

    @property
    def arms(self) -> dict[str, JointArms]:
        """Moment arms of the groups of fibres by coordinate."""
        found = {}
        for number, (name, unit, positive) in enumerate(self.facts["coordinates"]):
            keys = ("frames", "values", "arms", "slopes")
            frames, values, arms, slopes = (self.arrays[f"{key}{number}"] for key in keys)
            found[name] = JointArms(name, unit, positive, frames, values, arms, slopes, None, None)
        return found

    def arm_errors(self, coordinate: str) -> Floats:
        """Return the errors of the moment arms by a coordinate, as its ``arms``; NaN where unknown."""
        names = [name for name, _, _ in self.facts["coordinates"]]
        return np.asarray(self.arrays[f"errors{names.index(coordinate)}"])


def _arms(result: Result, name: str) -> list[JointArms]:
    """Return the moment arms of a muscle, none where none are known."""
    try:
        return list(result.moment_arms().get(name, {}).values())
    except InputError:  # why is in no number
        return []


def _total(estimate: Any, like: Floats) -> Floats:
    known = estimate is not None and estimate.total.shape == like.shape
    return np.asarray(estimate.total) if known else np.full(like.shape, np.nan)


def _grouped(values: Floats, labels: Ints) -> Floats:
    """Return the means of the columns of each group."""
    return np.column_stack([values[:, labels == group].mean(axis=1) for group in range(labels.max() + 1)])
