"""Points embedded in a muscle's surface (2021 paper, eq. 8), and ends of stiff tendons."""

from functools import cached_property
from typing import NamedTuple
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, vstack
from scipy.spatial import cKDTree

from vtkmuscle.core.fibres.between_areas import NEIGHBOURS, halved
from vtkmuscle.core.fibres.mean_value import coordinate_mesh, mean_value_coordinates, transport, weights_of
from vtkmuscle.core.jit import reduction
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import curve_segments, nearest_arcs
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, shared_tree, tree_of_deformed
from vtkmuscle.core.skinning.skinning import falling_weights
from vtkmuscle.core.types import GRAIN, ROUNDING, SAME, TINY, Bools, Floats, Ints, Progress, quiet

#: Points whose weights are computed at once: a step of progress, and the time until an abort.
_BLOCK = 128
#: Size up to which a process keeps weights [bytes], of 27 000 points in 10 000 vertices; further weights are
#: computed again for each frame.
_LARGEST_CACHE = 2**31
#: Weights kept by any points of the process.
_kept: WeakValueDictionary[int, Floats] = WeakValueDictionary()


class EmbeddedPoints:
    """Points that move with a surface, by mean value coordinates.

    Kohout, Cervenka 2021, eq. 8, doi:10.1007/978-3-030-72379-8_24.

    positions : (p, 3), points at rest [mm];
    points, triangles : (n, 3), (m, 3), the closed surface at rest [mm]; point ids;
    weight_tolerance : tolerance for merging vertices into groups of equal weight; 0 merges nothing
        (:func:`~vtkmuscle.core.fibres.embedding.sparse_mean_value_coordinates`).
    """

    def __init__(self, positions: Floats, points: Floats, triangles: Ints, weight_tolerance: float) -> None:
        self.positions, self.points, self.triangles = positions, points, triangles
        self.weight_tolerance = weight_tolerance
        self._sparse: SparseWeights | None = None
        self._weights: dict[int, Floats] = {}
        self._bent: TriangleTree | None = None  # alive for measures of the same pose

    @cached_property
    def gap(self) -> Floats:
        """Distances (p,) from the muscle at rest [mm]; 0 inside."""
        within = solids_of(self.points, self.triangles).into(self.positions)
        return np.asarray(np.linalg.norm(within - self.positions, axis=1))

    @cached_property
    def _tree(self) -> TriangleTree:
        return shared_tree(self.points, self.triangles)

    @cached_property
    def n_outside(self) -> int:
        """Number of points outside the muscle at rest."""
        return int((self.gap > SAME * np.linalg.norm(np.ptp(self.points, axis=0))).sum())

    @property
    def error(self) -> float:
        """Largest error of merged weights [mm]. For a muscle bent by about a radian."""
        return 0.0 if self._sparse is None else self._sparse.error

    def moved(self, vertices: Floats, report: Progress) -> Floats:
        """Return the moved points (p, 3). For vertices (n, 3); `report` takes the fraction done."""
        if self.weight_tolerance > 0.0:
            if self._sparse is None:
                mesh, prune = (self.points, self.triangles, self.positions), self.weight_tolerance
                self._sparse = sparse_mean_value_coordinates(*mesh, prune=prune, report=report)
            return sparse_transport(self._sparse, vertices)
        moved = np.empty_like(self.positions)
        for first in range(0, len(moved), _BLOCK):
            block, weights = slice(first, first + _BLOCK), self._weights.get(first)
            if weights is None:
                weights = mean_value_coordinates(self.points, self.triangles, self.positions[block])
                if sum(kept.nbytes for kept in list(_kept.values())) + weights.nbytes <= _LARGEST_CACHE:
                    self._weights[first] = _kept[id(weights)] = weights
            moved[block] = transport(weights, vertices)
            report(min(block.stop, len(moved)) / len(moved))
        return moved

    def keep_within(self, positions: Floats, vertices: Floats) -> None:
        """Move positions back to their rest distance outside. Positions (p, 3), in place; vertices (n, 3)."""
        self._bent = tree_of_deformed(self._tree, vertices, self.triangles)
        outside = np.flatnonzero(~self._bent.inside(positions))
        _, nearest, distances = self._bent.nearest(positions[outside])
        far = distances > self.gap[outside]
        out, nearest = outside[far], nearest[far]
        positions[out] = nearest + (self.gap[out] / distances[far])[:, None] * (positions[out] - nearest)


