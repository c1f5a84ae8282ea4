"""Diffusion of vectors over a surface, to smooth displacements."""

import math

import numpy as np
from scipy.sparse import csr_array

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.types import ROUNDING, TINY, Bools, Floats, Indices, Ints

#: Time that a plain explicit step takes, in units: one that leaves nothing of the shortest wave. Without the
#: step an adductor brevis has up to 3 folded edges, with it none.
PLAIN = 0.5
#: Bounds of an edge's cotangent weight; between equilateral triangles the weight is 0.58. The lower bound
#: lets a point go between its neighbours beside obtuse triangles, the upper beside degenerate ones.
COTANGENT_BOUNDS = (1e-3, 1e3)


def cotangent_weights(points: Floats, triangles: Ints) -> csr_array:
    """Return the weights of edges, (n, n), within :data:`COTANGENT_BOUNDS`.

    (cot a + cot b) / 2 for the angles a, b opposite an edge: Pinkall, Polthier 1993, *Computing discrete
    minimal surfaces and their conjugates*, doi:10.1080/10586458.1993.10504266. Weights of the intrinsic
    Delaunay triangulation pull on other points than a surface's edges: a muscle carried across a bone has
    edges twice as long with them.
    """
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    onward, before = np.roll(triangles, -1, axis=1), np.roll(triangles, 1, axis=1)
    ahead, back = points[onward] - points[triangles], points[before] - points[triangles]
    dots, sines = (ahead * back).sum(axis=2), np.linalg.norm(np.cross(ahead, back), axis=2)
    halves = 0.5 * dots / np.maximum(sines, np.maximum(ROUNDING * np.abs(dots), TINY))
    weights = csr_array((halves.ravel(), (onward.ravel(), before.ravel())), shape=(len(points),) * 2)
    weights = csr_array(weights + weights.T)
    weights.data = np.clip(weights.data, *COTANGENT_BOUNDS)
    return weights


class Diffusion:
    """The heat equation for vectors on a surface.

    The equation is dv/dt = Laplacian v, for vectors at the points of a surface at rest. Each point goes
    towards the mean of its neighbours by the weights of :func:`cotangent_weights`. A field that is linear
    over a flat part of the mesh stays unchanged, but where triangles are needles.

    time_unit : float, unit of the times of :meth:`spread`: the median over the points of a point's area over
        the sum of the point's weights, a quarter of a squared edge length where triangles are equilateral
        [mm^2].
    """

    def __init__(self, points: Floats, triangles: Ints) -> None:
        weights = cotangent_weights(points, triangles)
        degrees = np.asarray(weights.sum(axis=1))
        self._begins = weights.indptr.astype(np.uint32)
        self._neighbours = weights.indices.astype(np.uint32)
        total = np.where(degrees > 0.0, degrees, 1.0)
        self._rows = np.repeat(np.arange(len(points)), np.diff(self._begins))
        self._weights: Floats = weights.data / total[self._rows]
        self._totals: Floats = np.bincount(self._rows, self._weights, len(points)).astype(np.float64)
        thirds = np.repeat(np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0, 3)
        areas = np.bincount(triangles.reshape(-1), thirds, len(points))
        self.time_unit = float(np.median((areas / total)[degrees > 0.0]))
        self._memory = np.empty((3, len(points), 3))

    def spread(self, vectors: Floats, time: float, inside: Bools, *, insulated: bool = False) -> None:
        """Let vectors diffuse in place at points inside.

        Vectors are (n, 3), ``inside`` is (n,); vectors of outside points stay. The scheme is
        Runge-Kutta-Legendre of the first order. The number of stages grows with the root of the time, and the
        scheme makes no new extremes: Meyer, Balsara, Aslam 2014, *A stabilized Runge-Kutta-Legendre method
        for explicit super-time-stepping of parabolic and mixed equations*, doi:10.1016/j.jcp.2013.08.021,
        section 2.

        The time is in units of :attr:`time_unit`, >= 0. ``insulated``: outside points have no part in the
        diffusion, so that the points inside keep the sum of their vectors, weighted by the points' total
        cotangent weights.
        """
        weights, totals = self._weights, self._totals
        if insulated:
            weights = weights * inside[self._neighbours]
            totals = np.bincount(self._rows, weights, len(vectors)).astype(np.float64)
        rows = self._begins, self._neighbours, weights, totals, inside
        now, after, before = self._memory
        # The scheme leaves a part of the shortest waves, of which this takes most.
        first = min(PLAIN, time)
        _relax(vectors, vectors, vectors, 1.0, 0.0, first, *rows, now)
        if time > first:
            # A plain step may be as long as one unit: all eigenvalues are within 0 and 2.
            stages = math.ceil((math.sqrt(1.0 + 8.0 * (time - first)) - 1.0) / 2.0)
            step = 2.0 * (time - first) / (stages * (stages + 1))
            _relax(now, now, now, 1.0, 0.0, step, *rows, after)
            before, now, after = now, after, before
            for stage in range(2, stages + 1):
                part = (2.0 * stage - 1.0) / stage
                _relax(now, now, before, part, 1.0 - part, part * step, *rows, after)
                before, now, after = now, after, before
        vectors[:] = now


@vector_kernel
def _relax(
    v: Floats, first: Floats, second: Floats, a: float, b: float, step: float, begins: Indices,
    neighbours: Indices, weights: Floats, totals: Floats, inside: Bools, result: Floats,
) -> None:  # fmt: skip
    """Write a stage of the diffusion inside, v elsewhere.

    The stage is a ``one`` + b ``other`` + step (weighted sum of v's neighbours - total weight v).
    """
    for i in range(len(v)):
        if inside[i]:
            x, y, z = -totals[i] * v[i, 0], -totals[i] * v[i, 1], -totals[i] * v[i, 2]
            for k in range(begins[i], begins[i + 1]):
                j, w = neighbours[k], weights[k]
                x += w * v[j, 0]
                y += w * v[j, 1]
                z += w * v[j, 2]
            result[i, 0] = a * first[i, 0] + b * second[i, 0] + step * x
            result[i, 1] = a * first[i, 1] + b * second[i, 1] + step * y
            result[i, 2] = a * first[i, 2] + b * second[i, 2] + step * z
        else:
            result[i, 0], result[i, 1], result[i, 2] = v[i, 0], v[i, 1], v[i, 2]
