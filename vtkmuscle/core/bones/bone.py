"""A bone with exact surface, and distances filled where looked up."""

from collections.abc import Iterable
from functools import cached_property
from mmap import ACCESS_COPY, mmap

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.bones.lookup import Field, distance_and_normal, least_distance_at
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.sampling import UNEVEN, uneven_weights
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.solids import FAR, LEAST_PIECE, Solids, closed_shells, solids_from, solids_of
from vtkmuscle.core.mesh.surface import box_of, used_alone
from vtkmuscle.core.motion.rigid import apply_transform, inverse, transform_point
from vtkmuscle.core.types import TINY, Bools, Floats, Ints

#: Cells of the field along the diagonal of a bone's box along its axes: 1.3 mm on a pelvis, 1.5 on a femur.
#: With twice as many mean moment arms of two muscles of a hip change by up to 0.6 mm, lengths by 0.13 mm.
CELLS_PER_DIAGONAL = 300.0

#: Reach of the field beyond the bone's box, in diagonals of the box; farther away each point is measured.
#: With half of it lengths of a hip change by rounding.
REACH = 0.25

#: Step of the nodes that bound the distances of far points: few of these nodes bound them all.
APART = 16

#: Most nodes of a field: half a GB of addresses, of which memory is taken where nodes are known.
_MOST_NODES = 2.0**26

#: Most nodes that are noted as lacking at a time.
_LACKING = 4096


