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

from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.pbd.coarse import bind
from vtkmuscle.core.pbd.coarse_matrix import assemble
from vtkmuscle.core.pbd.constraints import volume_and_gradient
from vtkmuscle.core.pbd.dense import REGULARISATION, factorised, inverse_of, multiply, respect
from vtkmuscle.core.pbd.nodes import (
    Nodes,
    contact_rows,
    covariances,
    farthest_points,
    gather,
    prolong,
    restrict,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Nodes of the correction, about. More see more, but cost more, too: each iteration multiplies with a matrix
#: of six times as many rows.
NODES = 150

#: A node has at least so many free points on average; a muscle too small for :data:`LEAST_NODES` of them has
#: no coarse correction, and needs none.
POINTS_PER_NODE = 8
LEAST_NODES = 5

#: A correction moves no point by more than this part of the muscle's size: beyond, it is not linear.
LONGEST_MOVE = 0.05

#: Points on bones that are respected by the correction, at most; of more, so many are picked and count more.
CONTACTS = 128


class CoarseModel:
    """The constraints of a muscle at rest as the nodes see them.

    Node j takes a point x with it by w_j(x) (t_j + o_j x (x - c_j)). With P the matrix of these motions, a
    unit row a per constraint, its gradient by its length, and k its stiffness, the nodes' equations have the
    matrix P' (sum k a a' + h) P, with h =
    :data:`~vtkmuscle.core.pbd.coarse_matrix.HOLD`.

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
        assemble(
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
        self.inverse: Floats = inverse_of(matrix) * (scale[:, None] * scale)

    def means(self, points: Floats, n_nodes: int) -> Floats:
        """Return the weighted mean (c, 3) of the points of each node."""
        total, sums = np.zeros(n_nodes), np.zeros((n_nodes, 3))
        gather(points, self.neighbours, self.weights, total, sums)
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
        count = len(model.centres)
        centres = model.means(points, count)
        covariance = np.zeros((count, 3, 3))
        covariances(model.rest, points, model.neighbours, model.weights, model.centres, centres, covariance)
        u, _, vt = np.linalg.svd(covariance)
        u[:, :, 2] *= np.where(np.linalg.det(u @ vt) < 0.0, -1.0, 1.0)[:, None]
        self._nodes = Nodes(
            points.copy(), model.mass, model.neighbours, model.weights, centres, u @ vt, float(model.reach)
        )
        size = len(model.inverse)
        #: What a correction respects: a row for the volume, if any, and one for each contact.
        self._rows: Floats = np.zeros((int(keeps_volume), size))
        self._answers: Floats = np.zeros_like(self._rows)
        if keeps_volume:
            gradient = np.empty_like(points)
            volume_and_gradient(points, model.triangles, gradient)
            length = np.linalg.norm(gradient * model.mass[:, None])
            self._rows[0] = self._restrict(gradient / max(length, np.finfo(np.float64).tiny))
            multiply(model.inverse, self._rows[0], self._answers[0])
        self._always = len(self._rows)
        self._factor: Floats = factorised(self._rows, self._answers, np.zeros(self._always))
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
        contact_rows(contacts[used], normals[used], self._nodes, model.inverse, rows[first:], answers[first:])
        compliances = np.full(len(rows), 1.0 / every)
        compliances[:first] = 0.0  # the volume stays exactly
        self._rows, self._answers = rows, answers
        self._factor = factorised(rows, answers, compliances)

    def _restrict(self, residual: Floats) -> Floats:
        """Return forces and torques (6 c,) on the nodes, in their own frames."""
        result = np.zeros(len(self._model.inverse))
        restrict(residual, self._nodes, result)
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
        multiply(model.inverse, forces, motion)
        respect(self._rows, self._answers, self._factor, motion)
        prolong(motion, self._nodes, LONGEST_MOVE * model.size, points)


def has_coarse_model(free: Bools) -> bool:
    """Say whether a muscle with these free points (n,) is large enough for a coarse correction."""
    return int(free.sum()) >= POINTS_PER_NODE * LEAST_NODES
