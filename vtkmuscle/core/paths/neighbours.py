"""Neighbouring paths, held together like muscle tissue."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import ROUNDING, Floats, Indices, Ints

#: Young's modulus of muscle across its fibres, as a part of the tension per area along them. Of passive
#: muscle it is 0.1: 22 kPa (rabbit extensor digitorum longus; Morrow et al. 2010,
#: doi:10.1016/j.jmbbm.2009.03.004) of 225 kPa, the specific tension of human muscle. Muscle under tension is
#: stiffer, up to about as stiff as it is tense: this is the mean of 0.1 and 1, as ratios. What half and
#: double change is in the documentation.
MODULUS = 0.3

#: Shear modulus of muscle along its fibres, likewise: 3.87 kPa (Morrow et al. 2010) of 225 kPa.
SHEAR_MODULUS = 0.017

#: Neighbours of a path in a section: the three nearest rings of an even pattern, of 6 each, which are equally
#: stiff in sum. Springs to the first ring alone leave a strongly sheared section two shapes, a triangle of
#: springs and its mirror image, and many fibres snap at once. Two paths are neighbours if each is among the
#: nearest of the other: with all nearest, paths at a border would hold far ones, and the sheet would be a
#: third stiffer than its moduli. Where three rings are not less than half of the sheet, springs would reach
#: across all of it, and the first ring holds alone, with all nearest: mutual ones would be too few.
NEIGHBOURS, RING = 18, 6

#: Two points nearer than this part of the median distance are as stiff as two so far apart: where paths meet
#: in a tendon's end a strain would be of nothing. With half and twice of it mean moment arms of a hip
#: change by 0.5 mm at most.
LEAST_SPACING = 0.5

#: Points nearer than this part of the median distance do not hold each other: where lines run together, their
#: last digits would say in which direction. If they did, lengths in a knee would change by up to 0.04 mm.
TOO_NEAR = 0.01

#: Least stretch by which a path widens (muscles work between about 0.5 and 1.6): without length it has none.
LEAST_STRETCH = 0.25

#: Pairs of a row, computed side by side: four vectors of eight numbers.
WIDTH = 32


class NeighbourPairs(NamedTuple):
    """Pairs of points that keep their distance.

    The pairs belong to a sheet, and resist shear. Places without a pair, in the last row, have the point 0
    twice and no stiffness.

    pairs : (r, 2, WIDTH), numbers of points, in the order of paths;
    constants : (r, 4, WIDTH), of each pair: distance at rest, across the paths, and along the paths, of the
        first point from the second [mm]; stiffness across and along, in stiffnesses of a path's springs [1].
    """

    pairs: Indices
    constants: Floats


def neighbours_of(fibres: Floats) -> NeighbourPairs:
    """Return the pairs of neighbouring points of fibres.

    Fibres are (f, n, 3); a point is paired with the nearest point of each path beside it. A pair strained by
    e has the energy m (L e)^2 / 2 per length of path, of a path of length L with a tension of 1 per length: m
    is :data:`MODULUS`, and of the shear e :data:`SHEAR_MODULUS`, for :data:`RING` neighbours, and a third of
    each for :data:`NEIGHBOURS`. As paths shorten by l, the kept distances grow by l^(-1/2): the muscle keeps
    its volume. The numbers of paths and of points on each do not matter.
    """
    n, count = fibres.shape[1], NEIGHBOURS if len(fibres) > 2 * NEIGHBOURS else RING
    length = float(path_lengths(fibres).mean())
    pairs = _nearest_across(fibres, count, ROUNDING * length)
    ahead, across = _ahead_and_across(fibres.reshape(-1, 3), _tangents(fibres).reshape(-1, 3), *pairs.T)
    usual = float(np.quantile(across, 0.5 * RING / count)) if len(across) else 0.0  # of the first ring
    apart = (across > ROUNDING * length) & (across > TOO_NEAR * usual)
    spacing = np.maximum(across[apart], LEAST_SPACING * usual)
    moduli = RING / count * np.outer((MODULUS, SHEAR_MODULUS), (length / (spacing * (n - 1))) ** 2)
    of_pairs = np.vstack([across[apart], ahead[apart], moduli])
    return NeighbourPairs(_in_rows(pairs[apart].T).astype(np.uint32), _in_rows(of_pairs))


def _in_rows(values: NDArray[Any]) -> NDArray[Any]:
    """Return values (k, m) of pairs in rows (r, k, WIDTH), 0 in places without a pair."""
    filled = np.pad(values, ((0, 0), (0, -values.shape[1] % WIDTH)))
    return np.ascontiguousarray(filled.reshape(len(values), -1, WIDTH).swapaxes(0, 1))


def _nearest_across(fibres: Floats, count: int, same: float) -> Ints:
    """Return pairs (m, 2) of points, nearest to each other's paths.

    Points are inner points of fibres (f, n, 3), numbered in their order. Beside a point are the ``count``
    nearest paths; of more than :data:`RING`, only paths to whose point the point's path is one of the
    nearest. A path that ends before the point, or comes no nearer than a segment ahead, is not beside the
    point. Distances within ``same`` [mm] are equal.
    """
    f, n, _ = fibres.shape
    inner, flat = fibres[:, 1:-1], (fibres.reshape(-1, 3), _tangents(fibres).reshape(-1, 3))
    points = np.arange(f * n).reshape(f, n)[:, 1:-1]
    segments = path_lengths(fibres) / (n - 1)
    close_pairs = [np.empty((0, 2), dtype=np.int64)]
    for path in range(f):
        apart = cdist(inner[path], inner.reshape(-1, 3)).reshape(n - 2, f, n - 2)
        nearest = apart.argmin(axis=2)
        distance = np.take_along_axis(apart, nearest[..., None], axis=2)[..., 0]
        numbers = np.take_along_axis(points[None], nearest[..., None], axis=2)[..., 0]
        here = np.broadcast_to(points[path][:, None], numbers.shape)
        ahead, _ = _ahead_and_across(*flat, here.reshape(-1), numbers.reshape(-1))
        limit = np.where((nearest == 0) | (nearest == n - 3), 0.5 * segments, segments.mean())
        close = np.abs(ahead).reshape(numbers.shape) <= limit
        close[:, path] = False
        # Paths that have run together count once: rounding would say in which direction they are apart. Of
        # paths equally far none is left out: the order of the fibres would choose.
        distance[~close] = np.inf
        counted = np.where(distance > same, distance, np.inf)
        last = min(count, f) - 1
        close &= distance <= (1.0 + ROUNDING) * np.partition(counted, last, axis=1)[:, last, None]
        close_pairs.append(np.column_stack([here[close], numbers[close]]))
    ways = np.concatenate(close_pairs)
    if count > RING:
        ways = ways[np.isin(ways[:, 1] * f + ways[:, 0] // n, ways[:, 0] * f + ways[:, 1] // n)]
    return np.unique(np.sort(ways, axis=1), axis=0)


def _tangents(fibres: Floats) -> Floats:
    """Return the sums of the segments beside each point of fibres (f, n, 3), 0 at the ends."""
    tangents = np.zeros_like(fibres)
    tangents[:, 1:-1] = fibres[:, 2:] - fibres[:, :-2]
    return tangents


def _ahead_and_across(points: Floats, tangents: Floats, first: Ints, second: Ints) -> tuple[Floats, Floats]:
    """Return the distances of pairs along and across their mean tangents."""
    along = tangents[first] + tangents[second]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    ways = points[first] - points[second]
    ahead: Floats = np.einsum("mi,mi->m", ways, along)
    return ahead, np.asarray(np.linalg.norm(ways - ahead[:, None] * along, axis=1))


def path_lengths(points: Floats) -> Floats:
    """Return the lengths of paths (f, n, 3), (f,) [mm]."""
    lengths = np.empty(len(points))
    _add_steps(np.ascontiguousarray(points), lengths)
    return lengths


@kernel
def _add_steps(points: Floats, lengths: Floats) -> None:
    for a in range(len(points)):
        lengths[a] = 0.0
        for i in range(points.shape[1] - 1):
            square = 0.0
            for c in range(3):
                square += (points[a, i + 1, c] - points[a, i, c]) ** 2
            lengths[a] += np.sqrt(square)


def path_widths(points: Floats, lengths: Floats) -> Floats:
    """Return paths' relative widths. The volume is constant, and ``lengths`` (f,) are at rest."""
    return np.asarray(1.0 / np.sqrt(np.maximum(path_lengths(points) / lengths, LEAST_STRETCH)))


def widening(points: Floats, lengths: Floats) -> Floats:
    """Return the change of widths with length. Of :func:`path_widths`, (f,) [1/mm]."""
    widths = path_widths(points, lengths)
    return np.asarray(np.where(widths < LEAST_STRETCH**-0.5, -0.5 * widths**3 / lengths, 0.0))
