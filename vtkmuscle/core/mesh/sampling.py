"""Points spread evenly over a part of a surface."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import faces_between, unique_edges
from vtkmuscle.core.types import Bools, Floats, Ints

#: Blocks of as many positions as wanted that are looked through: bodies fill most of a tenth of their boxes.
MOST_BLOCKS = 512
#: Positions above each other in a column.
LAYERS = 16
#: Root of g^3 = g + 1: remainders of multiples of 1 / g and 1 / g^2 are spread evenly over a square, however
#: many are taken (Roberts 2018, *The unreasonable effectiveness of quasirandom sequences*).
GOLDEN = 1.324717957244746
#: How much more some points of a body count than others for its axes, by their numbers: enough to decide
#: between axes that are as long, far more than rounding, and too little to turn others.
UNEVEN = 1e-3
#: A direction along which the corners of no triangle are level.
GENERIC = np.array([1.0, 1.0 / GOLDEN, 1.0 / GOLDEN**2])
#: Digits of a place within an extent by which triangles are put in order: more are rounding.
PLACES = 1e7
#: How far positions are moved on along parts in a row: more than rounding, too little to be seen.
OFF_BOUNDS = 1e-9
#: Sets of evenly spread positions that are kept of an area.
MOST_KEPT = 64


def even_samples(candidates: Floats, count: int) -> Floats:
    """Return some of many positions, spread evenly among them.

    The farthest one is taken again and again; then each is moved to the centre of its cell a few times
    (Lloyd's relaxation) and from there to the nearest candidate.

    Parameters
    ----------
    candidates : (n, 3) array
        Positions, n >= 1 [mm].
    count : int
        Number of samples, >= 1; where there are fewer candidates they are repeated.

    Returns
    -------
    (count, 3) array
        Some of the candidates [mm].
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
    """Positions on the triangles between given points of a surface, each set of them found once.

    Where the points have no triangle in common the edges between them are sampled, and where there are no
    edges either the points themselves are returned.

    Parameters
    ----------
    points : (n, 3) array
        Points of the surface [mm].
    triangles : (m, 3) int array
        Point ids.
    patch : (j,) int array
        Ids of the points to stay between, j >= 1.
    """

    def __init__(self, points: Floats, triangles: Ints, patch: Ints) -> None:
        self._faces = _in_own_order(points, faces_between(triangles, patch))
        self._areas = np.linalg.norm(triangle_normals(points, self._faces), axis=1)
        self._points, self._patch = points, patch
        self._edges = unique_edges(triangles) if not self._areas.sum() > 0 else np.empty((0, 2), np.int64)
        self._edges = self._edges[np.isin(self._edges, patch).all(axis=1)]
        self._dense: dict[tuple[int, int], Floats] = {}
        self._trees: dict[int, cKDTree] = {}
        self._even: dict[tuple[Any, ...], Floats] = {}

    @property
    def area(self) -> float:
        """Area of the triangles [mm^2]."""
        return float(self._areas.sum()) / 2.0

    def dense(self, count: int, *, seed: int = 0) -> Floats:
        """Return at least `count` positions of even density, (k, 3); another seed gives others."""
        exponent = int(np.ceil(np.log2(count)))
        key = exponent, seed
        if key not in self._dense:
            self._dense[key] = self._sampled(_sobol(exponent, seed))
        return self._dense[key]

    def tree(self, count: int) -> cKDTree:
        """Return the search tree of at least `count` positions of even density."""
        positions = self.dense(count)
        if len(positions) not in self._trees:
            self._trees[len(positions)] = cKDTree(positions)
        return self._trees[len(positions)]

    def even(self, count: int, *, direction: Floats, above: float, seed: int = 0) -> Floats:
        """Return positions, (count, 3), spread over the part above a height along a direction.

        If no more than a hundredth is above it, they are spread over all.
        """
        wanted = 16 * count
        candidates = self.dense(wanted, seed=seed)
        share = float((candidates @ direction > above).mean())
        # Which candidates are above is known from how many.
        key: tuple[Any, ...] = count, seed
        if 0.01 < share < 1.0:
            wanted = int(np.ceil(wanted / share))
            candidates = self.dense(wanted, seed=seed)
            candidates = candidates[candidates @ direction > above]
            key = count, seed, wanted, len(candidates), direction.tobytes()
        if key not in self._even:
            if len(self._even) >= MOST_KEPT:
                self._even.clear()
            self._even[key] = even_samples(candidates, count)
        return self._even[key]

    def _sampled(self, u: Floats) -> Floats:
        """Return the positions that go with numbers (k, 3) in [0, 1)."""
        points = self._points
        if self._areas.sum() > 0:
            a, b, c = points[self._faces[_shares(self._areas, u[:, 0])]].transpose(1, 0, 2)
            root = np.sqrt(u[:, 1:2])  # uniform over it: Osada et al. 2002, doi:10.1145/571647.571648
            on_faces: Floats = (1.0 - root) * a + root * (1.0 - u[:, 2:]) * b + root * u[:, 2:] * c
            return on_faces
        lengths = np.linalg.norm(points[self._edges[:, 1]] - points[self._edges[:, 0]], axis=1)
        if lengths.sum() > 0:
            a, b = points[self._edges[_shares(lengths, u[:, 0])]].transpose(1, 0, 2)
            on_edges: Floats = (1.0 - u[:, 1:2]) * a + u[:, 1:2] * b
            return on_edges
        return points[self._patch]


@lru_cache(maxsize=16)
def _sobol(exponent: int, seed: int) -> Floats:
    """Return 2^exponent numbers (k, 3) in [0, 1) of a low-discrepancy sequence."""
    numbers = sobol(2**exponent, 3, first=seed * 2**exponent)
    numbers.setflags(write=False)
    return numbers


def uneven_weights(count: int) -> Floats:
    """Return arbitrary but fixed numbers (count,), spread evenly over [0, 1).

    Points that are weighted by them decide by their order where a body's symmetry leaves a choice, such as
    the sign of an axis: rounding would choose otherwise once the body has moved. They are multiples of the
    golden ratio, without the integer part.
    """
    fractions: Floats = np.modf(0.5 * (1.0 + 5.0**0.5) * np.arange(count))[0]
    return fractions


def skewed_direction(points: Floats) -> Floats:
    """Return the direction (d,) of the longer tail of points (n, d).

    That is their third moment, which no order of the points changes. Where symmetry leaves none, the numbers
    of the points decide, and not rounding.
    """
    arms = points - points.mean(axis=0)
    squares = (arms**2).sum(axis=1)
    uneven = UNEVEN * squares.mean() * (uneven_weights(len(arms)) - 0.5)
    side: Floats = (squares + uneven) @ arms
    return side


def own_axes(points: Floats) -> tuple[Floats, Floats]:
    """Return the mean of points (n, 3), and their axes (3, 3), a row each and the longest first.

    They go with the points where these move, and depend on their order only where symmetry leaves a choice.
    """
    centre = points.mean(axis=0)
    arms = points - centre
    weights = 1.0 + UNEVEN * (uneven_weights(len(points)) - 0.5)
    axes = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1].T[::-1].copy()
    axes *= np.where(axes @ skewed_direction(points) < 0.0, -1.0, 1.0)[:, None]
    return centre, axes


