"""A coarse correction: what a muscle does as a whole, which an iteration over its edges takes long to find.

Projecting constraints edge by edge (Gauss-Seidel) takes out in a few iterations what is wrong between
neighbours; what is wrong over the length of a muscle goes from edge to edge and takes thousands. A few nodes
that carry the points with them see just that. Their equations are those of the constraints themselves, so
that the shape that the iteration leads to stays what it is; it is only found sooner. Trottenberg, Oosterlee,
Schüller 2001, *Multigrid*, ISBN 0-12-701070-X, section 2; the nodes' rigid motions as in Sumner, Schmid,
Pauly 2007, *Embedded deformation for shape manipulation*, doi:10.1145/1276377.1276478.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.coarse import bind
from vtkmuscle.core.constraints import DEGENERATE_SINE, DIHEDRAL_FLOOR, volume_and_gradient
from vtkmuscle.core.convergence import reduction
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.topology import MeshTopology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Nodes of the correction, about. More see more, but cost more, too: each iteration multiplies with a matrix
#: of six times as many rows.
NODES = 150

#: Points whose distances differ by less than this part count as equally far.
AS_FAR = 1e-6

#: A node has at least so many free points on average; a muscle too small for :data:`LEAST_NODES` of them has
#: no coarse correction, and needs none.
POINTS_PER_NODE = 8
LEAST_NODES = 5

#: Stiffness, beside that of a constraint, by which a node holds every point: bounds the correction of what no
#: constraint resists.
HOLD = 1e-4

#: Part of the scaled diagonal that is added to it: motions of the nodes that cancel in all points.
REGULARISATION = 1e-9

#: A correction moves no point by more than this part of the muscle's size: beyond, it is not linear.
LONGEST_MOVE = 0.05

#: Points on bones that are respected by the correction, at most; of more, so many are picked and count more.
CONTACTS = 128


class CoarseModel:
    """The constraints of a muscle at rest as the nodes see them.

    Node j takes a point x with it by w_j(x) (t_j + o_j x (x - c_j)). With P the matrix of these motions, a
    unit row a per constraint, its gradient by its length, and k its stiffness, the nodes' equations have the
    matrix P' (sum k a a' + h) P, with h = :data:`HOLD`.

    Parameters
    ----------
    rest : (n, 3) array
        The muscle at rest [mm].
    topology : MeshTopology
        Of its surface.
    free : (n,) bool array
        Points that may move.
    edge_stiffness : (k,) array
        Of the distance constraints, per iteration.
    shape_stiffness : float
        Of the dihedral constraints, per iteration.
    n_nodes : int
        Nodes, about.
    """

    def __init__(
        self,
        rest: Floats,
        topology: MeshTopology,
        free: Bools,
        edge_stiffness: Floats,
        shape_stiffness: float,
        n_nodes: int = NODES,
    ) -> None:
        movable = np.flatnonzero(free)
        picked = farthest_points(rest[movable], min(n_nodes, len(movable) // POINTS_PER_NODE))
        binding = bind(rest, rest[movable[picked]])
        self.rest = rest
        self.triangles = topology.triangles
        self.mass: Floats = free.astype(np.float64)
        self.neighbours: Ints = binding.neighbours
        self.weights: Floats = binding.weights
        #: Twice the distance of the farthest point from the mean [mm].
        self.size = 2.0 * float(np.linalg.norm(rest - rest.mean(axis=0), axis=1).max())
        #: A node's turn is measured by how far it takes a point at this distance [mm].
        self.reach = self.size / np.sqrt(len(picked))
        self.centres: Floats = self.means(rest, len(picked))
        size = 6 * len(picked)
        matrix = np.zeros((size, size))
        _assemble(
            rest,
            self.mass,
            topology.edges,
            edge_stiffness,
            topology.quads,
            shape_stiffness,
            self.neighbours,
            self.weights,
            self.centres,
            self.reach,
            matrix,
        )
        scale = 1.0 / np.sqrt(np.maximum(matrix.diagonal(), np.finfo(np.float64).tiny))
        matrix *= scale[:, None] * scale
        matrix[np.diag_indices(size)] += REGULARISATION
        #: Of the nodes' matrix.
        self.inverse: Floats = _inverse(matrix) * (scale[:, None] * scale)

    def means(self, points: Floats, n_nodes: int) -> Floats:
        """Return the weighted mean (c, 3) of the points of each node."""
        total, sums = np.zeros(n_nodes), np.zeros((n_nodes, 3))
        _gather(points, self.neighbours, self.weights, total, sums)
        return sums / total[:, None]


class CoarseCorrection:
    """The coarse model carried along to where a step starts.

    Parameters
    ----------
    model : CoarseModel
        Of the muscle at rest.
    points : (n, 3) array
        The muscle now [mm].
    keeps_volume : bool
        Whether a correction leaves the volume as it is, to first order.
    """

    def __init__(self, model: CoarseModel, points: Floats, *, keeps_volume: bool) -> None:
        self._model = model
        self._points = points.copy()
        count = len(model.centres)
        self._centres = model.means(points, count)
        covariance = np.zeros((count, 3, 3))
        _covariances(
            model.rest, points, model.neighbours, model.weights, model.centres, self._centres, covariance
        )
        u, _, vt = np.linalg.svd(covariance)
        u[:, :, 2] *= np.where(np.linalg.det(u @ vt) < 0.0, -1.0, 1.0)[:, None]
        #: How each node has turned since rest.
        self._turns: Floats = u @ vt
        size = len(model.inverse)
        #: What a correction respects: a row for the volume, if any, and one for each contact.
        self._rows: Floats = np.zeros((int(keeps_volume), size))
        self._answers: Floats = np.zeros_like(self._rows)
        if keeps_volume:
            gradient = np.empty_like(points)
            volume_and_gradient(points, model.triangles, gradient)
            length = np.linalg.norm(gradient * model.mass[:, None])
            self._rows[0] = self._restrict(gradient / max(length, np.finfo(np.float64).tiny))
            _multiply(model.inverse, self._rows[0], self._answers[0])
        self._always = len(self._rows)
        self._factor: Floats = _factorised(self._rows, self._answers, np.zeros(self._always))
        self._contacts = np.empty(0, dtype=np.int64)

    def touch(self, contacts: Ints, normals: Floats) -> None:
        """Let corrections move points along bones, not into or away from them.

        Parameters
        ----------
        contacts : (m,) int array
            Points on a bone.
        normals : (m, 3) array
            Unit normals of the bones there.
        """
        if np.array_equal(contacts, self._contacts):
            return
        self._contacts = contacts
        count = len(contacts)
        every = max(1.0, count / CONTACTS)
        used = (np.arange(min(count, CONTACTS)) * every).astype(np.int64)
        model, first = self._model, self._always
        # Sherman, Morrison, Woodbury: the nodes' matrix itself stays as it is.
        rows, answers = np.zeros((2, first + len(used), len(model.inverse)))
        rows[:first], answers[:first] = self._rows[:first], self._answers[:first]
        _contact_rows(
            contacts[used],
            normals[used],
            self._points,
            model.mass,
            model.neighbours,
            model.weights,
            self._centres,
            self._turns,
            model.reach,
            model.inverse,
            rows[first:],
            answers[first:],
        )
        compliances = np.full(len(rows), 1.0 / every)
        compliances[:first] = 0.0  # the volume stays exactly
        self._rows, self._answers = rows, answers
        self._factor = _factorised(rows, answers, compliances)

    def _restrict(self, residual: Floats) -> Floats:
        """Return forces and torques (6 c,) on the nodes, in their own frames."""
        model = self._model
        result = np.zeros(len(model.inverse))
        _restrict(
            residual,
            self._points,
            model.mass,
            model.neighbours,
            model.weights,
            self._centres,
            self._turns,
            model.reach,
            result,
        )
        return result

    def add(self, residual: Floats, points: Floats) -> None:
        """Add the correction that belongs to a residual to points.

        Parameters
        ----------
        residual : (n, 3) array
            What an iteration has moved the points by [mm].
        points : (n, 3) array
            The points after it [mm], changed in place.
        """
        model = self._model
        forces = self._restrict(residual)
        motion = np.empty_like(forces)
        _multiply(model.inverse, forces, motion)
        _respect(self._rows, self._answers, self._factor, motion)
        _prolong(
            motion,
            self._points,
            model.mass,
            model.neighbours,
            model.weights,
            self._centres,
            self._turns,
            model.reach,
            LONGEST_MOVE * model.size,
            points,
        )


def has_coarse_model(free: Bools) -> bool:
    """Say whether a muscle with these free points (n,) is large enough for a coarse correction."""
    return int(free.sum()) >= POINTS_PER_NODE * LEAST_NODES


def farthest_points(points: Floats, count: int) -> Ints:
    """Return the ids (count,) of points spread evenly: each the farthest from all before it.

    The first is the farthest from the mean. Gonzalez 1985, *Clustering to minimize the maximum intercluster
    distance*, doi:10.1016/0304-3975(85)90224-5.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    count : int
        At most n.
    """
    picked = np.empty(count, dtype=np.int64)
    _farthest(points, np.linalg.norm(points - points.mean(axis=0), axis=1), picked)
    return picked


@kernel
def _farthest(points: Floats, distances: Floats, picked: Ints) -> None:
    for number in range(len(picked)):
        # Of several as far but for rounding the first: or a turned muscle might have other nodes.
        best = 0
        least = distances.max() * (1.0 - AS_FAR)
        while distances[best] < least:
            best += 1
        picked[number] = best
        for i in range(len(points)):
            x = points[i, 0] - points[best, 0]
            y = points[i, 1] - points[best, 1]
            z = points[i, 2] - points[best, 2]
            d = np.sqrt(x * x + y * y + z * z)
            if number == 0 or d < distances[i]:
                distances[i] = d


# -------------------------------------------------------------------------------- nodes and points


@kernel
def _gather(points: Floats, neighbours: Ints, weights: Floats, total: Floats, sums: Floats) -> None:
    for i in range(len(points)):
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n]
            total[j] += w
            for c in range(3):
                sums[j, c] += w * points[i, c]


@kernel
def _covariances(
    rest: Floats,
    points: Floats,
    neighbours: Ints,
    weights: Floats,
    rest_centres: Floats,
    centres: Floats,
    covariance: Floats,
) -> None:
    for i in range(len(points)):
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n]
            for a in range(3):
                for b in range(3):
                    covariance[j, a, b] += (
                        w * (points[i, a] - centres[j, a]) * (rest[i, b] - rest_centres[j, b])
                    )


@kernel
def _restrict(
    residual: Floats,
    points: Floats,
    mass: Floats,
    neighbours: Ints,
    weights: Floats,
    centres: Floats,
    turns: Floats,
    reach: float,
    result: Floats,
) -> None:
    """Write P' r into result (6 c,)."""
    sums = np.zeros((len(centres), 6))
    for i in range(len(points)):
        if mass[i] == 0.0:
            continue
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        fx, fy, fz = residual[i, 0], residual[i, 1], residual[i, 2]
        mx, my, mz = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n]
            sums[j, 0] += w * fx
            sums[j, 1] += w * fy
            sums[j, 2] += w * fz
            sums[j, 3] += w * mx
            sums[j, 4] += w * my
            sums[j, 5] += w * mz
    for j in range(len(centres)):
        x, y, z = centres[j, 0], centres[j, 1], centres[j, 2]
        fx, fy, fz = sums[j, 0], sums[j, 1], sums[j, 2]
        mx, my, mz = sums[j, 3] - y * fz + z * fy, sums[j, 4] - z * fx + x * fz, sums[j, 5] - x * fy + y * fx
        for c in range(3):
            t = turns[j]
            result[6 * j + c] = t[0, c] * fx + t[1, c] * fy + t[2, c] * fz
            result[6 * j + 3 + c] = (t[0, c] * mx + t[1, c] * my + t[2, c] * mz) / reach


