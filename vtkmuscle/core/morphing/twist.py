"""Fibres seen on a muscle's surface, and the twist of its sections by which a template's wind like them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import proper_segments, segments
from vtkmuscle.core.mesh.surface import extent
from vtkmuscle.core.morphing.correspondence import (
    N_PLACES,
    loop_lengths,
    nearest_place,
    points_at,
    sampled_loop,
)
from vtkmuscle.core.types import Floats, Ints

#: Segments are cut in pieces of no more than this part of the extent of the muscle that they belong to.
LONGEST_PIECE = 0.02


@dataclass(frozen=True, eq=False)
class SuperficialFibres:
    """Short pieces of the superficial fibres.

    Attributes
    ----------
    places : (m, 3) array
        Their middles [mm].
    directions : (m, 3) array
        Unit vectors along them; the sign means nothing.
    weights : (m,) array
        Their lengths [mm].
    """

    places: Floats
    directions: Floats
    weights: Floats

    def within(self, corner: Floats, frame: Floats) -> SuperficialFibres:
        """Return them in the coordinates along the columns of a frame (3, 3), from a corner (3,) on."""
        return replace(self, places=(self.places - corner) @ frame, directions=self.directions @ frame)


def superficial_pieces(points: Floats, offsets: Ints, muscle: Floats) -> SuperficialFibres:
    """Return superficial fibres as short pieces.

    Parameters
    ----------
    points, offsets
        As of :func:`~vtkmuscle.core.fibres.measures.arrangement`.
    muscle : (m, 3) array
        Points of the muscle; no piece is longer than :data:`LONGEST_PIECE` of its extent [mm].

    Raises
    ------
    ValueError
        If no fibre has a length.
    """
    a, b, lengths = proper_segments(points, offsets)
    counts = np.ceil(lengths / (LONGEST_PIECE * extent(muscle))).astype(np.int64)
    segment = np.repeat(np.arange(len(a)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (within + 0.5) / counts[segment]
    step = b - a
    return SuperficialFibres(
        places=a[segment] + share[:, None] * step[segment],
        directions=(step / lengths[:, None])[segment],
        weights=(lengths / counts)[segment],
    )


def angle_to_nearest(seen: SuperficialFibres, points: Floats, offsets: Ints) -> float:
    """Return the angle between given fibres and the segments of others nearest to them [rad].

    Parameters
    ----------
    seen : SuperficialFibres
        The given ones.
    points, offsets
        Of the others, likewise.

    Returns
    -------
    float
        Root mean square, in [0, pi / 2].
    """
    a, b = segments(points, offsets)
    nearest = cKDTree((a + b) / 2.0).query(seen.places)[1]
    return root_mean_square(angle_between(seen.directions, (b - a)[nearest]), seen.weights)


def angle_between(directions: Floats, others: Floats) -> Floats:
    """Return the angles between lines, whatever their sign, (m,) [rad, 0 to pi / 2].

    Parameters
    ----------
    directions, others : (m, 3) arrays
        Of any length; the angle to a zero vector is pi / 2.
    """
    across = np.linalg.norm(np.cross(directions, others), axis=-1)
    along = np.abs((directions * others).sum(axis=-1))
    return np.where((across > 0.0) | (along > 0.0), np.arctan2(across, along), np.pi / 2.0)


def root_mean_square(angles: Floats, weights: Floats) -> float:
    """Return the weighted root mean square of angles."""
    return float(np.sqrt((weights * angles**2).sum() / weights.sum()))


#: Heights of the sections by which a twist is found, and how far the first and the last are from the ends.
N_LEVELS, MARGIN = 33, 0.02
#: Largest twist that is looked for, and steps of the first look [degrees].
LARGEST, STEP = 360.0, 5.0
#: To how many degrees a twist is found.
FINEST = 1e-3
#: Which part of the sum of squared angles a twist may leave.
LARGEST_REST = 0.5
#: Twists whose angles differ by less than this are equally good: the smaller is taken [rad].
EQUALLY_GOOD = 1e-6


@dataclass(frozen=True)
class Twist:
    """A twist, and how well it suits fibres that were seen.

    Attributes
    ----------
    twist : float
        Of the insertion against the origin, 360 once round the contour [degrees].
    angle : float
        Between the seen fibres and those of the template beside them, on the surface, root mean square
        [degrees]; not a number where none were seen.
    straight_angle : float
        The same without a twist.
    best_angle : float
        The same with the best twist, also where that was not taken, as it explains too little.
    """

    twist: float = 0.0
    angle: float = np.nan
    straight_angle: float = np.nan
    best_angle: float = np.nan


@dataclass(frozen=True, eq=False)
class TwistSetting:
    """A given twist, or the superficial fibres that determine it.

    Attributes
    ----------
    degrees : float
        Of the insertion against the origin, 360 once round the contour.
    seen : SuperficialFibres or None
        Fibres on the surface; where there are some the twist is found from them.
    offsets : (k + 1,) int array
        First point of each fibre of the template, and their number: where fibres are seen.
    """

    degrees: float = 0.0
    seen: SuperficialFibres | None = None
    offsets: Ints = field(default_factory=lambda: np.zeros(1, dtype=np.int64))

    def found(
        self,
        guide: Callable[[], tuple[Sequence[Floats], Floats, Floats]],
        into_box: Callable[[SuperficialFibres], SuperficialFibres],
        template: Floats,
        sides: Floats,
    ) -> Twist:
        """Return the twist.

        Parameters
        ----------
        guide : callable
            Gives rings, starts and fractions, as :func:`fitted_twist` takes them.
        into_box : callable
            Gives the fibres in the coordinates of the template's box.
        template : (n, 3) array
            Points of the template in these coordinates [mm].
        sides : (3,) array
            Of the box [mm].

        Raises
        ------
        ValueError
            If the muscle has fewer than two of the sections.
        """
        if self.seen is None:
            return Twist(self.degrees)
        drift = BoundaryDrift(template, self.offsets, sides)
        return fitted_twist(*guide(), into_box(self.seen), None if drift.straight else drift)


#: No twist.
STRAIGHT = TwistSetting()


def guide_levels(length: float) -> Floats:
    """Return heights (k,) of sections by which a twist is found, in a muscle of this length [mm]."""
    return length * np.linspace(MARGIN, 1.0 - MARGIN, N_LEVELS)


def turned_starts(loops: Sequence[Floats], starts: Floats, fractions: Floats, twist: float) -> Floats:
    """Return starts moved on along their loops.

    Parameters
    ----------
    loops : sequence of (n, k) arrays
        Vertices of each loop, counterclockwise [mm].
    starts : (l, k) array
        A point on or near each loop [mm].
    fractions : (l,) array
        Which part of the way from origin to insertion each loop is at.
    twist : float
        Of the insertion against the origin, 360 once round the contour [degrees].

    Returns
    -------
    (l, k) array
        Points on the loops; the same ones as before without a twist.
    """
    if twist == 0.0:
        return starts
    result = np.empty_like(starts)
    for i, (loop, start, fraction) in enumerate(zip(loops, starts, fractions, strict=True)):
        lengths = loop_lengths(loop)
        place = nearest_place(loop, lengths, start) + twist / 360.0 * (fraction - 0.5) * lengths[-1]
        result[i] = points_at(loop, lengths, np.array([place]))[0]
    return result


def fitted_twist(
    rings: Sequence[Floats],
    starts: Floats,
    fractions: Floats,
    seen: SuperficialFibres,
    drift: BoundaryDrift | None = None,
) -> Twist:
    """Return the twist with which a template's fibres run most nearly like given ones.

    It minimises the sum of the squared angles between the given fibres and the morphed ones beside them, by
    the length of the pieces of the former. A twist that leaves more than :data:`LARGEST_REST` of that sum is
    not what the fibres show, and there is none then: on one side of a flat muscle fibres that run obliquely
    look a little like a twist, which would cross them with those of the other side.

    Parameters
    ----------
    rings : sequence of (n, 3) arrays
        Sections of the muscle, counterclockwise, at least two [mm].
    starts : (l, 3) array
        Where the matching of each begins without a twist [mm].
    fractions : (l,) array
        Which part of the way from origin to insertion each is at, ascending.
    seen : SuperficialFibres
        Fibres on the surface.
    drift : BoundaryDrift, optional
        How the template's own fibres run along the boundary of its sections; None: straight.

    Raises
    ------
    ValueError
        If there are fewer than two sections.
    """
    if len(rings) < 2:
        raise InputError(
            "",
            "the muscle has too few sections to find a twist from superficial fibres",
            "leave the superficial fibres out",
        )
    surface = np.array(
        [sampled_loop(ring, start, N_PLACES) for ring, start in zip(rings, starts, strict=True)]
    )
    along = np.gradient(surface, fractions, axis=0)
    around = (np.roll(surface, -1, axis=1) - np.roll(surface, 1, axis=1)) * (N_PLACES / 2.0)
    nearest = cKDTree(surface.reshape(-1, 3)).query(seen.places)[1]
    level, place = np.divmod(nearest, N_PLACES)
    along, around = along[level, place], around[level, place]
    normals = unit_vectors(np.cross(along, around))
    # Fibres that do not lie quite on the surface are seen from above it.
    directions = seen.directions - (seen.directions * normals).sum(axis=1)[:, None] * normals
    t, s = fractions[level], place / N_PLACES

    def angle(twist: float) -> float:
        turn = np.full(len(t), twist / 360.0)
        if drift is not None:
            turn += drift.at(t, s - twist / 360.0 * (t - 0.5))
        return root_mean_square(angle_between(directions, along + turn[:, None] * around), seen.weights)

    twists = np.arange(0.0, LARGEST + STEP / 2.0, STEP)
    twists = np.column_stack([twists, -twists]).reshape(-1)[1:]  # the smaller ones first
    angles = np.array([angle(twist) for twist in twists])
    best = float(twists[int((angles <= angles.min() + EQUALLY_GOOD).argmax())])
    found = minimize_scalar(
        angle, bounds=(best - STEP, best + STEP), method="bounded", options={"xatol": FINEST}
    )
    if found.fun < angle(best) - EQUALLY_GOOD:
        best = float(found.x)
    straight, least = angle(0.0), angle(best)
    if least**2 > LARGEST_REST * straight**2:
        best = 0.0
    return Twist(best, *(float(np.degrees(a)) for a in (angle(best), straight, least)))


class BoundaryDrift:
    """How fibres of a fitted template drift along the boundary of its sections.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Points of the template's fibres along the sides of its box [mm]; first point of each fibre, and n.
    sides : (3,) array
        Of the box [mm].
    """

    def __init__(self, points: Floats, offsets: Ints, sides: Floats) -> None:
        a, b = (ends / sides for ends in segments(points, offsets))
        rise = b[:, 2] - a[:, 2]
        upward = np.abs(rise) > 1e-9
        self._slopes: Floats = ((b - a)[upward, :2] / rise[upward, None]) * sides[:2]
        self._tree = cKDTree(((a + b) / 2.0)[upward]) if upward.any() else None
        self._sides = sides

    @property
    def straight(self) -> bool:
        """True where no fibre leaves its place in the section."""
        return self._tree is None or bool(np.abs(self._slopes).max() < 1e-9 * self._sides[:2].max())

    def at(self, t: Floats, s: Floats) -> Floats:
        """Return s'(t), by which part of the boundary fibres drift from origin to insertion.

        Parameters
        ----------
        t, s : (m,) arrays
            Which part of the way from origin to insertion, and of the boundary from its first corner on.
        """
        if self._tree is None:
            return np.zeros(len(t))
        width, depth = self._sides[:2]
        perimeter = 2.0 * (width + depth)
        ends = np.array([0.0, width, width + depth, 2.0 * width + depth, perimeter])
        corners = np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth), (0.0, 0.0)])
        length = (s % 1.0) * perimeter
        places = np.column_stack([np.interp(length, ends, column) for column in corners.T])
        side = np.clip(np.searchsorted(ends, length, side="right") - 1, 0, 3)
        run = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])[side]
        nearest = self._tree.query(np.column_stack([places / self._sides[:2], t]))[1]
        drift: Floats = (self._slopes[nearest] * run).sum(axis=1) / perimeter
        return drift
