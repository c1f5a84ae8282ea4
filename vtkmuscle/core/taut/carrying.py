"""A muscle's surface and fibres, carried by the taut paths of its fibres."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import array_kernel, kernel, reduction
from vtkmuscle.core.mesh.ring_rotations import nearest_rotation
from vtkmuscle.core.paths.bundles import nearest, to_nothing
from vtkmuscle.core.taut.paths import TautPaths, TautState
from vtkmuscle.core.paths.tissue import directions_along
from vtkmuscle.core.types import Floats, Ints

#: Points of strings that a point of the surface goes with, and that a string's point shares its turn with,
#: per segment of a string: as much of the muscle, however many points its strings have.
CARRIERS, COMPANIONS = 1.0, 0.75

#: But not fewer than this.
_FEWEST = 6

#: Part p of a constant volume's thinning that a muscle has across its fibres where they carry it:
#: l^(-p / 2) for a stretch l. With 1 all of it would come from the width; a broad muscle, held along its
#: attachments, thins in its thickness instead, which is left to the solve.
THINNING = 0.5

#: Bounds of the stretch, beyond which none is sensible (a muscle works between about 0.5 and 1.6).
LEAST_STRETCH, GREATEST_STRETCH = 0.25, 4.0

#: How much of a turn comes from the bones: it decides where strings do not, as all of them are on a line.
FROM_BONES = 0.02

#: Companions that are all within this part of the muscle's width of each other do not tell how it turns.
LEAST_APART = 1e-3

#: Rounds in which strings that stray from those beside them lose weight, at most; they end where the mean
#: moves by less than this part of the width.
_ROUNDS, _MOVES = 5, 1e-6


class Carrier:
    """Takes a muscle along with its taut strings: where it is before edges, volume and bones are heeded.

    Near each point of a string the muscle turns as the points around it have turned together, and is
    stretched along the fibre by as much as the string is, and made thinner across. The muscle is one body: a
    string keeps its place among those beside it, those that stray by more than the muscle's thickness count
    the less. Points near the fixed ones go with these. At rest nothing moves.

    Parameters
    ----------
    paths : TautPaths
        The strings.
    surface : (v, 3) array
        The muscle at rest [mm].
    fixed_to : (v,) int array
        Bone that each point is fixed to, -1 for free ones.
    """

    def __init__(self, paths: TautPaths, surface: Floats, fixed_to: Ints) -> None:
        fibres = paths.fibres
        self._paths = paths
        # Twice the mean thickness: over less, strings that have slipped would dent the surface.
        self._width = paths.width
        self._rest: Floats = fibres.reshape(-1, 3)
        self._tangents: Floats = directions_along(fibres).reshape(-1, 3)
        self._tree = cKDTree(self._rest)
        least = LEAST_APART * self._width
        segments = fibres.shape[1] - 1
        near, companions = nearest(self._tree, self._rest, max(round(COMPANIONS * segments), _FEWEST))
        shares = _falling_off(near, least)
        self._least = least**2
        self._when_taut = Company.of(paths.rest.points.reshape(-1, 3), companions, shares)
        self._at_rest = Company.of(self._rest, companions, shares)
        fixed = np.flatnonzero(fixed_to >= 0)
        near, carriers = nearest(self._tree, surface, max(round(CARRIERS * segments), _FEWEST))
        apart, holding = cKDTree(surface[fixed]).query(surface)
        with_bone = np.exp(-0.5 * (4.0 * apart / self._width) ** 2)
        shares = _falling_off(near, least)
        itself = np.arange(len(surface))[:, None]
        bone = fixed_to[fixed][holding]
        self._surface = Passengers(
            np.ascontiguousarray(surface), carriers, shares, bone, itself, with_bone[:, None]
        )

    def fibres(self, points: Floats, offsets: Ints) -> Passengers:
        """Return points (p, 3) of the fibres that the strings were made from; their ends go with the bones.

        What an end is off its bone goes to the whole fibre, in proportion to the way to the other end: a
        corner near the end would be in its length.

        offsets : (f + 1,) int array
            First point of each fibre, and p.
        """
        n = self._paths.fibres.shape[1]
        carriers, shares = np.empty((len(points), 2), dtype=np.int64), np.empty((len(points), 2))
        ends, pull = np.empty_like(carriers), np.empty_like(shares)
        for fibre, (begin, end) in enumerate(pairwise(offsets)):
            steps = np.linalg.norm(np.diff(points[begin:end], axis=0), axis=1)
            along = np.concatenate([[0.0], np.cumsum(steps)])
            at = along / max(along[-1], np.finfo(float).tiny) * (n - 1)
            low = np.minimum(at.astype(np.int64), n - 2)
            carriers[begin:end] = fibre * n + low[:, None] + np.arange(2)
            shares[begin:end] = np.column_stack([1.0 - (at - low), at - low])
            ends[begin:end] = begin, end - 1
            pull[begin:end] = np.column_stack([1.0 - at / (n - 1), at / (n - 1)])
        bone = np.zeros(len(points), dtype=np.int64)
        bone[offsets[:-1]], bone[offsets[1:] - 1] = self._paths.start_bones, self._paths.end_bones
        return Passengers(np.ascontiguousarray(points), carriers, shares, bone, ends, pull)

    def at(self, state: TautState) -> Carried:
        """Return the muscle carried by the strings in a pose."""
        paths, bundle = self._paths, self._paths.bundle
        n = paths.fibres.shape[1]
        stretch = np.repeat(state.lengths / paths.rest.lengths, n).clip(LEAST_STRETCH, GREATEST_STRETCH)
        taut_rest, taut = paths.rest.points.reshape(-1, 3), state.points.reshape(-1, 3)
        turns = _turns(paths, state.transforms)
        frames = np.empty((len(taut), 3, 3))
        _frames(taut, self._when_taut, turns, self._least, self._tangents, stretch, THINNING, frames)
        places = np.empty_like(taut)
        beside, parts = bundle.beside, bundle.parts
        said = np.empty((4, beside.shape[1]))
        _keep_among(self._rest, taut_rest, taut, frames, beside, parts, self._width, _ROUNDS, places, said)
        stretch = bundle.mean(stretch)
        _frames(places, self._at_rest, turns, self._least, self._tangents, stretch, THINNING, frames)
        return Carried(self._rest, places, frames, state.transforms, self._surface)


class Company(NamedTuple):
    """Where the companions of points are in some shape of the muscle, by which it is seen how they turn.

    Attributes
    ----------
    companions : (p, c) int array
        Points that each turns with.
    arms : (p, c, 3) array
        Where these are from their mean, times what each counts [mm]; their sum is 0.
    variances : (p,) array
        Of the companions [mm^2].
    """

    companions: Ints
    arms: Floats
    variances: Floats

    @classmethod
    def of(cls, points: Floats, companions: Ints, shares: Floats) -> Company:
        """Return that of points (p, 3) [mm]; shares (p, c) are what each companion counts, of 1."""
        there = points[companions] - points[:, None]  # far from the origin positions have few digits
        away = there - np.einsum("pc,pci->pi", shares, there)[:, None]
        return cls(companions, shares[:, :, None] * away, np.einsum("pc,pci,pci->p", shares, away, away))


class Passengers(NamedTuple):
    """Points of a muscle that its strings carry.

    Attributes
    ----------
    points : (p, 3) array
        At rest [mm].
    carriers : (p, c) int array
        Points of strings that they go with.
    shares : (p, c) array
        How much with each; rows sum to 1.
    bone : (p,) int array
        The bone that each is near to, if any.
    ends : (p, e) int array
        Points of these that say how far off their bones the strings carry a point.
    pull : (p, e) array
        How much of what each says is taken back, in [0, 1].
    """

    points: Floats
    carriers: Ints
    shares: Floats
    bone: Ints
    ends: Ints
    pull: Floats


class Carried:
    """A muscle where its strings carry it.

    Attributes
    ----------
    surface : (v, 3) array
        Points of the surface [mm].
    """

    def __init__(
        self, rest: Floats, places: Floats, frames: Floats, transforms: Floats, surface: Passengers
    ) -> None:
        self._rest, self._places, self._frames, self._transforms = rest, places, frames, transforms
        self.surface: Floats = self.points(surface)

    @property
    def nbytes(self) -> int:
        """Memory that it takes, but for what all poses share [bytes]."""
        return self._places.nbytes + self._frames.nbytes + self.surface.nbytes

    def points(self, passengers: Passengers) -> Floats:
        """Return where points are carried to, (p, 3) [mm]."""
        points = passengers.points
        moved = np.empty_like(points)
        _carry(self._rest, self._places, self._frames, passengers.carriers, passengers.shares, points, moved)
        result = np.empty_like(points)
        _take_back(points, moved, passengers, self._transforms, result)
        return result


def _falling_off(near: Floats, least: float) -> Floats:
    """Return weights for distances (m, k), ascending: Gaussian, 0 at the last, rows sum to 1.

    Distances below ``least`` are all the same.
    """
    width = np.maximum(near[:, -1:] / 2.0, least)
    values = to_nothing(np.exp(-0.5 * (near / width) ** 2))
    values /= values.sum(axis=1, keepdims=True)
    return values


def _turns(paths: TautPaths, transforms: Floats) -> Floats:
    """Return the bones' rotations, blended from end to end of each string, (f n, 3, 3); not orthogonal."""
    part = np.linspace(0.0, 1.0, paths.fibres.shape[1])[None, :, None, None]
    first, last = (transforms[bones][:, None, :3, :3] for bones in (paths.start_bones, paths.end_bones))
    turns: Floats = np.ascontiguousarray((1.0 - part) * first + part * last).reshape(-1, 3, 3)
    return turns