@kernel
def _prolong(
    motion: Floats,
    points: Floats,
    mass: Floats,
    neighbours: Ints,
    weights: Floats,
    centres: Floats,
    turns: Floats,
    reach: float,
    longest: float,
    result: Floats,
) -> None:
    """Add P q to result (n, 3), shortened so that no point moves by more than the longest move."""
    parts = np.empty((len(centres), 6))
    for j in range(len(centres)):
        for c in range(3):
            t, o = 0.0, 0.0
            for d in range(3):
                t += turns[j, c, d] * motion[6 * j + d]
                o += turns[j, c, d] * motion[6 * j + 3 + d]
            parts[j, c], parts[j, 3 + c] = t, o / reach
        x, y, z = centres[j, 0], centres[j, 1], centres[j, 2]
        ox, oy, oz = parts[j, 3], parts[j, 4], parts[j, 5]
        parts[j, 0] -= oy * z - oz * y
        parts[j, 1] -= oz * x - ox * z
        parts[j, 2] -= ox * y - oy * x
    moves = np.empty_like(points)
    most = 0.0
    for i in range(len(points)):
        tx, ty, tz, ox, oy, oz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if mass[i] != 0.0:
            for n in range(neighbours.shape[1]):
                j, w = neighbours[i, n], weights[i, n]
                tx += w * parts[j, 0]
                ty += w * parts[j, 1]
                tz += w * parts[j, 2]
                ox += w * parts[j, 3]
                oy += w * parts[j, 4]
                oz += w * parts[j, 5]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        tx, ty, tz = tx + oy * z - oz * y, ty + oz * x - ox * z, tz + ox * y - oy * x
        moves[i, 0], moves[i, 1], moves[i, 2] = tx, ty, tz
        most = max(most, tx * tx + ty * ty + tz * tz)
    factor = min(1.0, longest / np.sqrt(most)) if most > 0.0 else 1.0
    for i in range(len(points)):
        for c in range(3):
            result[i, c] += factor * moves[i, c]


