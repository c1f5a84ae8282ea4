"""A muscle without its tendons: lengths and angles of the fascicles, by its cross-section along its way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from vtkmuscle.core.fibres.measures import centroid_path, section_areas
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import evenly_spaced, polyline_lengths
from vtkmuscle.core.types import Floats, Ints

#: Area of a muscle over that of its tendon, at which both together are lightest (Ker, Alexander, Bennett
#: 1988, *Why are mammalian tendons so thick?*, Journal of Zoology 216, 309-324).
MUSCLE_FOR_TENDON = 34.0
#: A place with less than this part of the largest area along the muscle counts as tendon: half way from the
#: muscle's area to the tendon's on a logarithmic scale. The limits of that, a quarter of the way to either
#: side.
TENDON_AREA = MUSCLE_FOR_TENDON**-0.5
TENDON_AREAS = (MUSCLE_FOR_TENDON**-0.75, MUSCLE_FOR_TENDON**-0.25)
#: Points of the medial curve, its degree, passes of its fit, and places at which areas are measured.
NODES, DEGREE, PASSES, PLACES = 17, 2, 8, 40
#: Points of a fibre that are looked up on the curve; part of a fascicle that gives the direction of its end.
POINTS, END = 121, 0.1


@dataclass(frozen=True, eq=False)
class AreaProfile:
    """Areas (s,) of the cross-sections of a muscle [mm^2] along a curve (c, 3) through its middle [mm].

    `arcs` (s,) are the middles of even pieces of the curve, which goes beyond the origin and the insertion.
    """

    curve: Floats
    arcs: Floats
    areas: Floats

    def muscle_between(self, share: float) -> tuple[float, float]:
        """Return the arcs between which it has more than a part of the largest area [mm]."""
        least = share * float(self.areas.max())
        thick = np.flatnonzero(self.areas >= least)
        half = (self.arcs[1] - self.arcs[0]) / 2.0
        return (
            self._crossing(int(thick[0]), -1, least, -half),
            self._crossing(int(thick[-1]), 1, least, half),
        )

    def volume_share(self, low: float, high: float) -> float:
        """Return the part of the volume that is between two arcs [mm]."""
        half = (self.arcs[1] - self.arcs[0]) / 2.0
        inside = np.minimum(self.arcs + half, high) - np.maximum(self.arcs - half, low)
        return float(np.clip(inside / (2.0 * half), 0.0, 1.0) @ self.areas / self.areas.sum())

    def _crossing(self, last: int, step: int, least: float, half: float) -> float:
        """Return where the area falls below the least beside the last place at which it does not."""
        if not 0 <= last + step < len(self.arcs):
            return float(self.arcs[last] + half)
        here, there = self.areas[last], self.areas[last + step]
        return float(self.arcs[last] + 2.0 * half * (here - least) / (here - there))


@dataclass(frozen=True, eq=False)
class Fascicles:
    """The muscle part of fibres, without tendon.

    Lengths (k,) [mm] are 0 for a fibre that has no part in the muscle; the angles (k,) are between both ends
    of the fascicles and the curve through the muscle's middle [degrees]; `volume` is the muscle's [mm^3].
    """

    lengths: Floats
    origin_angles: Floats
    insertion_angles: Floats
    volume: float

    def cross_section(self, lengths: Floats | None = None) -> float:
        """Return the physiological cross-sectional area: volume cos(pennation) / fascicle length [mm^2].

        As of Lieber and Friden 2000, with the mean angle of both ends and the mean of these lengths, or of
        other ``lengths`` (k,) [mm].
        """
        angles = np.concatenate([self.origin_angles, self.insertion_angles])
        mean = float((self.lengths if lengths is None else lengths).mean())
        return self.volume * float(np.cos(np.radians(angles)).mean()) / mean if mean > 0.0 else 0.0


def area_profile(
    surface: Floats, triangles: Ints, samples: Floats, points: Floats, offsets: Ints
) -> AreaProfile:
    """Return the cross-sections of a muscle along its course.

    The curve through its middle is a principal curve (Hastie, Stuetzle 1989,
    doi:10.1080/01621459.1989.10478797): it begins as the fibres' centroid path, and each pass fits a parabola
    to the samples (j, 3), of even density in the muscle, by their arcs on it. (A curve of a higher degree
    curls in thick muscles.) So that of a pennate muscle runs along the muscle, across its fibres. The surface
    (p, 3) with its triangles (m, 3) is closed and faces outward; fibres run from origin to insertion, points
    (n, 3) and offsets (k + 1,).
    """
    curve = centroid_path(points, offsets, NODES)
    for _ in range(PASSES):
        arcs, _ = along(curve, samples)
        places = np.linspace(arcs.min(), arcs.max(), NODES)
        curve = np.column_stack([Polynomial.fit(arcs, x, DEGREE)(places) for x in samples.T])
    arcs, _ = along(curve, surface)
    bounds = np.linspace(arcs.min(), arcs.max(), PLACES + 1)
    middles = (bounds[1:] + bounds[:-1]) / 2.0
    places, normals = _at(curve, middles)
    return AreaProfile(curve, middles, section_areas(surface, triangles, places, normals))


def along(curve: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return the arcs (n,) of the points of a curve nearest to places (n, 3) [mm], and its directions there.

    The ends of the curve (c, 3) go on straight; arcs are negative before its first point.
    """
    begins, lengths, ahead = _segments(curve)
    columns, nearest = np.ascontiguousarray(places.T), np.full(len(places), np.inf)
    arcs, segment = np.zeros(len(places)), np.zeros(len(places), dtype=np.int64)
    for i, (start, way, length) in enumerate(zip(curve[:-1], ahead, lengths, strict=True)):
        low = -np.inf if i == 0 else 0.0
        high = np.inf if i == len(lengths) - 1 else length
        apart = columns - start[:, None]
        t = np.clip(way @ apart, low, high)
        square = ((apart - way[:, None] * t) ** 2).sum(axis=0)
        better = square < nearest
        nearest[better], arcs[better], segment[better] = square[better], begins[i] + t[better], i
    return arcs, ahead[segment]