@array_kernel
def _frames(
    after: Floats,
    company: Company,
    turns: Floats,
    least: float,
    tangents: Floats,
    stretch: Floats,
    thinning: float,
    frames: Floats,
) -> None:
    """Write how the muscle turns and stretches at each point: F = R (g I + (l - g) t t^T).

    R is the rotation that takes a point's companions from before to after best, in the least squares sense
    (Arun, Huang, Blostein 1987, doi:10.1109/TPAMI.1987.4767965), and a little the bones' turn: of companions
    in one place, their variance below ``least`` [mm^2], that decides.
    """
    r, work = np.empty((3, 3)), np.empty((6, 3))
    for i in range(len(after)):
        x, y, z = after[i, 0], after[i, 1], after[i, 2]
        xx, xy, xz, yx, yy, yz, zx, zy, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(company.companions.shape[1]):
            k, arm = company.companions[i, j], company.arms[i, j]
            p, q, s = after[k, 0] - x, after[k, 1] - y, after[k, 2] - z
            xx, xy, xz = xx + p * arm[0], xy + p * arm[1], xz + p * arm[2]
            yx, yy, yz = yx + q * arm[0], yy + q * arm[1], yz + q * arm[2]
            zx, zy, zz = zx + s * arm[0], zy + s * arm[1], zz + s * arm[2]
        r[0, 0], r[0, 1], r[0, 2] = xx, xy, xz
        r[1, 0], r[1, 1], r[1, 2] = yx, yy, yz
        r[2, 0], r[2, 1], r[2, 2] = zx, zy, zz
        bones = FROM_BONES * (company.variances[i] + least)
        for a in range(3):
            for b in range(3):
                r[a, b] += bones * turns[i, a, b]
        nearest_rotation(r, work)
        along, across = stretch[i], stretch[i] ** (-0.5 * thinning)
        for a in range(3):
            turned = r[a, 0] * tangents[i, 0] + r[a, 1] * tangents[i, 1] + r[a, 2] * tangents[i, 2]
            for b in range(3):
                frames[i, a, b] = across * r[a, b] + (along - across) * turned * tangents[i, b]


