"""The equilibrium of a sheet of paths.

Springs, neighbours and tissue exert forces, and Newton's method solves for the equilibrium. The unknowns are
the points of f paths of n points each, with given ends. Newton's method needs the gradient of the energy and
a positive part of the second derivatives: a symmetric 3 x 3 block for each point, -1 between neighbours along
a path, and a spring's stiffness between neighbours across. A symmetric block is stored as xx, xy, xz, yy, yz,
zz.
"""

import math

from vtkmuscle.core.jit import kernel, lane, reduction, vector_kernel
from vtkmuscle.core.paths.neighbours import WIDTH, NeighbourPairs
from vtkmuscle.core.types import Floats, Indices

#: Conjugate gradients end a step of Newton's method at this part of its residual: with 0.1 and 0.01 Newton's
#: method takes the same number of steps.
STEP_LEFT = 0.1

#: A step of steepest descent, in gradients: no spring is stiffer than a bone, which is 100 times as stiff.
STEEPEST = 0.01

#: Iterations of conjugate gradients in a step of Newton's method, at most. With 30 lengths in a knee change
#: by up to 0.2 mm, and moment arms in a pose by 5.6 mm.
STEPS = 60


@kernel
def add_springs(x: Floats, held: Floats, pull: Floats, gradient: Floats, blocks: Floats) -> None:
    """Write the gradient and blocks of springs and tissue.

    E = sum |x_{i+1} - x_i|^2 / 2 + sum x_i . (A_i x_i / 2 - b_i).

    x : (f, n, 3), positions [mm];
    held, pull : (f, n, 6), (f, n, 3), A as symmetric blocks, and b [mm];
    gradient, blocks : (f, n, 3), (f, n, 6), overwritten; the gradient is 0 at the ends.
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
def write_point_rows(points: Floats, widths: Floats, rows: Floats) -> None:
    """Write what pairs need of each point, as rows (f n, 8).

    A row has the position of points (f, n, 3), half of the width of the path (f,), and the sum of the two
    segments at the point, 0 at the ends.
    """
    f, n, _ = points.shape
    for a in range(f):
        for i in range(n):
            row = rows[a * n + i]
            row[3] = 0.5 * widths[a]
            for c in range(3):
                row[c] = points[a, i, c]
                row[4 + c] = points[a, i + 1, c] - points[a, i - 1, c] if 0 < i < n - 1 else 0.0


@lane
def gather_pairs(rows: Floats, pairs: Indices, lanes: Floats, first: int) -> None:
    """Write what a row of pairs needs of the points' rows (f n, 8).

    Of the two points of each pair the differences of the first three numbers, and the sums of the next four,
    become rows of ``lanes``, from the row ``first`` on.
    """
    starts, ends = pairs[0], pairs[1]
    for k in range(WIDTH):
        a, b = rows[starts[k]], rows[ends[k]]
        for c in range(3):
            lanes[(first + c) * WIDTH + k] = a[c] - b[c]
        for c in range(3, 7):
            lanes[(first + c) * WIDTH + k] = a[c] + b[c]


@lane
def pull_apart(forces: Floats, pairs: Indices, lanes: Floats) -> None:
    """Add the vectors in the first three rows of lanes to the first points of pairs.

    The second points get the opposite. The forces are (f n, 3).
    """
    starts, ends = pairs[0], pairs[1]
    for k in range(WIDTH):
        i, j = starts[k], ends[k]
        for c in range(3):
            forces[i, c] += lanes[c * WIDTH + k]
            forces[j, c] -= lanes[c * WIDTH + k]


@lane
def axes_of(lanes: Floats, k: int) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return the axes and lengths of a pair of points.

    The result has three numbers of the unit vector t along the paths, the mean of their tangents at the two
    points; three of the unit vector u across the paths, from the pair's second point towards the first; the
    length of the sum of the tangents; and the distance of the first point from the second along t and along u
    [mm].
    """
    d0, d1, d2 = lanes[k], lanes[WIDTH + k], lanes[2 * WIDTH + k]
    t0, t1, t2 = lanes[4 * WIDTH + k], lanes[5 * WIDTH + k], lanes[6 * WIDTH + k]
    size = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    part = 1.0 / size
    part = part if size > 0.0 else 0.0
    t0, t1, t2 = part * t0, part * t1, part * t2
    ahead = d0 * t0 + d1 * t1 + d2 * t2
    u0, u1, u2 = d0 - ahead * t0, d1 - ahead * t1, d2 - ahead * t2
    apart = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    part = 1.0 / apart
    part = part if apart > 0.0 else 0.0
    return t0, t1, t2, part * u0, part * u1, part * u2, size, ahead, apart


