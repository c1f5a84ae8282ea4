"""A step solved by an accelerated iteration."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.pbd.anderson import Workspace, anderson
from vtkmuscle.core.pbd.projection import Projection
from vtkmuscle.core.pbd.stages import StageClock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class AcceleratedSolve:
    """The iteration of one step, accelerated: each is a projection of all constraints.

    Parameters
    ----------
    projection : Projection
        Projects all constraints once.
    keep_out : callable
        Moves positions (n, 3) out of the bones, in place, and returns which, (n,).
    edges : (k, 2) int array
        Of the muscle.
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
        *,
        bones_last: bool,
        bound: float | None = None,
        clock: StageClock,
        progress: Callable[[float], None],
    ) -> None:
        self._projection = projection
        self._keep_out = keep_out
        self._edges = edges
        self._bones_last, self._bound = bones_last, bound
        self._clock, self._progress = clock, progress
        self._done, self._iterations = 0, 0
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
            At most.
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
        result = anderson(
            self._iterate,
            p.reshape(-1),
            max_iterations=iterations,
            tolerance=tolerance,
            points=movable,
            bound=self._bound,
            unsteady=self._unsteady.reshape(-1),
            workspace=workspace,
        )
        self._progress(1.0)
        return result.x.reshape(-1, 3), self._collided, (self._done, result.residual, result.distance)

    def _iterate(self, flat: Floats) -> Floats:
        """Return the image of an iterate, both (3 n,)."""
        self._clock.switch("constraints")
        image = self._image
        image[:] = flat.reshape(-1, 3)
        self._done += 1
        self._collided = self._projection.iterate(image, self._keep_out, bones_last=self._bones_last)
        if self._bones_last and self._collided.any():
            # What a point on a bone does, and what its neighbours do about it, is not smooth.
            _mark_with_neighbours(self._collided, self._edges, self._unsteady)
        self._progress(self._done / self._iterations)
        self._clock.switch("acceleration")
        return image.reshape(-1)


@kernel
def _mark_with_neighbours(points: Bools, edges: Ints, marked: Bools) -> None:
    """Mark the components (n, 3) of points (n,) and of those that share an edge with one."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        if points[i] or points[j]:
            marked[i] = marked[j] = True
