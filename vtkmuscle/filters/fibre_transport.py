"""FibreTransport: move fibres with the muscle they are in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.mean_value import mean_value_coordinates, transport
from vtkmuscle.core.fibres.sparse_weights import (
    SparseWeights,
    sparse_mean_value_coordinates,
    sparse_transport,
)
from vtkmuscle.core.fibres.tendons import Tendons
from vtkmuscle.core.mesh.polylines import evenly_spaced, polyline_lengths
from vtkmuscle.core.mesh.solids import points_inside
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, shared_tree, tree_of_deformed
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.data.paths import PATH_POINTS, add_paths
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports

#: Fibre points whose weights are computed together: bounds the steps of progress and the time to abort.
_BLOCK = 256
#: Size up to which weights are kept [bytes]; the others are computed again for each frame.
_LARGEST_CACHE = 2**31
#: Points nearer to the surface than this part of the muscle's size do not count as outside.
_ON_SURFACE = 1e-6
#: Ends of fibres nearer to a triangle than this part of the mean edge are on it.
_ON_TRIANGLE = 0.1


@dataclass(eq=False)
class _Rest:
    """Fibres and muscle at rest, with the weights between them: all, block by block, or the sparse ones."""

    fibre_points: Floats
    points: Floats
    triangles: Ints
    weight_tolerance: float
    #: Distances of the fibre points from the muscle, (p,) [mm], 0 inside.
    gap: Floats
    sparse: SparseWeights | None = None
    weights: dict[int, Floats] = field(default_factory=dict)
    bent: TriangleTree | None = None

    def is_of(self, fibre_points: Floats, points: Floats, triangles: Ints, weight_tolerance: float) -> bool:
        return (
            self.weight_tolerance == weight_tolerance
            and np.array_equal(self.fibre_points, fibre_points)
            and np.array_equal(self.points, points)
            and np.array_equal(self.triangles, triangles)
        )

    @cached_property
    def tree(self) -> TriangleTree:
        """The triangles of the muscle at rest."""
        return shared_tree(self.points, self.triangles)

    @cached_property
    def n_outside(self) -> int:
        """Number of fibre points outside of the muscle at rest."""
        return int((self.gap > _ON_SURFACE * np.linalg.norm(np.ptp(self.points, axis=0))).sum())

    @property
    def error(self) -> float:
        """Largest error of the weights [mm]."""
        return 0.0 if self.sparse is None else self.sparse.error

    def moved(self, deformed: Floats, report: Callable[[float], None]) -> Floats:
        """Return the fibre points in the deformed vertices; `report` is called with the part done."""
        if self.weight_tolerance > 0.0:
            if self.sparse is None:
                self.sparse = sparse_mean_value_coordinates(
                    self.points,
                    self.triangles,
                    self.fibre_points,
                    prune=self.weight_tolerance,
                    report=lambda part: report(0.9 * part),
                )
            moved = sparse_transport(self.sparse, deformed)
            report(1.0)
            return moved
        moved = np.empty_like(self.fibre_points)
        for first in range(0, len(moved), _BLOCK):
            moved[first : first + _BLOCK] = transport(self._of_block(first), deformed)
            report(min(first + _BLOCK, len(moved)) / len(moved))
        return moved

    def keep_within(self, fibre_points: Floats, surface: Floats) -> None:
        """Move fibre points (p, 3) that are farther outside of the surface (n, 3) than at rest towards it.

        Parity decides which are outside: the triangle nearest to a point of a muscle that touches itself may
        be that of the other side.
        """
        self.bent = tree_of_deformed(self.tree, surface, self.triangles)
        outside = np.flatnonzero(~points_inside(fibre_points, self.bent))
        _, nearest, distances = self.bent.nearest(fibre_points[outside])
        far = distances > self.gap[outside]
        out, nearest = outside[far], nearest[far]
        part = (self.gap[out] / distances[far])[:, None]
        fibre_points[out] = nearest + part * (fibre_points[out] - nearest)

    def _of_block(self, first: int) -> Floats:
        """Return the weights of a block of fibre points, from number `first` on."""
        if first in self.weights:
            return self.weights[first]
        block = self.fibre_points[first : first + _BLOCK]
        weights = mean_value_coordinates(self.points, self.triangles, block)
        if weights.nbytes + sum(kept.nbytes for kept in self.weights.values()) <= _LARGEST_CACHE:
            self.weights[first] = weights
        return weights


class FibreTransport(Filter):
    """Move fibres from a muscle at rest into the deformed muscle.

    With ``method="mean-value"``, that of the paper, a fibre point is a weighted mean of the vertices of the
    muscle at rest (mean value coordinates); it moves to the same mean of the deformed vertices. The weights
    are kept while the rest fibres and the rest muscle have the same content, so that a frame costs one matrix
    product. Fibre points outside of the muscle are moved as well, and counted.

    With ``method="carried"`` fibres first go with the taut fibres of PBDDeformer (``FibrePoints``); the
    weights then add the displacement of the surface from where the paths carried it (``Carried``). Points
    farther outside of the deformed muscle than at rest are moved back towards it. Where these arrays are
    missing, or belong to other fibres, ``"mean-value"`` takes its place.

    With ``rest_paths``, for fibres between aponeuroses, the ends of fibres keep their distance from their
    bones along the muscle's paths, for tendon is stiff; ends on a part of the muscle that is fixed to a bone
    go with that part. Fibres that are straight at rest stay straight.

    All weights of 1600 points on 9878 vertices take 126 MB. With ``weight_tolerance`` groups of vertices
    with similar weights share one, and affine motions stay exact; 0.3 keeps one weight in ten. The cost is in
    ``WeightError``: the largest error of a fibre point if the muscle is bent by about one radian.

    Parameters
    ----------
    rest_fibres
        Polylines in the muscle at rest.
    rest_muscle
        The muscle at rest, closed, triangles.
    deformed_muscle
        The same points as the muscle at rest, moved.
    paths
        The same fibres pulled taut, as by TautFibres: the paths, where the deformed muscle has none.
    rest_paths
        For fibres between aponeuroses: the lines at rest, from bone to bone, with which the muscle was
        deformed.
    weight_tolerance
        Tolerance for merging vertices into groups that share one weight: with a larger one transport is
        faster, takes less memory and is less exact. 0 merges nothing; 0.3 keeps one weight in ten.
    method
        Whether fibres follow the taut fibres of the deformer and then the surface, or the surface alone.

    Attributes
    ----------
    output
        The moved polylines, with the arrays of the rest fibres and the cell array ``RestLength`` (n_fibres,)
        [mm], and the field arrays ``PointsOutside``, the number of rest fibre points that are outside of the
        muscle, and ``WeightError`` [mm]. With the arrays of the muscle's paths, where the deformed muscle or
        the taut fibres have them: ``PathLength``, ``PathPoints`` and ``PathLever_COORDINATE``
        (:mod:`vtkmuscle.data.paths`).

    Raises
    ------
    ValueError
        If the rest muscle is not closed; if the muscles have different numbers of points; if ``paths`` are
        not one for each fibre.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*, eq. 8,
    doi:10.1007/978-3-030-72379-8_24; Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular
    meshes*, doi:10.1145/1073204.1073229.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource, vtkSphereSource
    >>> from vtkmuscle.filters import FibreTransport
    >>> rest = vtkSphereSource(radius=10.0).update().output
    >>> thinner = vtkSphereSource(radius=5.0).update().output
    >>> fibre = vtkLineSource(point1=(-4, 0, 0), point2=(4, 0, 0)).update().output
    >>> moved = FibreTransport()(fibre, rest, thinner)
    >>> round(moved.GetPoint(1)[0], 6)
    2.0
    """

    weight_tolerance = Parameter(float, default=0.0, minimum=0.0, maximum=10.0)

    method = Parameter(str, default="carried", choices=("carried", "mean-value"))

    rest_fibres = ports.Lines()
    rest_muscle = ports.Surface()
    deformed_muscle = ports.Surface()
    paths = InputPort(vtkPolyData, optional=True)
    rest_paths = ports.Lines(optional=True)
    output = OutputPort(vtkPolyData)

    _rest: _Rest | None = None
    _tendons: tuple[tuple[Floats, Floats], Tendons] | None = None

    times_from = "deformed_muscle"

    def execute(
        self,
        rest_fibres: Polylines,
        rest_muscle: Surface,
        deformed_muscle: Surface,
        paths: vtkPolyData | None,
        rest_paths: Polylines | None,
    ) -> vtkPolyData:
        """Return the fibres in the deformed muscle."""
        points, deformed = rest_fibres.points, deformed_muscle.points
        if len(deformed) != len(rest_muscle.points):
            raise InputError(
                "",
                f"deformed_muscle has {len(deformed)} points, but rest_muscle has {len(rest_muscle.points)}",
                "both must be the same mesh, before and after the deformation",
            )
        rest = self._rest_of(points, rest_muscle)
        carried = self._carried(deformed_muscle, len(points))
        surface, fibre_points = (0.0, 0.0) if carried is None else carried
        moved = fibre_points + rest.moved(deformed - surface, self.report_progress)
        if rest_paths is not None:
            moved = self._held(moved, rest_fibres, rest_paths, rest_muscle, deformed_muscle)
        if carried is not None or rest_paths is not None:
            rest.keep_within(moved, deformed)
        result = add_arrays(
            rest_fibres.moved(moved),
            cells={"RestLength": polyline_lengths(points, rest_fibres.offsets)},
            fields={"PointsOutside": rest.n_outside, "WeightError": rest.error},
        )
        add_paths(result, deformed_muscle.data, paths, "paths")
        return result

    def _carried(self, muscle: Surface, count: int) -> tuple[Floats, Floats] | None:
        """Return the surface and `count` fibre points as taut fibres carry them; None where unknown."""
        if self.method != "carried" or not muscle.data.GetPointData().HasArray("Carried"):
            return None
        points = field_array(muscle.data, "FibrePoints")
        if points is None or points.shape != (count, 3):
            return None
        return np.array(muscle.array("Carried"), dtype=np.float64), np.array(points, dtype=np.float64)

    def _held(
        self, moved: Floats, fibres: Polylines, lines: Polylines, rest: Surface, muscle: Surface
    ) -> Floats:
        """Return the fibres' points (p, 3) with their ends held by tendons."""
        now = field_array(muscle.data, PATH_POINTS)
        if now is None or len(now) != len(lines):
            return moved  # deformed without paths, by the published model
        now = np.asarray(now, dtype=np.float64).reshape(len(lines), -1, 3)
        counts = np.unique(np.diff(fibres.offsets))
        if len(counts) > 1:
            raise InputError(
                "rest_fibres",
                f"they have {counts[0]} to {counts[-1]} points each, but with rest_paths as many each",
                "FibreSource makes such fibres",
            )
        given = fibres.points, lines.points
        if self._tendons is None or not all(map(np.array_equal, self._tendons[0], given)):
            even = evenly_spaced(lines.points, lines.offsets, now.shape[1])
            shape = fibres.points.reshape(len(fibres), -1, 3)
            self._tendons = given, Tendons(shape, even, _fixed(rest, shape[:, [0, -1]]))
        held = self._tendons[1].held(moved.reshape(len(fibres), -1, 3), now)
        return held.reshape(-1, 3)

    def _rest_of(self, fibre_points: Floats, muscle: Surface) -> _Rest:
        # To compare content costs a hundredth of a frame. Modification times would be wrong for inputs that
        # were copied, or changed through a numpy view.
        given = fibre_points, muscle.points, muscle.triangles
        if self._rest is None or not self._rest.is_of(*given, self.weight_tolerance):
            gap = np.linalg.norm(muscle.geometry.solids.into(fibre_points) - fibre_points, axis=1)
            self._rest = _Rest(*given, self.weight_tolerance, gap)
        return self._rest


def _fixed(muscle: Surface, ends: Floats) -> Bools:
    """Return which ends (k, 2, 3) are on triangles of a muscle all of whose points are fixed to bones."""
    geometry = muscle.geometry
    fixed_to = muscle.data.GetPointData().GetArray("FixedTo")
    if fixed_to is None:
        return np.zeros(ends.shape[:2], dtype=np.bool_)
    tree = shared_tree(geometry.points, geometry.triangles)
    faces, _, apart = tree.nearest(ends.reshape(-1, 3))
    on_bone = (np.asarray(fixed_to) >= 0)[geometry.triangles[faces]].all(axis=1)
    return (on_bone & (apart <= _ON_TRIANGLE * geometry.mean_edge)).reshape(ends.shape[:2])