@reduction
def _inverse(matrix: Floats) -> Floats:
    """Return the inverse of a positive definite matrix, by its lower triangle, which is overwritten.

    By dot products of rows, on one thread: a library's own threads would wait for each other where other
    muscles are solved at the same time, and its result could depend on their number.
    """
    size = len(matrix)
    for i in range(size):  # matrix = l l'
        row = matrix[i]
        for j in range(i + 1):
            other = matrix[j]
            total = row[j]
            for k in range(j):
                total -= row[k] * other[k]
            row[j] = np.sqrt(total) if i == j else total / other[j]
    half = np.zeros((size, size))  # the transpose of l's inverse
    for j in range(size):
        column = half[j]
        column[j] = 1.0 / matrix[j, j]
        for i in range(j + 1, size):
            row = matrix[i]
            total = 0.0
            for k in range(j, i):
                total -= row[k] * column[k]
            column[i] = total / row[i]
    inverse = np.empty((size, size))
    for i in range(size):
        row = half[i]
        for j in range(i + 1):
            other = half[j]
            total = 0.0
            for k in range(i, size):
                total += row[k] * other[k]
            inverse[i, j] = inverse[j, i] = total
    return inverse


@reduction
def _multiply(matrix: Floats, vector: Floats, result: Floats) -> None:
    for i in range(len(matrix)):
        row = matrix[i]
        total = 0.0
        for j in range(len(vector)):
            total += row[j] * vector[j]
        result[i] = total