#: Halvings from a group to its subgroups.
HALVINGS = 2
#: Indices of a sparse matrix.
Small = NDArray[np.int32]


class Groups(NamedTuple):
    """Groups (g,) of consecutive vertices, each followed by its subgroups.

    Arrays have the first vertex of a group, its number of vertices, the largest distance of a vertex from the
    mean [mm], and the number of the next group outside of this group.
    """

    starts: Ints
    sizes: Ints
    radii: Floats
    following: Ints


def vertex_groups(points: Floats) -> tuple[Ints, Groups, csc_array]:
    """Return groups of vertices: all, quarters, and so on to single vertices. Points (n, 3) [mm].

    Groups are halved across their longest axes. Vertices of a group are consecutive in the order (n,); the
    matrix (g, n) takes vertex values, in mesh order, to group means.
    """
    n = len(points)
    depth = -(-max(n - 1, 0).bit_length() // HALVINGS) * HALVINGS
    part = halved([points], 2 ** (depth - HALVINGS))[0] << HALVINGS if depth else np.zeros(n, dtype=np.int64)
    order = np.argsort(part, kind="stable")
    ancestors = (part[order] >> depth - level for level in range(0, depth, HALVINGS))
    bounds = [*(np.unique(each, return_index=True)[1] for each in ancestors), np.arange(n)]
    extents = [first * (n + 1) + n - np.diff(np.append(first, n)) for first in bounds]
    starts, rest = np.divmod(np.unique(np.concatenate(extents)), n + 1)  # the largest first, each once
    sizes = n - rest
    ends = np.concatenate([[0], np.cumsum(sizes)])
    members = order[np.arange(ends[-1]) - np.repeat(ends[:-1] - starts, sizes)]
    means = csc_array(csr_array((np.repeat(1.0 / sizes, sizes), members, ends)))
    apart = np.linalg.norm(points[members] - np.repeat(means @ points, sizes, axis=0), axis=1)
    radii = np.maximum.reduceat(apart, ends[:-1])
    return order, Groups(starts, sizes, radii, np.searchsorted(starts, starts + sizes)), means


class SparseWeights(NamedTuple):
    """Mean value coordinates in the means of vertex groups.

    Rows of the matrix (q, g) sum to 1 and reproduce linear functions. `error` is the largest distance of a
    point from its dense transport, for a mesh bent by the quadratic x_i^2 / (2 d) along each axis, with the
    mesh's diagonal d [mm]: about one radian.
    """

    matrix: csc_array  # by columns, a product with three of them takes half the time of one by rows
    error: float
    means: csc_array


def sparse_mean_value_coordinates(
    points: Floats, triangles: Ints, queries: Floats, *, prune: float, report: Progress = quiet
) -> SparseWeights:
    """Return mean value coordinates with merged weights.

    Far from a point the weights vary slowly: in a group of vertices they differ little from their mean w, and
    sum w_j p_j differs from w sum p_j by at most sum abs(w_j - w) times the group's radius. The least-squares
    change of weights restores the sum 1 and the point, so rigid and affine motions are exact, and only
    bending costs accuracy.

    points, triangles, queries : as for
        :func:`~vtkmuscle.core.fibres.mean_value.mean_value_coordinates`;
    prune : a group has one weight if sum abs(w_j - w) r < 2 prune R / n, with its radius r and the radius R
        of all n vertices; >= 0;
    report : callable, receives the fraction of points done.
    """
    order, groups, means_of = vertex_groups(points)
    # Vertices in the order of the groups: a group's weights are next to each other.
    mesh = coordinate_mesh(points[order], np.argsort(order)[triangles])
    centred = points - mesh.centre
    bent = centred**2 / (2.0 * mesh.diagonal)
    means, means_of_bent = means_of @ centred, means_of @ bent
    threshold = 2.0 * prune * groups.radii[0] / len(points)

    ordered_bent = np.ascontiguousarray(bent[order].T)
    parts, error = [csr_array((0, len(means)))], 0.0
    for first in range(0, len(queries), _BLOCK):
        block = queries[first : first + _BLOCK]
        weights = weights_of(mesh, block, first=first)
        grouped = _grouped(weights, groups, threshold)
        corrected = _reproduce_points(grouped, means, groups.sizes, block - mesh.centre)
        if not corrected.all():
            whole = _grouped(weights[~corrected], groups, -np.inf)
            row = np.argsort(np.argsort(~corrected, kind="stable"))
            grouped = csr_array(vstack([grouped[corrected], whole]))[row]
        missed = grouped @ means_of_bent - np.einsum("qn,kn->qk", weights, ordered_bent)
        error = max(error, float(np.linalg.norm(missed, axis=1).max()))
        parts.append(grouped)
        report(min(1.0, (first + _BLOCK) / len(queries)))
    return SparseWeights(csc_array(vstack(parts)), error, means_of)


def sparse_transport(weights: SparseWeights, points: Floats) -> Floats:
    """Return moved points (q, 3), from vertices (n, 3) [mm]."""
    centre = points.mean(axis=0)
    return np.asarray(weights.matrix @ (weights.means @ (points - centre)) + centre)


def _grouped(weights: Floats, groups: Groups, threshold: float) -> csr_array:
    """Return weights in the largest groups of similar weights. Weights (q, n) of ordered vertices."""
    values, columns = np.empty(weights.size), np.empty(weights.size, dtype=np.int32)
    ends = np.zeros(len(weights) + 1, dtype=np.int32)
    _group(weights, groups, threshold, values, columns, ends)
    kept = values[: ends[-1]].copy(), columns[: ends[-1]].copy(), ends
    return csr_array(kept, shape=(len(weights), len(groups.starts)))


@reduction
def _group(weights: Floats, groups: Groups, most: float, values: Floats, columns: Small, ends: Small) -> None:
    """Write sums and numbers of groups whose weights differ by at most the most, times the radius."""
    entry = 0
    for q in range(len(weights)):
        g = 0
        while g < len(groups.starts):
            first, size = groups.starts[g], groups.sizes[g]
            total, off = 0.0, 0.0
            for i in range(first, first + size):
                total += weights[q, i]
            mean = total / size
            for i in range(first, first + size):
                off += abs(weights[q, i] - mean)
            if size > 1 and groups.radii[g] * off > most:
                g += 1
                continue
            if total != 0.0:
                values[entry], columns[entry] = total, g
                entry += 1
            g = groups.following[g]
        ends[q + 1] = entry


def _reproduce_points(weights: csr_array, means: Floats, sizes: Ints, queries: Floats) -> Bools:
    """Correct weights (q, g) to reproduce points (q, 3); return success (q,).

    With c_j vertices in group j, minimise sum_j d_j^2 / c_j for weights w + d, which sum to 1.
    """
    row = np.repeat(np.arange(len(queries)), np.diff(weights.indptr))
    terms = np.ones((4, len(row)))
    terms[1:] = means.T.take(weights.indices, axis=1) - queries.T.take(row, axis=1)
    counts, starts = sizes.take(weights.indices), weights.indptr[:-1]

    def summed(values: Floats) -> Floats:
        return np.add.reduceat(values, starts, axis=-1).T

    # Term by term: an array of all products at once would not stay in the processor's cache.
    matrices = np.array([[summed(a * b) for a in counts * terms] for b in terms])
    matrices = matrices.transpose(2, 0, 1)
    scales = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), TINY))
    # Means may lie in one plane. With 1e-9 lengths of fibres in an arm change by up to 0.03 mm.
    matrices = matrices / (scales[:, :, None] * scales[:, None]) + GRAIN * np.eye(4)
    target = np.array([1.0, 0.0, 0.0, 0.0])
    missing = (target - summed(weights.data * terms)) / scales
    multipliers = np.linalg.solve(matrices, missing[..., None])[..., 0] / scales
    change = sum(term * factor.take(row) for term, factor in zip(terms, multipliers.T, strict=True))
    weights.data += counts * change
    products = weights.data * terms
    left = np.abs(target - summed(products)) <= ROUNDING * (target + summed(np.abs(products)))
    return np.asarray(left.all(axis=1))