def _in_own_order(points: Floats, faces: Ints) -> Ints:
    """Return triangles in an order, and each from a corner, that their numbers do not decide.

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
    """Return positions of even density in a body; where the body moves they move with it.

    They stand in columns along the body's longest axis, one layer above the other: what positions beside a
    fibre say of where its middle is has the same error all along it, and so does not bend the fibre.

    Parameters
    ----------
    inside : callable
        From positions (n, 3) to whether they are in the body (n,).
    points : (m, 3) array
        Of its surface [mm].
    count : int
        Number of positions, >= 1.

    Returns
    -------
    (k, 3) array
        Column by column, the columns from a low-discrepancy sequence: more positions begin with the same
        ones [mm]. Fewer than `count` where the body has next to no volume.
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
    """Return for each u in [0, 1) the number of the part that it falls into, parts as large as given."""
    bounds = np.cumsum(sizes)
    # A little off, for fractions of a power of two fall on the bounds of equal parts, and rounding decided.
    chosen: Ints = np.searchsorted(bounds, (u + OFF_BOUNDS) * bounds[-1], side="right")
    return chosen.clip(max=len(sizes) - 1)


#: Binary digits of each number.
_DIGITS = 30
#: Per coordinate, of the primitive polynomial: inner coefficients, and the first direction numbers (Joe and
#: Kuo 2008, doi:10.1137/070709359). The first coordinate is van der Corput's sequence.
_DIRECTIONS = (((), (1,)), ((1,), (1, 3)))


