"""The edges of a muscle packed into batches whose members share no point, ready for vector instructions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.pbd.colouring import greedy_colouring
from vtkmuscle.core.pbd.rest_shape import RestShape
from vtkmuscle.core.types import Floats, Ints

Offsets = NDArray[np.uint32]
T = TypeVar("T", bound=np.generic)

#: Edges of a batch: two vectors of eight doubles, which measured best.
WIDTH = 16

#: Numbers of a point's record: x, y, z and the inverse mass.
RECORD = 4

#: Constants of an edge: rest length, stiffness, cosine and sine of the rest angle, shape stiffness, and the
#: length scale of the angle.
CONSTANTS = 6

#: Edges that are coloured together: their points' records fill about half a second-level cache.
BLOCK = 32_768


@dataclass(frozen=True, eq=False)
class PackedEdges:
    """The distance and dihedral constraints of one muscle, packed by :func:`pack`.

    Points are kept as *records* of four numbers (x, y, z, inverse mass) in one flat array, with a spare
    record at its end, of no mass, that the empty places of a batch refer to.

    Attributes
    ----------
    n_points : int
        Points of the muscle.
    edges : (b * WIDTH,) int array
        The edge of the topology in each place of each batch, -1 in empty places: the order in which they are
        projected.
    edge_at : (b * 4 * WIDTH,) uint32 array
        Offsets of records: per batch the p1 of all its edges, then all p2, p3, p4 (as in the topology's
        ``quads``).
    constants : (b * CONSTANTS * WIDTH,) array
        Per batch the rest lengths [mm], the stiffnesses, the cosines and the sines of the rest angles, the
        shape stiffnesses, and the angles' length scales [1 / mm^2].
    """

    n_points: int
    edges: Ints
    edge_at: Offsets
    constants: Floats

    def records(self) -> Floats:
        """Return zero records, (4 (n + 1),): they start on a cache line, so that none lies across two."""
        size = RECORD * (self.n_points + 1)
        raw = np.zeros(8 * size + 64, dtype=np.uint8)
        start = -raw.ctypes.data % 64
        return raw[start : start + 8 * size].view(np.float64)

    def set_rest(self, lengths: Floats, cosines: Floats, sines: Floats) -> None:
        """Replace the rest lengths [mm] and the cosines and sines of the rest angles of edges, (k,) each.

        What was dropped, or had no angle, stays so.
        """
        table = self.constants.reshape(-1, CONSTANTS, WIDTH)
        _set_rest(table, self.edges.reshape(-1, WIDTH), lengths, cosines, sines)


@kernel
def _set_rest(table: Floats, edges: Ints, lengths: Floats, cosines: Floats, sines: Floats) -> None:
    """Do what :meth:`PackedEdges.set_rest` says; edges (b, width) are those of the table, -1 for none."""
    for b in range(len(edges)):
        for lane in range(edges.shape[1]):
            edge = edges[b, lane]
            if edge >= 0:
                table[b, 0, lane] = lengths[edge]
                if table[b, 4, lane] > 0:
                    table[b, 2, lane], table[b, 3, lane] = cosines[edge], sines[edge]


def pack(
    topology: MeshTopology,
    shape: RestShape,
    inverse_mass: Floats,
    edge_stiffness: Floats | float = 1.0,
    shape_stiffness: float = 1.0,
) -> PackedEdges:
    """Pack the distance and dihedral constraints of a muscle.

    Both constraints of an edge are projected together, for they move the same points. Edges without a
    dihedral angle (not manifold, degenerate at rest) keep their length only; edges that cannot move anything
    are dropped.

    Parameters
    ----------
    topology : MeshTopology
        Of the muscle's surface.
    shape : RestShape
        Of the muscle.
    inverse_mass : (n,) array
        1 free, 0 fixed.
    edge_stiffness : float or (k,) array
        Stiffness per iteration of each of the topology's edges, in [0, 1].
    shape_stiffness : float
        Stiffness per iteration, in [0, 1].

    Raises
    ------
    ValueError
        If the mesh has too many points for 32-bit offsets (2^30).
    """
    n, k = topology.n_points, len(topology.edges)
    if n >= np.iinfo(np.uint32).max // RECORD:
        raise ValueError(f"a muscle of {n} points is too large to pack; at most 2^30 - 2 points fit")
    bent = topology.quad_edges[shape.angle_defined]
    corners = np.full((k + 1, 4), n, dtype=np.int64)  # the last row is for empty places
    corners[:-1, :2] = topology.edges
    corners[bent] = topology.quads[shape.angle_defined]
    # The two ends come in the order of the quadruple, also where there is no angle.
    flat = topology.quad_edges[~shape.angle_defined]
    corners[flat, :2] = topology.quads[~shape.angle_defined, :2]

    values = np.zeros((k + 1, CONSTANTS))
    values[:-1, 0] = shape.lengths
    values[:-1, 1] = edge_stiffness
    values[:, 2] = 1.0
    angles = shape.angles[shape.angle_defined]
    values[bent, 2], values[bent, 3], values[bent, 4] = np.cos(angles), np.sin(angles), shape_stiffness
    values[bent, 5] = shape.angle_squares[shape.angle_defined]

    free = np.append(inverse_mass > 0, np.False_)
    used = free[corners[:-1, :2]].any(axis=1) & (values[:-1, 1] > 0)
    used |= free[corners[:-1]].any(axis=1) & (values[:-1, 4] > 0)
    ids = np.flatnonzero(used)
    edges = cut_into_batches(ids, greedy_colouring(corners[ids], n, block=BLOCK), WIDTH)
    offsets = (RECORD * corners[edges]).astype(np.uint32)
    return PackedEdges(n, edges, _by_lanes(offsets), _by_lanes(values[edges]))


def cut_into_batches(ids: Ints, colours: Ints, width: int) -> Ints:
    """Cut each colour into batches of equal width.

    Parameters
    ----------
    ids : (m,) int array
        Constraints.
    colours : (m,) int array
        Their colours.
    width : int
        Constraints of a batch.

    Returns
    -------
    (b * width,) int array
        The constraints by colour, in their order within each, and -1 where a colour's last batch is not
        full.
    """
    order = np.argsort(colours, kind="stable")
    _, counts = np.unique(colours, return_counts=True)
    padded = -(-counts // width) * width
    shift = np.repeat(np.cumsum(padded) - padded - (np.cumsum(counts) - counts), counts)
    batches = np.full(int(padded.sum()), -1, dtype=np.int64)
    batches[np.arange(len(ids)) + shift] = ids[order]
    return batches


def _by_lanes(table: NDArray[T]) -> NDArray[T]:
    """Reorder rows (b * WIDTH, c) to (b, c, WIDTH), flat: each batch one column after the other."""
    columns = table.shape[1]
    return np.ascontiguousarray(table.reshape(-1, WIDTH, columns).transpose(0, 2, 1)).reshape(-1)
