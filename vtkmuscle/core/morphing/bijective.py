"""A one-to-one map between a section of the muscle, convex or not, and the template's rectangle.

A harmonic map of a disc onto a convex region that takes boundary to boundary one to one is one to one
everywhere (Rado 1926, Kneser 1926, Choquet 1945); so is a piecewise linear one whose inner points are
weighted means, with positive weights, of their neighbours (Tutte 1963, doi:10.1112/plms/s3-13.1.743; Floater
2003, doi:10.1090/S0025-5718-02-01466-7). Mean value coordinates in the rectangle, applied to the section's
contour, are neither: they may fold a concave section, and leave it.

The section is triangulated, its triangulation mapped into the rectangle, and the image searched for the
points there. The inverse is thereby exact for the triangulation: a point of the rectangle is in one image
triangle, and its place in the section is in that triangle's original.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.bins import extremes, sorted_into_bins, stable_order
from vtkmuscle.core.morphing.triangulation import triangulate
from vtkmuscle.core.types import Floats, Ints

#: Points inside of a section, about as many.
N_INNER = 200
#: No point inside is nearer to the contour than this part of the points' spacing.
CLEARANCE = 0.4
#: Bounds of the weights: positive even where four points are on a circle.
WEIGHTS = (1e-6, 1e6)


@array_kernel
def onto_region(contour: Floats, image: Floats) -> tuple[Floats, Ints, Floats]:
    """Return a harmonic map of a section onto a convex region, as triangles with their images.

    Parameters
    ----------
    contour : (n, 2 + k) array
        Vertices of a simple polygon, counterclockwise, n >= 3, neighbours different; beside x and y any k
        values, which are continued harmonically into it.
    image : (n, 2) array
        Where its vertices go: on the boundary of a convex region, counterclockwise.

    Returns
    -------
    images : (p, 2) array
        Where points of the section go.
    triangles : (t, 3) int array
        Ids of the points; none where the polygon is not simple.
    values : (p, 2 + k) array
        x and y of the points, and the values there.
    """
    n, width = len(contour), contour.shape[1]
    polygon = np.empty((n, 2))
    for i in range(n):
        polygon[i, 0], polygon[i, 1] = contour[i, 0], contour[i, 1]
    nodes, triangles, neighbours = triangulate(polygon, _lattice(polygon))
    if len(triangles) == 0:
        return np.empty((0, 2)), triangles, np.empty((0, width))
    known = contour.copy()
    for i in range(n):
        known[i, 0], known[i, 1] = image[i, 0], image[i, 1]
    edges, weights = _edge_weights(nodes, triangles, neighbours)
    values = _harmonic(nodes, edges, weights, known)
    images = np.empty((len(nodes), 2))
    for i in range(len(nodes)):
        images[i, 0], images[i, 1] = values[i, 0], values[i, 1]
        values[i, 0], values[i, 1] = nodes[i, 0], nodes[i, 1]
    return images, triangles, values


@array_kernel
def _lattice(polygon: Floats) -> Floats:
    """Return points of a triangular lattice in a polygon, with a clearance from its edges."""
    n = len(polygon)
    doubled = 0.0
    for i in range(n):
        after = i + 1 if i + 1 < n else 0
        doubled += (polygon[i, 0] - polygon[0, 0]) * (polygon[after, 1] - polygon[0, 1])
        doubled -= (polygon[after, 0] - polygon[0, 0]) * (polygon[i, 1] - polygon[0, 1])
    left, right = extremes(polygon, 0)
    bottom, top = extremes(polygon, 1)
    spacing = np.sqrt(max(0.5 * doubled, 0.0) / (N_INNER * np.sqrt(0.75)))
    row = spacing * np.sqrt(0.75)
    # A polygon that encloses next to nothing in a large box is not worth a lattice.
    if not spacing > 0.0 or (right - left) * (top - bottom) > 1e3 * doubled:
        return np.empty((0, 2))
    n_rows, n_columns = int((top - bottom) / row) + 1, int((right - left) / spacing) + 2
    # Half of the winding of the edges to the right of each lattice point; cleared near any edge.
    crossings = np.zeros((n_rows, n_columns), dtype=np.int64)
    near = np.zeros((n_rows, n_columns), dtype=np.bool_)
    reach = CLEARANCE * spacing
    for i in range(n):
        after = i + 1 if i + 1 < n else 0
        ax, ay, bx, by = polygon[i, 0], polygon[i, 1], polygon[after, 0], polygon[after, 1]
        length = (bx - ax) ** 2 + (by - ay) ** 2
        first = max(int(np.floor((min(ay, by) - reach - bottom) / row - 0.5)), 0)
        last = min(int(np.ceil((max(ay, by) + reach - bottom) / row - 0.5)), n_rows - 1)
        for j in range(first, last + 1):
            y = bottom + (j + 0.5) * row
            shift = left + (0.25 if j % 2 else 0.75) * spacing
            if (ay > y) != (by > y):
                crossing = ax + (y - ay) / (by - ay) * (bx - ax)
                for k in range(min(int(np.ceil((crossing - shift) / spacing)), n_columns)):
                    crossings[j, k] += 1
            k = max(int(np.floor((min(ax, bx) - reach - shift) / spacing)), 0)
            stop = min(int(np.ceil((max(ax, bx) + reach - shift) / spacing)), n_columns - 1)
            while k <= stop:
                x = shift + k * spacing
                share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length if length > 0.0 else 0.0
                share = min(max(share, 0.0), 1.0)
                dx, dy = ax + share * (bx - ax) - x, ay + share * (by - ay) - y
                near[j, k] = near[j, k] or dx * dx + dy * dy < reach * reach
                k += 1
    result = np.empty((n_rows * n_columns, 2))
    found = 0
    for j in range(n_rows):
        for k in range(n_columns):
            if crossings[j, k] % 2 == 1 and not near[j, k]:
                result[found, 0] = left + ((0.25 if j % 2 else 0.75) + k) * spacing
                result[found, 1] = bottom + (j + 0.5) * row
                found += 1
    return result[:found]


@array_kernel
def _edge_weights(nodes: Floats, triangles: Ints, neighbours: Ints) -> tuple[Ints, Floats]:
    """Return the edges of a triangulation and (cot a + cot b) / 2 for each, bounded to be positive."""
    edges = np.empty((3 * len(triangles), 2), dtype=np.int64)
    weights = np.empty(3 * len(triangles))
    n = 0
    for t in range(len(triangles)):
        for side in range(3):
            other = neighbours[t, side]
            if 0 <= other < t:
                continue
            a, b = triangles[t, side], triangles[t, (side + 1) % 3]
            weight = _cotangent(nodes, a, b, triangles[t, (side + 2) % 3])
            if other >= 0:
                j = 0
                while neighbours[other, j] != t:
                    j += 1
                weight += _cotangent(nodes, b, a, triangles[other, (j + 2) % 3])
            edges[n, 0], edges[n, 1] = a, b
            weights[n] = min(max(0.5 * weight, WEIGHTS[0]), WEIGHTS[1])
            n += 1
    return edges[:n], weights[:n]


@kernel
def _cotangent(nodes: Floats, a: int, b: int, c: int) -> float:
    """Return the cotangent of the angle at c in a triangle that runs counterclockwise."""
    ux, uy = nodes[a, 0] - nodes[c, 0], nodes[a, 1] - nodes[c, 1]
    vx, vy = nodes[b, 0] - nodes[c, 0], nodes[b, 1] - nodes[c, 1]
    cosine, sine = ux * vx + uy * vy, ux * vy - uy * vx
    return float(cosine / max(sine, 1e-9 * abs(cosine) + 1e-300))


@array_kernel
def _harmonic(nodes: Floats, edges: Ints, weights: Floats, known: Floats) -> Floats:
    """Return the values at all nodes, those of the first len(known) given, by Cholesky's factors.

    Unknowns are numbered along the longer side of the section: then those that are joined are few numbers
    apart, and all entries of a row of the matrix and of its factor L are within its envelope, from the first
    joined one on (Jennings 1966, doi:10.1093/comjnl/9.3.281). That is exact, and takes less time than a few
    conjugate gradients.
    """
    n, n_free = len(known), len(nodes) - len(known)
    result = np.empty((len(nodes), known.shape[1]))
    for i in range(n):
        for column in range(known.shape[1]):
            result[i, column] = known[i, column]
    if n_free == 0:
        return result
    left, right = extremes(nodes, 0)
    bottom, top = extremes(nodes, 1)
    axis = 0 if right - left > top - bottom else 1
    along = np.empty(n_free)
    for i in range(n_free):
        along[i] = nodes[n + i, axis]
    order = stable_order(along)
    place = np.full(len(nodes), -1, dtype=np.int64)
    for i in range(n_free):
        place[n + order[i]] = i
    places = np.empty((len(edges), 2), dtype=np.int64)
    for e in range(len(edges)):
        places[e, 0], places[e, 1] = place[edges[e, 0]], place[edges[e, 1]]
    first, diagonal, entries, values = _system(places, weights, edges, known, n_free)
    _factorised(entries, diagonal, first)
    for column in range(known.shape[1]):
        x = values[:, column]
        for i in range(n_free):
            for j in range(first[i], i):
                x[i] -= entries[diagonal[i] - i + j] * x[j]
            x[i] /= entries[diagonal[i]]
        for i in range(n_free - 1, -1, -1):
            x[i] /= entries[diagonal[i]]
            for j in range(first[i], i):
                x[j] -= entries[diagonal[i] - i + j] * x[i]
        for i in range(n_free):
            result[n + order[i], column] = x[i]
    return result


@array_kernel
def _system(
    places: Ints, weights: Floats, edges: Ints, known: Floats, n_free: int
) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the lower half of the Laplacian's rows of unknowns, in their envelope, and the right-hand sides.

    The entry (i, j) is at diagonal[i] - i + j, from j = first[i] on.
    """
    first, diagonal = np.empty(n_free, dtype=np.int64), np.empty(n_free, dtype=np.int64)
    for i in range(n_free):
        first[i] = i
    for e in range(len(edges)):
        i, j = max(places[e, 0], places[e, 1]), min(places[e, 0], places[e, 1])
        if j >= 0:
            first[i] = min(first[i], j)
    n_entries = 0
    for i in range(n_free):
        n_entries += i - first[i] + 1
        diagonal[i] = n_entries - 1
    entries = np.zeros(n_entries)
    values = np.zeros((n_free, known.shape[1]))
    for e in range(len(edges)):
        for one, other in ((0, 1), (1, 0)):
            i, j = places[e, one], places[e, other]
            if i < 0:
                continue
            entries[diagonal[i]] += weights[e]
            if j < 0:
                for column in range(known.shape[1]):
                    values[i, column] += weights[e] * known[edges[e, other], column]
            elif j < i:
                entries[diagonal[i] - i + j] -= weights[e]
    return first, diagonal, entries, values


