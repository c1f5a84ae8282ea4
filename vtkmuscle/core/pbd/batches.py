"""A muscle's constraints packed into batches whose members share no point, ready for vector instructions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.surface import edge_lengths
from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.pbd.batched_constraints import CONSTANTS, RECORD, WIDTH, Offsets, Reals
from vtkmuscle.core.pbd.batched_volume import RING_STEP
from vtkmuscle.core.pbd.colouring import greedy_colouring
from vtkmuscle.core.pbd.constraints import VOLUME_FLOOR, volume_and_gradient
from vtkmuscle.core.pbd.domains import LARGE, domains_of_points, groups_of_constraints, order_of_points
from vtkmuscle.core.pbd.rest_shape import dihedral_angles

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: What a task does: project batches of edges, compute the volume's gradient, move points along it.
EDGES, GRADIENT, MOVE = 0, 1, 2

#: Columns of a task: what it does, the first and last (excluded) batch or place that it does it to, how many
#: tasks must be done before, and which part of the sums it computes.
KIND, FIRST, LAST, AFTER, PART = range(5)

#: Edges that are coloured together: their points' records fill about half a second-level cache.
BLOCK = 32_768

#: Rings of more edges are left as they come rather than being walked around.
LONGEST_WALK = 128


@dataclass(frozen=True, eq=False)
class PackedMuscle:
    """The constraints of one muscle, packed by :func:`pack`.

    Points are kept as *records* of four numbers (x, y, z, inverse mass) in one flat array, with a spare
    record at its end, of no mass, that the empty places of a batch refer to. ``*_at`` are offsets of records
    in that array.

    Attributes
    ----------
    n_points : int
        Points of the muscle.
    edges : (b * WIDTH,) int array
        The edge of the topology in each place of each batch of edges, -1 in empty places: the order in
        which they are projected.
    edge_at : (b * 4 * WIDTH,) uint32 array
        Per batch the p1 of all its edges, then all p2, p3, p4 (as in the topology's ``quads``).
    constants : (b * CONSTANTS * WIDTH,) array
        Per batch the rest lengths [mm], the stiffnesses, the cosines and the sines of the rest angles, and
        the shape stiffnesses.
    vertex_at : (v * WIDTH,) uint32 array
        Per batch its vertices.
    ring_starts : (v + 1,) int array
        First and last (excluded) step of each batch in ``ring_at``.
    ring_at : (s * (RING_STEP + 1) * WIDTH,) uint32 array
        Per step the first points of the vertices' rings, then all second points, and so on.
    tasks : (t, 5) int array
        An iteration in parts, in order, see :data:`KIND`: those that need not wait for each other may be done
        side by side. A small muscle has one of each kind.
    places : (n,) int array
        Record of each point.
    inverse_mass : (n,) array
        Of each record: 1 free, 0 fixed.
    rest_volume, volume_floor, volume_stiffness : float
        V0 [mm^3]; least denominator of the projection [mm^4]; stiffness per iteration.
    dtype : dtype
        float64 or float32.
    """

    n_points: int
    edges: Ints
    edge_at: Offsets
    constants: Reals
    vertex_at: Offsets
    ring_starts: Ints
    ring_at: Offsets
    tasks: Ints
    places: Ints
    inverse_mass: Floats
    rest_volume: float
    volume_floor: float
    volume_stiffness: float
    dtype: np.dtype[np.floating]

    @property
    def nbytes(self) -> int:
        """Memory of the packed constraints [bytes]."""
        arrays = (self.edges, self.edge_at, self.constants, self.vertex_at, self.ring_starts, self.ring_at)
        return sum(array.nbytes for array in arrays) + self.inverse_mass.nbytes

    def records(self, points: Floats) -> Reals:
        """Return the records of points (n, 3) [mm]: a flat array of (n + 1) * 4 numbers."""
        flat = aligned_zeros(RECORD * (self.n_points + 1), self.dtype)
        table = flat.reshape(-1, RECORD)
        table[self.places, :3] = points
        table[:-1, 3] = self.inverse_mass
        return flat

    def points(self, records: Reals) -> Floats:
        """Return the positions (n, 3) [mm] of records."""
        positions: Floats = records.reshape(-1, RECORD)[self.places, :3].astype(np.float64)
        return positions

    def set_rest(self, lengths: Floats, cosines: Floats, sines: Floats) -> None:
        """Replace the rest lengths [mm] and the cosines and sines of the rest angles of edges, (k,) each.

        What was dropped, or had no angle, stays so.
        """
        table = self.constants.reshape(-1, CONSTANTS, WIDTH)
        _set_rest(table, self.edges.reshape(-1, WIDTH), lengths, cosines, sines)


@kernel
def _set_rest(table: Reals, edges: Ints, lengths: Floats, cosines: Floats, sines: Floats) -> None:
    """Do what :meth:`PackedMuscle.set_rest` says; edges (b, width) are those of the table, -1 for none."""
    for b in range(len(edges)):
        for lane in range(edges.shape[1]):
            edge = edges[b, lane]
            if edge >= 0:
                table[b, 0, lane] = lengths[edge]
                if table[b, 4, lane] > 0:
                    table[b, 2, lane], table[b, 3, lane] = cosines[edge], sines[edge]


def aligned_zeros(size: int, dtype: np.dtype[np.floating]) -> Reals:
    """Return zeros that start on a cache line (64 bytes), so that no record lies across two."""
    raw = np.zeros(size * dtype.itemsize + 64, dtype=np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size * dtype.itemsize].view(dtype)


def pack(
    topology: MeshTopology,
    rest: Floats,
    inverse_mass: Floats,
    *,
    edge_stiffness: Floats | float = 1.0,
    shape_stiffness: Floats | float = 1.0,
    volume_stiffness: float = 1.0,
    dtype: str = "float64",
) -> PackedMuscle:
    """Pack the distance, dihedral and volume constraints of a muscle.

    The distance and the dihedral constraint of an edge are projected together, for they move the same
    points. Edges without a dihedral angle (boundary, not manifold, degenerate at rest) keep their length
    only; edges that cannot move anything are dropped.

    Parameters
    ----------
    topology : MeshTopology
        Of the muscle's surface.
    rest : (n, 3) array
        Rest positions, about a centre near the muscle [mm].
    inverse_mass : (n,) array
        1 free, 0 fixed.
    edge_stiffness, shape_stiffness : float or (k,) array
        Stiffness per iteration of each of the topology's edges, in [0, 1].
    volume_stiffness : float
        Stiffness per iteration, in [0, 1].
    dtype : str
        ``"float64"`` or ``"float32"``: the numbers that positions and constants are kept in.

    Returns
    -------
    PackedMuscle
        About 115 bytes per triangle in float64.

    Raises
    ------
    ValueError
        If the mesh has too many points for 32-bit offsets (2^30).
    """
    n = topology.n_points
    if n >= np.iinfo(np.uint32).max // RECORD:
        raise ValueError(f"a muscle of {n} points is too large to pack; at most 2^30 - 2 points fit")
    number = np.dtype(dtype)
    order = order_of_points(topology.edges, n)
    places = np.empty(n + 1, dtype=np.int64)
    places[order], places[n] = np.arange(n), n
    k = len(topology.edges)
    lengths = edge_lengths(rest, topology.edges)
    corners = np.full((k + 1, 4), n, dtype=np.int64)  # the last row is for empty places
    corners[:-1, :2] = topology.edges
    corners[topology.quad_edges] = topology.quads

    angles, defined = dihedral_angles(rest, topology.quads)
    bent = topology.quad_edges[defined]
    corners[topology.quad_edges[~defined], 2:] = n
    values = np.zeros((k + 1, CONSTANTS))
    values[:-1, 0] = lengths
    values[:-1, 1] = edge_stiffness
    values[:, 2] = 1.0
    values[bent, 2], values[bent, 3] = np.cos(angles[defined]), np.sin(angles[defined])
    values[bent, 4] = np.broadcast_to(shape_stiffness, k)[bent]

    free = np.append(inverse_mass > 0, np.False_)
    used = free[corners[:-1, :2]].any(axis=1) & (values[:-1, 1] > 0)
    used |= free[corners[:-1]].any(axis=1) & (values[:-1, 4] > 0)
    ids = np.flatnonzero(used)
    corners = places[corners]
    first = corners[ids].min(axis=1)
    large = k >= LARGE
    if large:
        along = np.argsort(first, kind="stable")
        ids, first = ids[along], first[along]
    domains = domains_of_points(np.bincount(first, minlength=n)[:n], large=large)
    groups, stages = groups_of_constraints(corners[ids], domains)
    batches = [
        cut_into_batches(ids[group], greedy_colouring(corners[ids[group]], n, block=BLOCK), WIDTH)
        for group in groups
    ]
    edges = np.concatenate(batches)

    vertex_at, ring_starts, ring_at, vertex_batches = _pack_rings(places[topology.triangles], domains)
    gradient = np.empty_like(rest)
    volume = volume_and_gradient(rest, topology.triangles, gradient)
    squares = np.einsum("ij,ij->i", gradient, gradient)
    return PackedMuscle(
        n_points=n,
        edges=edges,
        edge_at=_by_lanes(RECORD * corners[edges]).astype(np.uint32),
        constants=_by_lanes(values[edges]).astype(number),
        vertex_at=vertex_at,
        ring_starts=ring_starts,
        ring_at=ring_at,
        tasks=_tasks([len(batch) // WIDTH for batch in batches], stages, vertex_batches, domains),
        places=places[:-1],
        inverse_mass=inverse_mass[order],
        rest_volume=float(volume),
        volume_floor=VOLUME_FLOOR * float(inverse_mass @ squares),
        volume_stiffness=volume_stiffness,
        dtype=number,
    )


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


def _tasks(batches: list[int], stages: list[int], vertex_batches: Ints, domains: Ints) -> Ints:
    """Return ``tasks`` of :class:`PackedMuscle`.

    Its groups of edges, in stages, have so many batches of edges, its parts so many batches of vertices.
    """
    ends = np.cumsum(batches)
    tasks = [(EDGES, ends[i] - batches[i], ends[i], stages.index(stage), i) for i, stage in enumerate(stages)]
    parts = len(vertex_batches)
    records = RECORD * np.searchsorted(domains, np.arange(parts + 1))
    for kind, cuts in ((GRADIENT, np.append(0, np.cumsum(vertex_batches))), (MOVE, records)):
        before = len(tasks)
        tasks += [(kind, cuts[i], cuts[i + 1], before, i) for i in range(parts)]
    return np.array(tasks, dtype=np.int64)


def _by_lanes(table: NDArray[np.generic]) -> NDArray[np.generic]:
    """Reorder rows (b * WIDTH, c) to (b, c, WIDTH), flat: each batch one column after the other."""
    columns = table.shape[1]
    return np.ascontiguousarray(table.reshape(-1, WIDTH, columns).transpose(0, 2, 1)).reshape(-1)


def _pack_rings(triangles: Ints, domains: Ints) -> tuple[Offsets, Ints, Offsets, Ints]:
    """Return ``vertex_at``, ``ring_starts``, ``ring_at`` of :class:`PackedMuscle`, and batches per part."""
    n = len(domains)
    corner = triangles.reshape(-1)
    order = np.argsort(corner, kind="stable")
    degree = np.bincount(corner, minlength=n)
    first = np.cumsum(degree) - degree
    following = triangles[:, [1, 2, 0]].reshape(-1)[order]
    opposite = triangles[:, [2, 0, 1]].reshape(-1)[order]
    rings = np.empty(3 * len(corner) + n, dtype=np.int64)
    lengths = _walk_rings(first, degree, following, opposite, n, rings)

    used = np.flatnonzero(degree)
    needed = -(-(lengths - 1) // RING_STEP)
    used = used[np.argsort(needed[used], kind="stable")]
    parts = int(domains.max(initial=0)) + 1
    groups = [used[domains[used] == part] for part in range(parts)]
    groups = [np.append(group, np.full(-len(group) % WIDTH, n)) for group in groups]
    vertices = np.concatenate(groups)
    # Rings of one batch have the length of its longest; the spare point has a ring of itself.
    steps = np.append(needed, 0)[vertices].reshape(-1, WIDTH).max(axis=1)
    starts = np.zeros(len(steps) + 1, dtype=np.int64)
    np.cumsum(steps, out=starts[1:])
    ring_at = np.empty(int(starts[-1]) * (RING_STEP + 1) * WIDTH, dtype=np.uint32)
    _fill_steps(vertices, starts, first, rings, lengths, n, WIDTH, RING_STEP, RECORD, ring_at)
    batches = np.array([len(group) // WIDTH for group in groups])
    return (RECORD * vertices).astype(np.uint32), starts, ring_at, batches


@kernel
def _walk_rings(first: Ints, degree: Ints, following: Ints, opposite: Ints, n: int, rings: Ints) -> Ints:
    """Write the points around each vertex in order, from 3 * first[v] + v on; return their numbers.

    The ring is a walk along the edges opposite to the vertex. Where it cannot go on (a boundary, a vertex
    where surfaces touch), it jumps by way of the spare point n to the next edge not walked yet.
    """
    lengths = np.zeros(len(degree), dtype=np.int64)
    for v in range(len(degree)):
        d = degree[v]
        tails = following[first[v] : first[v] + d].copy()
        heads = opposite[first[v] : first[v] + d].copy()
        ring = rings[3 * first[v] + v :]
        length = 0
        for start in range(d):
            # Edges walked already have been swapped to the front.
            if start == 0 or d > LONGEST_WALK or ring[length - 1] != tails[start]:
                if start > 0:
                    ring[length] = n
                    length += 1
                ring[length] = tails[start]
                length += 1
            ring[length] = heads[start]
            length += 1
            if d <= LONGEST_WALK:
                for other in range(start + 1, d):
                    if tails[other] == heads[start]:
                        tails[start + 1], tails[other] = tails[other], tails[start + 1]
                        heads[start + 1], heads[other] = heads[other], heads[start + 1]
                        break
        lengths[v] = length
    return lengths


@kernel
def _fill_steps(
    vertices: Ints,
    starts: Ints,
    first: Ints,
    rings: Ints,
    lengths: Ints,
    n: int,
    width: int,
    ring_step: int,
    record_size: int,
    ring_at: Offsets,
) -> None:
    """Cut the rings into steps of a few edges, lane by lane; a ring that has ended stays at its end.

    The layout comes as arguments: a constant from another file would go stale in the compiled cache.
    """
    points = ring_step + 1
    for batch in range(len(starts) - 1):
        for lane in range(width):
            v = vertices[batch * width + lane]
            for step in range(starts[batch], starts[batch + 1]):
                for point in range(points):
                    record = n
                    if v < n:
                        place = min(ring_step * (step - starts[batch]) + point, lengths[v] - 1)
                        record = rings[3 * first[v] + v + place]
                    ring_at[(step * points + point) * width + lane] = record_size * record
