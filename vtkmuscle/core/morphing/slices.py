"""Slice by slice from the fitted template into the muscle: the common part of planes and isolines."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vtkmuscle.core.morphing.correspondence import count_outside, section_map
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import Floats, Ints

#: Heights that differ by no more than this part of the box's length are equal but for rounding.
SAME_HEIGHT = 1e-9
#: Heights of slices are multiples of this part of the box's length: more than rounding, less than
#: :data:`SAME_HEIGHT`.
GRAIN = 1e-12
#: A muscle is bent too much for parallel planes where more than this part of its course runs more steeply
#: than this angle to the box's axis [degrees], or its main branch holds less than this part of its volume.
LARGEST_STEEP_SHARE, STEEP, LEAST_SHARE = 0.15, 45.0, 0.8
#: Guiding sections, at fixed heights: starts on all others are interpolated between theirs. How many there
#: are, and how far the first and the last are from the ends, as a part of the length.
N_GUIDES, GUIDE_MARGIN = 33, 0.02


@dataclass(frozen=True, eq=False)
class Morph:
    """Fibres in a muscle, by their points (n, 3) [mm], and how well the method suits it.

    `n_outside` is, by planes, the number of points that the mean value map put outside of their section;
    along isolines, which are not flat, that of points outside of the muscle but for ends on the attachment
    areas. `split_error` is the largest one of a section, `volume_share` the part of the muscle's volume in
    the branch that the fibres fill, `steep_share` the part of its course at more than :data:`STEEP` degrees
    to the axis.
    """

    points: Floats
    n_outside: int
    split_error: float
    volume_share: float
    steep_share: float

    @property
    def suits(self) -> bool:
        """False where parallel planes do not follow the muscle's course."""
        return self.volume_share >= LEAST_SHARE and self.steep_share <= LARGEST_STEEP_SHARE


@dataclass(frozen=True, eq=False)
class Slicing:
    """How to slice a muscle, by planes or along isolines.

    Points of the fitted template whose heights differ by no more than `slice_tolerance` [mm] share a slice.
    Neighbouring slices resist twisting over the part `continuity` of the muscle's length; 0 is the paper's
    rule, by which sections start and are split at their own vertices. `report_progress` is called with the
    part of the work that is done; `once`, with a key and a function, returns the function's result for the
    first call with that key: sections and their maps do not depend on how many fibres there are.
    """

    slice_tolerance: float
    continuity: float
    report_progress: Callable[[float], None] = lambda fraction: None
    once: Callable[[Hashable, Callable[[], Any]], Any] = lambda key, find: find()

    def key(self, transform: Floats, *levels: Floats) -> Hashable:
        """Return the settings that sections at some levels and their maps depend on."""
        return self.continuity, *(np.ascontiguousarray(array).tobytes() for array in (transform, *levels))


class SliceMaps:
    """Maps of the template's rectangle to sections of a muscle, whatever fibres go through them.

    The sections' boundaries are `loops` (j, k), counterclockwise about z, which start at `starts` (l, k)
    [mm]; `hits` (l,) are the numbers of the levels that they are at, `sides` (2,) or longer those of the
    rectangle. Sections in space are seen along z after the rotations `views` (l, 3, 3).
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
            as_printed = slicing.continuity == 0.0
            self._maps.append(section_map(loop, starts[number], sides, as_printed=as_printed))
            slicing.report_progress(0.5 + 0.4 * (number + 1) / len(loops))

    def places(
        self, inside: Floats, heights: Floats, levels: Floats, slice_of: Ints
    ) -> tuple[Floats, int, float]:
        """Return points of the template in the sections of the muscle.

        A point whose height is not quite that of its slice is mapped by that slice and by the next one on its
        side, and put between the two. A level without a section, by rounding, takes that of the level next to
        it. Points (n, 2) or wider are in the rectangle; heights (n,) and levels (h,), ascending, in one unit;
        `slice_of` (n,) is the level of each point.

        Returns
        -------
        places : (n, k) array
            Of the points, in their order [mm].
        n_outside : int
            Points outside of their section, seen along z.
        split_error : float
            The largest one of a section.
        """
        above = heights - levels[slice_of]
        others = slice_of + np.sign(above).astype(np.int64)
        apart = np.abs(above) > SAME_HEIGHT * (levels[-1] - levels[0])
        shared = np.flatnonzero(apart & (others >= 0) & (others < len(levels)))
        shares = above[shared] / (levels[others[shared]] - levels[slice_of[shared]])
        weights = np.concatenate([np.ones(len(inside)), shares])
        weights[shared] -= shares
        points = np.concatenate([np.arange(len(inside)), shared])
        at_level = np.concatenate([slice_of, others[shared]])
        order = np.argsort(at_level, kind="stable")
        members = np.split(order, np.searchsorted(at_level[order], np.arange(1, len(levels))))
        places = np.zeros((len(inside), self._loops[0].shape[1]))
        flat = np.ascontiguousarray(inside[:, :2])
        n_outside, split_error = 0, 0.0
        for level, mine in enumerate(members):
            number = int(np.abs(self._hits - level).argmin())
            section = self._maps[number]
            found = section.places(flat[points[mine]])
            turned = found if self._views is None else found @ self._views[number]
            places[points[mine]] += weights[mine, None] * turned
            split_error = max(split_error, section.split_error)
            n_outside += count_outside(self._loops[number], found[mine < len(inside)])
        return places, n_outside, split_error


class Box:
    """A fitted template's box, and coordinates along its sides.

    A transform (4, 4) of the unit cube that mirrors it gives left-handed sides: all that is done in these
    coordinates is then done to the mirror image of the muscle.
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
        """Return points (n, 3) along the sides, from the corner Q0 on [mm]."""
        return (points - self._corner) @ self._frame

    def surface(self, muscle: ClosedSurface) -> ClosedSurface:
        """Return a muscle in these coordinates, facing outward."""
        return ClosedSurface(self.coordinates(muscle.points), muscle.triangles, muscle.opposite).outward()

    def positions(self, coordinates: Floats) -> Floats:
        """Return the points (n, 3) that have these coordinates [mm]."""
        return coordinates @ self._frame.T + self._corner


def guide_levels(length: float) -> Floats:
    """Return heights (k,) of guiding sections in a muscle of this length [mm]."""
    return length * np.linspace(GUIDE_MARGIN, 1.0 - GUIDE_MARGIN, N_GUIDES)


def shared_levels(heights: Floats, tolerance: float, grain: float = 0.0) -> tuple[Floats, Ints]:
    """Return the strictly ascending levels of slices (k,) [mm] that heights can share, and each one's (n,).

    From the lowest height on, a slice takes all heights up to the tolerance [mm] above its lowest one. Its
    level is half way between its lowest and its highest, rounded to a multiple of the grain, which is much
    less than the tolerance: so other fibres, whose heights differ by rounding, have the same slices.
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
    found = np.array(levels)
    return np.round(found / grain) * grain if grain > 0.0 else found, slice_of
