"""Lengths, moment arms, volume and area of a muscle with their errors, cause by cause."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from vtkmuscle.core.estimate import (
    Estimate,
    convergence_error,
    expanded_of_bounds,
    expanded_of_samples,
)
from vtkmuscle.core.mesh.rest_shape import rounded_volume
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.run.frames import MuscleTrack

#: Causes whose part takes further solves, and those of them that need nothing but the scene.
KINDS = ("model", "mesh", "slices", "landmarks")
SOLVED = KINDS[:-1]
#: Orders of convergence: of a muscle's shape in its edges, the lowest there is, since that of position based
#: dynamics is not known; of fibres in their segments, which are chords of curves; and of a smooth surface in
#: its triangles.
MESH_ORDER, SLICES_ORDER, FACET_ORDER = 1.0, 2.0, 2.0
#: Length of fascicles as a part of their muscle's, where these are shortest: the semimembranosus, of the four
#: hamstrings of eight cadavers (Kellis et al. 2012, doi:10.1016/j.jelekin.2012.03.012; others 0.27 to 0.58).
SHORTEST_FASCICLE = 0.22

#: From a value (...) and other values of it (n, ...) to an expanded uncertainty (...).
Rule = Callable[[Floats, Floats], Floats]
#: By a coordinate, from lengths (f, k) of paths to -dl/dq (m, k), NaN where poses do not tell it.
Slopes = Callable[[str, Floats], Floats]


def _difference(value: Floats, others: Floats) -> Floats:
    """Return the difference from one other value, which is known and not corrected for."""
    return np.asarray(np.abs(others[0] - value))


#: Per cause, the rule by which its other lengths give its part of an error.
RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "segments": _difference,
        "model": lambda value, others: expanded_of_bounds(others[0] - value),
        "mesh": lambda value, others: convergence_error(value, others[0], order=MESH_ORDER),
        "slices": lambda value, others: convergence_error(value, others[0], order=SLICES_ORDER),
        "landmarks": lambda _, others: expanded_of_samples(others),
    }
)


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause of error, a key of :data:`RULES`, with the lengths as they would be without it.

    ``lengths`` (f, k) are those of the paths or fibres, ``rest`` (k,) of the fibres at rest [mm], and
    ``arms`` the moment arms of the paths by coordinate; each once or several times, or none.
    """

    name: str
    lengths: Sequence[Floats]
    rest: Sequence[Floats] = ()
    arms: Sequence[Mapping[str, JointArms]] = ()

    def part(self, of: Callable[[Floats], Floats], value: Floats, lengths: Sequence[Floats]) -> Floats:
        """Return the cause's part of the error of a quantity; ``of`` gives the quantity of ``lengths``."""
        return RULES[self.name](value, np.array([of(other) for other in lengths]))


def chord_errors(track: MuscleTrack, millimetres: float) -> tuple[Floats, Floats]:
    """Return by how much arcs are longer than their chords, of fibres and of paths (f, k) each [mm]."""
    of_paths = [one.path_chords for one in track.numbers if one.path_chords is not None]
    return np.array([one.chords for one in track.numbers]) * millimetres, np.array(of_paths) * millimetres


def length_estimates(name: str, lengths: Floats, causes: Sequence[Cause]) -> dict[str, Estimate]:
    """Return the estimates NAME of the mean of lengths (f, k) and ``each_NAME`` of every one [mm]."""
    mean = lengths.mean(axis=1)
    parts = {cause.name: cause.part(_mean_of_last, mean, cause.lengths) for cause in causes}
    of_each = {cause.name: cause.part(_itself, lengths, cause.lengths) for cause in causes}
    return {
        name: Estimate(mean, "mm", parts | _of_number(lengths.T)),
        f"each_{name}": Estimate(lengths, "mm", of_each),
    }


