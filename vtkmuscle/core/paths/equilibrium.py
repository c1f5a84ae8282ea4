"""The equilibrium of a sheet of paths: forces of springs, neighbours and surroundings, and their stiffness.

The unknowns are the points of f paths of n points each, the ends of which are given. One energy has all that
acts on them. Newton's method needs its gradient and a positive part of its second derivatives: a block 3 x 3
of each point, -1 between neighbours along a path, and a spring's along its own direction between neighbours
across. Its steps are solved by conjugate gradients, preconditioned by the paths one by one, which are block
tridiagonal.
"""

from __future__ import annotations

import math

from vtkmuscle.core.jit import kernel, reduction
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.types import Floats

#: Part of the residual that conjugate gradients leave in a step of Newton's method: of 0.1 and 0.01 the same
#: number of these results. And where the response to a move of a bone is asked for, which nothing corrects:
#: of a strap over two rollers, 0.01 has moment arms 0.69 mm off -dl/dq (rms of means), 1e-3 to 1e-6 0.35.
STEP_LEFT, RESPONSE_LEFT = 0.1, 1e-3

#: Steps of conjugate gradients in a step of Newton's, at most.
STEPS = 60


@kernel
def add_springs(x: Floats, held: Floats, pull: Floats, gradient: Floats, blocks: Floats) -> None:
    """Write the gradient and the blocks of springs along paths and of what holds each point.

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
    """Add the springs between neighbours, and write their directions (m, 3).

    E = sum c (a - w d)^2 / 2, with a the distance of x_i and x_j across the paths, at right angles to the
    mean of their tangents there, and w the mean of the paths' ``widths`` (f,). Along each other they slide: a
    sheet that is sheared does not get narrower. Arrays of points are (f n, ...) here. Of a spring's second
    derivatives those along it count, and tangents are taken as they are.
    """
    n = len(x) // len(widths)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        u, v, w = across(x, i, j)
        length = math.sqrt(u * u + v * v + w * w)
        c = neighbours.stiffness[e]
        width = 0.5 * (widths[i // n] + widths[j // n])
        force = c * (length - width * neighbours.distances[e])
        if length > 0.0:
            u, v, w = u / length, v / length, w / length
        directions[e, 0], directions[e, 1], directions[e, 2] = u, v, w
        for k, sign in ((i, 1.0), (j, -1.0)):
            s = sign * force
            gradient[k, 0], gradient[k, 1], gradient[k, 2] = (
                gradient[k, 0] + s * u,
                gradient[k, 1] + s * v,
                gradient[k, 2] + s * w,
            )
            add_direction(blocks[k], c, u, v, w)


@kernel
def across(x: Floats, i: int, j: int) -> tuple[float, float, float]:
    """Return the way from point j to point i of two paths less what of it is along these [mm]."""
    u, v, w = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
    p = x[i + 1, 0] - x[i - 1, 0] + x[j + 1, 0] - x[j - 1, 0]
    q = x[i + 1, 1] - x[i - 1, 1] + x[j + 1, 1] - x[j - 1, 1]
    r = x[i + 1, 2] - x[i - 1, 2] + x[j + 1, 2] - x[j - 1, 2]
    length2 = p * p + q * q + r * r
    along = (u * p + v * q + w * r) / length2 if length2 > 0.0 else 0.0
    return u - along * p, v - along * q, w - along * r


@kernel
def add_direction(block: Floats, stiffness: float, u: float, v: float, w: float) -> None:
    """Add the stiffness s d d^T along a direction d to a point's block (6,)."""
    block[0] += stiffness * u * u
    block[1] += stiffness * u * v
    block[2] += stiffness * u * w
    block[3] += stiffness * v * v
    block[4] += stiffness * v * w
    block[5] += stiffness * w * w


@reduction
def newton_step(
    gradient: Floats,
    blocks: Floats,
    neighbours: Neighbours,
    directions: Floats,
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
    left_over : float
        A step of conjugate gradients ends the solve where what is left of the residual, in the norm of the
        preconditioner, is this part of what it was.
    inverses, work, sheet : (f, n, 6), (4, f, n, 3), (4, 1, n, 6) arrays
        Working memory.
    step : (f, n, 3) array
        Overwritten.
    """
    residual, solved, way, image = work[0], work[1], work[2], work[3]
    coarse, sections, means = sheet[0], sheet[1], sheet[2:4, 0, :, :3]
    _invert(blocks, inverses)
    _add_scaled(gradient, -1.0, residual, 0.0)
    _add_scaled(gradient, 0.0, step, 0.0)
    # A solve that goes far is worth it.
    as_one = left_over < STEP_LEFT
    if as_one:
        _invert_sections(blocks, neighbours, directions, coarse, sections)
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
        stiffness = -2.0 * neighbours.stiffness[e] / f
        add_direction(coarse[0, i], stiffness, directions[e, 0], directions[e, 1], directions[e, 2])
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
        c = neighbours.stiffness[e]
        u, v, w = directions[e, 0], directions[e, 1], directions[e, 2]
        on_i = c * (u * a[j, 0] + v * a[j, 1] + w * a[j, 2])
        on_j = c * (u * a[i, 0] + v * a[i, 1] + w * a[i, 2])
        b[i, 0], b[i, 1], b[i, 2] = b[i, 0] - on_i * u, b[i, 1] - on_i * v, b[i, 2] - on_i * w
        b[j, 0], b[j, 1], b[j, 2] = b[j, 0] - on_j * u, b[j, 1] - on_j * v, b[j, 2] - on_j * w
