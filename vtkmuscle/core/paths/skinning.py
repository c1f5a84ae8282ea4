"""A muscle taken along by its paths: linear blend skinning with frames by shape matching."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import kernel, vector_kernel
from vtkmuscle.core.motion.blending import nearest_rotation
from vtkmuscle.core.paths.sheet import MusclePaths, PathState
from vtkmuscle.core.paths.surroundings import directions_along, less_the_last
from vtkmuscle.core.types import Floats, Ints

#: Paths that take a point of the surface along, at most: those of the nearest points of paths, of which so
#: many are looked at.
CARRIERS, LOOKED_AT = 8, 64

#: Paths beside one whose points turn with its own, with it, and the weights of their points so many before to
#: so many behind: a binomial, as wide as a cubic B-spline.
BESIDE, WINDOW = 12, (1.0, 4.0, 6.0, 4.0, 1.0)

#: How much of a turn comes from the bones: it decides where paths do not, as all of them are on a line.
FROM_BONES = 0.02

#: Distances below this part of the muscle's thickness are the same.
LEAST_APART = 1e-3


class SkinningWeights(NamedTuple):
    """The points of paths that take p points along, and their weights.

    Attributes
    ----------
    points : (p, 3) array
        At rest, about the middle of the paths [mm].
    carriers : (p, c) int array
        Numbers of points of paths, in the order of paths, and after these of bones.
    weights : (p, c) array
        Rows sum to 1.
    """

    points: Floats
    carriers: Ints
    weights: Floats


class Skinning:
    """Takes a muscle along with its paths, before it settles.

    Around each point of a path the muscle turns as the points beside it have turned together (shape matching;
    Müller, Heidelberger, Teschner, Gross 2005, doi:10.1145/1073204.1073216), is as much longer along the path
    as this is, and thinner across by as much as keeps its volume. A point of the surface goes with the paths
    nearest to it, with each by the four points about its place beside that, weighted by a cubic B-spline: the
    surface is as smooth along the paths as these, however few points they have. Near the fixed points it goes
    with the bone. At rest nothing moves.

    Parameters
    ----------
    paths : MusclePaths
        The paths.
    surface : (v, 3) array
        The muscle at rest [mm].
    fixed_to : (v,) int array
        Bone that each point is fixed to, -1 for free ones.
    """

    def __init__(self, paths: MusclePaths, surface: Floats, fixed_to: Ints) -> None:
        self._paths = paths
        rest = paths.rest.points
        self._widths = paths.widths(rest)
        f, n, _ = rest.shape
        self._rest: Floats = rest.reshape(-1, 3)
        self._middle: Floats = self._rest.mean(axis=0)
        tangents = directions_along(rest).reshape(-1, 3)
        least = LEAST_APART * paths.thickness
        count, reach = min(BESIDE, f), len(WINDOW) // 2
        beside, parts = np.empty((f, n, count), dtype=np.int64), np.empty((f, n, count))
        for i in range(n):
            apart, found = cKDTree(rest[:, i]).query(rest[:, i], k=range(1, count + 1))
            beside[:, i], parts[:, i] = n * found + i, falling_weights(apart, least)
        begins = np.arange(0, beside.size + 1, count)
        self._beside = csr_array((parts.reshape(-1), beside.reshape(-1), begins), shape=(f * n, f * n))
        self._beside.eliminate_zeros()
        near = np.arange(n)[:, None] + np.arange(-reach, reach + 1)
        window = np.where((near >= 0) & (near < n), WINDOW, 0.0)
        self._near: Ints = np.clip(near, 0, n - 1)
        around = np.concatenate([self._around(rest), np.ones((f, *near.shape, 1))], axis=3)
        self._window: Floats = window[:, :, None] * around
        sums, total = self._sums(rest), np.tile(window.sum(axis=1), f)
        means = sums[:, :, 3] / total[:, None]
        variance = np.einsum("kii->k", sums[:, :, :3]) - total * (means**2).sum(axis=1)
        of_bones = FROM_BONES * (variance + total * least**2)
        self._at_rest = self._rest - self._middle, tangents, means, of_bones
        fixed = np.flatnonzero(fixed_to >= 0)
        apart, nearest = cKDTree(surface[fixed]).query(surface)
        with_bone = np.exp(-0.5 * (2.0 * apart / paths.thickness) ** 2)[:, None]
        points, carriers, weights = self._weights_of(surface, least)
        carriers = np.column_stack([carriers, f * n + fixed_to[fixed][nearest]])
        weights = np.column_stack([(1.0 - with_bone) * weights, with_bone])
        self._surface = SkinningWeights(points, carriers, weights)

    def _weights_of(self, points: Floats, least: float) -> SkinningWeights:
        f, n, _ = self._paths.rest.points.shape
        tree = cKDTree(self._rest)
        away, near = tree.query(points, k=range(1, min(LOOKED_AT, tree.n) + 1))
        count = min(CARRIERS, f)
        apart, at = np.empty((len(points), count)), np.empty((len(points), count))
        paths = np.empty((len(points), count), dtype=np.int64)
        _places_beside(points, self._rest.reshape(f, n, 3), near, paths, apart, at)
        # A path that none of these points is of is farther than the last.
        seen = apart if tree.n <= LOOKED_AT else np.minimum(apart, away[:, -1:])
        parts = falling_weights(seen, least)
        low = np.clip(at.astype(np.int64), 0, n - 2)
        t = (at - low)[:, :, None]
        spline = np.concatenate(
            [
                (1.0 - t) ** 3 / 6.0,
                (3.0 * t**3 - 6.0 * t**2 + 4.0) / 6.0,
                (-3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0) / 6.0,
                t**3 / 6.0,
            ],
            axis=2,
        )
        nodes = np.clip(low[:, :, None] + np.arange(-1, 3), 0, n - 1) + n * paths[:, :, None]
        carriers = nodes.reshape(len(points), -1)
        weights = (parts[:, :, None] * spline).reshape(len(points), -1)
        used = weights.any(axis=0)  # the last of the paths has no part
        return SkinningWeights(
            points - self._middle, carriers.compress(used, axis=1), weights.compress(used, axis=1)
        )

    def weights_of_fibres(self, points: Floats, offsets: Ints) -> SkinningWeights:
        """Return the weights of points (p, 3) of the fibres that paths were made from, each with its path.

        ``offsets`` (f + 1,) are the numbers of the first point of each fibre, and p.
        """
        n = self._paths.fibres.shape[1]
        carriers, weights = np.empty((len(points), 2), dtype=np.int64), np.empty((len(points), 2))
        for fibre, (begin, end) in enumerate(pairwise(offsets)):
            steps = np.linalg.norm(np.diff(points[begin:end], axis=0), axis=1)
            along = np.concatenate([[0.0], np.cumsum(steps)])
            at = along / max(along[-1], np.finfo(float).tiny) * (n - 1)
            low = np.minimum(at.astype(np.int64), n - 2)
            carriers[begin:end] = fibre * n + low[:, None] + np.arange(2)
            weights[begin:end] = np.column_stack([1.0 - (at - low), at - low])
        return SkinningWeights(points - self._middle, carriers, weights)

    def at(self, state: PathState) -> SkinnedMuscle:
        """Return the muscle in a pose of its paths."""
        paths, bones = self._paths, state.transforms
        f, n, _ = state.points.shape
        stretch = (self._widths / paths.widths(state.points)) ** 2
        affine = np.empty((f * n + len(bones), 3, 4))
        affine[: f * n] = self._sums(state.points)
        affine[f * n :] = bones[:, :3]
        affine[f * n :, :, 3] += bones[:, :3, :3] @ self._middle
        ends = bones[paths.start_bones], bones[paths.end_bones]
        _frames(*self._at_rest, *ends, stretch, state.points, affine, np.empty((11, 4)))
        muscle = SkinnedMuscle(affine, np.empty((0, 3)))
        return muscle._replace(surface=muscle.points(self._surface))

    def _around(self, points: Floats) -> Floats:
        """Return the points near each of paths (f, n, 3), about the middle of all there, (f, n, w, 3)."""
        around: Floats = points.take(self._near, axis=1) - points.mean(axis=0)[:, None]
        return around

    def _sums(self, points: Floats) -> Floats:
        """Return weighted sums over the points q beside each, p at rest, of q p^T and of q, (f n, 3, 4)."""
        along = self._around(points).swapaxes(2, 3) @ self._window
        sums: Floats = (self._beside @ along.reshape(-1, 12)).reshape(-1, 3, 4)
        return sums


class SkinnedMuscle(NamedTuple):
    """A muscle as its paths take it along in a pose.

    Attributes
    ----------
    affine : (f n + b, 3, 4) array
        How the muscle moves, turns and stretches about each point of paths, and each bone: the matrix F | t
        of p -> F p + t, about the middle of the paths at rest.
    surface : (v, 3) array
        Points of its surface [mm].
    """

    affine: Floats
    surface: Floats

    def points(self, weights: SkinningWeights) -> Floats:
        """Return the positions of points in the pose, (p, 3) [mm]."""
        moved = np.empty_like(weights.points)
        _skin(self.affine, weights.carriers, weights.weights, weights.points, moved)
        return moved


def falling_weights(distances: Floats, least: float) -> Floats:
    """Return weights for distances (m, k), ascending: Gaussian, 0 at the last, rows sum to 1.

    Distances below ``least`` are all the same.
    """
    width = np.maximum(distances[:, -1:] / 2.0, least)
    values = less_the_last(np.exp(-0.5 * (distances / width) ** 2))
    weights: Floats = values / values.sum(axis=1, keepdims=True)
    return weights


@kernel
def _places_beside(points: Floats, paths: Floats, near: Ints, found: Ints, apart: Floats, at: Floats) -> None:
    """Write the paths nearest to points (v, 3), ascending, their distances and the places along them.

    ``near`` (v, k) are points of paths, ascending by distance; a path that has none among these is infinitely
    far.
    """
    n = paths.shape[1]
    for v in range(len(points)):
        count = 0
        for k in range(near.shape[1]):
            path = near[v, k] // n
            known = False
            for c in range(count):
                known = known or found[v, c] == path
            if known or count == found.shape[1]:
                continue
            apart[v, count], at[v, count] = _place_beside(points[v], paths[path])
            found[v, count] = path
            count += 1
        for c in range(count, found.shape[1]):
            found[v, c], apart[v, c], at[v, c] = found[v, count - 1], np.inf, at[v, count - 1]
        for c in range(1, count):  # ascending: sorted by insertion
            k = c
            while k > 0 and apart[v, k] < apart[v, k - 1]:
                found[v, k], found[v, k - 1] = found[v, k - 1], found[v, k]
                apart[v, k], apart[v, k - 1] = apart[v, k - 1], apart[v, k]
                at[v, k], at[v, k - 1] = at[v, k - 1], at[v, k]
                k -= 1


@kernel
def _place_beside(point: Floats, path: Floats) -> tuple[float, float]:
    """Return the distance of a path from a point, and the point's place along it, in segments.

    The place is the mean of the path's points, weighted by a Gaussian of their distances as wide as a
    segment. Beside a straight path that is the nearest place. A curved one may have two: it does not choose.
    """
    nearest2, best2, width2 = np.inf, np.inf, 0.0
    for j in range(len(path)):
        squared = 0.0
        for c in range(3):
            squared += (path[j, c] - point[c]) ** 2
        best2 = min(best2, squared)
        if j + 1 < len(path):
            ahead, length2 = 0.0, 0.0
            for c in range(3):
                step = path[j + 1, c] - path[j, c]
                ahead += (point[c] - path[j, c]) * step
                length2 += step * step
            part = min(max(ahead / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
            nearest2 = min(nearest2, squared - part * (2.0 * ahead - part * length2))
            width2 = max(width2, length2)
    total, place = 0.0, 0.0
    for j in range(len(path)):
        squared = 0.0
        for c in range(3):
            squared += (path[j, c] - point[c]) ** 2
        weight = np.exp(-0.5 * (squared - best2) / width2)
        total += weight
        place += weight * j
    return np.sqrt(max(nearest2, 0.0)), place / total


@kernel
def _frames(
    rest: Floats,
    tangents: Floats,
    means: Floats,
    of_bones: Floats,
    starts: Floats,
    ends: Floats,
    stretch: Floats,
    now: Floats,
    affine: Floats,
    work: Floats,
) -> None:
    """Replace sums (f n, 3, 4) by F | t, F = R (g I + (l - g) t t^T), g = l^(-1/2), at each point of paths.

    R takes the points beside it from rest to now best, in the least squares sense (Arun, Huang, Blostein
    1987, doi:10.1109/TPAMI.1987.4767965), and a little the bones' turn.
    """
    f, n, _ = now.shape
    r = work[8:, :3]
    for a in range(f):
        along = stretch[a]
        across = 1.0 / np.sqrt(along)
        for i in range(n):
            k, part = a * n + i, i / (n - 1)
            m, t = affine[k], tangents[k]
            for c in range(3):
                for d in range(3):
                    turn = (1.0 - part) * starts[a, c, d] + part * ends[a, c, d]
                    r[c, d] = m[c, d] - m[c, 3] * means[k, d] + of_bones[k] * turn
            nearest_rotation(r, work[:8])
            for c in range(3):
                turned = (along - across) * (r[c, 0] * t[0] + r[c, 1] * t[1] + r[c, 2] * t[2])
                m[c, 3] = now[a, i, c]
                for d in range(3):
                    m[c, d] = across * r[c, d] + turned * t[d]
                    m[c, 3] -= m[c, d] * rest[k, d]


@vector_kernel
def _skin(affine: Floats, carriers: Ints, weights: Floats, points: Floats, moved: Floats) -> None:
    """Write the weighted means of the places to which its carriers take each point."""
    for v in range(len(points)):
        a, b, c = points[v, 0], points[v, 1], points[v, 2]
        x, y, z = 0.0, 0.0, 0.0
        for j in range(carriers.shape[1]):
            m, w = affine[carriers[v, j]], weights[v, j]
            x += w * (m[0, 0] * a + m[0, 1] * b + m[0, 2] * c + m[0, 3])
            y += w * (m[1, 0] * a + m[1, 1] * b + m[1, 2] * c + m[1, 3])
            z += w * (m[2, 0] * a + m[2, 1] * b + m[2, 2] * c + m[2, 3])
        moved[v, 0], moved[v, 1], moved[v, 2] = x, y, z