@reduction
def _factorised(rows: Floats, answers: Floats, compliances: Floats) -> Floats:
    """Return the Cholesky factor (m, m) of rows answers' and the compliances, slightly regularised."""
    count = len(rows)
    factor = np.zeros((count, count))
    for m in range(count):
        used = np.flatnonzero(rows[m])  # a contact's row knows a few nodes only
        row = rows[m][used]
        for n in range(m + 1):
            total = 0.0
            answer = answers[n]
            for k in range(len(used)):
                total += row[k] * answer[used[k]]
            if m == n:
                total = total * (1.0 + REGULARISATION) + compliances[m]
            for k in range(n):
                total -= factor[m, k] * factor[n, k]
            if m == n:
                factor[m, m] = np.sqrt(total) if total > 0.0 else np.inf  # not resolved: not respected
            else:
                factor[m, n] = total / factor[n, n]
    return factor


@reduction
def _respect(rows: Floats, answers: Floats, factor: Floats, motion: Floats) -> None:
    """Take out of a motion (6 c,) what rows (m, 6 c) forbid."""
    count = len(rows)
    multipliers = np.empty(count)
    for m in range(count):
        total = 0.0
        row = rows[m]
        for k in range(len(motion)):
            total += row[k] * motion[k]
        for n in range(m):
            total -= factor[m, n] * multipliers[n]
        multipliers[m] = total / factor[m, m]
    for m in range(count - 1, -1, -1):
        for n in range(m + 1, count):
            multipliers[m] -= factor[n, m] * multipliers[n]
        multipliers[m] /= factor[m, m]
    for m in range(count):
        answer = answers[m]
        for k in range(len(motion)):
            motion[k] -= multipliers[m] * answer[k]


