"""Straight fibres from area to area, as those of muscles between their aponeuroses are.

Measured fibres of a gastrocnemius are straight (length over chord 1.006, median), and equal shares of one
aponeurosis go to equal shares of the other, in order (:mod:`vtkmuscle.core.fibres.equal_shares`). That takes
no axis and no template, and an area may have several pieces.

Fibres do not grow thinner on their way from aponeurosis to aponeurosis. So of the one that has the larger
cross-section, seen along the fibres, that part stays bare from which they would have to converge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from vtkmuscle.core.fibres.equal_shares import CANDIDATES, even_places, matched_places
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.polylines import smooth_polylines
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.surface import faces_between
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import Floats, Ints

#: Places on the lesser of two areas that decide which part of the larger one stays bare. With 64 to 400 of
#: them fibres in the measured gastrocnemius deviate by 10.0 to 11.0 degrees from the tracts (median).
COARSE = 128
#: Number of fibres whose mean is the direction at a place of an area; from 2 to 16 that angle varies by as
#: much.
BESIDE = 4
#: An area with no less than this part of the other's cross-section is as large: those places cannot resolve
#: less than one row of a square of them.
SAME = 1.0 - COARSE**-0.5
#: Passes in which fibres that leave the muscle are smoothed and put back into it.
BENDS = 8
#: Weight of the middle point in that smoothing, as in the papers'.
MIDDLE = 4.0


@dataclass(frozen=True, eq=False)
class EndSurface:
    """A surface that fibres end on: a part of the muscle's surface, or one within the muscle.

    The whole surface is points (n, 3) and triangles (m, 3) [mm]; fibres end on the points `patch` (j,).
    `takes` are the least and the most cross-section of fibres that end on it, as multiples of its own,
    |u . n| times its area: 1 and 1 where fibres themselves end on one face of it, 1 and 2 where they may end
    on both, 0 and infinity where tendons lie between.
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
        """Triangles of the patch, (k, 3): none where it is a curve or loose points."""
        return faces_between(self.triangles, self.patch)

    @cached_property
    def tree(self) -> TriangleTree:
        """The triangles of the patch."""
        return triangle_tree(self.points, self.faces)

    def candidates(self, count: int) -> Floats:
        """Return positions of even density on it, `count` or more [mm]; loose points are repeated."""
        found = self.samples.dense(count)
        return found if len(found) >= count else np.resize(found, (count, 3))

    def crossed_by(self, directions: Floats, places: Floats) -> Floats:
        """Return its cross-section (m,) along fibres, |u . n| times its area, at places (m, 3) on it [mm^2].

        Directions (m, k, 3) are the unit vectors of k fibres beside each place. |u . n| is averaged, not u:
        on a surface within a muscle they may come from either side.
        """
        if not len(self.faces):
            return np.zeros(len(places))
        normals = unit_vectors(triangle_normals(self.points, self.faces))[self.tree.nearest(places)[0]]
        crossed: Floats = self.samples.area * np.abs(directions @ normals[:, :, None]).mean(axis=(1, 2))
        return crossed


def straight_fibres(origin: EndSurface, insertion: EndSurface, count: int, resolution: int) -> Floats:
    """Return straight fibres (count, resolution + 1, 3) [mm] between two areas, without crossings.

    They are evenly spread over both areas. Where one takes more fibres than the other, at the same
    cross-section of each all along, the rest of it stays bare.
    """
    candidates = [area.candidates(CANDIDATES * max(count, COARSE)) for area in (origin, insertion)]
    starts, ends = even_places(_taken(origin, insertion, candidates), count)
    ends = ends[matched_places(starts, ends)]
    t = np.linspace(0.0, 1.0, resolution + 1)[:, None]
    return (1.0 - t) * starts[:, None] + t * ends[:, None]


def _taken(origin: EndSurface, insertion: EndSurface, candidates: Sequence[Floats]) -> Sequence[Floats]:
    """Return the end points on both areas, (m, 3) each, of fibres with equal cross-sections."""
    areas = origin, insertion
    if not all(area.takes[0] > 0.0 and len(area.faces) for area in areas):
        return candidates
    few = [area.candidates(CANDIDATES * COARSE) for area in areas]
    starts, ends = even_places(few, COARSE)
    ends = ends[matched_places(starts, ends)]
    ahead = unit_vectors(ends - starts)
    sections = [
        area.crossed_by(ahead[cKDTree(known).query(places, BESIDE)[1]], places)
        for area, places, known in zip(areas, few, (starts, ends), strict=True)
    ]
    takes = [np.multiply(area.takes, s.mean()) for area, s in zip(areas, sections, strict=True)]
    larger = int(takes[1][0] > takes[0][0])
    ratio = takes[larger][0] / takes[1 - larger][1]
    if ratio <= 1.0 / SAME:
        return candidates
    counts = [COARSE, COARSE]
    counts[larger] = round(ratio * COARSE)
    known = [_by_section(*each) for each in zip(few, sections, counts, strict=True)]
    one, two = (x - np.average(y, axis=0, weights=w) for x, y, w in zip(known, few, sections, strict=True))
    used = linear_sum_assignment(((one[:, None] - two) ** 2).sum(axis=-1))[larger]
    nearest = cKDTree(known[larger]).query(candidates[larger])[1]
    taken = list(candidates)
    taken[larger] = candidates[larger][np.isin(nearest, used)]
    return taken


def _by_section(places: Floats, sections: Floats, count: int) -> Floats:
    """Return some of the places, (count, 3), of which each stands for an equal share of a cross-section."""
    mixed = np.random.default_rng(0).permutation(len(places))
    shares = np.cumsum(sections[mixed])
    size = CANDIDATES * count
    chosen = places[mixed][np.searchsorted(shares, (np.arange(size) + 0.5) / size * shares[-1])]
    return even_places([chosen], count)[0]


def filled_share(fibres: Floats, origin: EndSurface, insertion: EndSurface, volume: float) -> float:
    """Return the part of a muscle's volume [mm^3] that straight fibres (k, r, 3) between two areas fill.

    That is their mean cross-section times their mean length, over the volume: about 1 in a block between two
    plates, and next to 0 in a spindle that is attached by its tips.
    """
    ways = fibres[:, -1] - fibres[:, 0]
    ahead = unit_vectors(ways)
    ends = (origin, fibres[:, 0]), (insertion, fibres[:, -1])
    section = np.mean([area.crossed_by(ahead[:, None], places).mean() for area, places in ends])
    return float(section * np.linalg.norm(ways, axis=1).mean() / volume)


def bend_inside(fibres: Floats, into_muscle: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Return fibres (k, r, 3) bent into the muscle, and the largest distance of each outside of it (k,) [mm].

    Each fibre that leaves the muscle is smoothed, its ends kept, and its points outside are moved to the
    nearest ones of the muscle (`into_muscle`, from (n, 3) to (n, 3)), again and again: that leads to about
    the shortest way within the muscle.
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
