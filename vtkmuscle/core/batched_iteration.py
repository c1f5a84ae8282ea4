"""The Gauss-Seidel iteration of a packed muscle: many of them in one call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.batched_constraints import (
    EDGE_BUFFER,
    RECORD,
    Offsets,
    Reals,
    sweep_edges,
    vector_kernel,
)
from vtkmuscle.core.batched_volume import VOLUME_BUFFER, centre_spare, project_volume
from vtkmuscle.core.batches import PackedMuscle, aligned_zeros
from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@vector_kernel
def iterate(
    p: Reals,
    edge_at: Offsets,
    constants: Reals,
    vertex_at: Offsets,
    ring_starts: Ints,
    ring_at: Offsets,
    rest: float,
    floor: float,
    stiffness: float,
    iterations: int,
    gradient: Reals,
    buffer: Reals,
) -> float:
    """Project all edges and then the volume so many times; arguments and result as those of the two."""
    centre_spare(p)
    volume = 0.0
    for _ in range(iterations):
        sweep_edges(p, edge_at, constants, buffer)
        volume = project_volume(p, vertex_at, ring_starts, ring_at, rest, floor, stiffness, gradient, buffer)
    return volume


class BatchedIteration:
    """The Gauss-Seidel iteration of a packed muscle, with its working memory (so: one per thread).

    Parameters
    ----------
    muscle : PackedMuscle
        Constraints.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.batches import pack
    >>> from vtkmuscle.core.topology import mesh_topology
    >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    >>> muscle = pack(mesh_topology(4, triangles), points, np.array([0.0, 1, 1, 1]))
    >>> p = muscle.records(1.5 * points)
    >>> _ = BatchedIteration(muscle).run(p, 20)
    >>> bool(np.allclose(muscle.points(p), points))
    True
    """

    def __init__(self, muscle: PackedMuscle) -> None:
        self.muscle = muscle
        self._gradient = aligned_zeros(RECORD * (muscle.n_points + 1), muscle.dtype)
        self._buffer = aligned_zeros(max(EDGE_BUFFER, VOLUME_BUFFER), muscle.dtype)

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
        m = self.muscle
        volume: float = iterate(
            p,
            m.edge_at,
            m.constants,
            m.vertex_at,
            m.ring_starts,
            m.ring_at,
            m.rest_volume,
            m.volume_floor,
            m.volume_stiffness,
            iterations,
            self._gradient,
            self._buffer,
        )
        return volume

    def edges(self, p: Reals) -> None:
        """Project all edges once, in place: the first half of an iteration, ahead of a collision stage."""
        sweep_edges(p, self.muscle.edge_at, self.muscle.constants, self._buffer)

    def volume(self, p: Reals) -> float:
        """Project the volume once, in place: the second half of an iteration.

        Points whose mass in the records is set to 0 take no part. Returns the volume before [mm^3].
        """
        m = self.muscle
        centre_spare(p)
        volume: float = project_volume(
            p,
            m.vertex_at,
            m.ring_starts,
            m.ring_at,
            m.rest_volume,
            m.volume_floor,
            m.volume_stiffness,
            self._gradient,
            self._buffer,
        )
        return volume


class FreePoints:
    """One iteration as a map of the free points alone, for :func:`~vtkmuscle.core.anderson.anderson`.

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
        self._at = RECORD * np.flatnonzero(iteration.muscle.inverse_mass > 0)
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
