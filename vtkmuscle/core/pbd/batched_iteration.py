"""The Gauss-Seidel iteration of a packed muscle: many of them in one call, on any number of threads."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel, vector_kernel
from vtkmuscle.core.pbd.atomics import exchange, fetch_add, give_way, load
from vtkmuscle.core.pbd.batched_constraints import (
    EDGE_BUFFER,
    RECORD,
    Offsets,
    Reals,
    sweep_edges,
)
from vtkmuscle.core.pbd.batched_volume import (
    VOLUME_BUFFER,
    centre_spare,
    move_along_gradient,
    volume_gradient,
)
from vtkmuscle.core.pbd.batches import (
    AFTER,
    EDGES,
    FIRST,
    GRADIENT,
    KIND,
    LAST,
    PART,
    PackedMuscle,
    aligned_zeros,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Places of the counts that threads share: tasks done, and from the second cache line on, task by task, the
#: iterations that it was taken in.
DONE, TAKEN = 0, 8

#: How often a thread that has to wait looks before it does another's task, or lets it have the processor.
PATIENCE = 20000


@kernel
def _wait_for(counts: Ints, done: int) -> None:
    """Return when so many tasks are done, by whomever."""
    looks = 0
    while load(counts, DONE) < done:
        looks += 1
        if looks > PATIENCE:
            give_way()


@vector_kernel
def work(
    thread: int,
    threads: int,
    counts: Ints,
    tasks: Ints,
    iterations: int,
    p: Reals,
    edge_at: Offsets,
    constants: Reals,
    vertex_at: Offsets,
    ring_starts: Ints,
    ring_at: Offsets,
    rest: float,
    floor: float,
    stiffness: float,
    gradient: Reals,
    parts: Floats,
    buffer: Reals,
) -> None:
    """Do iterations, task by task, along with other threads.

    Each thread first takes the tasks that are its share, whose points it has in its cache, and then what
    others have not begun. So no thread is waited for that is not at work. What a task computes does not
    depend on who does it. The first thread returns when all is done.

    Parameters
    ----------
    thread, threads : int
        Which of how many threads this is.
    counts : (TAKEN + t,) int array
        What all threads have taken and done; 0 at first.
    tasks : (t, 5) int array
        Of one iteration, as in :class:`~vtkmuscle.core.pbd.batches.PackedMuscle`, or a stretch of them.
    iterations : int
        How often all of them are done.
    p : (4 (n + 1),) array
        Records, changed in place.
    edge_at, constants, vertex_at, ring_starts, ring_at, rest, floor, stiffness
        Of the muscle.
    gradient : (4 (n + 1),) array
        Working memory that all threads share; 0 at points without a triangle.
    parts : (d, 2) array
        Likewise: what each part of the vertices adds to the volume, and to the gradient's norm.
    buffer : array
        Working memory of this thread, of :data:`EDGE_BUFFER` or :data:`VOLUME_BUFFER` numbers.
    """
    count = len(tasks)
    for iteration in range(iterations):
        start = 0
        while start < count:
            end = start
            while end < count and tasks[end, AFTER] == tasks[start, AFTER]:
                end += 1
            _wait_for(counts, iteration * count + tasks[start, AFTER] - tasks[0, AFTER])
            looks = 0
            for step in range(end - start):
                task = start + (step + thread * (end - start) // threads) % (end - start)
                if step >= (end - start) // threads:  # another thread's; it may be about to take it
                    while looks < PATIENCE and load(counts, TAKEN + task) == iteration:
                        looks += 1
                if not exchange(counts, TAKEN + task, iteration, iteration + 1):
                    continue
                kind, first, last = tasks[task, KIND], tasks[task, FIRST], tasks[task, LAST]
                if kind == EDGES:
                    sweep_edges(p, edge_at, constants, first, last, buffer)
                elif kind == GRADIENT:
                    sums = volume_gradient(p, vertex_at, ring_starts, ring_at, first, last, gradient, buffer)
                    parts[tasks[task, PART], 0], parts[tasks[task, PART], 1] = sums
                else:
                    move_along_gradient(p, gradient, first, last, parts, rest, floor, stiffness)
                fetch_add(counts, DONE, 1)
            start = end
    if thread == 0:
        _wait_for(counts, iterations * count)


def available_threads() -> int:
    """Return how many threads this process may run side by side."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _helpers() -> ThreadPoolExecutor:
    """Return the threads that help with large muscles; all muscles share them."""
    return ThreadPoolExecutor(max(os.cpu_count() or 1, 8), thread_name_prefix="vtkmuscle")