@reduction
def _keep_among(
    rest: Floats,
    taut_rest: Floats,
    taut: Floats,
    frames: Floats,
    beside: Ints,
    parts: Floats,
    width: float,
    rounds: int,
    places: Floats,
    work: Floats,
) -> None:
    """Write the mean of where the strings beside a point say that it is; those far off count the less.

    Weights 1 / (1 + d^2 / width^2)^2 by the distance d from the mean, taken anew in each round (iteratively
    reweighted least squares; Holland, Welsch 1977, doi:10.1080/03610927708827533).
    work : (4, k) working memory for k strings beside a point.
    """
    count = beside.shape[1]
    said, w = work[:3], work[3]
    least2 = (_MOVES * width) ** 2
    for i in range(len(rest)):
        mx, my, mz = np.inf, np.inf, np.inf
        for j in range(count):
            g, w[j] = beside[i, j], parts[i, j]
            f = frames[g]
            x, y, z = rest[i, 0] - taut_rest[g, 0], rest[i, 1] - taut_rest[g, 1], rest[i, 2] - taut_rest[g, 2]
            for q in range(3):
                said[q, j] = (taut[g, q] - taut[i, q]) + f[q, 0] * x + f[q, 1] * y + f[q, 2] * z
        for _ in range(rounds):
            total, x, y, z = 0.0, 0.0, 0.0, 0.0
            for j in range(count):
                total += w[j]
                x, y, z = x + w[j] * said[0, j], y + w[j] * said[1, j], z + w[j] * said[2, j]
            x, y, z = x / total, y / total, z / total
            moved2 = (x - mx) ** 2 + (y - my) ** 2 + (z - mz) ** 2
            mx, my, mz = x, y, z
            if moved2 <= least2:
                break
            for j in range(count):
                off2 = (said[0, j] - x) ** 2 + (said[1, j] - y) ** 2 + (said[2, j] - z) ** 2
                w[j] = parts[i, j] / (1.0 + off2 / (width * width)) ** 2
        places[i, 0], places[i, 1], places[i, 2] = taut[i, 0] + mx, taut[i, 1] + my, taut[i, 2] + mz


