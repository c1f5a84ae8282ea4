"""The equilibrium of a sheet of paths: forces of springs, neighbours and surroundings, and their stiffness.

The unknowns are the points of f paths of n points each, the ends of which are given. One energy has all that
acts on them. Newton's method needs its gradient and a positive part of its second derivatives: a block 3 x 3
of each point, -1 between neighbours along a path, and a spring's along its own directions between neighbours
across. Its steps are solved by conjugate gradients, preconditioned by the paths one by one, which are block
tridiagonal, and where a solve goes far by all of them as one.
"""

from __future__ import annotations

import math

from vtkmuscle.core.jit import kernel, reduction
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.types import Floats

#: Part of the residual that conjugate gradients leave in a step of Newton's method: of 0.1 and 0.01 the same
#: number of these results.
STEP_LEFT = 0.1

#: Steps of conjugate gradients in a step of Newton's, at most.
STEPS = 60


@kernel
def add_springs(x: Floats, held: Floats, pull: Floats, gradient: Floats, blocks: Floats) -> None:
    """Write the gradient and the blocks of springs along paths and of the tissue that holds each point.

    E = sum |x_{i+1} - x_i|^2 / 2 + sum x_i . (A_i x_i / 2 - b_i).

    Parameters
    ----------
    x : (f, n, 3) array
        Positions [mm].
    held : (f, n, 6) array
        A: xx, xy, xz, yy, yz, zz.
    pull : (f, n, 3) array
        b [mm].
    gradient : (f, n, 3) array
        Overwritten.
    blocks : (f, n, 6) array
        Overwritten; symmetric, as A.
    """
    f, n, _ = x.shape
    for a in range(f):
        for i in range(1, n - 1):
            k = held[a, i]
            p, q, r = x[a, i, 0], x[a, i, 1], x[a, i, 2]
            gradient[a, i, 0] = k[0] * p + k[1] * q + k[2] * r
            gradient[a, i, 1] = k[1] * p + k[3] * q + k[4] * r
            gradient[a, i, 2] = k[2] * p + k[4] * q + k[5] * r
            for c in range(3):
                gradient[a, i, c] += 2.0 * x[a, i, c] - x[a, i - 1, c] - x[a, i + 1, c] - pull[a, i, c]
            for c in range(6):
                blocks[a, i, c] = k[c]
            blocks[a, i, 0] += 2.0
            blocks[a, i, 3] += 2.0
            blocks[a, i, 5] += 2.0
        for c in range(3):
            gradient[a, 0, c] = gradient[a, n - 1, c] = 0.0


@kernel
def add_neighbours(
    x: Floats, gradient: Floats, blocks: Floats, neighbours: Neighbours, widths: Floats, directions: Floats
) -> None:
    """Add the springs between neighbours, and write their directions (m, 2, 3): across the paths, and along.

    E = sum c (a - w d)^2 / 2 + k (s - h / w^2)^2 / 2: a is the distance of x_i and x_j across the paths, at
    right angles to the mean of their tangents there, s how far x_i lies ahead of x_j along that, and w the
    mean of the paths' ``widths`` (f,); d and h are those at rest. A sheet that is sheared does not get
    narrower. Of a spring's second derivatives those along it count, and tangents and widths are taken as they
    are. Arrays of points are (f n, ...) here.
    """
    n = len(x) // len(widths)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        width = 0.5 * (widths[i // n] + widths[j // n])
        across, along = directions[e, 0], directions[e, 1]
        ahead = 0.0
        for c in range(3):
            across[c] = x[i, c] - x[j, c]
            along[c] = x[i + 1, c] - x[i - 1, c] + x[j + 1, c] - x[j - 1, c]
        _normalise(along)
        for c in range(3):
            ahead += across[c] * along[c]
        for c in range(3):
            across[c] -= ahead * along[c]
        apart = _normalise(across)
        press = neighbours.stiffness[e, 0] * (apart - width * neighbours.distances[e])
        shear = neighbours.stiffness[e, 1] * (ahead - neighbours.ahead[e] / (width * width))
        for c in range(3):
            force = press * across[c] + shear * along[c]
            gradient[i, c], gradient[j, c] = gradient[i, c] + force, gradient[j, c] - force
        for d in range(2):
            u, v, w = directions[e, d, 0], directions[e, d, 1], directions[e, d, 2]
            add_direction(blocks[i], neighbours.stiffness[e, d], u, v, w)
            add_direction(blocks[j], neighbours.stiffness[e, d], u, v, w)


