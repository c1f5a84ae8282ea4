"""Straight fibres between two areas, such as a muscle's aponeuroses.

Measured fibres of a gastrocnemius are straight (length over chord 1.006, median). Equal shares of one
aponeurosis go to equal shares of the other, in order (:mod:`vtkmuscle.core.fibres.equal_shares`), without
axis or template. An area may have several pieces.

Fibres keep their thickness between aponeuroses. So the area with the larger cross-section, seen along the
fibres, keeps a bare part from which fibres would have to converge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from vtkmuscle.core.fibres.equal_shares import CANDIDATES, even_positions, matched_ends
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.polylines import smooth_polylines
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.surface import faces_between
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import Floats, Ints

#: Positions on the smaller area that decide which part of the larger area stays bare. With 64 to 400
#: positions fibres in the measured gastrocnemius deviate by 10.0 to 11.0 degrees from the tracts (median).
COARSE = 128
#: Number of fibres whose mean is the direction at a position of an area; from 2 to 16 fibres the deviation
#: varies as little.
N_NEIGHBOURS = 4
#: Areas count as equal above this ratio of cross-sections: one row of a square of `COARSE` positions.
EQUAL = 1.0 - COARSE**-0.5
#: Passes in which fibres that leave the muscle are smoothed and put back into it.
BENDS = 8
#: Weight of the middle point in that smoothing, as in the papers'.
MIDDLE = 4.0


@dataclass(frozen=True, eq=False)
class EndSurface:
    """Surface of fibre ends, on the muscle or within.

    Fibres end on the points `patch` (j,) of a surface with points (n, 3) [mm] and triangles (m, 3). `takes`
    is the least and the greatest cross-section of ending fibres, in multiples of the patch's cross-section |u
    . n| A: (1, 1) for fibres on one face, (1, 2) for fibres on both faces, (0, inf) with tendons between.
    """

    points: Floats
    triangles: Ints
    patch: Ints
    takes: tuple[float, float] = (0.0, np.inf)

    @cached_property
    def samples(self) -> PatchSamples:
        """Positions on the patch."""
        return PatchSamples(self.points, self.triangles, self.patch)

    @cached_property
    def faces(self) -> Ints:
        """Triangles (k, 3) of the patch. Empty for a curve or loose points."""
        return faces_between(self.triangles, self.patch)

    @cached_property
    def tree(self) -> TriangleTree:
        """The triangles of the patch."""
        return triangle_tree(self.points, self.faces)

    def candidates(self, count: int) -> Floats:
        """Return positions of even density [mm]. At least `count`; loose points repeat."""
        dense = self.samples.dense(count)
        return dense if len(dense) >= count else np.resize(dense, (count, 3))

    def crossed_by(self, directions: Floats, positions: Floats) -> Floats:
        """Return the cross-sections (m,) along fibres, |u . n| A, at positions (m, 3) [mm^2].

        Directions (m, k, 3) are unit vectors of k fibres near each position. The mean is of |u . n|, as
        fibres may come from either side of a surface within a muscle.
        """
        if not len(self.faces):
            return np.zeros(len(positions))
        normals = unit_vectors(triangle_normals(self.points, self.faces))[self.tree.nearest(positions)[0]]
        crossed: Floats = self.samples.area * np.abs(directions @ normals[:, :, None]).mean(axis=(1, 2))
        return crossed


def straight_fibres(origin: EndSurface, insertion: EndSurface, count: int, resolution: int) -> Floats:
    """Return straight fibres that do not cross. Points (count, resolution + 1, 3) [mm].

    Fibres are spread evenly over both areas. The area that takes more fibres keeps a bare part.
    """
    candidates = [area.candidates(CANDIDATES * max(count, COARSE)) for area in (origin, insertion)]
    starts, ends = even_positions(_taken(origin, insertion, candidates), count)
    ends = ends[matched_ends(starts, ends)]
    t = np.linspace(0.0, 1.0, resolution + 1)[:, None]
    return (1.0 - t) * starts[:, None] + t * ends[:, None]


def _taken(origin: EndSurface, insertion: EndSurface, candidates: Sequence[Floats]) -> Sequence[Floats]:
    """Return the candidates (m, 3) on which fibres end, with equal cross-sections on both areas."""
    areas = origin, insertion
    if not all(area.takes[0] > 0.0 and len(area.faces) for area in areas):
        return candidates
    coarse = [area.candidates(CANDIDATES * COARSE) for area in areas]
    starts, ends = even_positions(coarse, COARSE)
    ends = ends[matched_ends(starts, ends)]
    directions = unit_vectors(ends - starts)
    sections = [
        area.crossed_by(directions[cKDTree(feet).query(positions, N_NEIGHBOURS)[1]], positions)
        for area, positions, feet in zip(areas, coarse, (starts, ends), strict=True)
    ]
    takes = [np.multiply(area.takes, s.mean()) for area, s in zip(areas, sections, strict=True)]
    larger = int(takes[1][0] > takes[0][0])
    ratio = takes[larger][0] / takes[1 - larger][1]
    if ratio <= 1.0 / EQUAL:
        return candidates
    counts = [COARSE, COARSE]
    counts[larger] = round(ratio * COARSE)
    even = [_by_section(*each) for each in zip(coarse, sections, counts, strict=True)]
    centred = [x - np.average(y, axis=0, weights=w) for x, y, w in zip(even, coarse, sections, strict=True)]
    costs = ((centred[0][:, None] - centred[1]) ** 2).sum(axis=-1)
    used = linear_sum_assignment(costs)[larger]
    nearest = cKDTree(even[larger]).query(candidates[larger])[1]
    taken = list(candidates)
    taken[larger] = candidates[larger][np.isin(nearest, used)]
    return taken


def _by_section(positions: Floats, sections: Floats, count: int) -> Floats:
    """Return positions (count, 3) of equal shares of a cross-section."""
    mixed = np.random.default_rng(0).permutation(len(positions))
    shares = np.cumsum(sections[mixed])
    size = CANDIDATES * count
    chosen = positions[mixed][np.searchsorted(shares, (np.arange(size) + 0.5) / size * shares[-1])]
    return even_positions([chosen], count)[0]


def filled_share(fibres: Floats, origin: EndSurface, insertion: EndSurface, volume: float) -> float:
    """Return the part of a muscle's volume filled by straight fibres. Volume [mm^3], fibres (k, r, 3).

    Mean cross-section times mean length, over the volume: about 1 in a block between two plates, near 0 in a
    spindle attached by its tips.
    """
    chords = fibres[:, -1] - fibres[:, 0]
    directions = unit_vectors(chords)[:, None]
    ends = (origin, fibres[:, 0]), (insertion, fibres[:, -1])
    section = np.mean([area.crossed_by(directions, positions).mean() for area, positions in ends])
    return float(section * np.linalg.norm(chords, axis=1).mean() / volume)


def bend_inside(fibres: Floats, into_muscle: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Return fibres bent into the muscle, and departures.

    Fibres (k, r, 3); largest distances outside (k,) [mm].

    A fibre that leaves the muscle is smoothed with its ends kept, and its outer points move to the nearest
    points of the muscle (`into_muscle`, (n, 3) to (n, 3)); repeated, the fibre takes about the shortest
    course within the muscle.
    """
    result = fibres.copy()
    inner = fibres[:, 1:-1]
    away = np.linalg.norm(into_muscle(inner.reshape(-1, 3)).reshape(inner.shape) - inner, axis=2)
    departures = away.max(axis=1, initial=0.0)
    bent = np.flatnonzero(departures > 0.0)
    offsets = np.arange(len(bent) + 1) * fibres.shape[1]
    lines = fibres[bent]
    for _ in range(BENDS if len(bent) else 0):
        lines = smooth_polylines(lines.reshape(-1, 3), offsets, MIDDLE, 1).reshape(lines.shape)
        lines[:, 1:-1] = into_muscle(lines[:, 1:-1].reshape(-1, 3)).reshape(len(bent), -1, 3)
    result[bent] = lines
    return result, departures
