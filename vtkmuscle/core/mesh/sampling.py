"""Even samples of surfaces and bodies, and stable orders."""

from collections.abc import Callable
from functools import cached_property, lru_cache

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import box_of, edge_lengths, faces_between, longest_side, unique_edges
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import ROUNDING, SAME, Bools, Floats, Ints

#: Most blocks of positions tested; a body fills a tenth of its box or more.
MOST_BLOCKS = 512
#: Positions of a column. With 8 the points of fibres in ten muscles of a hip and a knee move by 0.6 to 1.6 mm
#: (root mean square).
LAYERS = 16
#: Spread of the points' weights in the axes of a body, bone or area: decides between axes of equal length,
#: far above rounding, without turning other axes: without it mean lengths of fibres in ten muscles differ by
#: at most 0.003 mm.
#: With 0.1 in the axes of areas lengths of fibres differ by at most 0.007 mm.
UNEVEN = 1e-3
#: Powers of the root 1 / g, g^3 = g + 1: remainders of their multiples fill a square evenly, for any number
#: (Roberts 2018, *The unreasonable effectiveness of quasirandom sequences*). As a direction they are generic:
#: a triangle's corners have different heights.
GENERIC = 1.324717957244746 ** -np.arange(3.0)


def part_means(values: Floats, part: Ints, count: int, default: Floats | None = None) -> Floats:
    """Return mean values (count, k) of parts. The default, or 0, for parts without members."""
    sizes = np.bincount(part, minlength=count)[:, None]
    sums = np.column_stack([np.bincount(part, x, count) for x in values.T])
    means = np.zeros(sums.shape) if default is None else default.copy()
    return np.divide(sums, sizes, out=means, where=sizes > 0)


def farthest(places: Floats, count: int, first: int = 0) -> Ints:
    """Return places far from each other.

    The numbers of ``count`` places (n, k), from the first on: each is the farthest from those before
    (Gonzalez 1985, doi:10.1016/0304-3975(85)90224-5).
    """
    numbers = np.empty(count, dtype=np.int64)
    _choose(places, first, np.full(len(places), np.inf), numbers)
    return numbers


@kernel
def _choose(places: Floats, at: int, squares: Floats, chosen: Ints) -> None:
    """Do the work of :func:`farthest`; squares : (n,), of distances from the chosen, -1 for these."""
    for k in range(len(chosen)):
        chosen[k], last, squares[at], greatest = at, at, -1.0, -1.0
        for i in range(len(places)):
            square = 0.0
            for c in range(places.shape[1]):
                square += (places[i, c] - places[last, c]) ** 2
            squares[i] = min(squares[i], square)
            if squares[i] > greatest:
                greatest, at = squares[i], i