@kernel
def _normalise(v: Floats) -> float:
    """Make a vector (3,) one of length 1, in place, and return its length; 0 stays 0."""
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length > 0.0:
        v[0], v[1], v[2] = v[0] / length, v[1] / length, v[2] / length
    return length


@kernel
def add_direction(block: Floats, stiffness: float, u: float, v: float, w: float) -> None:
    """Add the stiffness s d d^T along a direction d to a point's block (6,)."""
    block[0] += stiffness * u * u
    block[1] += stiffness * u * v
    block[2] += stiffness * u * w
    block[3] += stiffness * v * v
    block[4] += stiffness * v * w
    block[5] += stiffness * w * w


@kernel
def prepare_solve(
    blocks: Floats, neighbours: Neighbours, directions: Floats, as_one: bool, inverses: Floats, sheet: Floats
) -> None:
    """Write the preconditioner of :func:`newton_step`: each path, and ``as_one`` all together."""
    _invert(blocks, inverses)
    if as_one:
        _invert_sections(blocks, neighbours, directions, sheet[0], sheet[1])


@reduction
def newton_step(
    gradient: Floats,
    blocks: Floats,
    neighbours: Neighbours,
    directions: Floats,
    as_one: bool,
    left_over: float,
    inverses: Floats,
    work: Floats,
    sheet: Floats,
    step: Floats,
) -> float:
    """Write the step of Newton's method, (f, n, 3), and return its slope: gradient . step, negative.

    Parameters
    ----------
    gradient, blocks, neighbours, directions
        As of the functions above; ``blocks`` (f, n, 6).
    as_one : bool
        Whether the sheet as a whole is part of the preconditioner.
    left_over : float
        A step of conjugate gradients ends the solve where what is left of the residual, in the norm of the
        preconditioner, is this part of what it was.
    inverses, sheet : (f, n, 6), (4, 1, n, 6) arrays
        Of :func:`prepare_solve`.
    work : (4, f, n, 3) array
        Working memory.
    step : (f, n, 3) array
        Overwritten.
    """
    residual, solved, way, image = work[0], work[1], work[2], work[3]
    sections, means = sheet[1], sheet[2:4, 0, :, :3]
    _add_scaled(gradient, -1.0, residual, 0.0)
    _add_scaled(gradient, 0.0, step, 0.0)
    _precondition(inverses, sections, as_one, residual, solved, means)
    left = _dot(residual, solved)
    aim = left_over * left_over * left
    _add_scaled(solved, 1.0, way, 0.0)
    for _ in range(STEPS):
        if not left > aim:
            break
        _multiply(blocks, neighbours, directions, way, image)
        curvature = _dot(way, image)
        if not curvature > 0.0:
            break
        part = left / curvature
        _add_scaled(way, part, step, 1.0)
        _add_scaled(image, -part, residual, 1.0)
        _precondition(inverses, sections, as_one, residual, solved, means)
        before, left = left, _dot(residual, solved)
        _add_scaled(solved, 1.0, way, left / before)
    return _dot(gradient, step)


@kernel
def _add_scaled(x: Floats, by: float, y: Floats, keep: float) -> None:
    """Write by x + keep y, of (f, n, 3) arrays, to y."""
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            for c in range(3):
                y[k, i, c] = by * x[k, i, c] + (keep * y[k, i, c] if keep != 0.0 else 0.0)


@reduction
def _dot(a: Floats, b: Floats) -> float:
    """Return the sum of the products of (f, n, 3) arrays, inner points only."""
    total = 0.0
    f, n, _ = a.shape
    for k in range(f):
        for i in range(1, n - 1):
            for c in range(3):
                total += a[k, i, c] * b[k, i, c]
    return total


@kernel
def _invert(blocks: Floats, inverses: Floats) -> None:
    """Write the inverse blocks of the elimination of each path's matrix, -1 beside its blocks."""
    f, n, _ = blocks.shape
    for k in range(f):
        for i in range(1, n - 1):
            h = inverses[k, i]
            for c in range(6):
                h[c] = blocks[k, i, c] - (inverses[k, i - 1, c] if i > 1 else 0.0)
            a, b, c0, d, e, g = h[0], h[1], h[2], h[3], h[4], h[5]
            size = 1.0 / (a * (d * g - e * e) + b * (c0 * e - b * g) + c0 * (b * e - c0 * d))
            h[0], h[1], h[2] = size * (d * g - e * e), size * (c0 * e - b * g), size * (b * e - c0 * d)
            h[3], h[4], h[5] = size * (a * g - c0 * c0), size * (b * c0 - a * e), size * (a * d - b * b)


