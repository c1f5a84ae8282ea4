"""A step solved by an accelerated iteration, corrected on a coarse level where there is one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.pbd.anderson import AndersonResult, Workspace, anderson
from vtkmuscle.core.pbd.convergence import root_mean_square_distance
from vtkmuscle.core.pbd.projection import Projection
from vtkmuscle.core.pbd.stages import StageClock
from vtkmuscle.core.pbd.two_level import CoarseCorrection

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Coarse corrections pause where an iteration has to move the points so many times as far as the least of
#: those before, or where so many in a row come no nearer: a muscle about to buckle is not what its rest shape
#: says of it, and one that meets a bone with many points at once does not know yet with which.
WORSE, STALLED = 20.0, 8

#: Iterations of such a pause.
PAUSE = 10


class AcceleratedSolve:
    """The iteration of one step, accelerated: each is a projection of all constraints and a correction.

    Parameters
    ----------
    projection : Projection
        Projects all constraints once.
    keep_out : callable
        Moves positions (n, 3) out of the bones, in place, and returns which, (n,).
    edges : (k, 2) int array
        Of the muscle.
    correct : callable
        Returns what is added to each iteration from given points (n, 3) on: a CoarseCorrection or None.
    bones_last : bool
        Whether bones come last in an iteration, which acceleration needs to be smooth.
    bound : float, optional
        How many times the residual the end can be away, where that is known.
    clock : StageClock
        Is told which stage goes on.
    progress : callable
        Called after each iteration with the part that is done; may raise, to stop.
    """

    def __init__(
        self,
        projection: Projection,
        keep_out: Callable[[Floats], Bools],
        edges: Ints,
        correct: Callable[[Floats], CoarseCorrection | None],
        *,
        bones_last: bool,
        bound: float | None = None,
        clock: StageClock,
        progress: Callable[[float], None],
    ) -> None:
        self._projection = projection
        self._touching = _Touching(keep_out)
        self._edges = edges
        self._correct = correct
        self._correction: CoarseCorrection | None = None
        self._bones_last, self._bound = bones_last, bound
        self._clock, self._progress = clock, progress
        self._done, self._iterations = 0, 0
        self._least_projected, self._least_corrected, self._stalled = np.inf, np.inf, 0
        self._best: Floats = np.empty((0, 3))
        self._image: Floats = np.empty((0, 3))
        self._unsteady: Bools = np.empty((0, 3), dtype=np.bool_)
        self._collided: Bools = np.empty(0, dtype=np.bool_)

    def run(
        self, p: Floats, *, iterations: int, tolerance: float, movable: int, workspace: Workspace
    ) -> tuple[Floats, Bools, tuple[int, float, float | None]]:
        """Solve from p; return the positions, points that met a bone, and how it went.

        Parameters
        ----------
        p : (n, 3) array
            Where to start [mm].
        iterations : int
            At most; > 1 with a correction.
        tolerance : float
            Estimated distance to the end of the solve to stop at [mm]; 0 never stops.
        movable : int
            Points that can move, over which means are taken.
        workspace : Workspace
            Of the acceleration.

        Returns
        -------
        positions : (n, 3) array
            [mm].
        collided : (n,) bool array
            Points that met a bone in the last iteration.
        (int, float, float or None)
            Iterations done, the residual and the estimated distance, as of
            :class:`~vtkmuscle.core.pbd.state.MuscleState`.
        """
        self._iterations = iterations
        self._image = np.empty_like(p)
        self._unsteady = np.zeros(p.shape, dtype=np.bool_)

        def accelerate(start: Floats, most: int) -> AndersonResult:
            return anderson(
                self._iterate,
                start.reshape(-1),
                max_iterations=most,
                tolerance=tolerance,
                points=movable,
                corrected=self._correction is not None,
                bound=self._bound,
                unsteady=self._unsteady.reshape(-1),
                workspace=workspace,
            )

        x = p
        while True:
            self._correction = self._correct(x) if iterations - self._done > 1 else None
            self._least_projected, self._least_corrected, self._stalled = np.inf, np.inf, 0
            try:
                left = iterations - self._done
                result = accelerate(x, left if self._correction is None else left - 1)
                break
            except _WorsenedError:
                self._correction = None
            left = max(iterations - self._done, 1)
            result = accelerate(self._best, min(PAUSE, left))
            if left <= PAUSE or result.converged:
                break
            x = result.x.reshape(-1, 3)
        x = result.x.reshape(-1, 3)
        if self._correction is not None:
            # Volume and bones hold after an iteration, not after a correction.
            self._clock.switch("constraints")
            self._collided = self._project(x)
        self._progress(1.0)
        return x, self._collided, (self._done, result.residual, result.distance)

    def _project(self, x: Floats) -> Bools:
        self._done += 1
        return self._projection.iterate(x, self._touching.keep_out, bones_last=self._bones_last)

    def _iterate(self, flat: Floats) -> Floats:
        """Return the image of an iterate, both (3 n,)."""
        self._clock.switch("constraints")
        x, image = flat.reshape(-1, 3), self._image
        image[:] = x
        self._collided = self._project(image)
        if self._bones_last and self._collided.any():
            # What a point on a bone does, and what its neighbours do about it, is not smooth.
            _mark_with_neighbours(self._collided, self._edges, self._unsteady)
        self._progress(self._done / self._iterations)
        self._clock.switch("acceleration")
        if self._correction is not None:
            before = image.copy()
            self._correction.touch(self._touching.contacts, self._touching.normals)
            self._correction.add(image - x, image)
            self._watch(flat, before)
        return image.reshape(-1)

    def _watch(self, x: Floats, before: Floats) -> None:
        """Give corrections up where they lead away from the end.

        Corrections leave kinks that the projections have to mend, so that what these move may grow for a
        while as the end comes nearer; and the other way round.
        """
        projected, corrected = (
            root_mean_square_distance(moved.reshape(-1), x, len(before)) for moved in (before, self._image)
        )
        nearer = projected < self._least_projected or corrected < self._least_corrected
        self._stalled = 0 if nearer else self._stalled + 1
        if self._stalled == STALLED or projected > WORSE * self._least_projected:
            raise _WorsenedError
        if corrected < self._least_corrected:
            self._best = before
        self._least_projected = min(projected, self._least_projected)
        self._least_corrected = min(corrected, self._least_corrected)


class _WorsenedError(Exception):
    """Coarse corrections lead away from the end of the solve."""


class _Touching:
    """Notices which points touch bones, and the direction that these push them in."""

    def __init__(self, keep_out: Callable[[Floats], Bools]) -> None:
        self._keep_out = keep_out
        self.contacts: Ints = np.empty(0, dtype=np.int64)
        self.normals: Floats = np.empty((0, 3))

    def keep_out(self, p: Floats) -> Bools:
        before = p.copy()
        hit = self._keep_out(p)
        touching = np.flatnonzero(hit)
        pushed = p[touching] - before[touching]
        length = np.linalg.norm(pushed, axis=1)
        used = length > 0.0
        self.contacts, self.normals = touching[used], pushed[used] / length[used, None]
        return hit


@kernel
def _mark_with_neighbours(points: Bools, edges: Ints, marked: Bools) -> None:
    """Mark the components (n, 3) of points (n,) and of those that share an edge with one."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        if points[i] or points[j]:
            marked[i] = marked[j] = True
