"""The shortest ways of fibres between their ends, round the bones, at rest and as the bones move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import check_volume, signed_volume
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.motion.blending import screw_between
from vtkmuscle.core.motion.rigid import inverse
from vtkmuscle.core.taut.bedding import bedding_of, no_bedding
from vtkmuscle.core.taut.bone_fields import BoneFields
from vtkmuscle.core.taut.bundles import bundle_of
from vtkmuscle.core.taut.ring_contact import Rings
from vtkmuscle.core.taut.string_arrays import Fields, Memory, Tissue
from vtkmuscle.core.taut.strings import pull_taut
from vtkmuscle.core.taut.tissue import directions_along, smoothed_along, tissue_between
from vtkmuscle.core.taut.via_rings import ViaRing, in_ring_plane, is_inside, moved_ring, nearest_on_polygon
from vtkmuscle.core.taut.wrenches import (
    give_ends,
    give_to_ring,
    near_bones,
    path_wrenches,
    shares_of_bones,
)
from vtkmuscle.core.types import Bools, Floats, Ints

#: Points of a string. Strings of 17 points round a cylinder of 30 mm have moment arms 1 % less than those of
#: 33 and 65, which agree within 0.1 mm.
POINTS = 33

#: Cells of the bones' distance fields per segment of a string.
CELLS_PER_SEGMENT = 2.0

#: An iteration that moves no point by more than this part of a segment ends the pulling.
TOLERANCE = 1e-3

#: Iterations for a string in one pose, at most; 5 to 10 is what most take.
ITERATIONS = 60

#: Bones go from one pose to another in parts, in which they carry no end of a string farther than this, in
#: segments: a string does not jump over what lies between.
LARGEST_STEP = 4.0

#: Bones whose moves differ by less than this have moved together: the strings go with them as they are [mm].
TOGETHER = 1e-9

#: What is measured between a fibre and the bones is smoothed along the fibre by a Gaussian of this standard
#: deviation, as a part of its length: the thickness of the tissue, and the direction aside of the fibre.
THICKNESS_SMOOTHING, ASIDE_SMOOTHING = 1.0 / 32.0, math.sqrt(2.0) / 32.0

#: Segments of a string whose guides are as stiff as its springs. Guides of one with more, which are closer
#: together and whose springs carry less, are as much less stiff as lets it bend as far aside.
GUIDED_SEGMENTS = 32

#: A bone's normal must be this much across a fibre, as a sine, to tell which way is aside; from half more on
#: it is sure.
LEAST_ACROSS = 0.3

_MISSING = 4096


@dataclass(frozen=True, eq=False)
class TautState:
    """Strings in one pose of the bones.

    Attributes
    ----------
    points : (f, n, 3) array
        [mm].
    transforms : (b, 4, 4) array
        Of the bones, rest to now.
    place : (b, f, n) int array
        Segment of the fibre at rest that each point is nearest to, seen from each bone.
    pushed : (b, f, n) bool array
        Which points each bone pushes.
    wrenches : (f, b, 6) array
        Force [1] and moment about the origin [mm] that each string, of unit tension, exerts on each bone that
        has a transform.
    unsettled : int
        Strings that did not come to rest.
    """

    points: Floats
    transforms: Floats
    place: Ints
    pushed: Bools
    wrenches: Floats
    unsettled: int = 0

    @property
    def lengths(self) -> Floats:
        """Length of each string, (f,) [mm]."""
        lengths: Floats = np.linalg.norm(np.diff(self.points, axis=1), axis=2).sum(axis=1)
        return lengths

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        arrays = self.points, self.transforms, self.place, self.pushed, self.wrenches
        return sum(one.nbytes for one in arrays)


class TautPaths:
    """Fibres as strings, pulled taut round moving bones.

    A string goes from end to end of its fibre, each end fixed to its bone. It keeps away from the bones by
    what of the muscle lies between the fibre and them at rest, and where the muscle lies on the bone of its
    origin it does not slip off sideways: there it keeps to its course over that bone, but may slide along it
    and lift off. It passes through via rings. Otherwise it has no friction and no stiffness, and so the least
    length: -dl/dq is the lever of its pull about the axis of q.

    Parameters
    ----------
    fibres : (f, n, 3) array
        Points at rest, evenly spread along each fibre, n >= 3, origin to insertion [mm].
    start_bones, end_bones : (f,) int arrays
        Which bones the ends are fixed to.
    surface : (v, 3) array
        The muscle at rest [mm].
    triangles : (m, 3) int array
        Point ids, outward, closed.
    bones : mapping of int to (points (p, 3), triangles (q, 3), axes (4, 4))
        By their number: the bones that strings keep away from, at rest, and the rigid transform to the axes
        that their fields are laid along.
    rings : sequence of (int, ViaRing)
        The bone that each via ring moves with, and the ring at rest.
    hold : float, optional
        Gap between tissue and bone up to which a fibre is held aside [mm]; by default V / A, half the mean
        thickness of a muscle of volume V and surface A, 0 for no guide.

    Attributes
    ----------
    rest : TautState
        Pulled taut at rest.
    width : float
        Of the muscle as a fibre sees it, twice its mean thickness [mm].
    bundle : Bundle
        Which fibres lie beside which, within about that.

    Raises
    ------
    ValueError
        If a fibre has no length, or the muscle no volume.
    """

    def __init__(
        self,
        fibres: Floats,
        start_bones: Ints,
        end_bones: Ints,
        surface: Floats,
        triangles: Ints,
        bones: Mapping[int, tuple[Floats, Ints, Floats]],
        *,
        rings: Sequence[tuple[int, ViaRing]] = (),
        hold: float | None = None,
    ) -> None:
        self.fibres: Floats = np.ascontiguousarray(fibres, dtype=np.float64)
        self.start_bones, self.end_bones = start_bones, end_bones
        #: See the parameter. It looks at the surface, before fibres that may be made from that are.
        half = half_thickness(surface, triangles)
        self.hold = half if hold is None else hold
        f, n, _ = self.fibres.shape
        segments = np.linalg.norm(np.diff(self.fibres, axis=1), axis=2)
        if not (segments.sum(axis=1) > 0.0).all():
            raise ValueError(f"fibre {int(segments.sum(axis=1).argmin())} has no length")
        self._segment = float(segments.mean())
        self._rings = tuple(rings)
        cell = self._segment / CELLS_PER_SEGMENT
        self._numbers = list(bones)
        solids = [(solids_of(points, faces), axes) for points, faces, axes in bones.values()]
        self._tissue, reach, distances = self._between(
            [bone for bone, _ in solids], triangle_tree(surface, triangles), cell
        )
        self._bones = BoneFields(solids, cell=cell, reach=reach)
        self._outside = self._outside_at_rest()
        of_rings = (bone for bone, _ in self._rings)
        last = max([*self._numbers, int(start_bones.max()), int(end_bones.max()), *of_rings])
        still = np.zeros((last + 1, 4, 4)) + np.eye(4)
        start = np.broadcast_to(np.minimum(np.arange(n), n - 2), (len(bones), f, n))
        self._near = near_bones(distances)
        none = np.zeros((len(bones), f, n), dtype=np.bool_)
        at_rest = TautState(self.fibres, still, start, none, np.zeros((f, last + 1, 6)))
        self._bedding = no_bedding(len(bones), self.fibres)
        self.rest: TautState = self._pulled(at_rest, still)
        self.width = 4.0 * half
        self.bundle = bundle_of(self.fibres, self.width)
        if bones:
            self._bedding = bedding_of(
                self.fibres, self.rest.points, distances, self.bundle, half, self.width
            )
            self.rest = self._pulled(at_rest, still)

    def _between(
        self, bones: Sequence[Solids], muscle: TriangleTree, cell: float
    ) -> tuple[Tissue, list[float], Floats]:
        """Return the tissue between fibres and bones, and how far from each bone distances are needed."""
        shape = (len(self._numbers), *self.fibres.shape[:2])
        thickness, guide, aside = np.zeros(shape), np.zeros(shape), np.zeros((*shape, 3))
        distances = np.zeros(shape)
        tangents = directions_along(self.fibres)
        for bone, number in enumerate(self._numbers):
            distance, outward, tissue = tissue_between(self.fibres, tangents, bones[bone], muscle)
            distances[bone] = distance
            thickness[bone] = np.minimum(smoothed_along(tissue, THICKNESS_SMOOTHING), distance)
            side = smoothed_along(np.cross(tangents, outward), ASIDE_SMOOTHING)
            across = np.linalg.norm(side, axis=2)
            aside[bone] = side / np.maximum(across, np.finfo(float).tiny)[:, :, None]
            if self.hold > 0.0:
                gap = np.clip((distance - thickness[bone]) / self.hold, 0.0, 1.0)
                sure = np.clip(2.0 * (across - LEAST_ACROSS), 0.0, 1.0)
                from_here = (self.start_bones == number)[:, None]
                held = smoothed_along(from_here * sure * (1.0 - gap**2) ** 2, THICKNESS_SMOOTHING)
                guide[bone] = (GUIDED_SEGMENTS / (self.fibres.shape[1] - 1)) ** 2 * held
        within = thickness.max(axis=2)
        guided: Bools = np.asarray((guide > 0.0).any(axis=2))
        within[guided] += self.hold
        reach = [max(float(most), 0.0) + 2.0 * cell for most in within.max(axis=1, initial=0.0)]
        tissue_of = Tissue(self.fibres, thickness, within, guide, aside, guided, max(self.hold, 1e-300))
        return tissue_of, reach, distances

    def follow(self, before: TautState, transforms: Floats) -> TautState:
        """Return the strings in another pose of the bones, which these reach along their screws.

        Parameters
        ----------
        before : TautState
            Where the strings were; not changed.
        transforms : (b, 4, 4) array
            Of the bones, rest to now.
        """
        transforms = np.array(transforms, dtype=np.float64)
        known = _known(before.transforms, transforms)
        moves = _moves(known, transforms)
        if np.ptp(moves, axis=0).max() <= TOGETHER:
            points = self._with_bones(before.points, moves)
            wrenches = self._wrenches(points, before.pushed, transforms)
            return replace(before, points=points, transforms=transforms, wrenches=wrenches)
        steps = math.ceil(self._carried(known, transforms) / (LARGEST_STEP * self._segment))
        state = before
        for number in range(1, steps):
            part = number / steps
            pairs = zip(known, transforms, strict=True)
            state = self._pulled(state, np.array([screw_between(a, b, part) for a, b in pairs]))
        return self._pulled(state, transforms)

    def _carried(self, before: Floats, now: Floats) -> float:
        """Return how far the bones carry the strings' ends against each other's bones, at most [mm]."""
        farthest = 0.0
        for mine, others, ends in (
            (self.start_bones, self.end_bones, self.fibres[:, 0]),
            (self.end_bones, self.start_bones, self.fibres[:, -1]),
        ):
            a, b = (_seen_from(t, mine, others, ends) for t in (before, now))
            farthest = max(farthest, float(np.linalg.norm(b - a, axis=1).max()))
        return farthest

    def _with_bones(self, points: Floats, moves: Floats) -> Floats:
        """Return strings that went with their bones, whose moves (b, 4, 4) are blended from end to end.

        Left where it was, a string might be met by a bone that its end is on, and be caught on its far side.
        """
        part = np.linspace(0.0, 1.0, points.shape[1])[None, :, None]
        first, last = (
            points @ turn[:, :3, :3].transpose(0, 2, 1) + turn[:, None, :3, 3]
            for turn in (moves[self.start_bones], moves[self.end_bones])
        )
        return np.ascontiguousarray(first + part * (last - first))

    def _pulled(self, start: TautState, transforms: Floats) -> TautState:
        moves = _moves(start.transforms, transforms)
        x = self._with_bones(start.points, moves)
        x[:, 0] = _carried_by(transforms[self.start_bones], self.fibres[:, 0])
        x[:, -1] = _carried_by(transforms[self.end_bones], self.fibres[:, -1])
        # About their middle: far from the origin the stiff springs would take the digits.
        middle = (x.min(axis=(0, 1)) + x.max(axis=(0, 1))) / 2.0
        x -= middle
        to_rest = np.array([inverse(transforms[bone]) for bone in self._numbers]).reshape(-1, 4, 4)
        to_rest[:, :3, 3] += to_rest[:, :3, :3] @ middle
        begin = x.copy()
        memory = Memory(start.place.copy(), start.pushed.copy())
        unfinished = np.ones(len(x), dtype=np.bool_)
        missing, done = np.zeros(_MISSING, dtype=np.int64), np.zeros(len(x), dtype=np.int64)
        rings, tolerance = self._rings_at(transforms, middle), TOLERANCE * self._segment
        while unfinished.any():
            bones = self._bones
            fields = Fields(bones.to_axes, bones.layout, bones.table, bones.values)
            lacking = pull_taut(
                x,
                to_rest,
                fields,
                self._tissue,
                self._bedding,
                rings,
                memory,
                self._segment / CELLS_PER_SEGMENT,
                tolerance,
                ITERATIONS,
                unfinished,
                missing,
                done,
            )
            if lacking:
                bones.fill(missing[:lacking])
                # From the start again, so that it does not matter what was known already.
                x[unfinished] = begin[unfinished]
                memory.place[:, unfinished] = start.place[:, unfinished]
                memory.pushed[:, unfinished] = start.pushed[:, unfinished]
        unsettled = int((done > ITERATIONS).sum())
        x += middle
        wrenches = self._wrenches(x, memory.pushed, transforms)
        return TautState(x, transforms, memory.place, memory.pushed, wrenches, unsettled)

    def _wrenches(self, points: Floats, pushed: Bools, transforms: Floats) -> Floats:
        """Return what the strings do to the bones, (f, b, 6)."""
        shares = np.zeros((len(transforms), *points.shape[:2]))
        shares[self._numbers] = shares_of_bones(self._near, pushed)
        for bone, ring in self._rings:
            give_to_ring(shares, points, bone, moved_ring(ring, transforms[bone]))
        give_ends(shares, self.start_bones, self.end_bones)
        return path_wrenches(points, shares)

    def _rings_at(self, transforms: Floats, middle: Floats) -> Rings:
        """Return the via rings where their bones are, about a point."""
        moved = [moved_ring(ring, transforms[bone]) for bone, ring in self._rings]
        frames = np.array([[ring.centre - middle, ring.normal, *ring.axes] for ring in moved]).reshape(
            -1, 4, 3
        )
        corners = np.concatenate([np.empty((0, 2)), *(ring.corners for ring in moved)])
        offsets = np.cumsum([0, *(len(ring.corners) for ring in moved)])
        return Rings(frames, corners, offsets, self._outside)

    def _outside_at_rest(self) -> Floats:
        """Return how far outside of each ring each fibre crosses its plane at rest, (r, f) [mm]."""
        outside = np.zeros((len(self._rings), len(self.fibres)))
        for number, (_, ring) in enumerate(self._rings):
            for fibre, points in enumerate(self.fibres):
                places, heights = in_ring_plane(ring, points)
                cut = np.flatnonzero((heights[1:] < 0.0) != (heights[:-1] < 0.0))
                if not len(cut):
                    continue
                part = (heights[cut] / (heights[cut] - heights[cut + 1]))[:, None]
                crossings = places[cut] + part * (places[cut + 1] - places[cut])
                s, t = crossings[np.linalg.norm(crossings, axis=1).argmin()]
                if not is_inside(ring.corners, s, t):
                    u, v = nearest_on_polygon(ring.corners, s, t)
                    outside[number, fibre] = math.hypot(u - s, v - t)
        return outside


def half_thickness(surface: Floats, triangles: Ints) -> float:
    """Return V / A of a closed surface, half the mean thickness of what is flat [mm].

    Raises
    ------
    ValueError
        If it encloses no volume.
    """
    a, b, c = (surface[triangles[:, corner]] for corner in range(3))
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    volume = signed_volume(surface, triangles)
    check_volume(surface, volume)
    return abs(volume) / area


def _known(before: Floats, now: Floats) -> Floats:
    """Return the transforms before of all bones that have some now."""
    known = np.array(now)
    known[: len(before)] = before[: len(now)]
    return known


def _moves(before: Floats, now: Floats) -> Floats:
    """Return how bones went on, (b, 4, 4)."""
    return np.array([b @ inverse(a) for a, b in zip(_known(before, now), now, strict=True)])


def _carried_by(transforms: Floats, points: Floats) -> Floats:
    moved: Floats = np.einsum("fij,fj->fi", transforms[:, :3, :3], points) + transforms[:, :3, 3]
    return moved


def _seen_from(transforms: Floats, mine: Ints, others: Ints, points: Floats) -> Floats:
    """Return points (f, 3) that go with some bones, seen from others."""
    moved = _carried_by(transforms[mine], points) - transforms[others, :3, 3]
    seen: Floats = np.einsum("fji,fj->fi", transforms[others, :3, :3], moved)
    return seen