class Tendons:
    """Fibre ends at constant distances from bones, along paths.

    A tendon is longer by 3.3 % at the largest force of its muscle (Zajac 1989, *Muscle and tendon*, Critical
    Reviews in Biomedical Engineering 17, 359-411), while fibres may shorten by half. So a path and its fibres
    change their lengths alike.

    fibres : (k, r, 3), fibres at rest, from the aponeurosis on the origin's side to the opposite aponeurosis
        [mm];
    paths : (p, n, 3), paths of the muscle at rest, from bone to bone [mm];
    fixed : (k, 2), ends on a part of the muscle that is fixed to a bone, and moves with the bone.
    """

    def __init__(self, fibres: Floats, paths: Floats, fixed: Bools) -> None:
        self._share = np.linspace(0.0, 1.0, fibres.shape[1])[:, None]
        bow = np.linalg.norm(fibres - self._chords(fibres[:, 0], fibres[:, -1]), axis=2).max(axis=1)
        self._bent = bow > SAME * np.linalg.norm(fibres[:, -1] - fibres[:, 0], axis=1)
        self._free = ~fixed
        self._sides = [_EndNeighbours(fibres[:, end], paths[:, :: -1 if end else 1]) for end in (0, -1)]

    def placed(self, carried: Floats, paths: Floats) -> Floats:
        """Return carried fibres (k, r, 3) with placed ends.

        Ends keep their rest distance along paths (p, n, 3) [mm], and straight fibres stay straight.
        """
        ends = []
        for end, free, side in zip((0, -1), self._free.T, self._sides, strict=True):
            held = side.positions(paths[:, :: -1 if end else 1])
            ends.append(np.where(free[:, None], held, carried[:, end]))
        bows = carried - self._chords(carried[:, 0], carried[:, -1])
        return self._chords(*ends) + np.where(self._bent[:, None, None], bows, 0.0)

    def _chords(self, starts: Floats, ends: Floats) -> Floats:
        return (1.0 - self._share) * starts[:, None] + self._share * ends[:, None]


