"""Template fibres into the muscle, slice by slice, along parallel planes.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3, extended in
doi:10.1007/978-3-642-38241-3_3.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.mesh.surface import sorted_into_bins
from vtkmuscle.core.morphing import correspondence
from vtkmuscle.core.morphing.correspondence import LoopStack, SectionMap, section_map
from vtkmuscle.core.morphing.sections import Branch, ClosedSurface
from vtkmuscle.core.types import GRAIN, ROUNDING, SAME, Floats, Ints

#: Parallel planes do not suit a muscle whose course exceeds an angle to the box's axis [degrees] over more
#: than a share of its length, or whose main branch has less than a share of the volume. Of 19 real muscles
#: 18 have shares up to 0.12, a quadratus femoris 0.21, bent phantoms 0.20 to 0.25; with 30 degrees six real
#: ones exceed 0.15, with 60 no phantom does.
LARGEST_STEEP_SHARE, STEEP, LEAST_SHARE = 0.15, 45.0, 0.8
#: Guiding sections at fixed heights, between which starts are interpolated: their number, and the distance of
#: the first and last from the ends, as a part of the length. With 0.015 single fibres of a hip take other
#: courses, with lengths that differ by up to 32 mm; mean lengths of fascicles differ by at most 0.1 mm.
N_GUIDES, GUIDE_MARGIN = 33, 0.02


class Morph(NamedTuple):
    """Fibre points (n, 3) in a muscle [mm], with measures.

    `volume_share` is the part of the muscle's volume in the branch with fibres, `steep_share` the part of the
    branch's course at more than :data:`STEEP` degrees to the axis.
    """

    points: Floats
    volume_share: float
    steep_share: float

    @property
    def suits(self) -> bool:
        """False if parallel planes do not follow the course."""
        return self.volume_share >= LEAST_SHARE and self.steep_share <= LARGEST_STEEP_SHARE


class Slicing(NamedTuple):
    """Settings of slices through a muscle, by planes or isolines.

    Fibre points within `slice_tolerance` [mm] of height share a slice. `continuity` is the part of the
    muscle's length over which neighbouring slices resist twisting; 0 is the paper's rule, with sections
    started and split at their vertices.
    """

    slice_tolerance: float
    continuity: float


def mapped_points(
    inside: Floats, heights: Floats, levels: Floats, slice_of: Ints, maps: Sequence[SectionMap], hits: Ints,
    views: Floats | None = None,
) -> Floats:  # fmt: skip
    """Return template points (n, k) in the muscle's sections [mm].

    A point off its slice's level is interpolated between the maps of the slice and of the next slice on its
    side. A level without a section, by rounding, takes the section of the nearest level. Points (n, 2) or
    wider are in the rectangle; heights (n,) and ascending levels (h,) have one unit; `slice_of` (n,) is the
    level of each point, `hits` (l,) are the numbers of the sections' levels. Sections in space are viewed
    along z after the rotations `views` (l, 3, 3).
    """
    above = heights - levels[slice_of]
    adjacent = slice_of + np.sign(above).astype(np.int64)
    apart = np.abs(above) > ROUNDING * (levels[-1] - levels[0])
    shared = np.flatnonzero(apart & (adjacent >= 0) & (adjacent < len(levels)))
    shares = above[shared] / (levels[adjacent[shared]] - levels[slice_of[shared]])
    weights = np.concatenate([np.ones(len(inside)), shares])
    weights[shared] -= shares
    points = np.concatenate([np.arange(len(inside)), shared])
    order, starts = sorted_into_bins(np.concatenate([slice_of, adjacent[shared]]), len(levels))
    positions = np.zeros((len(inside), maps[0].ring.shape[1]))
    flat = np.ascontiguousarray(inside[:, :2])
    for level, members in enumerate(np.split(order, starts[1:-1])):
        number = int(np.abs(hits - level).argmin())
        mapped = maps[number].positions(flat[points[members]])
        turned = mapped if views is None else mapped @ views[number]
        positions[points[members]] += weights[members, None] * turned
    return positions


def slice_maps(
    stack: LoopStack, guides: LoopStack, box: "Box", continuity: float, views: Floats | None = None
) -> Sequence[SectionMap]:
    """Return the maps to sections, with loops counterclockwise about z [mm].

    Guiding loops and continuity as of :func:`followed_starts`; views of :func:`mapped_points`.
    """
    loops = stack.loops
    starts = correspondence.followed_starts(stack, guides, continuity, np.zeros(2 if views is None else 3))
    if views is not None:
        loops = [loop @ view.T for loop, view in zip(loops, views, strict=True)]
        starts = np.einsum("lij,lj->li", views, starts)
    pairs = zip(loops, starts, strict=True)
    return [section_map(loop, start, box.sides, as_printed=continuity == 0.0) for loop, start in pairs]


class Box:
    """Fitted template's box, with coordinates along its sides.

    A mirroring transform (4, 4) of the unit cube gives left-handed sides, and a mirror image's coordinates.
    """

    def __init__(self, transform: Floats) -> None:
        self.sides: Floats = np.linalg.norm(transform[:3, :3], axis=0)
        self.length = float(self.sides[2])
        self._frame: Floats = transform[:3, :3] / self.sides
        self._corner: Floats = transform[:3, 3]

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


#: Slices that measure the muscle's course: by 64 the ten muscles of a hip and a knee have the same course. By
#: the guiding sections a strap round a roller has moment arms 3.5 % off its radius, instead of below 3 %.
N_PLANES = 16


def morph_by_planes(points: Floats, transform: Floats, muscle: ClosedSurface, slicing: Slicing) -> Morph:
    """Return template fibres moved into the muscle by planes.

    A plane at each height of fibre points along the box's z axis cuts the box in a rectangle and the muscle
    in loops, of which :func:`vtkmuscle.core.morphing.sections.main_loops` chooses one. Rectangle and loop are
    matched, and the rectangle's points mapped to the loop (:mod:`vtkmuscle.core.morphing.correspondence`).
    Points keep their heights, but heights beyond the last loop are squeezed into the rest of the muscle.

    points : (n, 3), points of the fitted template [mm];
    transform : (4, 4), Unit cube to box, from :func:`vtkmuscle.core.template.fit_box`;
    muscle : ClosedSurface, the muscle;
    slicing : Slicing, settings of slices and maps.

    Raises a ValueError if no slice through the template has an inside.
    """
    box = Box(transform)
    inside = box.coordinates(points)
    # Without the grain rounding moves paths of a knee and an elbow: their lengths change by up to 0.2 mm.
    tolerance, grain = max(slicing.slice_tolerance, ROUNDING * box.length), GRAIN * box.length
    course = _PlaneCourse(box.surface(muscle))
    volume_share, steep_share = course.shares()
    heights = np.clip(inside[:, 2], course.bottom + course.margin, course.top - course.margin)
    levels, slice_of = shared_levels(heights, tolerance, grain)
    branch = course.branch(np.union1d(levels, course.guides))
    if (branch.at(levels[[0, -1]]) < 0).any():
        heights = course.squeezed(heights, branch)
        levels, slice_of = shared_levels(heights, tolerance, grain)
        branch = course.branch(np.union1d(levels, course.guides))
    slices, hits = branch.stack(levels, 2)
    maps = slice_maps(slices, branch.stack(course.guides, 2)[0], box, slicing.continuity * box.length)
    across = mapped_points(inside, heights, levels, slice_of, maps, hits)
    return Morph(box.positions(np.column_stack([across, heights])), volume_share, steep_share)


class _PlaneCourse:
    """Muscle in the coordinates of its box, cut at heights."""

    def __init__(self, surface: ClosedSurface) -> None:
        self.surface, self.heights = surface, np.ascontiguousarray(surface.points[:, 2])
        used = self.heights[surface.triangles]
        self.bottom, self.top = float(used.min()), float(used.max())
        self.margin = SAME * (self.top - self.bottom)
        self.guides = self.bottom + guide_levels(self.top - self.bottom)

    def branch(self, heights: Floats) -> Branch:
        """Return the main branch at some heights."""
        return Branch(self.surface, self.heights, heights, heights, lambda areas: areas[:, 2])

    def shares(self) -> tuple[float, float]:
        """Return the main branch's volume share, and its steep share."""
        branch = self.branch(self.bottom + (self.top - self.bottom) * (np.arange(N_PLANES) + 0.5) / N_PLANES)
        steps = np.diff(correspondence.boundary_centroids(branch.stack(branch.heights, 3)[0].loops), axis=0)
        if not len(steps):
            return branch.share, 0.0
        lengths = np.linalg.norm(steps, axis=1)
        steep = steps[:, 2] < np.cos(np.radians(STEEP)) * lengths
        return branch.share, float(lengths[steep].sum() / lengths.sum())

    def squeezed(self, heights: Floats, branch: Branch) -> Floats:
        """Return heights with those beyond the branch's loops squeezed into the muscle's ends."""
        sections, hits = branch.sections, np.flatnonzero(branch.numbers >= 0)
        (lower, upper), (first, last) = branch.numbers[hits[[0, -1]]], branch.heights[hits[[0, -1]]]
        low = self.heights[sections.vertex_parts == sections.parts_below[lower]].min() + self.margin
        high = self.heights[sections.vertex_parts == sections.parts_above[upper]].max() - self.margin
        ends = [min(heights.min(), first), first, last, max(heights.max(), last)]
        squeezed = np.interp(heights, ends, [low, first, last, high])
        return np.where((heights < first) | (heights > last), squeezed, heights)