class PatchSamples:
    """Samples of the triangles between some points of a surface, and distances to them.

    Each set of samples is computed once. A patch (j,), j >= 1, without triangles is sampled along its edges,
    a patch without edges at its points.
    """

    def __init__(self, points: Floats, triangles: Ints, patch: Ints) -> None:
        parts = self.faces = _in_own_order(points, faces_between(triangles, patch))
        sizes = np.linalg.norm(triangle_normals(points, parts), axis=1)
        #: Area of the triangles [mm^2].
        self.area = float(sizes.sum()) / 2.0
        if not sizes.sum() > 0:
            edges = unique_edges(triangles)
            parts = edges[np.isin(edges, patch).all(axis=1)]
            sizes = edge_lengths(points, parts)
        #: Corners of the triangles, or ends of the edges, or points to sample, (k, 3), (k, 2) or (k, 1).
        self._parts = parts if sizes.sum() > 0 else patch[:, None]
        self.points, self._sizes = points, sizes
        self._dense: dict[tuple[int, int], Floats] = {}

    @cached_property
    def tree(self) -> TriangleTree:
        """Tree of the triangles; edges and points count as triangles without area."""
        return triangle_tree(self.points, self._parts[:, np.minimum([0, 1, 2], self._parts.shape[1] - 1)])

    def distances(self, positions: Floats) -> Floats:
        """Return distances (k,) of positions (k, 3) from the patch."""
        return self.tree.nearest(positions)[2]

    def onto(self, positions: Floats) -> Floats:
        """Return the nearest points of the patch. Positions are (k, 3)."""
        return self.tree.nearest(positions)[1]

    def dense(self, count: int, *, seed: int = 0) -> Floats:
        """Return positions of even density. At least `count`, (k, 3); a seed selects a set.

        Loose points repeat.
        """
        exponent = int(np.ceil(np.log2(count)))
        key = exponent, seed
        if key not in self._dense:
            self._dense[key] = self._sampled(sobol(2**exponent, 3, first=seed * 2**exponent))
        return self._dense[key]

    def above(self, count: int, direction: Floats, height: float, *, seed: int = 0) -> Floats:
        """Return positions above a height along a direction.

        About `count` or more, (k, 3), are of even density. If at most a hundredth of the patch is above the
        height, positions are spread over the whole patch.
        """
        positions = self.dense(count, seed=seed)
        share = float((positions @ direction > height).mean())
        if 0.01 < share < 1.0:
            positions = self.dense(int(np.ceil(count / share)), seed=seed)
            positions = positions[positions @ direction > height]
        return positions

    def _sampled(self, u: Floats) -> Floats:
        """Return the positions of numbers (k, 3) in [0, 1)."""
        if self._parts.shape[1] == 1:
            return np.resize(self.points[self._parts[:, 0]], (len(u), 3))
        bounds = np.cumsum(self._sizes)
        # Without the offset, fractions of a power of two fall on bounds of equal parts: rounding decides.
        chosen = np.searchsorted(bounds, (u[:, 0] + ROUNDING) * bounds[-1], side="right")
        a, b, *third = self.points[self._parts[chosen.clip(max=len(bounds) - 1)]].transpose(1, 0, 2)
        if not third:
            return np.asarray((1.0 - u[:, 1:2]) * a + u[:, 1:2] * b)
        root = np.sqrt(u[:, 1:2])  # uniform over it: Osada et al. 2002, doi:10.1145/571647.571648
        return np.asarray((1.0 - root) * a + root * (1.0 - u[:, 2:]) * b + root * u[:, 2:] * third[0])


def uneven_weights(count: int) -> Floats:
    """Return fixed numbers (count,) spread evenly over [0, 1).

    Multiples of the golden ratio, modulo 1. As weights of points they decide, by the order of the points,
    about choices left open by a body's symmetry, such as the sign of an axis; rounding would choose anew
    after a motion.
    """
    return np.asarray(np.modf(0.5 * (1.0 + 5.0**0.5) * np.arange(count))[0])


def skewed_direction(points: Floats) -> Floats:
    """Return the direction (d,) of the longer tail. Points (n, d).

    Their third moment, independent of their order; the order decides in case of symmetry.
    """
    arms = points - points.mean(axis=0)
    squares = (arms**2).sum(axis=1)
    uneven = UNEVEN * squares.mean() * (uneven_weights(len(arms)) - 0.5)
    return np.asarray((squares + uneven) @ arms)


def own_axes(points: Floats) -> tuple[Floats, Floats]:
    """Return the mean (3,) and principal axes (3, 3).

    An axis per row, the longest first. They move with the points, and depend on the points' order only in
    case of symmetry.
    """
    centre = points.mean(axis=0)
    arms = points - centre
    sizes = np.linalg.eigvalsh(arms.T @ arms)
    uneven = UNEVEN if np.diff(sizes).min() <= UNEVEN * sizes[-1] else 0.0
    weights = 1.0 + uneven * (uneven_weights(len(points)) - 0.5)
    axes = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1].T[::-1].copy()
    axes *= np.where(axes @ skewed_direction(points) < 0.0, -1.0, 1.0)[:, None]
    return centre, axes


