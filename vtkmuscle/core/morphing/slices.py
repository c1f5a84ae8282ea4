"""Slices from the template into the muscle, by planes or isolines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.morphing.correspondence import count_outside, section_map
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import Floats, Ints

#: Heights within this part of the box's length are equal but for rounding.
SAME_HEIGHT = 1e-9
#: Heights of slices are multiples of this part of the box's length, between rounding and `SAME_HEIGHT`.
GRAIN = 1e-12
#: Parallel planes do not suit a muscle whose course exceeds an angle to the box's axis [degrees] over more
#: than a share of its length, or whose main branch has less than a share of the volume.
LARGEST_STEEP_SHARE, STEEP, LEAST_SHARE = 0.15, 45.0, 0.8
#: Guiding sections at fixed heights, between which starts are interpolated: their number, and the distance of
#: the first and last from the ends, as a part of the length.
N_GUIDES, GUIDE_MARGIN = 33, 0.02


@dataclass(frozen=True, eq=False)
class Morph:
    """Fibre points (n, 3) in a muscle [mm], with measures.

    `n_outside` counts points outside of their section (planes), or outside of the muscle except ends on
    attachment areas (isolines, not flat). `split_error` is the largest of a section, `volume_share` the part
    of the muscle's volume in the branch with fibres, `steep_share` the part of the branch's course at more
    than :data:`STEEP` degrees to the axis.
    """

    points: Floats
    n_outside: int
    split_error: float
    volume_share: float
    steep_share: float

    @property
    def suits(self) -> bool:
        """False if parallel planes do not follow the course."""
        return self.volume_share >= LEAST_SHARE and self.steep_share <= LARGEST_STEEP_SHARE


@dataclass(frozen=True, eq=False)
class Slicing:
    """Settings of slices through a muscle, by planes or isolines.

    Fibre points within `slice_tolerance` [mm] of height share a slice. `continuity` is the part of the
    muscle's length over which neighbouring slices resist twisting; 0 is the paper's rule, with sections
    started and split at their vertices. `report_progress` receives the fraction of work done.
    """

    slice_tolerance: float
    continuity: float
    report_progress: Callable[[float], None] = lambda fraction: None


class SliceMaps:
    """Maps of the template's rectangle to sections of a muscle.

    The boundaries `loops` (j, k) of the sections run counterclockwise about z from `starts` (l, k) [mm];
    `hits` (l,) are the numbers of their levels, `sides` (2,) or longer the rectangle's sides. Sections in
    space are viewed along z after the rotations `views` (l, 3, 3).
    """

    def __init__(
        self,
        loops: Sequence[Floats],
        starts: Floats,
        hits: Ints,
        sides: Floats,
        slicing: Slicing,
        views: Floats | None = None,
    ) -> None:
        slicing.report_progress(0.5)
        if views is not None:
            loops = [loop @ view.T for loop, view in zip(loops, views, strict=True)]
            starts = np.einsum("lij,lj->li", views, starts)
        self._loops, self._views, self._hits = loops, views, hits
        self._maps = []
        for number, loop in enumerate(loops):
            printed = slicing.continuity == 0.0
            self._maps.append(section_map(loop, starts[number], sides, as_printed=printed))
            slicing.report_progress(0.5 + 0.4 * (number + 1) / len(loops))

    def positions(
        self, inside: Floats, heights: Floats, levels: Floats, slice_of: Ints
    ) -> tuple[Floats, int, float]:
        """Return template points in the muscle's sections.

        A point off its slice's level is interpolated between the maps of the slice and of the next slice on
        its side. A level without a section, by rounding, takes the section of the nearest level. Points (n,
        2) or wider are in the rectangle; heights (n,) and ascending levels (h,) have one unit; `slice_of`
        (n,) is the level of each point.

        Returns
        -------
        positions : (n, k) array
            Points in the muscle, in their order [mm].
        n_outside : int
            Points outside of their section, seen along z.
        split_error : float
            Largest split error of a section.
        """
        above = heights - levels[slice_of]
        adjacent = slice_of + np.sign(above).astype(np.int64)
        apart = np.abs(above) > SAME_HEIGHT * (levels[-1] - levels[0])
        shared = np.flatnonzero(apart & (adjacent >= 0) & (adjacent < len(levels)))
        shares = above[shared] / (levels[adjacent[shared]] - levels[slice_of[shared]])
        weights = np.concatenate([np.ones(len(inside)), shares])
        weights[shared] -= shares
        points = np.concatenate([np.arange(len(inside)), shared])
        at_level = np.concatenate([slice_of, adjacent[shared]])
        order = np.argsort(at_level, kind="stable")
        positions = np.zeros((len(inside), self._loops[0].shape[1]))
        flat = np.ascontiguousarray(inside[:, :2])
        n_outside, split_error = 0, 0.0
        for level, members in enumerate(
            np.split(order, np.searchsorted(at_level[order], np.arange(1, len(levels))))
        ):
            number = int(np.abs(self._hits - level).argmin())
            section = self._maps[number]
            mapped = section.positions(flat[points[members]])
            turned = mapped if self._views is None else mapped @ self._views[number]
            positions[points[members]] += weights[members, None] * turned
            split_error = max(split_error, section.split_error)
            n_outside += count_outside(self._loops[number], mapped[members < len(inside)])
        return positions, n_outside, split_error


class Box:
    """Fitted template's box, with coordinates along its sides.

    A mirroring transform (4, 4) of the unit cube gives left-handed sides, and coordinates of the muscle's
    mirror image.
    """

    def __init__(self, transform: Floats) -> None:
        self.sides: Floats = np.linalg.norm(transform[:3, :3], axis=0)
        self._frame: Floats = transform[:3, :3] / self.sides
        self._corner: Floats = transform[:3, 3]

    @property
    def length(self) -> float:
        """Length along z [mm]."""
        return float(self.sides[2])

    def coordinates(self, points: Floats) -> Floats:
        """Return points (n, 3) along the sides [mm]. From corner Q0."""
        return (points - self._corner) @ self._frame

    def surface(self, muscle: ClosedSurface) -> ClosedSurface:
        """Return a muscle in box coordinates, facing outward."""
        return ClosedSurface(self.coordinates(muscle.points), muscle.triangles, muscle.opposite).outward()

    def positions(self, coordinates: Floats) -> Floats:
        """Return the points (n, 3) of coordinates [mm]."""
        return coordinates @ self._frame.T + self._corner


def guide_levels(length: float) -> Floats:
    """Return heights (k,) of guiding sections [mm]."""
    return length * np.linspace(GUIDE_MARGIN, 1.0 - GUIDE_MARGIN, N_GUIDES)


def shared_levels(heights: Floats, tolerance: float, grain: float = 0.0) -> tuple[Floats, Ints]:
    """Return slice levels (k,) [mm] and each height's slice (n,).

    From the lowest height on, a slice takes all heights within the tolerance [mm] of its lowest. Its level is
    half way between its lowest and highest height, rounded to a multiple of the grain, far below the
    tolerance: heights that differ by rounding share their slices.
    """
    order = np.argsort(heights, kind="stable")
    slice_of = np.empty(len(heights), dtype=np.int64)
    ascending = heights[order]
    levels: list[float] = []
    first = 0
    while first < len(ascending):
        last = int(np.searchsorted(ascending, ascending[first] + tolerance, side="right"))
        slice_of[order[first:last]] = len(levels)
        levels.append(0.5 * (ascending[first] + ascending[last - 1]))
        first = last
    exact = np.array(levels)
    return np.round(exact / grain) * grain if grain > 0.0 else exact, slice_of