@vector_kernel
def add_neighbours(
    x: Floats, neighbours: NeighbourPairs, widths: Floats, rows: Floats, lanes: Floats, gradient: Floats,
    springs: Floats,
) -> None:  # fmt: skip
    """Add the springs between neighbours.

    E = sum c (a - w d)^2 / 2 + k (s - h / w^2)^2 / 2: a is the distance of two points across the paths, s the
    distance along the paths, d and h are the distances at rest, and w is the mean of the paths' ``widths``
    (f,). A sheared sheet does not get narrower. The stiffness leaves out changes of tangents and widths.

    x : (f, n, 3), positions [mm];
    rows : (f n, 8), overwritten as by :func:`write_point_rows`;
    lanes : (7 WIDTH,), memory;
    gradient : (f n, 3), added to;
    springs : (r, 6, WIDTH), overwritten by each pair's stiffness, as a block.
    """
    write_point_rows(x, widths, rows)
    for r in range(len(neighbours.pairs)):
        gather_pairs(rows, neighbours.pairs[r], lanes, 0)
        constants, blocks = neighbours.constants[r].reshape(-1), springs[r].reshape(-1)
        for k in range(WIDTH):
            _spring(lanes, constants, blocks, k)
        pull_apart(gradient, neighbours.pairs[r], lanes)


@lane
def _spring(lanes: Floats, constants: Floats, block: Floats, k: int) -> None:
    t0, t1, t2, u0, u1, u2, _, ahead, apart = axes_of(lanes, k)
    width, across, along = lanes[3 * WIDTH + k], constants[2 * WIDTH + k], constants[3 * WIDTH + k]
    press = across * (apart - width * constants[k])
    shear = along * (ahead - constants[WIDTH + k] / (width * width))
    for c, (u, t) in enumerate(((u0, t0), (u1, t1), (u2, t2))):
        lanes[c * WIDTH + k] = press * u + shear * t
    block[k] = across * u0 * u0 + along * t0 * t0
    block[WIDTH + k] = across * u0 * u1 + along * t0 * t1
    block[2 * WIDTH + k] = across * u0 * u2 + along * t0 * t2
    block[3 * WIDTH + k] = across * u1 * u1 + along * t1 * t1
    block[4 * WIDTH + k] = across * u1 * u2 + along * t1 * t2
    block[5 * WIDTH + k] = across * u2 * u2 + along * t2 * t2


@kernel
def add_direction(block: Floats, stiffness: float, u: float, v: float, w: float) -> None:
    """Add a stiffness to a point's block (6,). It is s d d^T, with the direction d of (u, v, w)."""
    block[0] += stiffness * u * u
    block[1] += stiffness * u * v
    block[2] += stiffness * u * w
    block[3] += stiffness * v * v
    block[4] += stiffness * v * w
    block[5] += stiffness * w * w


@kernel
def add_lacking(moves: Floats, forces: Floats, lacking: Floats) -> None:
    """Add the stiffness that points lack along their moves.

    Moves (f, n, 3) are of a step, ``forces`` (f, n, 3) are the change of the gradient beyond the matrix's;
    ``lacking`` are blocks (f, n, 6). Each point has a secant of its own, no less than 0 (partitioned
    quasi-Newton methods; Griewank, Toint 1982, doi:10.1007/BF01399316).
    """
    for a in range(len(moves)):
        for i in range(1, moves.shape[1] - 1):
            u, v, w = moves[a, i, 0], moves[a, i, 1], moves[a, i, 2]
            size = u * u + v * v + w * w
            work = forces[a, i, 0] * u + forces[a, i, 1] * v + forces[a, i, 2] * w
            if work > 0.0 and size > 0.0:
                add_direction(lacking[a, i], work / (size * size), u, v, w)


