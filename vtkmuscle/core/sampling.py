"""Points spread evenly over a part of a surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import qmc

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh import triangle_normals, unique_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Blocks of eight times as many positions as wanted that are looked through: bodies fill most of a tenth of
#: their boxes.
MOST_BLOCKS = 64
#: Positions above each other in a column.
LAYERS = 16


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
        cells = cKDTree(samples).query(candidates)[1]
        sizes = np.bincount(cells, minlength=len(samples))
        sums = np.column_stack([np.bincount(cells, candidates[:, i], len(samples)) for i in range(3)])
        filled = sizes > 0
        samples[filled] = candidates[tree.query(sums[filled] / sizes[filled, None])[1]]
    return samples[np.arange(count) % len(samples)]


@kernel
def _farthest(candidates: Floats, count: int) -> Ints:
    """Return which candidates are the farthest from those before, again and again; first the central one."""
    n = len(candidates)
    centre = np.zeros(3)
    for i in range(n):
        centre += candidates[i] / n
    chosen = np.empty(count, dtype=np.int64)
    distances = np.full(n, np.inf)
    at, least = 0, np.inf
    for i in range(n):
        distance = ((candidates[i] - centre) ** 2).sum()
        if distance < least:
            at, least = i, distance
    for k in range(count):
        chosen[k] = at
        x, y, z = candidates[at, 0], candidates[at, 1], candidates[at, 2]
        farthest = -1.0
        for i in range(n):
            dx, dy, dz = candidates[i, 0] - x, candidates[i, 1] - y, candidates[i, 2] - z
            distances[i] = min(distances[i], dx * dx + dy * dy + dz * dz)
            if distances[i] > farthest:
                at, farthest = i, distances[i]
    return chosen


def dense_samples(points: Floats, triangles: Ints, patch: Ints, count: int, *, seed: int = 0) -> Floats:
    """Return positions of even density on the triangles between given points of a surface.

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
    count : int
        Least number of samples, >= 1.
    seed : int, optional
        Another number gives other samples.

    Returns
    -------
    (k, 3) array
        Positions on the surface, from a low-discrepancy sequence [mm].
    """
    sequence = qmc.Sobol(3, scramble=False)
    exponent = int(np.ceil(np.log2(count)))
    if seed:
        sequence.fast_forward(seed * 2**exponent)
    u = sequence.random(2**exponent)
    member = np.zeros(len(points), dtype=np.bool_)
    member[patch] = True
    faces = triangles[member[triangles].all(axis=1)]
    areas = np.linalg.norm(triangle_normals(points, faces), axis=1)
    if areas.sum() > 0:
        a, b, c = (points[faces[_shares(areas, u[:, 0])][:, i]] for i in range(3))
        root = np.sqrt(u[:, 1:2])  # uniform over the triangle: Osada et al. 2002, doi:10.1145/571647.571648
        on_faces: Floats = (1.0 - root) * a + root * (1.0 - u[:, 2:]) * b + root * u[:, 2:] * c
        return on_faces
    edges = unique_edges(triangles)
    edges = edges[member[edges].all(axis=1)]
    lengths = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    if lengths.sum() > 0:
        a, b = (points[edges[_shares(lengths, u[:, 0])][:, i]] for i in range(2))
        on_edges: Floats = (1.0 - u[:, 1:2]) * a + u[:, 1:2] * b
        return on_edges
    return points[patch]


def samples_inside(depth: Callable[[Floats], Floats], points: Floats, count: int) -> Floats:
    """Return positions of even density in a body; where the body moves they move with it.

    They stand in columns along the body's longest axis, one layer above the other: what positions beside a
    fibre say of where its middle is has the same error all along it, and so does not bend the fibre.

    Parameters
    ----------
    depth : callable
        From positions (n, 3) to how deep they are in the body (n,), 0 outside.
    points : (m, 3) array
        Of its surface [mm].
    count : int
        Number of positions, >= 1.

    Returns
    -------
    (k, 3) array
        Column by column, the columns from a low-discrepancy sequence [mm]; fewer than `count` where the body
        has next to no volume.
    """
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre, full_matrices=False)[2]
    along = (points - centre) @ axes.T
    # An axis may as well point the other way: the order of the points decides, in symmetric bodies too.
    later = np.arange(len(points)) @ along
    axes *= np.where(later < 0.0, -1.0, 1.0)[:, None]
    along = (points - centre) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    sequence = qmc.Sobol(2, scramble=False)
    block = 2 ** int(np.ceil(np.log2(8 * count / LAYERS)))
    layers = (np.arange(LAYERS) + 0.5) / LAYERS
    found = np.empty((0, 3))
    for _ in range(MOST_BLOCKS):
        across = np.repeat(sequence.random(block), LAYERS, axis=0)
        shares = np.column_stack([np.tile(layers, block), across])
        places = centre + (low + shares * (high - low)) @ axes
        found = np.vstack([found, places[depth(places) > 0.0]])
        if len(found) >= count:
            break
    return found[:count]


def _shares(sizes: Floats, u: Floats) -> Ints:
    """Return for each u in [0, 1) the number of the part that it falls into, parts as large as given."""
    bounds = np.cumsum(sizes)
    chosen: Ints = np.searchsorted(bounds, u * bounds[-1], side="right")
    return chosen.clip(max=len(sizes) - 1)
