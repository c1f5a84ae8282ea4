"""The order in which the constraints of a muscle are projected, and one iteration of a step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.contact import Contact
from vtkmuscle.core.jit import kernel, vector_kernel
from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.pbd import as_printed
from vtkmuscle.core.pbd.batches import CONSTANTS, RECORD, WIDTH, pack
from vtkmuscle.core.pbd.constraints import (
    VOLUME_FLOOR,
    dihedral,
    distance,
    project_volume,
)
from vtkmuscle.core.pbd.rest_shape import RestShape
from vtkmuscle.core.pbd.stages import StageClock
from vtkmuscle.core.types import Bools, Floats, Ints

Offsets = NDArray[np.uint32]

_KeepOut = Callable[[Floats], Bools]

# Places in the buffer, each of WIDTH numbers: four records before, four after, and the constants.
_AFTER = 4 * RECORD * WIDTH
_CONSTANTS = 8 * RECORD * WIDTH

#: Numbers in the working memory of :func:`sweep_batches`.
BUFFER = _CONSTANTS + CONSTANTS * WIDTH

ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Stiffness per iteration of a muscle's constraints, in [0, 1].

    Attributes
    ----------
    edges : (k,) array
        Of the length of each edge.
    shape, volume : float
        Of the angles between triangles, and of the volume.
    """

    edges: Floats
    shape: float
    volume: float


class Iteration:
    """One iteration of a step: a map of positions, whose fixed point is the muscle's shape.

    Free points are drawn towards where the taut fibres carry them, all constraints are projected, and points
    are moved out of the bones.

    Parameters
    ----------
    order : Order
        Projects the constraints.
    contact : Contact
        The bones and muscles that points are kept out of in this step.
    n_points : int
        Points of the muscle.
    most : int
        Iterations, at most, of which progress is told.
    clock : StageClock
        Is told which stage goes on.
    progress : callable
        Called after each iteration with the part that is done; may raise, to stop.
    drawn : (target, part, free), optional
        Where the fibres carry the points, (n, 3) [mm], and which part of their way there the free ones, (n,)
        bool, are drawn.
    smooth : (k, 2) int array, optional
        Edges of the muscle, where the map has to be smooth, which acceleration needs: bones then come last,
        and ``unsteady`` notes where it is not smooth all the same.

    Attributes
    ----------
    collided : (n,) bool array
        Points that met a bone: in the last iteration of a smooth map, in any of another one.
    unsteady : (3 n,) bool array
        Coordinates of points that met a bone in any iteration, and of their neighbours.
    """

    def __init__(
        self,
        order: Order,
        contact: Contact,
        n_points: int,
        *,
        most: int,
        clock: StageClock,
        progress: Callable[[float], None],
        drawn: tuple[Floats, float, Bools] | None = None,
        smooth: Ints | None = None,
    ) -> None:
        self._order, self._contact, self._drawn, self._smooth = order, contact, drawn, smooth
        self._most, self._clock, self._progress = most, clock, progress
        self._done = 0
        self._image: Floats = np.empty((n_points, 3))
        self.collided: Bools = np.zeros(n_points, dtype=np.bool_)
        self.unsteady: Bools = np.zeros(3 * n_points, dtype=np.bool_)

    def __call__(self, positions: Floats) -> Floats:
        """Return the image (3 n,) of positions (3 n,), in memory that the next call writes again."""
        self._clock.switch("constraints")
        image = self._image
        image[:] = positions.reshape(-1, 3)
        if self._drawn is not None:
            _draw_to(image, *self._drawn)
        hit = self._order.project(image, self.keep_out, bones_last=self._smooth is not None)
        if self._smooth is None:
            self.collided |= hit
        else:
            self.collided = hit
            if hit.any():
                # What a point on a bone does, and what its neighbours do about it, is not smooth.
                _mark_with_neighbours(hit, self._smooth, self.unsteady.reshape(-1, 3))
        self._done += 1
        self._progress(self._done / self._most)
        self._clock.switch("acceleration")
        return image.reshape(-1)

    def keep_out(self, p: Floats) -> Bools:
        """Move positions (n, 3) out of the bones, in place; return which points, (n,)."""
        stage = self._clock.switch("collision")
        hit = self._contact.keep_out(p)
        self._clock.switch(stage)
        return hit


@kernel
def _draw_to(p: Floats, target: Floats, part: float, free: Bools) -> None:
    """Move the free points (n, 3) a part of their way to a target, in place."""
    for i in range(len(p)):
        if free[i]:
            for k in range(3):
                p[i, k] += part * (target[i, k] - p[i, k])


