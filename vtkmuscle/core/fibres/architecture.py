"""Fascicle lengths and pennation angles, from cross-sections along the muscle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from vtkmuscle.core.fibres.measures import centroid_path, section_areas
from vtkmuscle.core.mesh.polylines import curve_segments, evenly_spaced, polyline_lengths
from vtkmuscle.core.types import Floats, Ints

#: Area of a muscle over that of its tendon, at which both together are lightest (Ker, Alexander, Bennett
#: 1988, *Why are mammalian tendons so thick?*, Journal of Zoology 216, 309-324).
MUSCLE_FOR_TENDON = 34.0
#: A section with less than this part of the largest area counts as tendon: half way between the areas of
#: muscle and tendon on a logarithmic scale. The limits lie a quarter of the scale to either side.
TENDON_AREA = MUSCLE_FOR_TENDON**-0.5
TENDON_AREAS = (MUSCLE_FOR_TENDON**-0.75, MUSCLE_FOR_TENDON**-0.25)
#: Points of the medial curve, degree of its polynomial, passes of the fit, number of cross-sections.
NODES, DEGREE, PASSES, SECTIONS = 17, 2, 8, 40
#: Samples of a fibre along the curve; part of a fascicle that gives the direction of its end.
POINTS, END = 121, 0.1


@dataclass(frozen=True, eq=False)
class AreaProfile:
    """Areas of muscle cross-sections along a medial curve. Areas (s,) [mm^2], curve (c, 3) [mm].

    `arcs` (s,) are the middles of equal pieces of the curve, which passes both ends of the muscle.
    """

    curve: Floats
    arcs: Floats
    areas: Floats

    def muscle_between(self, share: float) -> tuple[float, float]:
        """Return the arcs [mm] between which sections are muscle.

        Their areas exceed a part of the largest.
        """
        least = share * float(self.areas.max())
        thick = np.flatnonzero(self.areas >= least)
        return self._crossing(int(thick[0]), -1, least), self._crossing(int(thick[-1]), 1, least)

    def volume_share(self, low: float, high: float) -> float:
        """Return the part of the volume between two arcs [mm]."""
        half = (self.arcs[1] - self.arcs[0]) / 2.0
        inside = np.minimum(self.arcs + half, high) - np.maximum(self.arcs - half, low)
        return float(np.clip(inside / (2.0 * half), 0.0, 1.0) @ self.areas / self.areas.sum())

    def _crossing(self, last: int, step: int, least: float) -> float:
        """Return the arc beyond section `last` with the least area."""
        share, after = 0.5, last + step
        if 0 <= after < len(self.arcs):
            share = (self.areas[last] - least) / (self.areas[last] - self.areas[after])
        return float(self.arcs[last] + step * share * (self.arcs[1] - self.arcs[0]))


@dataclass(frozen=True, eq=False)
class Fascicles:
    """Fascicles: the parts of fibres within the muscle, without tendon.

    Lengths (k,) [mm] are 0 for a fibre without a part in the muscle. Angles (k,) are between the ends of
    fascicles and the medial curve [degrees]. `volume` is the muscle's [mm^3].
    """

    lengths: Floats
    origin_angles: Floats
    insertion_angles: Floats
    volume: float

    def cross_section(self, lengths: Floats | None = None) -> float:
        """Return the physiological cross-sectional area: volume cos(pennation) / length [mm^2].

        After Lieber and Friden 2000, with the mean angle of both ends and the mean fascicle length, or the
        mean of ``lengths`` (k,) [mm].
        """
        angles = np.concatenate([self.origin_angles, self.insertion_angles])
        mean = float((self.lengths if lengths is None else lengths).mean())
        return self.volume * float(np.cos(np.radians(angles)).mean()) / mean if mean > 0.0 else 0.0


def area_profile(
    surface: Floats, triangles: Ints, samples: Floats, points: Floats, offsets: Ints
) -> AreaProfile:
    """Return the cross-sections of a muscle along its course.

    The medial curve is a principal curve (Hastie, Stuetzle 1989, doi:10.1080/01621459.1989.10478797). The fit
    begins with the centroid path of the fibres, and each pass fits a parabola to samples (j, 3) of even
    density in the muscle. Curves of a higher degree curl in thick muscles. In a pennate muscle the curve runs
    along the muscle and across the fibres. The surface (p, 3), (m, 3) is closed and faces outward; fibres (n,
    3), (k + 1,) run from origin to insertion.
    """
    curve = centroid_path(points, offsets, NODES)
    for _ in range(PASSES):
        arcs, _ = along(curve, samples)
        nodes = np.linspace(arcs.min(), arcs.max(), NODES)
        curve = np.column_stack([Polynomial.fit(arcs, x, DEGREE)(nodes) for x in samples.T])
    arcs, _ = along(curve, surface)
    bounds = np.linspace(arcs.min(), arcs.max(), SECTIONS + 1)
    middles = (bounds[1:] + bounds[:-1]) / 2.0
    begins, _, directions = curve_segments(curve)
    segment = np.clip(np.searchsorted(begins, middles, side="right") - 1, 0, len(begins) - 1)
    centres = curve[segment] + (middles - begins[segment])[:, None] * directions[segment]
    return AreaProfile(curve, middles, section_areas(surface, triangles, centres, directions[segment]))


def along(curve: Floats, positions: Floats) -> tuple[Floats, Floats]:
    """Return arcs and directions of a curve at nearest points.

    Positions (n, 3), arcs (n,) [mm], directions (n, 3).

    The end segments of the curve (c, 3) are prolonged; arcs before its first point are negative.
    """
    begins, lengths, directions = curve_segments(curve)
    columns, nearest = np.ascontiguousarray(positions.T), np.full(len(positions), np.inf)
    arcs, segment = np.zeros(len(positions)), np.zeros(len(positions), dtype=np.int64)
    for i, (start, direction, length) in enumerate(zip(curve[:-1], directions, lengths, strict=True)):
        low = -np.inf if i == 0 else 0.0
        high = np.inf if i == len(lengths) - 1 else length
        apart = columns - start[:, None]
        t = np.clip(direction @ apart, low, high)
        square = ((apart - direction[:, None] * t) ** 2).sum(axis=0)
        better = square < nearest
        nearest[better], arcs[better], segment[better] = square[better], begins[i] + t[better], i
    return arcs, directions[segment]


def fascicles(
    profile: AreaProfile, volume: float, points: Floats, offsets: Ints, *, shares: Sequence[float]
) -> list[Fascicles]:
    """Return the fascicles of fibres for each limit of tendon.

    Sections with less than a share of the largest area count as tendon. The volume is the muscle's [mm^3].
    """
    dense, whole = evenly_spaced(points, offsets, POINTS), polyline_lengths(points, offsets)
    arcs, directions = (
        array.reshape(len(dense), POINTS, -1) for array in along(profile.curve, dense.reshape(-1, 3))
    )
    parts, row = [], np.arange(len(dense))
    for low, high in map(profile.muscle_between, shares):
        within = (arcs[..., 0] >= low) & (arcs[..., 0] <= high)
        # A piece of a fibre counts by half if one of its ends is in the muscle.
        pieces = (within[:, 1:].astype(np.float64) + within[:, :-1]) / 2.0
        counts, first = within.sum(axis=1), within.argmax(axis=1)
        last = POINTS - 1 - within[:, ::-1].argmax(axis=1)
        reach = np.where(counts > 1, np.maximum(1, np.round(END * counts)), 0).astype(np.int64)
        a, b = np.array([first, last - reach]), np.array([first + reach, last])
        chords, axes = dense[row, b] - dense[row, a], directions[row, (a + b) // 2]
        across = np.linalg.norm(np.cross(chords, axes), axis=2)
        origin, insertion = np.degrees(np.arctan2(across, np.abs((chords * axes).sum(axis=2))))
        share = profile.volume_share(low, high)
        parts.append(Fascicles(whole * pieces.mean(axis=1), origin, insertion, volume * share))
    return parts