class BatchedIteration:
    """The Gauss-Seidel iteration of a packed muscle, with its working memory: for one caller at a time.

    Parameters
    ----------
    muscle : PackedMuscle
        Constraints.
    threads : int
        How many threads work on a large muscle, the caller's among them; 0 for as many as there are
        processors. A small muscle is left to one. The result is the same, bit for bit.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.pbd.batches import pack
    >>> from vtkmuscle.core.mesh.topology import mesh_topology
    >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    >>> muscle = pack(mesh_topology(4, triangles), points, np.array([0.0, 1, 1, 1]))
    >>> p = muscle.records(1.5 * points)
    >>> _ = BatchedIteration(muscle).run(p, 20)
    >>> bool(np.allclose(muscle.points(p), points))
    True
    """

    def __init__(self, muscle: PackedMuscle, *, threads: int = 1) -> None:
        self.muscle = muscle
        parts = int(muscle.tasks[-1, PART]) + 1
        #: Threads that work on this muscle.
        self.threads = min(threads or available_threads(), parts)
        self._first_of_volume = int((muscle.tasks[:, KIND] == EDGES).sum())
        self._gradient = aligned_zeros(RECORD * (muscle.n_points + 1), muscle.dtype)
        self._parts = np.zeros((parts, 2))
        size = max(EDGE_BUFFER, VOLUME_BUFFER)
        self._buffers = [aligned_zeros(size, muscle.dtype) for _ in range(self.threads)]

    def run(self, p: Reals, iterations: int) -> float:
        """Project all constraints so many times, in one call that holds no lock.

        An iteration projects the edges (length and dihedral angle) in the order of ``muscle.edges``, then
        the volume, which so holds exactly in the end.

        Parameters
        ----------
        p : (4 (n + 1),) array
            Records, changed in place.
        iterations : int
            How often.

        Returns
        -------
        float
            The volume before the last projection of it [mm^3]; 0 without an iteration.
        """
        centre_spare(p)
        self._do(p, self.muscle.tasks, iterations, self.muscle.volume_stiffness)
        return float(self._parts[:, 0].sum()) if iterations else 0.0

    def edges(self, p: Reals) -> None:
        """Project all edges once, in place: the first half of an iteration, ahead of a collision stage."""
        self._do(p, self.muscle.tasks[: self._first_of_volume], 1, 0.0)

    def volume(self, p: Reals, stiffness: float | None = None) -> float:
        """Project the volume once, in place: the second half of an iteration.

        Points whose mass in the records is set to 0 take no part. The stiffness is the muscle's by default.
        Returns the volume before [mm^3].
        """
        if stiffness is None:
            stiffness = self.muscle.volume_stiffness
        centre_spare(p)
        self._do(p, self.muscle.tasks[self._first_of_volume :], 1, stiffness)
        return float(self._parts[:, 0].sum())

    def _do(self, p: Reals, tasks: Ints, iterations: int, stiffness: float) -> None:
        m = self.muscle
        shared = (
            np.zeros(TAKEN + len(tasks), dtype=np.int64),
            tasks,
            iterations,
            p,
            m.edge_at,
            m.constants,
            m.vertex_at,
            m.ring_starts,
            m.ring_at,
            m.rest_volume,
            m.volume_floor,
            stiffness,
            self._gradient,
            self._parts,
        )
        for thread in range(1, self.threads):
            # One that comes too late finds all tasks taken, and touches nothing but the counts.
            _helpers().submit(work, thread, self.threads, *shared, self._buffers[thread])
        work(0, self.threads, *shared, self._buffers[0])


class FreePoints:
    """One iteration as a map of the free points alone, for :func:`~vtkmuscle.core.pbd.anderson.anderson`.

    Parameters
    ----------
    iteration : BatchedIteration
        Of the muscle.
    positions : (n, 3) array
        All points; the fixed ones stay there [mm].

    Attributes
    ----------
    first : (3 f,) array
        The free points of ``positions``.
    """

    def __init__(self, iteration: BatchedIteration, positions: Floats) -> None:
        self._iteration = iteration
        self._records = iteration.muscle.records(positions)
        places = iteration.muscle.places
        self._at = RECORD * places[iteration.muscle.inverse_mass[places] > 0]
        self.first: Floats = np.empty(3 * len(self._at))
        _take(self._records, self._at, self.first)
        self._image = np.empty_like(self.first)

    def __call__(self, x: Floats) -> Floats:
        """Return the free points (3 f,) after one iteration, in memory that the next call writes again."""
        _put(x, self._at, self._records)
        self._iteration.run(self._records, 1)
        _take(self._records, self._at, self._image)
        return self._image

    def positions(self, x: Floats) -> Floats:
        """Return all points (n, 3), with the free ones at x."""
        _put(x, self._at, self._records)
        return self._iteration.muscle.points(self._records)


@kernel
def _put(x: Floats, at: Ints, records: Reals) -> None:
    """Copy points (3 f,) into the records at offsets (f,)."""
    for i in range(len(at)):
        for c in range(3):
            records[at[i] + c] = x[3 * i + c]


@kernel
def _take(records: Reals, at: Ints, x: Floats) -> None:
    """Copy points (3 f,) out of the records at offsets (f,)."""
    for i in range(len(at)):
        for c in range(3):
            x[3 * i + c] = records[at[i] + c]