@kernel
def _mark_with_neighbours(points: Bools, edges: Ints, marked: Bools) -> None:
    """Mark the components (n, 3) of points (n,) and of those that share an edge with one."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        if points[i] or points[j]:
            marked[i] = marked[j] = True


class Volume:
    """The volume constraint of a muscle.

    Parameters
    ----------
    triangles : (m, 3) int array
        Of the muscle's closed surface.
    shape : RestShape
        Of the muscle.
    inverse_mass : (n,) array
        1 free, 0 fixed.
    """

    def __init__(self, triangles: Ints, shape: RestShape, inverse_mass: Floats) -> None:
        self._triangles, self._mass = triangles, inverse_mass
        #: Volume at rest [mm^3].
        self.rest = shape.volume
        squares = np.einsum("ij,ij->i", shape.volume_gradient, shape.volume_gradient)
        self._floor = VOLUME_FLOOR * float(inverse_mass @ squares)
        self._gradient: Floats = np.empty_like(shape.volume_gradient)

    def project(self, p: Floats, stiffness: float, held: Bools | None = None) -> float:
        """Project the volume of positions (n, 3) in place; return what it was before [mm^3].

        held : (n,) bool array
            Points that take no part in it.
        """
        mass = self._mass if held is None else np.where(held, 0.0, self._mass)
        return project_volume(p, mass, self._triangles, self.rest, self._floor, stiffness, self._gradient)


class Order(Protocol):
    """Projects all constraints of a muscle once.

    Attributes
    ----------
    settles : bool
        Whether volume and bones are attended to once more after the iterations.
    """

    settles: bool

    def project(self, p: Floats, keep_out: _KeepOut, *, bones_last: bool) -> Bools:
        """Project all constraints of positions (n, 3) once, in place; return which points met a bone.

        Parameters
        ----------
        p : (n, 3) array
            Positions [mm], changed in place.
        keep_out : callable
            Moves positions (n, 3) out of the bones, in place, and returns which, (n,).
        bones_last : bool
            Whether the volume is projected before the bones.
        """

    def set_rest(self, lengths: Floats, cosines: Floats, sines: Floats) -> None:
        """Replace the rest lengths [mm] and the cosines and sines of the rest angles of all edges, (k,)."""


class ColourOrder:
    """Distance, shape, collision, volume; edges in the order of their colours, many at a time.

    Volume comes last, as in the end only what was projected last holds exactly: V / V0 stays within 0.1 %
    where another order ends at 1.07. So that this does not push points back into the bones that they
    have just been moved out of, those take no part in it: the volume goes to where the muscle can give way.

    Acceleration needs a map without jumps. A point that takes part in the projection of the volume or not, as
    it just touches a bone or just does not, makes one: with ``bones_last`` all take part, and points are
    moved out of the bones after that.

    Parameters
    ----------
    topology : MeshTopology
        Of the muscle.
    shape : RestShape
        Of the muscle.
    inverse_mass : (n,) array
        1 free, 0 fixed.
    stiffness : Stiffness
        Of its constraints.
    """

    settles = True

    def __init__(
        self, topology: MeshTopology, shape: RestShape, inverse_mass: Floats, stiffness: Stiffness
    ) -> None:
        self._edges = pack(topology, shape, inverse_mass, stiffness.edges, stiffness.shape)
        self._mass = inverse_mass
        self._records = self._edges.records()
        self._buffer = np.zeros(BUFFER)
        self._volume, self._stiffness = Volume(topology.triangles, shape, inverse_mass), stiffness.volume
        #: See :meth:`Order.set_rest`.
        self.set_rest = self._edges.set_rest

    def project(self, p: Floats, keep_out: _KeepOut, *, bones_last: bool) -> Bools:
        """Project all constraints once, in place; see :meth:`Order.project`."""
        _put(p, self._mass, self._records)
        sweep_batches(self._records, self._edges.edge_at, self._edges.constants, self._buffer)
        _take(self._records, p)
        if bones_last:
            self._volume.project(p, self._stiffness)
            return keep_out(p)
        hit = keep_out(p)
        self._volume.project(p, self._stiffness, hit)
        return hit


class SequentialOrder:
    """Algorithm 2 as printed: all distances, the volume, all dihedral angles, the bones.

    Edges come one by one, in the order of the mesh, by :mod:`~vtkmuscle.core.pbd.as_printed`. The volume is
    not what was projected last, so that it is kept less well.

    Parameters
    ----------
    topology, shape, inverse_mass, stiffness
        As of :class:`ColourOrder`.
    """

    settles = False

    def __init__(
        self, topology: MeshTopology, shape: RestShape, inverse_mass: Floats, stiffness: Stiffness
    ) -> None:
        self._mass, self._stiffness = inverse_mass, stiffness
        edges, quads = topology.edges, topology.quads
        self._held = used = (inverse_mass[edges] > 0).any(axis=1)
        self._long = np.ascontiguousarray(edges[used]), shape.lengths[used], stiffness.edges[used]
        used = shape.angle_defined & (inverse_mass[quads] > 0).any(axis=1)
        self._turned = topology.quad_edges[used]
        self._bent = np.ascontiguousarray(quads[used]), np.abs(shape.angles[used])
        self._solid = topology.triangles, shape.volume, stiffness.volume
        self._gradient: Floats = np.empty_like(shape.volume_gradient)

    def project(self, p: Floats, keep_out: _KeepOut, *, bones_last: bool) -> Bools:
        """Project all constraints once, in place, the bones always last; see :meth:`Order.project`."""
        as_printed.sweep_distances(p, self._mass, *self._long)
        as_printed.project_volume(p, self._mass, *self._solid, self._gradient)
        as_printed.sweep_angles(p, self._mass, *self._bent, self._stiffness.shape)
        return keep_out(p)

    def set_rest(self, lengths: Floats, cosines: Floats, sines: Floats) -> None:
        """See :meth:`Order.set_rest`."""
        self._long[1][:] = lengths[self._held]
        self._bent[1][:] = np.abs(np.arctan2(sines[self._turned], cosines[self._turned]))


# -------------------------------------------------------------------------------- many at a time


@vector_kernel
def sweep_batches(p: Floats, edge_at: Offsets, constants: Floats, buffer: Floats) -> None:
    """Project the distance and then the dihedral constraint of each edge, batch by batch.

    No two edges of a batch touch the same point, so this is exactly the projection of one after the other
    (Gauss-Seidel) in the order of the batches. A batch is copied into one flat buffer, all of it is projected
    by a loop of constant length that the compiler turns into vector instructions, and copied back.

    Parameters
    ----------
    p : (4 (n + 1),) array
        Records, changed in place.
    edge_at, constants : arrays
        As in :class:`~vtkmuscle.core.pbd.batches.PackedEdges`.
    buffer : array
        Working memory of :data:`BUFFER` numbers.
    """
    corner = RECORD * WIDTH
    for batch in range(len(edge_at) // (4 * WIDTH)):
        for i in range(4 * WIDTH):
            at = edge_at[4 * WIDTH * batch + i]
            # All loads first, which makes them one move.
            x, y, z, w = p[at], p[at + ONE], p[at + TWO], p[at + THREE]
            to = RECORD * i
            buffer[to] = x
            buffer[to + 1] = y
            buffer[to + 2] = z
            buffer[to + 3] = w
        # Constants are loaded four at a time and then stored, so that the compiler need not know that the
        # arrays do not overlap; it would not make vectors of a loop over two arrays.
        for i in range(CONSTANTS * WIDTH // 4):
            at = CONSTANTS * WIDTH * batch + 4 * i
            k0, k1, k2, k3 = constants[at], constants[at + 1], constants[at + 2], constants[at + 3]
            buffer[_CONSTANTS + 4 * i] = k0
            buffer[_CONSTANTS + 4 * i + 1] = k1
            buffer[_CONSTANTS + 4 * i + 2] = k2
            buffer[_CONSTANTS + 4 * i + 3] = k3
        for i in range(WIDTH):
            at = RECORD * i
            x1, y1, z1, w1 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = RECORD * i + corner
            x2, y2, z2, w2 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = RECORD * i + 2 * corner
            x3, y3, z3, w3 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = RECORD * i + 3 * corner
            x4, y4, z4, w4 = buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]
            at = _CONSTANTS + i
            x1, y1, z1, x2, y2, z2 = distance(x1, y1, z1, w1, x2, y2, z2, w2, buffer[at], buffer[at + WIDTH])
            x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4 = dihedral(
                x1, y1, z1, w1, x2, y2, z2, w2, x3, y3, z3, w3, x4, y4, z4, w4,
                buffer[at + 2 * WIDTH], buffer[at + 3 * WIDTH], buffer[at + 4 * WIDTH],
                buffer[at + 5 * WIDTH],
            )  # fmt: skip
            # To other places than they came from: whole records are stored, masses too, by plain moves.
            at = _AFTER + RECORD * i
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x1, y1, z1, w1
            at = _AFTER + RECORD * i + corner
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x2, y2, z2, w2
            at = _AFTER + RECORD * i + 2 * corner
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x3, y3, z3, w3
            at = _AFTER + RECORD * i + 3 * corner
            buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3] = x4, y4, z4, w4
        for i in range(4 * WIDTH):
            at = edge_at[4 * WIDTH * batch + i]
            to = _AFTER + RECORD * i
            x, y, z, w = buffer[to], buffer[to + 1], buffer[to + 2], buffer[to + 3]
            p[at] = x
            p[at + ONE] = y
            p[at + TWO] = z
            p[at + THREE] = w


@kernel
def _put(p: Floats, mass: Floats, records: Floats) -> None:
    """Copy positions (n, 3) and inverse masses (n,) into the records."""
    for i in range(len(p)):
        for c in range(3):
            records[RECORD * i + c] = p[i, c]
        records[RECORD * i + 3] = mass[i]


@kernel
def _take(records: Floats, p: Floats) -> None:
    """Copy the records into positions (n, 3)."""
    for i in range(len(p)):
        for c in range(3):
            p[i, c] = records[RECORD * i + c]