def arm_estimates(
    known: Mapping[str, JointArms], causes: Sequence[Cause], slopes: Slopes
) -> dict[str, Estimate]:
    """Return ``moment_arm_NAME`` (m,) by each coordinate, and ``each_moment_arm_NAME`` (m, k) [mm].

    ``slopes``: the difference of the lever of a pull and -dl/dq of its path bounds the error; it is 0 where
    -dl/dq is not known. Where a cause has no moment arms, they follow from the slopes of its lengths.
    """
    estimates: dict[str, Estimate] = {}
    for name, found in known.items():
        off = np.nan_to_num(found.arms - found.slopes)
        of_mean: dict[str, Floats] = {"slopes": expanded_of_bounds(off.mean(axis=1))}
        of_each: dict[str, Floats] = {"slopes": expanded_of_bounds(off)}
        for cause in causes:
            if cause.arms:
                others = [one[name].arms for one in cause.arms]
            else:
                change = (slopes(name, one) - found.slopes for one in cause.lengths)
                others = [found.arms + np.nan_to_num(one) for one in change]
            means = [one.mean(axis=1) for one in others]
            of_mean[cause.name] = cause.part(_itself, found.mean, means)
            of_each[cause.name] = cause.part(_itself, found.arms, others)
        estimates[f"moment_arm_{name}"] = Estimate(found.mean, "mm", of_mean | _of_number(found.arms.T))
        estimates[f"each_moment_arm_{name}"] = Estimate(found.arms, "mm", of_each)
    return estimates


def volume_estimate(track: MuscleTrack, millimetres: float) -> Estimate:
    """Return the muscle's volume per frame (f,), or at rest (1,) where it is not deformed [mm^3].

    ``facets`` is the error of flat triangles for a round surface, ``solve`` the change of volume.
    """
    assert track.rest is not None  # it was run
    points, triangles = points_of(track.rest), triangles_of(track.rest, "muscle")
    volume = float(track.report["volume_mm3"])
    rounded = rounded_volume(points, triangles) * millimetres**3
    ratios = [row["volume_ratio"] for row in track.report["frames"] if "volume_ratio" in row]
    now = volume * np.array(ratios or [1.0])
    facets = np.broadcast_to(convergence_error(volume, rounded, order=FACET_ORDER), now.shape)
    parts = {"facets": facets}
    return Estimate(now, "mm^3", parts | ({"solve": np.abs(now - volume)} if ratios else {}))


def architecture_estimates(
    architecture: Mapping[str, Any], volume: Estimate, rest: Estimate
) -> dict[str, Estimate]:
    """Return ``pcsa`` and ``pcsa_without_tendon`` [mm^2] and ``fascicle_length`` [mm], (1,) each.

    They are quotients and parts of the volume and of the mean length ``rest`` (1,), whose relative variances
    add, cause by cause (JCGM 100:2008, 5.1.6, eq. 12). ``tendon`` is the range over what may count as tendon.
    ``aponeuroses``, where none are given: fascicles that end on them are shorter, down to
    :data:`SHORTEST_FASCICLE` of the muscle's length, and areas as much larger.
    """
    facets = {"facets": volume.parts["facets"][:1] / volume.value[:1]}
    relative = {cause: part / rest.value for cause, part in rest.parts.items()}
    area, length = architecture["pcsa_without_tendon_mm2"], architecture["fascicle_length_mm"]["mean"]
    bounds_of_area = architecture["pcsa_without_tendon_range_mm2"]
    given = (
        ("pcsa", architecture["pcsa_mm2"], "mm^2", facets | relative, None),
        ("pcsa_without_tendon", area, "mm^2", facets | relative, bounds_of_area),
        ("fascicle_length", length, "mm", relative, architecture["fascicle_length_range_mm"]),
    )
    estimates = {}
    least = SHORTEST_FASCICLE if architecture["tendon_from"] == "estimate" else 1.0
    for name, value, unit, shares, bounds in given:
        parts = {cause: np.array([value]) * share for cause, share in shares.items()}
        if bounds is not None:
            parts["tendon"] = expanded_of_bounds([(bounds[1] - bounds[0]) / 2.0])
        parts["aponeuroses"] = np.array([value * ((1.0 - least) if unit == "mm" else (1.0 / least - 1.0))])
        estimates[name] = Estimate(np.array([value]), unit, parts)
    return estimates


def rest_estimate(rest: Floats, causes: Sequence[Cause]) -> Estimate:
    """Return the estimate of the mean (1,) of the fibres' lengths (k,) at rest [mm]."""
    mean = np.array([rest.mean()])
    parts = {
        cause.name: cause.part(lambda other: np.array([other.mean()]), mean, cause.rest)
        for cause in causes
        if len(cause.rest)
    }
    return Estimate(mean, "mm", parts | _of_number(rest[:, None]))


def _of_number(values: Floats) -> dict[str, Floats]:
    """Return the sampling error of the mean of values (k, ...) of k fibres; none for a single fibre."""
    return {"fibres": expanded_of_samples(values, of_mean=True)} if len(values) > 1 else {}


def _itself(value: Floats) -> Floats:
    return value


def _mean_of_last(value: Floats) -> Floats:
    return np.asarray(value.mean(axis=-1))