class Bone:
    """A bone in its rest pose.

    Points (n, 3) [mm] and triangles (m, 3) are not changed afterwards; points of no triangle are left out.
    The solids measure distances from the triangles; :meth:`field` looks distances up between the nodes of a
    lattice along the bone's own axes, in a few hundredths of the time. Nodes are measured when first looked
    up, and depend on the bone alone, to the last digit: several threads may ask a bone at once. A bone away
    from all points builds nothing.

    Neighbouring nodes are ``cell`` > 0 apart [mm], by default the bone's diagonal /
    :data:`CELLS_PER_DIAGONAL`.
    """

    def __init__(
        self, points: Floats, triangles: Ints, name: object = "bone", *, cell: float | None = None
    ) -> None:
        self.points, self.triangles = used_alone(points, triangles)
        #: Name of the bone in warnings and errors.
        self.name = str(name)
        #: Lowest and highest corner of the bone's box at rest [mm].
        self.box = box_of(self.points)
        if cell is not None:
            self.cell = cell
        self._known: tuple[float, Field] | None = None  # with its reach

    @cached_property
    def solids(self) -> Solids:
        """The bone's parts, closed where open: the exact surface."""
        with errors_at(self.name):
            return solids_of(self.points, self.triangles)

    @cached_property
    def pieces(self) -> tuple["Bone", ...]:
        """The bone's connected pieces, largest first.

        Tibia and fibula in one surface are two pieces: a point between both has a direction from each. A
        crumb, or a piece whose box is within a larger piece's box, such as a hollow, stays with the largest.
        """
        with errors_at(self.name):
            closed = closed_shells(self.points, self.triangles)
        parts: list[list[int]] = []
        boxes: list[tuple[Floats, Floats]] = []
        sizes = [len(shell) for shell in closed.shells]
        for number in sorted(range(len(sizes)), key=sizes.__getitem__, reverse=True):
            low, high = box_of(closed.points[closed.shells[number].reshape(-1)])
            within = any((low >= lowest).all() and (high <= highest).all() for lowest, highest in boxes)
            if parts and (within or sizes[number] < LEAST_PIECE * sum(sizes)):
                parts[0].append(number)
            else:
                parts.append([number])
                boxes.append((low, high))
        if len(parts) == 1:
            return (self,)
        pieces = []
        order = np.lexsort(closed.points.T[::-1])  # the axes do not depend on the file's order
        number_of = np.argsort(order)
        for part in parts:
            triangles = number_of[np.concatenate([closed.shells[number] for number in part])]
            pieces.append(Bone(closed.points[order], triangles, self.name, cell=self.cell))
            pieces[-1].solids = solids_from(closed, part)
        return tuple(pieces)

    @cached_property
    def axes(self) -> Floats:
        """From the scene at rest to the field's axes, (4, 4)."""
        return bone_axes(self.points)

    @cached_property
    def from_axes(self) -> Floats:
        """From the field's axes to the scene at rest, (4, 4)."""
        return inverse(self.axes)

    @cached_property
    def box_along_axes(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the bone's box along its axes [mm]."""
        return box_of(apply_transform(self.axes, self.points))

    @cached_property
    def cell(self) -> float:
        """Distance of neighbouring nodes of the field [mm]."""
        low, high = self.box_along_axes
        return float(np.linalg.norm(high - low)) / CELLS_PER_DIAGONAL

    def field(self, points: ArrayLike, *, within: ArrayLike = np.inf) -> tuple[Floats, Floats]:
        """Return the trilinear distances and directions of points.

        Distances (n,) [mm] are negative inside; points (n, 3) are at rest. Distances are within sqrt(3) / 2
        of a cell of the exact distance, and beside a smooth surface of radius R about cell^2 / (4 R) off;
        beyond the :data:`REACH` of the field they are exact. Points that are surely farther away than
        ``within`` [mm] are not looked up, and get a bound beyond ``within``; points that are not finite get
        :data:`~vtkmuscle.core.mesh.solids.FAR`. Directions (n, 3) in which the distance grows are unit
        vectors, continuous, by differences over a cell; 0 where the distance is missing or constant.
        """
        positions = np.ascontiguousarray(points, dtype=np.float64)
        distance, outward = np.empty(len(positions)), np.empty((len(positions), 3))
        lacks = np.ones(len(positions), dtype=np.bool_)
        matters: Floats = np.full(len(positions), within, dtype=np.float64)
        field = self.look_up()
        while True:
            _look_up(field, self.axes, positions, matters, lacks, distance, outward, np.empty((2, 3)))
            if not self.fill(field):
                break
        beyond = np.flatnonzero(np.isnan(distance))
        if len(beyond):
            distance[beyond] = FAR
            beyond = beyond[(np.abs(positions[beyond]) < FAR).all(axis=1)]
            distance[beyond], outward[beyond] = self.solids.exact(positions[beyond])
        return distance, outward

    def look_up(self, reach: float = 0.0) -> Field:
        """Return the known part of the field, for kernels.

        Give the field to :meth:`fill` afterwards. The field is defined up to ``reach`` [mm] from the bone's
        box, at least :data:`REACH` diagonals, or as far as the nodes suffice.
        """
        if self._known is None or reach > self._known[0]:
            self._known = self._nothing(reach)
        return self._known[1]._replace(lacking=np.zeros(2 + _LACKING, dtype=np.int64))

    def fill(self, field: Field) -> bool:
        """Fill the missing nodes of a field.

        Return whether nodes were missing. If so, the look-ups of missing nodes must be repeated.
        """
        if field.lacking[0] == 0:
            return False
        flat, shape, three = field.nodes.reshape(-1), field.nodes.shape, np.arange(3)
        around = ((three[:, None] * shape[1] + three)[:, :, None] * shape[2] + three).reshape(-1)
        notes = field.lacking[2 : 2 + field.lacking[1]]
        numbers = np.append(-1 - notes[notes < 0], notes[notes >= 0, None] + around)
        numbers = np.unique(numbers[flat[numbers] == 0.0])
        field.lacking[:2] = 0
        positions = field.cell * (np.transpose(np.unravel_index(numbers, shape)) + field.low)
        distances = self.solids.distances(apply_transform(self.from_axes, positions))
        flat[numbers] = np.where(distances == 0.0, TINY, distances)  # 0 is unknown
        return True

    def _nothing(self, reach: float) -> tuple[float, Field]:
        """Return the reach of a field, and the field without known nodes."""
        (low, high), cell, least = self.box_along_axes, self.cell, 3.0  # cells, for differences of distances
        reach = max(reach, REACH * float(np.linalg.norm(high - low)))
        cells = reach / cell
        while True:
            first = np.floor(low / cell - cells - least)
            counts = np.ceil(high / cell + cells + least) - first + 1.0 + APART
            if np.prod(counts) <= _MOST_NODES:
                break
            if not cells > 1.0:
                problem = f"cells of {cell:g} mm are too small for the field of a bone of its size"
                raise InputError(self.name, problem)
            cells *= 0.75
        shape = counts.astype(np.int64)
        # Memory of the system's own, small pages: numpy's large pages would be cleared whole for a few nodes.
        memory = mmap(-1, 8 * int(shape.prod()), access=ACCESS_COPY)
        nodes, box = np.frombuffer(memory).reshape(shape), np.concatenate([low, high])
        return reach, Field(nodes, first, box, cell, 1.0 / cell, np.zeros(2, dtype=np.int64))


#: The bone of a surface, and of a name, one for all who hold it.
bone_of = shared(Bone)


def depth_in(bones: Iterable[tuple[Bone, Floats]], points: Floats) -> Floats:
    """Return the depth of points in the deepest bone.

    Depths are (n,) [mm], 0 outside; points (n, 3) are in the present pose. Each bone comes with a transform
    (4, 4), rest to now; the bone's triangles count, not the field.
    """
    depth = np.zeros(len(points))
    for bone, transform in bones:
        np.maximum(depth, bone.solids.depth(apply_transform(inverse(transform), points)), out=depth)
    return depth


def bone_axes(points: Floats) -> Floats:
    """Return the transform to a bone's principal axes.

    The rigid transform (4, 4) leads from the scene to the axes and the bone's centre. A grid along the axes
    of the scene would make the result depend on the scene's turn, and would have more cells around the bone.
    The points (n, 3) of a round bone do not determine the axes; then the points' order decides: the points
    are weighted a little unevenly.
    """
    centre = points.mean(axis=0)
    arms = points - centre
    weights = 1.0 + UNEVEN * uneven_weights(len(points))
    axes = np.linalg.eigh((arms * weights[:, None]).T @ arms)[1].T
    # The order of the points decides about the sign of an eigenvector, too.
    axes[(weights - weights.mean()) @ (arms @ axes.T) < 0.0] *= -1.0
    axes[2] = np.cross(axes[0], axes[1])  # a rotation, not a reflection
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = axes, -axes @ centre
    return transform


@kernel
def _look_up(
    field: Field, axes: Floats, points: Floats, within: Floats, lacks: Bools, distance: Floats,
    outward: Floats, work: Floats,
) -> None:  # fmt: skip
    """Do the work of :meth:`Bone.field`. lacks : (n,), points with unknown nodes;  work : (2, 3), memory."""
    at, normal = work[0], work[1]
    for i in range(len(points)):
        if not lacks[i]:
            continue
        before = field.lacking[0]
        transform_point(axes, points, i, at)
        normal[0], normal[1], normal[2] = 0.0, 0.0, 0.0
        least = -np.inf
        if within[i] < np.inf:
            least = least_distance_at(field, at[0], at[1], at[2], max(within[i], 0.0))
        if least > within[i]:
            distance[i] = min(least, FAR)
        elif field.lacking[0] == before:
            distance[i] = distance_and_normal(field, at, normal)
        for k in range(3):
            outward[i, k] = axes[0, k] * normal[0] + axes[1, k] * normal[1] + axes[2, k] * normal[2]
        lacks[i] = field.lacking[0] > before
