"""A muscle skinned to its paths, with frames by shape matching."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, kron
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.polylines import stations_of
from vtkmuscle.core.mesh.surface import sorted_into_bins
from vtkmuscle.core.motion.blending import nearest_rotations
from vtkmuscle.core.paths.neighbours import path_lengths, path_widths
from vtkmuscle.core.paths.surroundings import directions_along
from vtkmuscle.core.types import ROUNDING, TINY, Floats, Ints

#: Paths that take a point of the surface along, at most: those of the nearest points of paths, of which so
#: many are looked at. With 12 lengths of single fibres in four muscles of a real hip change by up to 0.8 mm.
CARRIERS, LOOKED_AT = 8, 64
#: Paths beside one whose points turn with its own, with it, and the weights of their points so many before to
#: so many behind: a binomial, as wide as a cubic B-spline. With 8 beside lengths of single fibres in the four
#: muscles change by up to 0.4 mm.
BESIDE, WINDOW = 12, (1.0, 4.0, 6.0, 4.0, 1.0)
#: Weights of a cubic B-spline's four nodes (columns), by powers of the place between the middle two (rows).
CUBIC = np.array([(1, 4, 1, 0), (-3, 0, 3, 0), (3, -6, 3, 0), (-1, 3, -3, 1)]) / 6.0
#: How much of a turn comes from the bones: it decides where paths do not, as all of them are on a line.
#: Without it fibres of four muscles of a real hip change by 0.04 to 0.6 mm.
FROM_BONES = 0.02


class SkinningWeights(NamedTuple):
    """The carriers of points, and the carriers' weights.

    Points of paths carry p points along.

    points : (p, 3), at rest [mm];
    carriers : (p, c) int, numbers of points of paths, in the order of paths;
    weights : (p, c), rows sum to 1.
    """

    points: Floats
    carriers: Ints
    weights: Floats


class Skinning:
    """Takes a muscle along with its paths.

    The muscle settles afterwards. Around each point of a path the muscle turns as the neighbouring points
    have turned together (shape matching; Müller, Heidelberger, Teschner, Gross 2005,
    doi:10.1145/1073204.1073216). The muscle lengthens along the path as the path does, and thins across to
    keep the volume. A point of the surface goes with the nearest paths, with each path by the four path
    points about the surface point's place along the path, weighted by a cubic B-spline: along the paths the
    surface is as smooth as the paths, however few points the paths have. Near the fixed points the surface
    goes with the bone. At rest nothing moves.

    paths : (f, n, 3), paths at rest, evenly spread points [mm];
    ends : (2, f) int, bones of the first and the last point of each path;
    surface : (v, 3), the muscle at rest [mm];
    fixed_to : (v,) int, bone that each point is fixed to, -1 for free points;
    thickness : float, mean thickness of the muscle [mm].
    """

    def __init__(
        self, paths: Floats, ends: tuple[Ints, Ints], surface: Floats, fixed_to: Ints, thickness: float
    ) -> None:
        f, n, _ = paths.shape
        self._ends, self._lengths = np.stack(ends, axis=1), path_lengths(paths)
        self._rest: Floats = paths.reshape(-1, 3)
        self._arms = self._rest - self._rest.mean(axis=0)
        self._tangents: Floats = directions_along(paths).reshape(-1, 3)
        least = ROUNDING * thickness
        count = min(BESIDE, f)
        adjacent, parts = np.empty((f, n, count), dtype=np.int64), np.empty((f, n, count))
        for i in range(n):
            apart, nearest = cKDTree(paths[:, i]).query(paths[:, i], k=range(1, count + 1))
            adjacent[:, i], parts[:, i] = nearest * n + i, falling_weights(apart, least)
        shifts = [np.eye(n, k=k - len(WINDOW) // 2) for k in range(len(WINDOW))]
        window = np.tensordot(WINDOW, shifts, axes=1)
        window /= window.sum(axis=1, keepdims=True)
        self._along = kron(csr_array(np.eye(f)), csr_array(window), format="csr")
        starts = np.arange(0, f * n * count + 1, count)
        self._across = csr_array((parts.reshape(-1), adjacent.reshape(-1), starts), shape=(f * n, f * n))
        self._means = self._means_beside(self._arms)
        squares = self._means_beside((self._arms**2).sum(axis=1)) - (self._means**2).sum(axis=1)
        self._spread: Floats = np.maximum(squares, 0.0) + least**2
        self._surface = self._weights_of(surface, least)
        fixed = np.flatnonzero(fixed_to >= 0)
        apart, nearest = cKDTree(surface[fixed]).query(surface)
        self._bone: Ints = fixed_to[fixed][nearest]
        self._with_bone: Floats = np.exp(-0.5 * (2.0 * apart / thickness) ** 2)

    def _means_beside(self, values: Floats) -> Floats:
        """Return means of neighbouring values. Of (f n, ...) at the points beside each point of a path."""
        return np.asarray(self._across @ (self._along @ values))

    def _weights_of(self, points: Floats, least: float) -> SkinningWeights:
        f, n = len(self._lengths), len(self._rest) // len(self._lengths)
        tree = cKDTree(self._rest)
        away, near = tree.query(points, k=range(1, min(LOOKED_AT, tree.n) + 1))
        paths, apart, at = _places_beside(points, self._rest.reshape(f, n, 3), near // n, min(CARRIERS, f))
        # A path that none of these points is of is farther than the last.
        seen = apart if tree.n <= LOOKED_AT else np.minimum(apart, away[:, -1:])
        parts = falling_weights(seen, least)
        low = np.clip(at.astype(np.int64), 0, n - 2)
        spline = (at - low)[:, :, None] ** np.arange(4) @ CUBIC
        nodes = np.clip(low[:, :, None] + np.arange(-1, 3), 0, n - 1) + n * paths[:, :, None]
        weights = (parts[:, :, None] * spline).reshape(len(points), -1)
        used = weights.any(axis=0)  # the last of the paths has no part
        carriers = nodes.reshape(weights.shape).compress(used, axis=1)
        return SkinningWeights(np.ascontiguousarray(points), carriers, weights.compress(used, axis=1))

    def weights_of_fibres(self, points: Floats, offsets: Ints) -> SkinningWeights:
        """Return the weights of points of fibres.

        Points are (p, 3); the paths were made from the fibres, and each fibre goes with the fibre's path.
        ``offsets`` (f + 1,) are the numbers of the first point of each fibre, and p.
        """
        n = len(self._rest) // len(self._lengths)
        fibre, low, share = stations_of(points, offsets, n)
        carriers, weights = (fibre * n + low)[:, None] + np.arange(2), np.column_stack([1.0 - share, share])
        return SkinningWeights(np.ascontiguousarray(points), carriers, weights)

    def at(self, paths: Floats, transforms: Floats) -> "SkinnedMuscle":
        """Return the muscle in a pose.

        Paths are (f, n, 3) [mm]; the bones' transforms (b, 4, 4) lead from rest to now.
        """
        n = paths.shape[1]
        stretch = path_widths(paths, self._lengths) ** -2
        parts = np.linspace((1.0, 0.0), (0.0, 1.0), n)
        turns = (parts @ transforms[self._ends, :3, :3].reshape(-1, 2, 9)).reshape(-1, 3, 3)
        now = np.ascontiguousarray(paths).reshape(-1, 3)
        arms = now - now.mean(axis=0)
        products = np.einsum("pi,pj->pij", arms, self._arms).reshape(-1, 9)
        sums = self._means_beside(np.hstack([arms, products]))
        # The points' covariance, now and at rest, and a little of the bones' turn: the rotation nearest to it
        # takes the points to now best, in the least squares sense (Arun, Huang, Blostein 1987,
        # doi:10.1109/TPAMI.1987.4767965).
        covariances = sums[:, 3:].reshape(-1, 3, 3) - np.einsum("pi,pj->pij", sums[:, :3], self._means)
        covariances += np.einsum("p,pij->pij", FROM_BONES * self._spread, turns)
        frames = nearest_rotations(covariances)
        # F = R (g I + (l - g) t t^T), g = l^(-1/2), with l along and g across.
        t, along = self._tangents, np.repeat(stretch, n)
        across = along**-0.5
        turned = np.einsum("pij,pj->pi", frames, t)
        frames = np.einsum("p,pij->pij", across, frames)
        frames += np.einsum("pi,pj->pij", (along - across)[:, None] * turned, t)
        muscle = SkinnedMuscle(self._rest, now, frames, np.empty((0, 3)))
        moved, points = muscle.points(self._surface), self._surface.points
        bones = transforms[self._bone]
        with_bone = np.einsum("vij,vj->vi", bones[:, :3, :3], points) + bones[:, :3, 3]
        moved += self._with_bone[:, None] * (with_bone - moved)
        return muscle._replace(surface=moved)


class SkinnedMuscle(NamedTuple):
    """A muscle taken along by paths in a pose.

    rest, nodes : (f n, 3), points of the paths at rest and now [mm];
    frames : (f n, 3, 3), turn and stretch of the muscle about each point;
    surface : (v, 3), points of the muscle's surface [mm].
    """

    rest: Floats
    nodes: Floats
    frames: Floats
    surface: Floats

    def points(self, weights: SkinningWeights) -> Floats:
        """Return the positions of points in the pose, (p, 3) [mm]."""
        moved = np.empty_like(weights.points)
        _skin(self.rest, self.nodes, self.frames, weights.carriers, weights.weights, weights.points, moved)
        return moved


def falling_weights(distances: Floats, least: float) -> Floats:
    """Return Gaussian weights that fall with distance.

    Distances are (m, k), ascending; the last weight is 0, rows sum to 1. Distances below ``least`` are equal.
    """
    values = np.exp(-0.5 * (distances / np.maximum(distances[:, -1:] / 2.0, least)) ** 2)
    # Rounding decides the last of several neighbours at an equal distance: with a weight of 0 the choice does
    # not matter. Rows of equal weights stay unchanged.
    less = values - values[:, -1:]
    values = np.where(less[:, :1] > ROUNDING, less, values)
    return np.asarray(values / values.sum(axis=1, keepdims=True))


def _places_beside(points: Floats, paths: Floats, near: Ints, count: int) -> tuple[Ints, Floats, Floats]:
    """Return the paths nearest to points.

    ``count`` paths per point come ascending, for points (v, 3), with their distances and the places along the
    paths. ``near`` (v, k) are the paths of points nearby, ascending by distance; a path without points in
    ``near`` is infinitely far.
    """
    chosen = np.empty((len(points), count), dtype=np.int64)
    apart, at = np.full(chosen.shape, np.inf), np.zeros(chosen.shape)
    new = np.ones(near.shape, dtype=np.bool_)
    for rank in range(count):
        chosen[:, rank] = near[np.arange(len(near)), new.argmax(axis=1)]
        apart[new.any(axis=1), rank] = 0.0
        new &= near != chosen[:, rank, None]
    bins, starts = sorted_into_bins(np.where(apart < np.inf, chosen, len(paths)).reshape(-1), len(paths) + 1)
    for path, begin, end in zip(paths, starts[:-2], starts[1:-1], strict=True):
        v, column = np.divmod(bins[begin:end], count)
        apart[v, column], at[v, column] = _place_beside(points[v], path)
    order = np.argsort(apart, axis=1, kind="stable")
    chosen, apart, at = (np.take_along_axis(part, order, axis=1) for part in (chosen, apart, at))
    return chosen, apart, at


def _place_beside(points: Floats, path: Floats) -> tuple[Floats, Floats]:
    """Return a path's distances and places beside points.

    The path is (n, 3), the points are (v, 3), and places are along the path, in segments. The place is the
    mean of the path's points, weighted by a Gaussian of the distances as wide as a segment. Beside a straight
    path the mean is the nearest place. A curved path may have two nearest places: the mean does not choose.
    """
    lengths2 = (np.diff(path, axis=0) ** 2).sum(axis=1)
    squared = cdist(points, path, "sqeuclidean")
    ahead = 0.5 * (squared[:, :-1] - squared[:, 1:] + lengths2)
    part = (ahead / np.maximum(lengths2, TINY)).clip(0.0, 1.0)
    nearest2 = (squared[:, :-1] - part * (2.0 * ahead - part * lengths2)).min(axis=1)
    weights = np.exp((squared.min(axis=1, keepdims=True) - squared) * (0.5 / lengths2.max()))
    return np.sqrt(nearest2.clip(0.0)), weights @ np.arange(len(path)) / weights.sum(axis=1)


@kernel
def _skin(
    rest: Floats, nodes: Floats, frames: Floats, carriers: Ints, weights: Floats, points: Floats,
    moved: Floats,
) -> None:  # fmt: skip
    """Write points moved by their carriers.

    Each moved point is the weighted mean of the places to which the point's carriers take the point.
    """
    for v in range(len(points)):
        x, y, z = 0.0, 0.0, 0.0
        for j in range(carriers.shape[1]):
            k, w = carriers[v, j], weights[v, j]
            if w == 0.0:
                continue
            a, b, c = points[v, 0] - rest[k, 0], points[v, 1] - rest[k, 1], points[v, 2] - rest[k, 2]
            m = frames[k]
            x += w * (nodes[k, 0] + m[0, 0] * a + m[0, 1] * b + m[0, 2] * c)
            y += w * (nodes[k, 1] + m[1, 0] * a + m[1, 1] * b + m[1, 2] * c)
            z += w * (nodes[k, 2] + m[2, 0] * a + m[2, 1] * b + m[2, 2] * c)
        moved[v, 0], moved[v, 1], moved[v, 2] = x, y, z
