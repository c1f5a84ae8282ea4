"""Reasons against a muscle's results from what is known twice: its own numbers, a population's, the scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.data.anatomy import PERSONAL, published, published_coordinate
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.run.verdict import LOOK, Reason
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.faults import SceneError

#: Part of a muscle's path that an optimal fibre length may be: 0.105 to 1.33 in 70 published muscles.
SHORTEST_FIBRE, LONGEST_FIBRE = 0.1, 2.0
#: Margin of published moment arms [mm]: the ranges are of single generic models, and from model to model
#: their edges move by as much.
MARGIN = 15.0


@dataclass(frozen=True, eq=False)
class Judged:
    """A muscle with all that is known of its results; lengths of paths are per frame and path [mm]."""

    name: str
    scene: SceneData
    track: MuscleTrack
    arms: Mapping[str, JointArms]
    lengths: Floats | None

    @property
    def anatomical(self) -> str:
        """Name for published numbers."""
        return self.scene.muscles[self.name].muscle or self.name

    @property
    def path(self) -> float:
        """Mean length of the fibres at rest, tendon included [mm]; 0 without fibres."""
        if self.track.rest_fibres is None:
            return 0.0
        lines = polylines_of(self.track.rest_fibres, "fibres")
        return float(polyline_lengths(lines.points, lines.offsets).mean()) * self.scene.millimetres


def further_reasons(muscle: Judged, odd: Sequence[SceneError]) -> Iterator[Reason]:
    """Yield reasons for a look at a muscle; ``odd`` are the implausible parts of the scene."""
    own = f"muscles.{muscle.name}."
    for error in odd:
        # The scale of a scene is no property of a muscle.
        if error.key.startswith(own) or not error.key.startswith(("muscles.", "units")):
            yield _reason(muscle, "plausible", (0.0, 0.0, ""), f"{error.key}: {error.problem}", error.remedy)
    if muscle.path > 0.0:
        yield from _hill(muscle)
        yield from _fascicles(muscle)
        for arms in muscle.arms.values():
            yield from _arms(muscle, arms)


def missing_checks(muscle: Judged) -> dict[str, str]:
    """Return the checks without published numbers, and why."""
    why = 'no published muscle has the name; write muscle = "semimembranosus", for example'
    return {} if published(muscle.anatomical) else {"published arms": why, "fascicles": why}


def _reason(
    muscle: Judged, check: str, found: tuple[float, float, str], says: str, do: str, at: int = 0
) -> Reason:
    """Return a reason for a look: value, limit and unit, ``at`` a kept frame."""
    row = muscle.track.report["frames"][at] if muscle.track.report["frames"] else {"frame": 0, "time": 0.0}
    value, limit, unit = found
    return Reason(check, LOOK, int(row["frame"]), row["time"], float(value), float(limit), unit, says, do)


def _hill(muscle: Judged) -> Iterator[Reason]:
    """Yield Hill's parameters that do not fit the muscle's own path."""
    hill, path = muscle.scene.muscles[muscle.name].hill, muscle.path
    for key, least, most in (
        ("optimal_fibre_length", SHORTEST_FIBRE, LONGEST_FIBRE),
        ("tendon_slack_length", 0.0, 1.0),
    ):
        ratio = hill.get(key, np.nan) * muscle.scene.millimetres / path
        if ratio < least or ratio > most:
            says = f"{key} is {ratio * path:.3g} mm, but the muscle's path is {path:.3g} mm long"
            do = f"check the unit; {least:g} to {most:g} of the path is plausible"
            yield _reason(muscle, "hill", (ratio, most if ratio > most else least, ""), says, do)


def _fascicles(muscle: Judged) -> Iterator[Reason]:
    """Yield fascicles that are too long or too short for the muscle's name."""
    known = published(muscle.anatomical, "fibre_to_path")
    architecture = muscle.track.report.get("architecture")
    if known is None or architecture is None:
        return
    shortest, longest = architecture["fascicle_length_range_mm"]
    low, high = known.low / PERSONAL, known.high * PERSONAL
    if longest < low * muscle.path or shortest > high * muscle.path:
        mean = architecture["fascicle_length_mm"]["mean"]
        says = f"the fascicles are {mean:.3g} mm long, {mean / muscle.path:.2f} of the path; published: "
        says += _span(known.low, known.high, source=known.source)
        limit = high if shortest > high * muscle.path else low
        do = "give aponeuroses, or tendon_slack_length under hill; do not use PCSA and fascicle lengths"
        yield _reason(muscle, "fascicles", (mean / muscle.path, limit, ""), says, do)


def _arms(muscle: Judged, arms: JointArms) -> Iterator[Reason]:
    """Yield moment arms longer than the muscle, or outside of what is published, at the worst value."""
    mean, frames = arms.mean, arms.frames.tolist()
    if arms.unit not in ANGLES or muscle.lengths is None or not np.isfinite(mean).any():
        return
    longer = np.nan_to_num(np.abs(mean) / muscle.lengths[frames].mean(axis=1))
    worst = int(longer.argmax())
    if longer[worst] > 1.0:
        says = f"the moment arm by {arms.coordinate} is {mean[worst]:.3g} mm, longer than the muscle"
        do = "check the coordinate's unit, the joint's centre and the attachments"
        yield _reason(muscle, "arm and length", (longer[worst], 1.0, ""), says, do, frames[worst])
    coordinate, sign = published_coordinate(arms.coordinate, arms.positive)
    known = published(muscle.anatomical, "moment_arm", coordinate) if coordinate else None
    length = published(muscle.anatomical, "path_length")
    angles = sign * np.degrees(arms.values * ANGLES[arms.unit])
    if known is None or length is None:
        return
    size = muscle.path / np.array([length.high * PERSONAL, length.low / PERSONAL])
    low, high = ((known.low - MARGIN) * size).min(), ((known.high + MARGIN) * size).max()
    within = (angles >= known.values[0]) & (angles <= known.values[1]) & np.isfinite(mean)
    if not within.any():
        return
    own = np.where(within, sign * mean, np.nan)
    worst, sweep = int(np.nanargmax(np.maximum(low - own, own - high))), float(np.nanmean(own))
    certain = known.low * known.high > 0.0 and max(abs(known.low), abs(known.high)) > MARGIN
    opposite = certain and sweep * known.low < 0.0
    if opposite or not low <= own[worst] <= high:
        limit = 0.0 if opposite else sign * (low if own[worst] < low else high)
        whole = f", of the other sign over the whole motion ({sign * sweep:.3g} mm)" if opposite else ""
        says = (
            f"the mean moment arm by {arms.coordinate} is {mean[worst]:.3g} mm at {sign * angles[worst]:.3g} "
        )
        says += f"degrees{whole}; published [mm]: "
        says += _span(*sorted([sign * known.low, sign * known.high]), source=known.source)
        do = "check the attachments, the axis and the surface there"
        yield _reason(muscle, "published arms", (mean[worst], limit, "mm"), says, do, frames[worst])


def _span(low: float, high: float, *, source: str) -> str:
    return f"{low:g} to {high:g} ({source})" if low < high else f"{low:g} ({source})"