# -------------------------------------------------------------------------------- the matrix


@kernel
def _add_point(
    point: Floats,
    gradient: Floats,
    nodes: Ints,
    weights: Floats,
    centres: Floats,
    reach: float,
    seen: Ints,
    row: Floats,
    count: int,
) -> int:
    """Add a point's part g to a constraint's row over the nodes seen so far; return their number."""
    gx, gy, gz = gradient[0], gradient[1], gradient[2]
    for n in range(len(nodes)):
        j, w = nodes[n], weights[n]
        if w == 0.0:
            continue
        at = 0
        while at < count and seen[at] != j:
            at += 1
        if at == count:
            seen[at] = j
            row[6 * at : 6 * at + 6] = 0.0
            count += 1
        x, y, z = point[0] - centres[j, 0], point[1] - centres[j, 1], point[2] - centres[j, 2]
        row[6 * at] += w * gx
        row[6 * at + 1] += w * gy
        row[6 * at + 2] += w * gz
        row[6 * at + 3] += w * (y * gz - z * gy) / reach
        row[6 * at + 4] += w * (z * gx - x * gz) / reach
        row[6 * at + 5] += w * (x * gy - y * gx) / reach
    return count


@kernel
def _add_square(seen: Ints, row: Floats, count: int, stiffness: float, matrix: Floats) -> None:
    """Add k a a' to the matrix."""
    for m in range(count):
        for n in range(count):
            if seen[n] > seen[m]:
                continue  # the lower triangle is enough
            for a in range(6):
                part = stiffness * row[6 * m + a]
                into = matrix[6 * seen[m] + a, 6 * seen[n] : 6 * seen[n] + 6]
                for b in range(6):
                    into[b] += part * row[6 * n + b]