def _in_own_order(points: Floats, faces: Ints) -> Ints:
    """Return triangles sorted by position, from canonical corners.

    The result is independent of the triangles' numbers and winding. Neighbours stay together, so even
    sequences of numbers fall evenly on them.
    """
    if not len(faces):
        return faces
    middles = points[faces].mean(axis=1)
    centre, axes = own_axes(middles)
    along = (middles - centre) @ axes.T
    along = np.round(along / max(SAME * longest_side(along), 1e-300))
    by_position = np.lexsort(along.T[::-1])
    ordered = faces[by_position[space_order(along[by_position])]]
    corners = ((points[ordered] - centre) @ axes.T @ GENERIC).argsort(axis=1)
    return np.take_along_axis(ordered, corners, axis=1)


def samples_inside(inside: Callable[[Floats], Bools], points: Floats, count: int) -> Floats:
    """Return positions (k, 3) of even density in a body [mm].

    They move with the body. They stand in columns along the body's longest axis: the middle of a fibre's cell
    then has the same error all along the fibre, without a bend. The columns come from a low-discrepancy
    sequence, so more positions begin with the same positions. A body with next to no volume gives fewer than
    ``count`` >= 1.

    inside : from positions (n, 3) to their inside flags (n,);  points : (m, 3), of its surface [mm].
    """
    centre, axes = own_axes(points)
    along = (points - centre) @ axes.T
    low, high = box_of(along)
    block = -(-count // LAYERS)
    layers = (np.arange(LAYERS) + 0.5) / LAYERS
    samples = np.empty((0, 3))
    for first in range(0, MOST_BLOCKS * block, block):
        numbers = np.arange(first, first + block)[:, None] + 0.5
        across = np.repeat(numbers * GENERIC[1:] % 1.0, LAYERS, axis=0)
        shares = np.column_stack([np.tile(layers, block), across])
        positions = centre + (low + shares * (high - low)) @ axes
        samples = np.vstack([samples, positions[inside(positions)]])
        if len(samples) >= count:
            break
    return samples[:count]


#: Binary digits of Sobol's numbers, as in SciPy.
BITS = 30


@lru_cache(maxsize=16)
def sobol(count: int, dimension: int, *, first: int = 0) -> Floats:
    """Return points (count, dimension <= 3) of Sobol's sequence in [0, 1), from number `first`.

    Direction numbers of Joe, Kuo 2008, doi:10.1137/070709359, in Gray code's order. SciPy's own, the same to
    the last digit, takes half a second to import. The points are kept, and must not be changed.
    """
    odd = [[1] * BITS, [1], [1, 3]]
    for _ in range(BITS):  # x + 1 and x^2 + x + 1, the primitive polynomials
        odd[1].append(2 * odd[1][-1] ^ odd[1][-1])
        odd[2].append(4 * odd[2][-2] ^ odd[2][-2] ^ 2 * odd[2][-1])
    numbers = np.arange(first, first + count)
    gray, points = numbers ^ numbers >> 1, np.zeros((count, dimension), dtype=np.int64)
    for bit in range(BITS):
        directions = np.array([odd[axis][bit] for axis in range(dimension)]) << (BITS - 1 - bit)
        points ^= (gray >> bit & 1)[:, None] * directions
    return np.asarray(points * 2.0**-BITS)


#: Halvings of the longest side of the box around positions: the cells of a volume have 21 binary digits.
HALVINGS = 7


def space_order(positions: Floats) -> Ints:
    """Return the order (n,) of positions along the Z-order curve. Positions (n, d).

    Morton 1966, *A computer oriented geodetic data base and a new technique in file sequencing*. Consecutive
    positions are neighbours, and so are their data in memory. Positions in a cell of the box keep order.
    """
    low, high = box_of(positions)
    size = max(float((high - low).max()), 1e-300)
    cells = ((positions - low) * (2**HALVINGS / size)).astype(np.int64)
    cells = np.minimum(cells, 2**HALVINGS - 1)
    dimensions, digits = cells.shape[1], np.arange(HALVINGS)
    # The binary digits of each cell number, spread by the number of dimensions.
    spread = ((np.arange(2**HALVINGS)[:, None] >> digits & 1) << dimensions * digits).sum(axis=1)
    return np.argsort((spread[cells] << np.arange(dimensions)).sum(axis=1), kind="stable")