@kernel
def _invert_sections(
    blocks: Floats, neighbours: Neighbours, directions: Floats, coarse: Floats, sections: Floats
) -> None:
    """Write the inverse blocks of the matrix of a sheet all of whose paths move alike, over f.

    Springs between neighbours drop out of it: what they add to the points' blocks is taken off.
    """
    f, n, _ = blocks.shape
    for i in range(1, n - 1):
        for c in range(6):
            total = 0.0
            for k in range(f):
                total += blocks[k, i, c]
            coarse[0, i, c] = total / f
    for e in range(len(neighbours.pairs)):
        i = neighbours.pairs[e, 0] % n
        for d in range(2):
            u, v, w = directions[e, d, 0], directions[e, d, 1], directions[e, d, 2]
            add_direction(coarse[0, i], -2.0 * neighbours.stiffness[e, d] / f, u, v, w)
    _invert(coarse, sections)


@kernel
def _precondition(
    inverses: Floats, sections: Floats, as_one: bool, residual: Floats, solved: Floats, means: Floats
) -> None:
    """Write each path's solution by itself; ``as_one`` adds that of a sheet whose paths move alike."""
    f, n, _ = residual.shape
    _solve_paths(inverses, residual, solved)
    if not as_one:
        return
    for i in range(n):
        for c in range(3):
            total = 0.0
            for k in range(f):
                total += residual[k, i, c]
            means[0, i, c] = total / f
    _solve_paths(sections, means[0:1], means[1:2])
    for k in range(f):
        for i in range(1, n - 1):
            for c in range(3):
                solved[k, i, c] += means[1, i, c]


@kernel
def _solve_paths(inverses: Floats, right: Floats, y: Floats) -> None:
    """Solve each path's equations for the right sides (f, n, 3)."""
    f, n, _ = right.shape
    for k in range(f):
        for c in range(3):
            y[k, 0, c] = y[k, n - 1, c] = 0.0
        for i in range(1, n - 1):
            for c in range(3):
                y[k, i, c] = right[k, i, c]
            if i > 1:
                _add_product(inverses[k, i - 1], y[k, i - 1], y[k, i])
        for i in range(n - 2, 0, -1):
            p, q, r = y[k, i, 0], y[k, i, 1], y[k, i, 2]
            if i < n - 2:
                p, q, r = p + y[k, i + 1, 0], q + y[k, i + 1, 1], r + y[k, i + 1, 2]
            h = inverses[k, i]
            y[k, i, 0] = h[0] * p + h[1] * q + h[2] * r
            y[k, i, 1] = h[1] * p + h[3] * q + h[4] * r
            y[k, i, 2] = h[2] * p + h[4] * q + h[5] * r


@kernel
def _add_product(block: Floats, x: Floats, y: Floats) -> None:
    y[0] += block[0] * x[0] + block[1] * x[1] + block[2] * x[2]
    y[1] += block[1] * x[0] + block[3] * x[1] + block[4] * x[2]
    y[2] += block[2] * x[0] + block[4] * x[1] + block[5] * x[2]


@kernel
def _multiply(blocks: Floats, neighbours: Neighbours, directions: Floats, x: Floats, y: Floats) -> None:
    """Write the product of the matrix with x (f, n, 3), 0 at the ends."""
    f, n, _ = x.shape
    for k in range(f):
        for c in range(3):
            y[k, 0, c] = y[k, n - 1, c] = 0.0
        for i in range(1, n - 1):
            for c in range(3):
                y[k, i, c] = -x[k, i - 1, c] - x[k, i + 1, c]
            _add_product(blocks[k, i], x[k, i], y[k, i])
    a, b = x.reshape(f * n, 3), y.reshape(f * n, 3)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        for d in range(2):
            u, v, w = directions[e, d, 0], directions[e, d, 1], directions[e, d, 2]
            on_i = neighbours.stiffness[e, d] * (u * a[j, 0] + v * a[j, 1] + w * a[j, 2])
            on_j = neighbours.stiffness[e, d] * (u * a[i, 0] + v * a[i, 1] + w * a[i, 2])
            b[i, 0], b[i, 1], b[i, 2] = b[i, 0] - on_i * u, b[i, 1] - on_i * v, b[i, 2] - on_i * w
            b[j, 0], b[j, 1], b[j, 2] = b[j, 0] - on_j * u, b[j, 1] - on_j * v, b[j, 2] - on_j * w