@kernel
def prepare_solve(blocks: Floats, pairs: Indices, springs: Floats, sums: Floats, inverses: Floats) -> None:
    """Write the inverse blocks of each path's elimination.

    The inverse blocks are (f + 1, n, 6). A path's matrix includes the springs at the path's points, whose
    sums are written to ``sums`` (f n, 6). The last row belongs to a sheet with equally moving paths,
    divided by f: springs between the paths drop out, exactly where their points are equally far along the
    paths.
    """
    f, n, _ = blocks.shape
    for i in range(f * n):
        for c in range(6):
            sums[i, c] = 0.0
    for r in range(len(pairs)):
        starts, ends, h = pairs[r, 0], pairs[r, 1], springs[r]
        for k in range(WIDTH):
            i, j = starts[k], ends[k]
            for c in range(6):
                sums[i, c] += h[c, k]
                sums[j, c] += h[c, k]
    for i in range(1, n - 1):
        for c in range(6):
            total = 0.0
            for k in range(f):
                total += blocks[k, i, c]
            inverses[f, i, c] = total / f
    for i in range(1, n - 1):
        for k in range(f + 1):
            h = inverses[k, i]
            for c in range(6):
                block = blocks[k, i, c] + sums[k * n + i, c] if k < f else h[c]
                h[c] = block - (inverses[k, i - 1, c] if i > 1 else 0.0)
            a, b, c0, d, e0, g = h[0], h[1], h[2], h[3], h[4], h[5]
            size = 1.0 / (a * (d * g - e0 * e0) + b * (c0 * e0 - b * g) + c0 * (b * e0 - c0 * d))
            h[0], h[1], h[2] = size * (d * g - e0 * e0), size * (c0 * e0 - b * g), size * (b * e0 - c0 * d)
            h[3], h[4], h[5] = size * (a * g - c0 * c0), size * (b * c0 - a * e0), size * (a * d - b * b)


@reduction
def newton_step(
    gradient: Floats, blocks: Floats, pairs: Indices, springs: Floats, inverses: Floats, left_over: float,
    work: Floats, step: Floats,
) -> float:  # fmt: skip
    """Write Newton's step and return its slope.

    The step is (f, n, 3); the slope, gradient . step, is negative. Conjugate gradients solve for the step,
    preconditioned by the solutions of single paths and of the sheet as a whole. The sheet's solution helps
    more with more paths. Where the matrix is not positive definite, as where bones curve sharply, the step is
    along the gradient.

    gradient : (f, n, 3), 0 at the ends;
    blocks, pairs, springs, inverses : as of the functions above;
    left_over : part of the residual, in the norm of the preconditioner, at which the solution ends;
    work : (4, f + 1, n, 3), working memory;
    step : (f, n, 3), overwritten, 0 at the ends.
    """
    f = len(gradient)
    down, result = gradient.reshape(-1), step.reshape(-1)
    residual, solved = work[0, :f].reshape(-1), work[1, :f].reshape(-1)
    direction, image = work[2, :f].reshape(-1), work[3, :f].reshape(-1)
    for k in range(len(down)):
        residual[k], result[k], direction[k] = -down[k], 0.0, 0.0
    left, before, aim = 0.0, 1.0, 0.0
    for number in range(STEPS + 1):
        _precondition(inverses, work[0], work[1])
        left = _dot(residual, solved)
        if number == 0:
            aim = left_over * left_over * left
        if number == STEPS or not left > aim:
            break
        for k in range(len(direction)):
            direction[k] = solved[k] + left / before * direction[k]
        multiply(blocks, pairs, springs, work[2, :f], work[3, :f])
        curvature = _dot(direction, image)
        if not curvature > 0.0:
            break
        part, before = left / curvature, left
        for k in range(len(direction)):
            result[k] += part * direction[k]
            residual[k] -= part * image[k]
    if not _dot(down, result) < 0.0:
        for k in range(len(down)):
            result[k] = -STEEPEST * down[k]
    return _dot(down, result)