@array_kernel
def _factorised(entries: Floats, diagonal: Ints, first: Ints) -> None:
    """Replace the lower half of a positive definite matrix by its factor L, column by column."""
    n = len(diagonal)
    # The last row that each column is in.
    last = np.empty(n, dtype=np.int64)
    for i in range(n):
        last[i] = i
        last[first[i]] = max(last[first[i]], i)
    for j in range(1, n):
        last[j] = max(last[j], last[j - 1])
    factors = np.empty(n)
    for j in range(n):
        pivot = np.sqrt(entries[diagonal[j]])
        entries[diagonal[j]] = pivot
        for i in range(j + 1, last[j] + 1):
            factors[i] = 0.0
            if first[i] > j:
                continue
            start = diagonal[i] - i
            factor = entries[start + j] / pivot
            entries[start + j] = factor
            factors[i] = factor
            if factor != 0.0:
                for k in range(max(first[i], j + 1), i + 1):
                    entries[start + k] -= factor * factors[k]


@array_kernel
def interpolated(nodes: Floats, triangles: Ints, values: Floats, points: Floats) -> Floats:
    """Return values (m, k) at points (m, 2) of a triangulated convex region, linear on each triangle.

    Points are sorted into a grid, so that a triangle meets those near to it only. One that rounding has put
    into no triangle takes the values of the nearest place in the triangle that it is least outside of.
    """
    m = len(points)
    result = np.empty((m, values.shape[1]))
    side = max(int(np.sqrt(m)), 1)
    low_x, high_x = extremes(nodes, 0)
    low_y, high_y = extremes(nodes, 1)
    wide, high = max(high_x - low_x, 1e-300) * (1.0 + 1e-9), max(high_y - low_y, 1e-300) * (1.0 + 1e-9)
    cells = np.empty(m, dtype=np.int64)
    for p in range(m):
        column = min(max(int((points[p, 0] - low_x) / wide * side), 0), side - 1)
        line = min(max(int((points[p, 1] - low_y) / high * side), 0), side - 1)
        cells[p] = line * side + column
    order, starts = sorted_into_bins(cells, side * side)
    best, home = np.empty(m), np.empty(m, dtype=np.int64)
    for p in range(m):
        best[p], home[p] = -np.inf, -1
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        left, right = min(nodes[a, 0], nodes[b, 0], nodes[c, 0]), max(nodes[a, 0], nodes[b, 0], nodes[c, 0])
        low, top = min(nodes[a, 1], nodes[b, 1], nodes[c, 1]), max(nodes[a, 1], nodes[b, 1], nodes[c, 1])
        first = int((left - low_x) / wide * side)
        last = min(int((right - low_x) / wide * side), side - 1)
        for line in range(
            int((low - low_y) / high * side), min(int((top - low_y) / high * side), side - 1) + 1
        ):
            for i in range(starts[line * side + first], starts[line * side + last + 1]):
                p = order[i]
                if best[p] < 0.0:
                    one, two, three = _shares(nodes, a, b, c, points[p, 0], points[p, 1])
                    least = min(one, two, three)
                    if least > best[p]:
                        best[p], home[p] = least, t
    for p in range(m):
        x, y = points[p, 0], points[p, 1]
        if not best[p] >= 0.0:
            for t in range(len(triangles)):
                one, two, three = _shares(nodes, triangles[t, 0], triangles[t, 1], triangles[t, 2], x, y)
                least = min(one, two, three)
                if least > best[p]:
                    best[p], home[p] = least, t
        a, b, c = triangles[home[p]]
        one, two, three = _shares(nodes, a, b, c, x, y)
        one, two, three = max(one, 0.0), max(two, 0.0), max(three, 0.0)
        total = one + two + three
        for axis in range(values.shape[1]):
            value = one * values[a, axis] + two * values[b, axis] + three * values[c, axis]
            result[p, axis] = value / total
    return result


@kernel
def _shares(nodes: Floats, a: int, b: int, c: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the barycentric coordinates of a point in a triangle; -inf for a triangle without area."""
    ax, ay = nodes[a, 0] - x, nodes[a, 1] - y
    bx, by = nodes[b, 0] - x, nodes[b, 1] - y
    cx, cy = nodes[c, 0] - x, nodes[c, 1] - y
    total = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if not total > 0.0:
        return -np.inf, -np.inf, -np.inf
    return (bx * cy - by * cx) / total, (cx * ay - cy * ax) / total, (ax * by - ay * bx) / total
