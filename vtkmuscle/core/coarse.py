"""A muscle of few points that stands in for the full one: solved first, it says where the full one goes.

No filter uses this yet: ``benchmarks/bench_convergence.py`` measures what it would bring. It needs the extra
``coarse`` (fast-simplification).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vtkmuscle.core.anderson import AndersonResult, anderson
from vtkmuscle.core.batched_iteration import BatchedIteration, FreePoints
from vtkmuscle.core.batches import pack
from vtkmuscle.core.blending import blend_motions
from vtkmuscle.core.convergence import AMPLIFICATION_GROWTH
from vtkmuscle.core.harmonic import harmonic_weights
from vtkmuscle.core.mesh import half_edges, vertex_normals
from vtkmuscle.core.rigid import apply_transform, inverse
from vtkmuscle.core.topology import MeshTopology, mesh_topology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
StiffnessOf = Callable[[Floats, MeshTopology, Ints], Floats]

#: Points of the coarse muscle, about.
COARSE_POINTS = 600

#: Coarse points that a point of the full muscle follows.
NEIGHBOURS = 4

#: Distance to its fixed point that a coarse solve goes to [mm], and its most iterations.
COARSE_TOLERANCE = 0.001
COARSE_ITERATIONS = 2000


@dataclass(frozen=True, eq=False)
class Binding:
    """Which coarse points each point follows, and how much.

    Attributes
    ----------
    neighbours : (n, k) int array
        Coarse points.
    weights : (n, k) array
        Rows sum to 1.
    """

    neighbours: Ints
    weights: Floats


class CoarseMuscle:
    """A decimated muscle with the same attachments, solved by Anderson acceleration.

    The coarse muscle is solved to its end, and the full muscle follows it (:meth:`prolong`). Where a
    converged full muscle before is known, following the coarse muscle from there (``origin``) is better
    than from rest: what the coarse solution errs by is much the same before and after, and drops out.

    Parameters
    ----------
    points : (n, 3) array
        The full muscle at rest, about a centre near it [mm].
    triangles : (m, 3) int array
        Point ids of a closed surface.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    n_coarse : int
        Points to leave, about.
    stiffness_of : callable, optional
        Gives the stiffness of each edge from points, topology and fixed_to of the coarse muscle, (k,) in
        [0, 1]; 1 by default.
    shape_stiffness, volume_stiffness : float
        Per iteration, in [0, 1].

    Attributes
    ----------
    rest : (c, 3) array
        The coarse muscle at rest [mm].
    triangles : (t, 3) int array
        Its triangles.
    fixed_to : (c,) int array
        Index of the bone each coarse point is fixed to, -1 for free ones.

    Raises
    ------
    ValueError
        If the decimated surface is not closed, which a muscle of very few points may come to.
    """

    def __init__(
        self,
        points: Floats,
        triangles: Ints,
        fixed_to: Ints,
        *,
        n_coarse: int = COARSE_POINTS,
        stiffness_of: StiffnessOf | None = None,
        shape_stiffness: float = 0.9,
        volume_stiffness: float = 1.0,
    ) -> None:
        self.n_fine = len(points)
        self.rest, self.triangles = decimate(points, triangles, n_coarse)
        topology = mesh_topology(len(self.rest), self.triangles)
        if topology.n_boundary_edges:
            raise ValueError(
                f"a muscle of {len(points)} points cannot be decimated to {n_coarse} and stay closed; "
                "solve it without a coarse start"
            )
        self.fixed_to = inherit_fixed_points(self.rest, points, fixed_to)
        stiffness = 1.0 if stiffness_of is None else stiffness_of(self.rest, topology, self.fixed_to)
        self.muscle = pack(
            topology,
            self.rest,
            (self.fixed_to < 0).astype(np.float64),
            edge_stiffness=stiffness,
            shape_stiffness=shape_stiffness,
            volume_stiffness=volume_stiffness,
        )
        self._iteration = BatchedIteration(self.muscle)
        self._rings = _rings(self.triangles)
        self.binding = bind(points, self.rest)
        self._blend = harmonic_weights(self.rest, self.triangles, self.fixed_to)

    def place(self, positions: Floats, before: Floats, now: Floats) -> Floats:
        """Return where a solve starts: the points moved by the bones' motions, blended.

        Parameters
        ----------
        positions : (c, 3) array
            The coarse muscle before [mm].
        before, now : (b, 4, 4) arrays
            The bones' transforms, rest to then and rest to now.

        Returns
        -------
        (c, 3) array
            Free points blended by harmonic weights, fixed points with their bones [mm].
        """
        bones, weights = self._blend
        motions = np.array([now[bone] @ inverse(before[bone]) for bone in bones])
        placed = blend_motions(motions, weights, positions)
        for bone in bones:
            fixed = self.fixed_to == bone
            placed[fixed] = apply_transform(now[bone], self.rest[fixed])
        return placed

    def solve(
        self,
        start: Floats,
        *,
        tolerance: float = COARSE_TOLERANCE,
        max_iterations: int = COARSE_ITERATIONS,
        observe: Callable[[int, Floats, float], None] | None = None,
    ) -> tuple[Floats, AndersonResult]:
        """Return the converged coarse muscle.

        Parameters
        ----------
        start : (c, 3) array
            First positions, fixed points where they are to be [mm]; see :meth:`place`.
        tolerance : float
            Estimated distance to the fixed point to stop at [mm].
        max_iterations : int
            Most iterations.
        observe : callable, optional
            As in :func:`~vtkmuscle.core.anderson.anderson`.

        Returns
        -------
        positions : (c, 3) array
            [mm].
        result : AndersonResult
            How it went.
        """
        step = FreePoints(self._iteration, start)
        result = anderson(
            step, step.first, max_iterations=max_iterations, tolerance=tolerance, observe=observe
        )
        return step.positions(result.x), result

    def amplification(self, start: Floats) -> float:
        """Return how far from its fixed point the full muscle is per residual, at most.

        It is measured on the coarse muscle, on the way from a start to its end, and grows with the number
        of points to the power :data:`~vtkmuscle.core.convergence.AMPLIFICATION_GROWTH`. Measure it once per
        muscle, from a step of a few degrees; it hardly depends on the motion.

        Parameters
        ----------
        start : (c, 3) array
            As for :meth:`solve`, not the solution.

        Returns
        -------
        float
            For ``amplification`` of :func:`~vtkmuscle.core.anderson.anderson`.
        """
        iterates: list[Floats] = []
        residuals: list[float] = []

        def observe(_count: int, x: Floats, residual: float) -> None:
            iterates.append(x.copy())
            residuals.append(residual)

        _, result = self.solve(start, tolerance=0.0, max_iterations=COARSE_ITERATIONS // 2, observe=observe)
        distances = np.linalg.norm(np.array(iterates) - result.x, axis=1) / np.sqrt(len(result.x) / 3.0)
        # The last iterates are too near to the end to see what it is the end of.
        seen = distances > 1e-3 * distances[0]
        scale = (self.n_fine / len(self.rest)) ** AMPLIFICATION_GROWTH
        return float((distances[seen] / np.maximum(np.array(residuals)[seen], 1e-300)).max() * scale)

    def prolong(self, positions: Floats, points: Floats, *, origin: Floats | None = None) -> Floats:
        """Return points of the full muscle, moved as the coarse muscle has moved.

        Each point keeps its place in the frames of its coarse neighbours, which turn with the rings around
        them: x' = sum_j w_j (R_j (x - c_j) + c_j').

        Parameters
        ----------
        positions : (c, 3) array
            The coarse muscle now [mm].
        points : (n, 3) array
            The full muscle before [mm].
        origin : (c, 3) array, optional
            The coarse muscle before [mm]; at rest by default.

        Returns
        -------
        (n, 3) array
            The full muscle now [mm]. Fixed points have to be put in place after it.
        """
        origin = self.rest if origin is None else origin
        rotations = ring_rotations(origin, positions, self.triangles, self._rings)
        near, weights = self.binding.neighbours, self.binding.weights
        result = np.zeros_like(points)
        for j in range(near.shape[1]):
            c = near[:, j]
            moved = np.einsum("nij,nj->ni", rotations[c], points - origin[c]) + positions[c]
            result += weights[:, j : j + 1] * moved
        return result


def decimate(points: Floats, triangles: Ints, n_coarse: int) -> tuple[Floats, Ints]:
    """Return a surface of about so many points, by quadric edge collapse (Garland, Heckbert 1997).

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    triangles : (m, 3) int array
        Point ids.
    n_coarse : int
        Points to leave, about; a closed surface has twice as many triangles.

    Returns
    -------
    points : (c, 3) array
        Positions [mm].
    triangles : (t, 3) int array
        Point ids.
    """
    if len(points) <= n_coarse:
        return points.copy(), triangles.copy()
    import fast_simplification  # noqa: PLC0415 -- an extra: no filter uses this module yet

    coarse, faces = fast_simplification.simplify(
        np.ascontiguousarray(points),
        np.ascontiguousarray(triangles, dtype=np.int32),
        target_count=2 * n_coarse,
    )
    faces = faces.astype(np.int64)
    used, ids = np.unique(faces, return_inverse=True)
    return coarse[used].astype(np.float64), ids.reshape(-1, 3)


def inherit_fixed_points(coarse: Floats, points: Floats, fixed_to: Ints) -> Ints:
    """Return the bone each coarse point is fixed to: that of the nearest point of the full muscle.

    Every bone keeps at least one coarse point, the nearest to the middle of its fixed points.

    Parameters
    ----------
    coarse : (c, 3) array
        Coarse points at rest [mm].
    points : (n, 3) array
        Points of the full muscle at rest [mm].
    fixed_to : (n,) int array
        Index of the bone each of them is fixed to, -1 for free points.

    Returns
    -------
    (c,) int array
        Likewise of the coarse points.
    """
    _, nearest = cKDTree(points).query(coarse)
    inherited: Ints = fixed_to[nearest].copy()
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        if not (inherited == bone).any():
            centre = points[fixed_to == bone].mean(axis=0)
            order = np.argsort(np.linalg.norm(coarse - centre, axis=1), kind="stable")
            inherited[order[inherited[order] < 0][:1]] = bone
    return inherited


def bind(points: Floats, coarse: Floats) -> Binding:
    """Bind points to the coarse points nearest to them.

    w_j = (1 - d_j / d_(k+1))^2, normalised, with d_(k+1) the distance to the first that is left out: weights
    go to zero before a neighbour is exchanged for another. Sumner, Schmid, Pauly 2007, *Embedded deformation
    for shape manipulation*, doi:10.1145/1276377.1276478, eq. 3 and 4.

    Parameters
    ----------
    points : (n, 3) array
        Of the full muscle at rest [mm].
    coarse : (c, 3) array
        Of the coarse muscle at rest [mm].

    Returns
    -------
    Binding
        With :data:`NEIGHBOURS` neighbours, fewer where there are not so many.
    """
    count = min(NEIGHBOURS, len(coarse) - 1)
    distances, neighbours = cKDTree(coarse).query(points, k=count + 1)
    reach = np.maximum(distances[:, -1:], np.finfo(float).tiny)
    weights = (1.0 - distances[:, :-1] / reach) ** 2
    total = weights.sum(axis=1, keepdims=True)
    # All as far as the one left out: all count the same.
    weights = np.divide(weights, total, out=np.full_like(weights, 1.0 / count), where=total > 0)
    return Binding(neighbours[:, :-1].astype(np.int64), weights)


def _rings(triangles: Ints) -> Ints:
    """Return the directed edges (k, 2) of all rings: (centre, neighbour), sorted by centre."""
    directed = half_edges(triangles)
    rings: Ints = np.unique(np.vstack([directed, directed[:, ::-1]]), axis=0)
    return rings


def ring_rotations(before: Floats, now: Floats, triangles: Ints, rings: Ints) -> Floats:
    """Return how each point's ring has turned.

    R minimises sum |R (x_j - x_i) - (x_j' - x_i')|^2 over the neighbours and the normal, the latter as long
    as the neighbours are far, so that a flat ring has a definite rotation. Sorkine, Alexa 2007,
    *As-rigid-as-possible surface modeling*, doi:10.2312/SGP/SGP07/109-116, eq. 5 and 6.

    Parameters
    ----------
    before, now : (c, 3) arrays
        Positions [mm].
    triangles : (t, 3) int array
        Point ids.
    rings : (k, 2) int array
        Pairs of a point and a neighbour of it, each both ways.

    Returns
    -------
    (c, 3, 3) array
        Rotations.
    """
    i, j = rings.T
    spokes, moved = before[j] - before[i], now[j] - now[i]
    covariance = np.zeros((len(before), 3, 3))
    np.add.at(covariance, i, moved[:, :, None] * spokes[:, None, :])
    squares = np.bincount(i, np.einsum("ij,ij->i", spokes, spokes), minlength=len(before))
    normal, turned = vertex_normals(before, triangles), vertex_normals(now, triangles)
    covariance += squares[:, None, None] * turned[:, :, None] * normal[:, None, :]
    u, _, vt = np.linalg.svd(covariance)
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    rotations: Floats = u @ vt
    return rotations