def sobol(count: int, dimension: int, *, first: int = 0) -> Floats:
    """Return points of Sobol's sequence, in the order of Gray's code (Antonov and Saleev 1979).

    Each one differs from the one before it in one direction number per coordinate; the i-th is the sum,
    without carries, of the direction numbers of the digits of i in Gray's code.

    Parameters
    ----------
    count : int
        Number of points.
    dimension : int
        1 to 3.
    first : int, optional
        Points that are left out.

    Returns
    -------
    (count, dimension) array
        In [0, 1).

    Examples
    --------
    >>> from vtkmuscle.core.mesh.sampling import sobol
    >>> sobol(4, 2).tolist()
    [[0.0, 0.0], [0.5, 0.5], [0.75, 0.25], [0.25, 0.75]]
    """
    index = np.arange(first, first + count)
    code = index ^ (index >> 1)
    points = np.zeros((count, dimension), dtype=np.int64)
    for digit in range(int(code.max(initial=0)).bit_length()):
        chosen = (code >> digit) & 1
        for axis in range(dimension):
            points[:, axis] ^= chosen * (_direction(axis, digit) << (_DIGITS - 1 - digit))
    return points / 2.0**_DIGITS


def _direction(axis: int, digit: int) -> int:
    """Return a direction number: odd, and less than 2^(digit + 1)."""
    if axis == 0:
        return 1
    coefficients, numbers = _DIRECTIONS[axis - 1]
    found = list(numbers)
    degree = len(numbers)
    while len(found) <= digit:
        value = found[-degree] ^ (found[-degree] << degree)
        for k, coefficient in enumerate(coefficients, 1):
            value ^= coefficient * (found[-k] << k)
        found.append(value)
    return found[digit]


#: Halvings of the longest side of the box around the places.
HALVINGS = 7


def space_order(places: Floats) -> Ints:
    """Return the order of places along a curve that goes through a box by halves, halves of halves and so on.

    That is the Z-order of Morton 1966, *A computer oriented geodetic data base and a new technique in file
    sequencing*. What is looked up for a place is then mostly at hand from the one before.

    Parameters
    ----------
    places : (n, d) array
        Positions, n >= 1, finite.

    Returns
    -------
    (n,) int array
        Numbers of the places; those in the same cell of the box as they come.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.sampling import space_order
    >>> space_order(np.array([[0.0, 0.0], [1.0, 1.0], [0.1, 0.0], [0.9, 1.0]])).tolist()
    [0, 2, 3, 1]
    """
    size = max(float(np.ptp(places, axis=0).max()), 1e-300)
    cells = ((places - places.min(axis=0)) * (2**HALVINGS / size)).astype(np.int64)
    cells = np.minimum(cells, 2**HALVINGS - 1)
    dimensions = cells.shape[1]
    digits = np.arange(HALVINGS)
    # Of each number of a cell its binary digits, as far apart as there are dimensions.
    apart = ((np.arange(2**HALVINGS)[:, None] >> digits & 1) << dimensions * digits).sum(axis=1)
    codes = (apart[cells] << np.arange(dimensions)).sum(axis=1)
    return np.argsort(codes, kind="stable")