def _at(curve: Floats, arcs: Floats) -> tuple[Floats, Floats]:
    """Return places (n, 3) and directions (n, 3) of a curve at some arcs (n,), its ends going on straight."""
    begins, _, ahead = _segments(curve)
    segment = np.clip(np.searchsorted(begins, arcs, side="right") - 1, 0, len(begins) - 1)
    return curve[segment] + (arcs - begins[segment])[:, None] * ahead[segment], ahead[segment]


def _segments(curve: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the arcs at which the segments of a curve begin, their lengths, and their directions."""
    steps = np.diff(curve, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]), lengths, unit_vectors(steps)


def fascicles(
    profile: AreaProfile, volume: float, points: Floats, offsets: Ints, *, shares: Sequence[float]
) -> list[Fascicles]:
    """Return the parts of fibres (n, 3), (k + 1,) between which a muscle of a volume [mm^3] is thick enough.

    For each of some shares: where it has less than that part of its largest area it is tendon.
    """
    dense, whole = evenly_spaced(points, offsets, POINTS), polyline_lengths(points, offsets)
    arcs, directions = (
        found.reshape(len(dense), POINTS, -1) for found in along(profile.curve, dense.reshape(-1, 3))
    )
    parts, row = [], np.arange(len(dense))
    for low, high in map(profile.muscle_between, shares):
        within = (arcs[..., 0] >= low) & (arcs[..., 0] <= high)
        # A piece of a fibre counts where its middle is in the muscle: by half where one end is.
        pieces = (within[:, 1:].astype(np.float64) + within[:, :-1]) / 2.0
        counts, first = within.sum(axis=1), within.argmax(axis=1)
        last = POINTS - 1 - within[:, ::-1].argmax(axis=1)
        reach = np.where(counts > 1, np.maximum(1, np.round(END * counts)), 0).astype(np.int64)
        a, b = np.array([first, last - reach]), np.array([first + reach, last])
        ways, axes = dense[row, b] - dense[row, a], directions[row, (a + b) // 2]
        across = np.linalg.norm(np.cross(ways, axes), axis=2)
        origin, insertion = np.degrees(np.arctan2(across, np.abs((ways * axes).sum(axis=2))))
        share = profile.volume_share(low, high)
        parts.append(Fascicles(whole * pieces.mean(axis=1), origin, insertion, volume * share))
    return parts
