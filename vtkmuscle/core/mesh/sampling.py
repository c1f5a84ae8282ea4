"""Points spread evenly over a part of a surface or in a body, and orders that do not change with a motion."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.shared import RecentlyUsed
from vtkmuscle.core.mesh.surface import edge_lengths, faces_between, unique_edges
from vtkmuscle.core.types import Bools, Floats, Ints

#: Most blocks of positions that are tested; a body fills a tenth of its box or more.
MOST_BLOCKS = 512
#: Positions above each other in a column.
LAYERS = 16
#: Root of g^3 = g + 1: remainders of multiples of 1 / g and 1 / g^2 are spread evenly over a square, however
#: many are taken (Roberts 2018, *The unreasonable effectiveness of quasirandom sequences*).
GOLDEN = 1.324717957244746
#: How much more some points of a body count than others for its axes: enough to decide between axes of equal
#: length, far more than rounding, and too little to turn other axes.
UNEVEN = 1e-3
#: A direction along which no two corners of a triangle are level.
GENERIC = np.array([1.0, 1.0 / GOLDEN, 1.0 / GOLDEN**2])
#: Steps in their extent to which positions are rounded before triangles are put in order by them.
PLACES = 1e7
#: Offset of positions along parts in a row: more than rounding, too little to be seen.
OFF_BOUNDS = 1e-9
#: Most sets of evenly spread positions that are kept of an area.
MOST_KEPT = 64


def even_samples(candidates: Floats, count: int) -> Floats:
    """Return some of the candidates (n, 3), n >= 1, spread evenly among them, (count, 3).

    The farthest one is taken again and again. Then each is moved to the centre of its cell a few times
    (Lloyd's relaxation) and from there to the nearest candidate. Where there are fewer candidates they are
    repeated.
    """
    samples = candidates[_farthest(candidates, min(count, len(candidates)))]
    tree = cKDTree(candidates)
    for _ in range(4):
        cell = cKDTree(samples).query(candidates)[1]
        sizes = np.bincount(cell, minlength=len(samples))
        sums = np.column_stack([np.bincount(cell, x, len(samples)) for x in candidates.T])
        filled = sizes > 0
        samples[filled] = candidates[tree.query(sums[filled] / sizes[filled, None])[1]]
    return samples[np.arange(count) % len(samples)]


def _farthest(candidates: Floats, count: int) -> Ints:
    """Return `count` of the candidates: the middle one, then each time the one farthest from all chosen."""
    at = int(((candidates - candidates.mean(axis=0)) ** 2).sum(axis=1).argmin())
    chosen, squares = [], np.full(len(candidates), np.inf)
    for _ in range(count):
        chosen.append(at)
        np.minimum(squares, ((candidates - candidates[at]) ** 2).sum(axis=1), out=squares)
        at = int(squares.argmax())
    return np.array(chosen)


class PatchSamples:
    """Positions on the triangles between given points of a surface, each set of them computed once.

    Where the points of the patch (j,), j >= 1, have no triangle in common the edges between them are sampled,
    and where there are no edges either the points themselves are returned.
    """

    def __init__(self, points: Floats, triangles: Ints, patch: Ints) -> None:
        parts = _in_own_order(points, faces_between(triangles, patch))
        sizes = np.linalg.norm(triangle_normals(points, parts), axis=1)
        #: Area of the triangles [mm^2].
        self.area = float(sizes.sum()) / 2.0
        if not sizes.sum() > 0:
            edges = unique_edges(triangles)
            parts = edges[np.isin(edges, patch).all(axis=1)]
            sizes = edge_lengths(points, parts)
        #: Corners of the triangles, or ends of the edges, or points to sample, (k, 3), (k, 2) or (k, 1).
        self._parts = parts if sizes.sum() > 0 else patch[:, None]
        self._points, self._sizes = points, sizes
        self._dense: dict[tuple[int, int], Floats] = {}
        self._even = RecentlyUsed(MOST_KEPT)

    def dense(self, count: int, *, seed: int = 0) -> Floats:
        """Return at least `count` positions of even density, (k, 3); another seed gives others."""
        exponent = int(np.ceil(np.log2(count)))
        key = exponent, seed
        if key not in self._dense:
            self._dense[key] = self._sampled(_sobol(exponent, seed))
        return self._dense[key]

    def tree(self, count: int) -> cKDTree:
        """Return the search tree of at least `count` positions of even density."""
        return cKDTree(self.dense(count))

    def even(self, count: int, *, direction: Floats, above: float, seed: int = 0) -> Floats:
        """Return positions, (count, 3), spread over the part above a height along a direction.

        If no more than a hundredth is above it, they are spread over all.
        """
        wanted = 16 * count
        candidates = self.dense(wanted, seed=seed)
        share = float((candidates @ direction > above).mean())
        # The candidates above it are known by their number, in this order.
        key: tuple[Any, ...] = count, seed
        if 0.01 < share < 1.0:
            wanted = int(np.ceil(wanted / share))
            candidates = self.dense(wanted, seed=seed)
            candidates = candidates[candidates @ direction > above]
            key = count, seed, wanted, len(candidates), direction.tobytes()
        samples: Floats = self._even(key, lambda: even_samples(candidates, count))
        return samples

    def _sampled(self, u: Floats) -> Floats:
        """Return the positions that go with numbers (k, 3) in [0, 1)."""
        if self._parts.shape[1] == 1:
            return self._points[self._parts[:, 0]]
        a, b, *others = self._points[self._parts[_shares(self._sizes, u[:, 0])]].transpose(1, 0, 2)
        if not others:
            on_edges: Floats = (1.0 - u[:, 1:2]) * a + u[:, 1:2] * b
            return on_edges
        root = np.sqrt(u[:, 1:2])  # uniform over it: Osada et al. 2002, doi:10.1145/571647.571648
        on_faces: Floats = (1.0 - root) * a + root * (1.0 - u[:, 2:]) * b + root * u[:, 2:] * others[0]
        return on_faces


@lru_cache(maxsize=16)
def _sobol(exponent: int, seed: int) -> Floats:
    """Return 2^exponent numbers (k, 3) in [0, 1) of a low-discrepancy sequence."""
    numbers = sobol(2**exponent, 3, first=seed * 2**exponent)
    numbers.setflags(write=False)
    return numbers


def uneven_weights(count: int) -> Floats:
    """Return fixed numbers (count,) spread evenly over [0, 1): multiples of the golden ratio, modulo 1.

    As weights of points they decide, by the order of the points, where a body's symmetry leaves a choice,
    such as the sign of an axis: rounding would choose differently once the body has moved.
    """
    fractions: Floats = np.modf(0.5 * (1.0 + 5.0**0.5) * np.arange(count))[0]
    return fractions


def skewed_direction(points: Floats) -> Floats:
    """Return the direction (d,) of the longer tail of points (n, d).

    That is their third moment, which does not depend on their order; where symmetry leaves none, their order
    decides.
    """
    arms = points - points.mean(axis=0)
    squares = (arms**2).sum(axis=1)
    uneven = UNEVEN * squares.mean() * (uneven_weights(len(arms)) - 0.5)
    side: Floats = (squares + uneven) @ arms
    return side


def own_axes(points: Floats) -> tuple[Floats, Floats]:
    """Return the mean of points (n, 3), and their axes (3, 3), a row each and the longest first.

    They move with the points, and depend on their order only where symmetry leaves a choice.
    """
    centre = points.mean(axis=0)
    arms = points - centre
    weights = 1.0 + UNEVEN * (uneven_weights(len(points)) - 0.5)
    axes = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1].T[::-1].copy()
    axes *= np.where(axes @ skewed_direction(points) < 0.0, -1.0, 1.0)[:, None]
    return centre, axes


def _in_own_order(points: Floats, faces: Ints) -> Ints:
    """Return triangles in an order, and each from a corner, that do not depend on their numbers.

    Neighbours stay together: even sequences of numbers then fall evenly on them.
    """
    if not len(faces):
        return faces
    middles = points[faces].mean(axis=1)
    centre, axes = own_axes(middles)
    places = (middles - centre) @ axes.T
    places = np.round(places * (PLACES / max(float(np.ptp(places, axis=0).max()), 1e-300)))
    by_place = np.lexsort(places.T[::-1])
    ordered = faces[by_place[space_order(places[by_place])]]
    first = ((points[ordered] - centre) @ axes.T @ GENERIC).argmin(axis=1)
    return np.take_along_axis(ordered, (first[:, None] + np.arange(3)) % 3, axis=1)


def samples_inside(inside: Callable[[Floats], Bools], points: Floats, count: int) -> Floats:
    """Return positions of even density in a body, (k, 3) [mm]; where the body moves they move with it.

    They stand in columns along the body's longest axis, one layer above the other: the middle of a fibre,
    taken from the positions beside it, then has the same error all along it, which does not bend the fibre.
    The columns come from a low-discrepancy sequence: more positions begin with the same ones. There are fewer
    than ``count`` >= 1 where the body has next to no volume.

    inside : tells of positions (n, 3) whether they are in the body (n,);  points : (m, 3), of its surface
    [mm].
    """
    centre, axes = own_axes(points)
    along = (points - centre) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    block = -(-count // LAYERS)
    layers = (np.arange(LAYERS) + 0.5) / LAYERS
    found = np.empty((0, 3))
    for first in range(0, MOST_BLOCKS * block, block):
        numbers = np.arange(first, first + block)[:, None] + 0.5
        across = np.repeat(numbers * [1.0 / GOLDEN, 1.0 / GOLDEN**2] % 1.0, LAYERS, axis=0)
        shares = np.column_stack([np.tile(layers, block), across])
        places = centre + (low + shares * (high - low)) @ axes
        found = np.vstack([found, places[inside(places)]])
        if len(found) >= count:
            break
    return found[:count]


def _shares(sizes: Floats, u: Floats) -> Ints:
    """Return for each u in [0, 1) the number of the part that it falls into, by the sizes of the parts."""
    bounds = np.cumsum(sizes)
    # Offset, or fractions of a power of two fall on the bounds of equal parts, where rounding would decide.
    chosen: Ints = np.searchsorted(bounds, (u + OFF_BOUNDS) * bounds[-1], side="right")
    return chosen.clip(max=len(sizes) - 1)


#: Binary digits of each number.
_DIGITS = 30


def _direction_numbers() -> Ints:
    """Return odd numbers less than 2^(k + 1), k from 0, for 3 coordinates, (3, 30).

    The first is van der Corput's sequence; the others follow from the primitive polynomials x + 1 and
    x^2 + x + 1 (Joe and Kuo 2008, doi:10.1137/070709359).
    """
    numbers = np.ones((3, _DIGITS), dtype=np.int64)
    numbers[2, 1] = 3
    for k in range(1, _DIGITS):
        last = numbers[1, k - 1]
        numbers[1, k] = last ^ (last << 1)
    for k in range(2, _DIGITS):
        before, last = numbers[2, k - 2 : k]
        numbers[2, k] = before ^ (before << 2) ^ (last << 1)
    return numbers


_DIRECTIONS = _direction_numbers()


def sobol(count: int, dimension: int, *, first: int = 0) -> Floats:
    """Return points (count, dimension) of Sobol's sequence, in [0, 1), from the first on; dimension 1 to 3.

    In the order of Gray's code (Antonov and Saleev 1979) each differs from the one before it in one direction
    number per coordinate; the i-th is the sum, without carries, of the direction numbers of the digits of i
    in Gray's code. SciPy's takes half a second to import.
    """
    index = np.arange(first, first + count)
    code = index ^ (index >> 1)
    points = np.zeros((count, dimension), dtype=np.int64)
    for digit in range(int(code.max(initial=0)).bit_length()):
        chosen = (code >> digit) & 1
        points ^= chosen[:, None] * (_DIRECTIONS[:dimension, digit] << (_DIGITS - 1 - digit))
    return points / 2.0**_DIGITS


#: Halvings of the longest side of the box around the places.
HALVINGS = 7


def space_order(places: Floats) -> Ints:
    """Return the order (n,) of places (n, d), n >= 1, along a curve through the halves of a box, and theirs.

    That is the Z-order of Morton 1966, *A computer oriented geodetic data base and a new technique in file
    sequencing*. Places that follow each other are near each other, and so are the data to look up for them.
    Places in the same cell of the box stay in their order.
    """
    size = max(float(np.ptp(places, axis=0).max()), 1e-300)
    cells = ((places - places.min(axis=0)) * (2**HALVINGS / size)).astype(np.int64)
    cells = np.minimum(cells, 2**HALVINGS - 1)
    dimensions = cells.shape[1]
    digits = np.arange(HALVINGS)
    # The binary digits of each cell number, as far apart as there are dimensions.
    apart = ((np.arange(2**HALVINGS)[:, None] >> digits & 1) << dimensions * digits).sum(axis=1)
    codes = (apart[cells] << np.arange(dimensions)).sum(axis=1)
    return np.argsort(codes, kind="stable")
