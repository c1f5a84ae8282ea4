"""Straight fibres from area to area, as those of muscles between their aponeuroses are.

Measured fibres of a gastrocnemius are straight (length over chord 1.006, median), and equal shares of one
aponeurosis go to equal shares of the other, in order (:mod:`vtkmuscle.core.fibres.equal_shares`). Nothing
else is asked: no axis, no template, and an area may have several pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vtkmuscle.core.fibres.equal_shares import CANDIDATES, even_places, matched_places
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.polylines import smooth_polylines
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import Floats, Ints

#: Passes in which fibres that leave the muscle are put back into it and smoothed.
BENDS = 8
#: Weight of the middle point in that smoothing, as in the papers'.
MIDDLE = 4.0


@dataclass(frozen=True, eq=False)
class EndSurface:
    """What fibres end on: a part of the muscle's surface, or a surface within the muscle.

    Attributes
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Of the surface that it is a part of [mm].
    patch : (j,) int array
        Ids of the points that belong to it.
    """

    points: Floats
    triangles: Ints
    patch: Ints

    @cached_property
    def samples(self) -> PatchSamples:
        """Positions on it."""
        return PatchSamples(self.points, self.triangles, self.patch)

    @cached_property
    def faces(self) -> Ints:
        """Its triangles, (k, 3): none where it is a curve or loose points."""
        member = np.zeros(len(self.points), dtype=np.bool_)
        member[self.patch] = True
        found: Ints = self.triangles[member[self.triangles].all(axis=1)]
        return found

    @cached_property
    def tree(self) -> TriangleTree:
        """Of its triangles."""
        return triangle_tree(self.points, self.faces)

    def candidates(self, count: int) -> Floats:
        """Return positions of even density on it, `count` or more [mm]; loose points are repeated."""
        found = self.samples.dense(count)
        return found if len(found) >= count else np.resize(found, (count, 3))

    def crossed_by(self, directions: Floats, places: Floats) -> float:
        """Return the cross-section of fibres that end on it, all together: its area times |u . n| [mm^2]."""
        if not len(self.faces):
            return 0.0
        normals = unit_vectors(triangle_normals(self.points, self.faces))[self.tree.nearest(places)[0]]
        return self.samples.area * float(np.abs((directions * normals).sum(axis=1)).mean())


def straight_fibres(origin: EndSurface, insertion: EndSurface, count: int, resolution: int) -> Floats:
    """Return straight fibres between two areas, evenly spread over both, that do not cross.

    Parameters
    ----------
    origin, insertion : EndSurface
        Where they begin and end.
    count : int
        Number of fibres, >= 1.
    resolution : int
        Segments of each, >= 1.

    Returns
    -------
    (count, resolution + 1, 3) array
        Their points [mm].
    """
    wanted = CANDIDATES * count
    starts, ends = even_places(origin.candidates(wanted), insertion.candidates(wanted), count)
    ends = ends[matched_places(starts, ends)]
    t = np.linspace(0.0, 1.0, resolution + 1)[:, None]
    fibres: Floats = (1.0 - t) * starts[:, None] + t * ends[:, None]
    return fibres


def filled_share(fibres: Floats, origin: EndSurface, insertion: EndSurface, volume: float) -> float:
    """Return which part of a muscle straight fibres fill: their mean cross-section times their length.

    Parameters
    ----------
    fibres : (k, r, 3) array
        Between the areas [mm].
    origin, insertion : EndSurface
        The areas.
    volume : float
        Of the muscle [mm^3].

    Returns
    -------
    float
        About 1 in a block between two plates, and next to 0 in a spindle that is attached by its tips.
    """
    ways = fibres[:, -1] - fibres[:, 0]
    ahead = unit_vectors(ways)
    ends = (origin, fibres[:, 0]), (insertion, fibres[:, -1])
    section = np.mean([area.crossed_by(ahead, places) for area, places in ends])
    return float(section * np.linalg.norm(ways, axis=1).mean() / volume)


def bent_inside(fibres: Floats, into_muscle: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Return fibres of which those that leave the muscle are bent inside.

    Their points outside go to the nearest place in the muscle, and each fibre is smoothed, its ends kept,
    again and again: that is about the shortest way within the muscle.

    Parameters
    ----------
    fibres : (k, r, 3) array
        Polylines [mm].
    into_muscle : callable
        From points (n, 3) to the nearest points (n, 3) of the muscle, themselves where they are in it [mm].

    Returns
    -------
    fibres : (k, r, 3) array
        With all but the ends in the muscle [mm].
    departures : (k,) array
        How far each was outside of the muscle at the most, 0 for those that are as they were [mm].
    """
    result = fibres.copy()
    n_points = fibres.shape[1]
    inner = fibres[:, 1:-1]
    away = np.linalg.norm(into_muscle(inner.reshape(-1, 3)).reshape(inner.shape) - inner, axis=2)
    departures = away.max(axis=1, initial=0.0)
    bent = np.flatnonzero(departures > 0.0)
    offsets = np.arange(len(bent) + 1) * n_points
    lines = fibres[bent]
    for _ in range(BENDS if len(bent) else 0):
        lines = smooth_polylines(lines.reshape(-1, 3), offsets, MIDDLE, 1).reshape(lines.shape)
        lines[:, 1:-1] = into_muscle(lines[:, 1:-1].reshape(-1, 3)).reshape(len(bent), -1, 3)
    result[bent] = lines
    return result, departures
