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
    segment_errors,
)
from vtkmuscle.core.mesh.enclosed_volume import rounded_volume
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, polylines_of, triangles_of
from vtkmuscle.data.paths import paths_of
from vtkmuscle.run.tracks import MuscleTrack

#: What further solves tell of, by the names that a run is asked for them.
KINDS = ("model", "mesh", "slices", "landmarks")
#: Those of them that take nothing but the scene.
SOLVED = KINDS[:-1]
#: Orders of convergence: of a muscle's shape in its edges, the lowest there is, since that of position based
#: dynamics is not known; and of fibres in their segments, chords of curves.
MESH_ORDER, SLICES_ORDER = 1.0, 2.0

#: From what is (...) and others of it (n, ...) to an expanded uncertainty (...).
Rule = Callable[[Floats, Floats], Floats]


def _apart(value: Floats, others: Floats) -> Floats:
    """Return how far the one other is off: a difference that is known, and not corrected for."""
    return np.asarray(np.abs(others[0] - value))


#: Per cause, what its other lengths say.
RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "segments": _apart,
        "model": lambda value, others: expanded_of_bounds(others[0] - value),
        "mesh": lambda value, others: convergence_error(value, others[0], order=MESH_ORDER),
        "slices": lambda value, others: convergence_error(value, others[0], order=SLICES_ORDER),
        "landmarks": lambda _, others: expanded_of_samples(others),
    }
)


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause, and lengths as they would be without it, or with more of it.

    Attributes
    ----------
    name : str
        A key of :data:`RULES`.
    lengths : sequence of (f, k) arrays
        Of the paths, or of the fibres, in each frame [mm].
    rest : sequence of (k,) arrays
        Of the fibres at rest [mm]; none where the cause has no part in them.
    arms : sequence of dict of str to JointArms
        Of the paths by coordinate, where these are known; else what lengths say of them.
    """

    name: str
    lengths: Sequence[Floats]
    rest: Sequence[Floats] = ()
    arms: Sequence[Mapping[str, JointArms]] = ()

    def part(self, of: Callable[[Floats], Floats], value: Floats, lengths: Sequence[Floats]) -> Floats:
        """Return the part of the error of a quantity that is made of lengths.

        Parameters
        ----------
        of : callable
            From lengths to the quantity.
        value : array
            The quantity.
        lengths : sequence of array
            ``lengths`` or ``rest``.
        """
        return RULES[self.name](value, np.array([of(other) for other in lengths]))


#: By a coordinate, from lengths (f, k) of paths to -dl/dq (m, k).
Slopes = Callable[[str, Floats], Floats]

#: A triangle's chords are off a smooth surface by the square of their length.
FACET_ORDER = 2.0
#: Length of fascicles as a part of their muscle's, where these are shortest: the semimembranosus, of the four
#: hamstrings of eight cadavers (Kellis et al. 2012, doi:10.1016/j.jelekin.2012.03.012; others 0.27 to 0.58).
SHORTEST_FASCICLE = 0.22


def causes_of_fibres(track: MuscleTrack, millimetres: float) -> list[Cause]:
    """Return the causes whose part in the lengths of fibres is known without a further solve.

    ``segments``: chords for arcs. ``millimetres`` is the length of the scene's unit.
    """
    lengths = np.array(track.fibre_lengths)
    assert track.rest_fibres is not None  # there are frames of them
    rested = polylines_of(track.rest_fibres, "fibres")
    rest = polyline_lengths(rested.points, rested.offsets)
    lines = (polylines_of(frame, "fibres") for frame in track.fibres)
    chords = np.array([segment_errors(one.points, one.offsets) for one in lines])
    of_rest = segment_errors(rested.points, rested.offsets)
    return [Cause("segments", [lengths + chords * millimetres], [(rest + of_rest) * millimetres])]


def causes_of_paths(track: MuscleTrack, millimetres: float) -> list[Cause]:
    """Return the causes whose part in the lengths of paths is known without a further solve: ``segments``."""
    chords = []
    for frame in track.fibres:
        paths = paths_of(frame, "fibres")
        assert paths is not None  # there are lengths of them
        k, n, _ = paths.points.shape
        chords.append(segment_errors(paths.points.reshape(-1, 3), n * np.arange(k + 1)))
    return [Cause("segments", [np.array(track.lengths) + np.array(chords) * millimetres])]


def length_estimates(name: str, lengths: Floats, causes: Sequence[Cause]) -> dict[str, Estimate]:
    """Return NAME, of the mean length per frame (f,), and ``each_NAME`` (f, k), of lengths (f, k) [mm]."""
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

    ``slopes``: what the lever of a pull and -dl/dq of its path differ by, taken as bounds of the error; where
    poses do not tell -dl/dq it adds nothing.

    Parameters
    ----------
    known : dict of str to JointArms
        The moment arms.
    causes : sequence of Cause
        Where one has no moment arms, its lengths say by their slopes how much others they would be.
    slopes : callable
        From lengths (f, k) to -dl/dq (m, k), NaN where it is not known, by a coordinate.
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

    ``facets``: flat triangles for a round surface. ``solve``: by how much the volume is not kept.
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
    """Return areas and fascicle length: quotients and parts, whose relative variances add.

    JCGM 100:2008, 5.1.6, eq. 12, cause by cause. ``tendon``: the range over what may count as tendon.
    ``aponeuroses``, where none are given: fascicles that end on them are shorter, down to
    :data:`SHORTEST_FASCICLE` of the muscle's length, and areas as much larger.

    Parameters
    ----------
    architecture : mapping
        Of the report.
    volume : Estimate
        At rest or in motion; what is not kept in motion does not count.
    rest : Estimate
        Mean length of the fibres at rest (1,).

    Returns
    -------
    dict of str to Estimate
        ``pcsa`` and ``pcsa_without_tendon`` [mm^2], ``fascicle_length`` [mm], (1,) each.
    """
    facets = {"facets": volume.parts["facets"][:1] / volume.value[:1]}
    relative = {cause: part / rest.value for cause, part in rest.parts.items()}
    given = (
        ("pcsa", architecture["pcsa_mm2"], "mm^2", facets | relative, None),
        (
            "pcsa_without_tendon",
            architecture["pcsa_without_tendon_mm2"],
            "mm^2",
            facets | relative,
            architecture["pcsa_without_tendon_range_mm2"],
        ),
        (
            "fascicle_length",
            architecture["fascicle_length_mm"]["mean"],
            "mm",
            relative,
            architecture["fascicle_length_range_mm"],
        ),
    )
    estimates = {}
    unknown = architecture["tendon_from"] == "estimate"
    for name, value, unit, shares, bounds in given:
        parts = {cause: np.array([value]) * share for cause, share in shares.items()}
        if bounds is not None:
            parts["tendon"] = expanded_of_bounds([(bounds[1] - bounds[0]) / 2.0])
        least = SHORTEST_FASCICLE if unknown else 1.0
        parts["aponeuroses"] = np.array([value * ((1.0 - least) if unit == "mm" else (1.0 / least - 1.0))])
        estimates[name] = Estimate(np.array([value]), unit, parts)
    return estimates


def rest_estimate(rest: Floats, causes: Sequence[Cause]) -> Estimate:
    """Return the mean length of the fibres at rest (1,), of their lengths (k,) [mm]."""
    mean = np.array([rest.mean()])
    parts = {
        cause.name: cause.part(lambda other: np.array([other.mean()]), mean, cause.rest)
        for cause in causes
        if len(cause.rest)
    }
    return Estimate(mean, "mm", parts | _of_number(rest[:, None]))


def _of_number(values: Floats) -> dict[str, Floats]:
    """Return what a mean owes to the number of fibres, of values (k, ...); nothing of a single one."""
    return {"fibres": expanded_of_samples(values, of_mean=True)} if len(values) > 1 else {}


def _itself(value: Floats) -> Floats:
    return value


def _mean_of_last(value: Floats) -> Floats:
    return np.asarray(value.mean(axis=-1))