class _EndNeighbours:
    """Positions of fibre ends relative to neighbouring paths. Ends (m, 3), paths (p, n, 3) at rest."""

    def __init__(self, ends: Floats, paths: Floats) -> None:
        nodes, n = paths.reshape(-1, 3), paths.shape[1]
        apart, nearest_nodes = cKDTree(nodes).query(ends, range(1, min(NEIGHBOURS, len(nodes)) + 1))
        self._paths, self._weights = nearest_nodes // n, falling_weights(apart, TINY)
        self._arcs = nearest_arcs(paths[self._paths], ends[:, None])[0]
        feet, self._ahead = self._along(paths)
        self._offsets = ends[:, None] - feet

    def positions(self, paths: Floats) -> Floats:
        """Return the ends (m, 3) at their rest arcs. Offsets turn with the paths."""
        feet, ahead = self._along(paths)
        axis, cosine = np.cross(self._ahead, ahead), (self._ahead * ahead).sum(axis=-1, keepdims=True)
        about = (axis * self._offsets).sum(axis=-1, keepdims=True) / np.maximum(1.0 + cosine, 1e-3)
        turned = cosine * self._offsets + np.cross(axis, self._offsets) + about * axis
        return np.asarray((self._weights[..., None] * (feet + turned)).sum(axis=1))

    def _along(self, paths: Floats) -> tuple[Floats, Floats]:
        """Return feet (m, c, 3) on paths, and directions. Directions span a segment to either side."""
        points = paths[self._paths]
        starts, lengths, ahead = curve_segments(points)

        def at(arcs: Floats) -> Floats:
            segment = np.maximum((starts <= arcs[..., None]).sum(axis=-1) - 1, 0)[..., None, None]
            since = arcs[..., None] - np.take_along_axis(starts, segment[..., 0], axis=-1)
            begin, on = (np.take_along_axis(x, segment, axis=2)[:, :, 0] for x in (points[:, :, :-1], ahead))
            return np.asarray(begin + since * on)

        reach = lengths.mean(axis=-1)
        return at(self._arcs), unit_vectors(at(self._arcs + reach) - at(self._arcs - reach))