@reduction
def _dot(a: Floats, b: Floats) -> float:
    """Return the sum of the products of arrays (k,)."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@vector_kernel
def _precondition(  # noqa: PLR0912 -- each kernel more costs time to compile
    inverses: Floats, residual: Floats, solved: Floats
) -> None:
    """Write each path's solution and add the sheet's.

    Solutions are (f + 1, n, 3); the whole sheet's solution is last. Paths are in the inner loops: no path
    waits for the path's own last result.
    """
    f, n = len(residual) - 1, residual.shape[1]
    for i in range(n):
        for c in range(3):
            total = 0.0
            for k in range(f):
                total += residual[k, i, c]
            residual[f, i, c] = total / f
    for k in range(f + 1):
        for c in range(3):
            solved[k, 0, c] = solved[k, n - 1, c] = 0.0
    for i in range(1, n - 1):
        for k in range(f + 1):
            p, q, r = residual[k, i, 0], residual[k, i, 1], residual[k, i, 2]
            if i > 1:
                h, y = inverses[k, i - 1], solved[k, i - 1]
                p += h[0] * y[0] + h[1] * y[1] + h[2] * y[2]
                q += h[1] * y[0] + h[3] * y[1] + h[4] * y[2]
                r += h[2] * y[0] + h[4] * y[1] + h[5] * y[2]
            solved[k, i, 0], solved[k, i, 1], solved[k, i, 2] = p, q, r
    for i in range(n - 2, 0, -1):
        for k in range(f + 1):
            h, y = inverses[k, i], solved[k, i + 1]
            # The last of all is 0: the end stays.
            p, q, r = solved[k, i, 0] + y[0], solved[k, i, 1] + y[1], solved[k, i, 2] + y[2]
            solved[k, i, 0] = h[0] * p + h[1] * q + h[2] * r
            solved[k, i, 1] = h[1] * p + h[3] * q + h[4] * r
            solved[k, i, 2] = h[2] * p + h[4] * q + h[5] * r
    for k in range(f):
        for i in range(1, n - 1):
            for c in range(3):
                solved[k, i, c] += solved[f, i, c]


@vector_kernel
def multiply(blocks: Floats, pairs: Indices, springs: Floats, x: Floats, y: Floats) -> None:
    """Write the product of the matrix with x. Both are (f, n, 3); the product is 0 at the ends."""
    f, n, _ = x.shape
    for k in range(f):
        for c in range(3):
            y[k, 0, c] = y[k, n - 1, c] = 0.0
        for i in range(1, n - 1):
            h, p, q, r = blocks[k, i], x[k, i, 0], x[k, i, 1], x[k, i, 2]
            y[k, i, 0] = h[0] * p + h[1] * q + h[2] * r - x[k, i - 1, 0] - x[k, i + 1, 0]
            y[k, i, 1] = h[1] * p + h[3] * q + h[4] * r - x[k, i - 1, 1] - x[k, i + 1, 1]
            y[k, i, 2] = h[2] * p + h[4] * q + h[5] * r - x[k, i - 1, 2] - x[k, i + 1, 2]
    a, b, first = x.reshape(f * n, 3), y.reshape(f * n, 3), pairs[0, 0, 0] if len(pairs) else 0
    p, q, s, f0, f1, f2 = a[first, 0], a[first, 1], a[first, 2], 0.0, 0.0, 0.0
    for r in range(len(pairs)):
        starts, ends, h = pairs[r, 0], pairs[r, 1], springs[r]
        for k in range(WIDTH):
            i, j = starts[k], ends[k]
            if i != first:  # pairs are in the order of their first points, whose sums wait in registers
                for c, force in enumerate((f0, f1, f2)):
                    b[first, c] += force
                first, p, q, s, f0, f1, f2 = i, a[i, 0], a[i, 1], a[i, 2], 0.0, 0.0, 0.0
            u, v, w = p - a[j, 0], q - a[j, 1], s - a[j, 2]
            g0 = h[0, k] * u + h[1, k] * v + h[2, k] * w
            g1 = h[1, k] * u + h[3, k] * v + h[4, k] * w
            g2 = h[2, k] * u + h[4, k] * v + h[5, k] * w
            f0, f1, f2 = f0 + g0, f1 + g1, f2 + g2
            for c, force in enumerate((g0, g1, g2)):
                b[j, c] -= force
    for c, force in enumerate((f0, f1, f2)):
        b[first, c] += force