@kernel
def _carry(
    rest: Floats,
    places: Floats,
    frames: Floats,
    carriers: Ints,
    weights: Floats,
    points: Floats,
    moved: Floats,
) -> None:
    """Write where points go: the weighted mean of where each carrier takes them."""
    for v in range(len(points)):
        x, y, z = 0.0, 0.0, 0.0
        for j in range(carriers.shape[1]):
            k, w = carriers[v, j], weights[v, j]
            a, b, c = points[v, 0] - rest[k, 0], points[v, 1] - rest[k, 1], points[v, 2] - rest[k, 2]
            f = frames[k]
            x += w * (places[k, 0] + f[0, 0] * a + f[0, 1] * b + f[0, 2] * c)
            y += w * (places[k, 1] + f[1, 0] * a + f[1, 1] * b + f[1, 2] * c)
            z += w * (places[k, 2] + f[2, 0] * a + f[2, 1] * b + f[2, 2] * c)
        moved[v, 0], moved[v, 1], moved[v, 2] = x, y, z


@kernel
def _take_back(
    points: Floats, moved: Floats, passengers: Passengers, transforms: Floats, result: Floats
) -> None:
    """Write moved points (p, 3), and take back what the strings carry their ends off the bones."""
    ends, pull = passengers.ends, passengers.pull
    for v in range(len(moved)):
        x, y, z = moved[v, 0], moved[v, 1], moved[v, 2]
        for j in range(ends.shape[1]):
            k, part = ends[v, j], pull[v, j]
            if part != 0.0:
                a, b, c = points[k, 0], points[k, 1], points[k, 2]
                t = transforms[passengers.bone[k]]
                x += part * (t[0, 0] * a + t[0, 1] * b + t[0, 2] * c + t[0, 3] - moved[k, 0])
                y += part * (t[1, 0] * a + t[1, 1] * b + t[1, 2] * c + t[1, 3] - moved[k, 1])
                z += part * (t[2, 0] * a + t[2, 1] * b + t[2, 2] * c + t[2, 3] - moved[k, 2])
        result[v, 0], result[v, 1], result[v, 2] = x, y, z