@kernel
def _assemble(  # noqa: PLR0912 -- one loop for each kind of constraint
    x: Floats,
    mass: Floats,
    edges: Ints,
    edge_stiffness: Floats,
    quads: Ints,
    shape_stiffness: float,
    neighbours: Ints,
    weights: Floats,
    centres: Floats,
    reach: float,
    matrix: Floats,
) -> None:
    width = neighbours.shape[1]
    seen, row = np.empty(4 * width, dtype=np.int64), np.empty(24 * width)
    gradient = np.zeros((4, 3))
    for i in range(len(x)):  # what holds each point
        for c in range(3):
            if mass[i] > 0.0:
                gradient[0] = 0.0
                gradient[0, c] = 1.0
                used = _add_point(x[i], gradient[0], neighbours[i], weights[i], centres, reach, seen, row, 0)
                _add_square(seen, row, used, HOLD, matrix)
    for e in range(len(edges)):
        i, j = edges[e]
        both = mass[i] + mass[j]
        along = x[i] - x[j]
        length = np.sqrt((along**2).sum())
        if both == 0.0 or length == 0.0 or edge_stiffness[e] == 0.0:
            continue
        used = 0
        for number, point in enumerate((i, j)):
            sign = 1.0 - 2.0 * number
            gradient[number] = along * (sign * mass[point] / (length * np.sqrt(both)))
            if mass[point] > 0.0:
                used = _add_point(
                    x[point],
                    gradient[number],
                    neighbours[point],
                    weights[point],
                    centres,
                    reach,
                    seen,
                    row,
                    used,
                )
        _add_square(seen, row, used, edge_stiffness[e], matrix)
    if shape_stiffness == 0.0:
        return
    for q in range(len(quads)):
        quad = quads[q]
        if not _bending(x[quad[0]], x[quad[1]], x[quad[2]], x[quad[3]], gradient):
            continue
        whole, moving = 0.0, 0.0
        for corner in range(4):
            square = (gradient[corner] ** 2).sum()
            whole += square
            moving += mass[quad[corner]] * square
        if moving == 0.0:
            continue
        length = np.sqrt(max(moving, DIHEDRAL_FLOOR * whole))
        used = 0
        for corner in range(4):
            point = quad[corner]
            if mass[point] > 0.0:
                used = _add_point(
                    x[point],
                    gradient[corner] / length,
                    neighbours[point],
                    weights[point],
                    centres,
                    reach,
                    seen,
                    row,
                    used,
                )
        _add_square(seen, row, used, shape_stiffness, matrix)


@kernel
def _bending(pi: Floats, pj: Floats, pk: Floats, pm: Floats, gradient: Floats) -> bool:
    """Write the gradient (4, 3) of the dihedral angle at the edge ij; return whether there is one."""
    e, a, b = pj - pi, pk - pi, pm - pi
    n1, n2 = np.cross(e, a), np.cross(b, e)
    ee, n11, n22 = (e**2).sum(), (n1**2).sum(), (n2**2).sum()
    least = DEGENERATE_SINE * DEGENERATE_SINE * ee
    if not (ee > 0.0 and n11 > least * (a**2).sum() and n22 > least * (b**2).sum()):
        return False
    length = np.sqrt(ee)
    s, t = (a * e).sum() / ee, (b * e).sum() / ee
    gradient[2] = n1 * (length / n11)
    gradient[3] = n2 * (length / n22)
    gradient[0] = -(1.0 - s) * gradient[2] - (1.0 - t) * gradient[3]
    gradient[1] = -s * gradient[2] - t * gradient[3]
    return True


@kernel
def _contact_rows(
    contacts: Ints,
    normals: Floats,
    points: Floats,
    mass: Floats,
    neighbours: Ints,
    weights: Floats,
    centres: Floats,
    turns: Floats,
    reach: float,
    inverse: Floats,
    rows: Floats,
    answers: Floats,
) -> None:
    """Write how far the nodes' motions move points along normals, (m, 6 c), and that times the inverse."""
    for m in range(len(contacts)):
        i = contacts[m]
        g = normals[m]
        for n in range(neighbours.shape[1]):
            j, w = neighbours[i, n], weights[i, n] * mass[i]
            x, y, z = points[i, 0] - centres[j, 0], points[i, 1] - centres[j, 1], points[i, 2] - centres[j, 2]
            tx, ty, tz = y * g[2] - z * g[1], z * g[0] - x * g[2], x * g[1] - y * g[0]
            t = turns[j]
            for c in range(3):
                rows[m, 6 * j + c] = w * (t[0, c] * g[0] + t[1, c] * g[1] + t[2, c] * g[2])
                rows[m, 6 * j + 3 + c] = w * (t[0, c] * tx + t[1, c] * ty + t[2, c] * tz) / reach
            for c in range(6 * j, 6 * j + 6):
                part = rows[m, c]
                for k in range(len(inverse)):
                    answers[m, k] += part * inverse[c, k]
