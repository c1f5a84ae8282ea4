"""Position based dynamics on two levels: the fine follows the coarse."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.mesh.triangle_tree import Near
from vtkmuscle.core.motion.blending import nearest_rotations
from vtkmuscle.core.pbd.solver import PBDSolver, State
from vtkmuscle.core.skinning.diffusion import cotangent_weights
from vtkmuscle.core.skinning.skinning import falling_weights
from vtkmuscle.core.types import TINY, Floats, Ints, Progress, quiet

#: Coarse points that take a fine point along. With eight, an iliacus solved with an iteration has 16 folded
#: edges, and an adductor brevis one of eight times its length; with sixteen 8, and 4 times.
CARRIERS = 16
#: Iterations of the fine surface, with its edges as they are carried. Four muscles of a real hip, solved with
#: 3 000 triangles, have 0 to 6 folded edges after two, 0 to 10 after one; five take 2 ms more.
FINE_ITERATIONS = 2


def coarse_fixed_points(fine: Floats, fixed_to: Ints, coarse: Floats) -> Ints:
    """Return the bone of each point of a coarse surface.

    Bones are (c,), -1 for free points. A coarse point (c, 3) goes with the bone of the nearest fine point
    (n, 3). A bone left without points gets the coarse point nearest to the middle of the bone's fine points.
    """
    result: Ints = fixed_to[cKDTree(fine).query(coarse)[1]]
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        if bone not in result:
            result[np.linalg.norm(coarse - fine[fixed_to == bone].mean(axis=0), axis=1).argmin()] = bone
    return result


class TwoLevels:
    """Solves a coarse surface that takes a fine surface along.

    Each fine point goes with the nearest coarse points. A coarse point turns as the points of its two rings
    have turned together (shape matching; Müller, Heidelberger, Teschner, Gross 2005,
    doi:10.1145/1073204.1073216). Fixed points then go to their bones and take their neighbourhood along. From
    the resulting positions the fine surface is solved, with the edges as long as carried.

    solver : PBDSolver, of the coarse surface;
    fine : PBDSolver, of the fine surface, with :data:`FINE_ITERATIONS`;
    fixed_to : (n,) int, bone that each point of the fine surface is fixed to, -1 for free points.
    """

    def __init__(self, solver: PBDSolver, fine: PBDSolver, fixed_to: Ints) -> None:
        self._solver, self._fine = solver, fine
        #: The fine surface at rest.
        self.shape = fine.shape
        rest, coarse, topology = fine.shape.points, solver.shape.points, solver.shape.topology
        self._coarse = coarse
        apart, carriers = cKDTree(coarse).query(rest, k=range(1, min(CARRIERS, len(coarse)) + 1))
        self._carriers, self._parts = carriers, falling_weights(apart, TINY)
        ring = cotangent_weights(coarse, topology.triangles) + eye_array(len(coarse))
        rings = csr_array((ring @ ring).astype(np.bool_))
        sizes, near = np.diff(rings.indptr), coarse[rings.indices]
        arms = near - np.repeat(np.add.reduceat(near, rings.indptr[:-1]) / sizes[:, None], sizes, axis=0)
        #: First of the points about each point, the points, and their arms at rest from the points' middle.
        self._rings = rings.indptr, rings.indices, arms
        self._fixed = np.flatnonzero(fixed_to >= 0)
        self._fixed_to = fixed_to[self._fixed]
        away, nearest = cKDTree(rest[self._fixed]).query(rest)
        near = np.exp(-0.5 * (away / solver.shape.lengths.mean()) ** 2)
        #: Points that fixed points take along, with the nearest of these and the part.
        self._along = np.flatnonzero(near > np.finfo(float).eps)
        self._nearest, self._near = nearest[self._along], near[self._along]

    def at_rest(self, n_bones: int) -> State:
        """Return the muscle and all bones at rest."""
        return replace(self._solver.at_rest(n_bones), surface=self.shape.points)

    def step(
        self, state: State, transforms: Floats, near: Sequence[Near] = (), report: Progress = quiet
    ) -> State:
        """Return the state after the bones have moved on.

        The parameters are as of :meth:`PBDSolver.step`. A neighbour comes with the depths of the points of
        the coarse surface and of the fine surface in the neighbour.
        """
        coarse, fine = ([pair[level] for pair in near] for level in (0, 1))
        state = self._solver.step(state, transforms, near=coarse, report=report)
        carried = self.prolonged(state.positions + self._solver.centre, transforms)
        solved = self._fine.pose(carried, transforms, near=fine)
        return replace(state, surface=solved.surface, colliding=solved.colliding)

    def prolonged(self, coarse: Floats, transforms: Floats) -> Floats:
        """Return the fine points (n, 3) carried by the coarse points (c, 3)."""
        rest, products = self.shape.points, np.empty((len(coarse), 3, 3))
        _products(*self._rings, coarse, products)
        turns, carried = nearest_rotations(products), np.empty_like(rest)
        shifts = coarse - np.einsum("cij,cj->ci", turns, self._coarse)
        _carry(np.hstack([turns.reshape(-1, 9), shifts]), self._carriers, self._parts, rest, carried)
        now, fixed = transforms[self._fixed_to], self._fixed
        residual = (now[:, :3, :3] @ rest[fixed, :, None])[:, :, 0] + now[:, :3, 3] - carried[fixed]
        carried[self._along] += self._near[:, None] * residual[self._nearest]
        return carried


@vector_kernel
def _products(starts: Ints, ends: Ints, arms: Floats, points: Floats, products: Floats) -> None:
    """Write the products of ways and arms. Products (c, 3, 3), points (c, 3), arms (k, 3) at rest."""
    for p in range(len(points)):
        for i in range(3):
            a = b = c = 0.0
            for k in range(starts[p], starts[p + 1]):
                way = points[ends[k], i] - points[p, i]
                a, b, c = a + way * arms[k, 0], b + way * arms[k, 1], c + way * arms[k, 2]
            products[p, i, 0], products[p, i, 1], products[p, i, 2] = a, b, c


@vector_kernel
def _carry(motions: Floats, carriers: Ints, parts: Floats, rest: Floats, carried: Floats) -> None:
    """Write points moved by their carriers. Points (n, 3), motions (c, 12), a turn and a shift."""
    for i in range(len(rest)):
        x, y, z = rest[i, 0], rest[i, 1], rest[i, 2]
        carried[i] = 0.0
        for k in range(carriers.shape[1]):
            part, m = parts[i, k], motions[carriers[i, k]]
            for axis in range(3):
                row = 3 * axis
                carried[i, axis] += part * (m[row] * x + m[row + 1] * y + m[row + 2] * z + m[9 + axis])
