"""FibreTransport: carry fibres along with the muscle they are in."""

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
from vtkmuscle.data.arrays import Polylines, field_array, set_cell_array, set_field_array
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.data.paths import PATH_POINTS, add_paths
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports

#: Fibre points whose weights are computed together: bounds the steps of progress and the time to abort.
_BLOCK = 256
#: Weights are kept up to this size [bytes]; beyond it they are computed again for each frame.
_LARGEST_CACHE = 2**31
#: Points nearer to the surface than this part of the muscle's size do not count as outside.
_ON_SURFACE = 1e-6
#: An end of a fibre nearer to a triangle than this part of the mean edge is on it.
_ON_TRIANGLE = 0.1


@dataclass(eq=False)
class _Rest:
    """What weights belong to, and those that were kept: all, block by block, or the sparse ones."""

    fibre_points: Floats
    points: Floats
    triangles: Ints
    weight_tolerance: float
    gap: Floats | None = None
    sparse: SparseWeights | None = None
    weights: dict[int, Floats] = field(default_factory=dict)
    size: int = 0
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
        """Of the muscle at rest."""
        return shared_tree(self.points, self.triangles)

    @cached_property
    def slack(self) -> float:
        """How far from the surface points do not count as outside [mm]."""
        return _ON_SURFACE * float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def error(self) -> float:
        """What the weights err by at most [mm]."""
        return 0.0 if self.sparse is None else self.sparse.error

    def moved(self, deformed: Floats, report: Callable[[float], None]) -> Floats:
        """Return the fibre points in the deformed vertices; `report` is called with the part that is done."""
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
        """Move fibre points (p, 3) to the surface (n, 3) that are farther outside of it than at rest.

        Which are outside follows from parity: the nearest triangle of a muscle that touches itself may be
        that of the other side.
        """
        assert self.gap is not None
        self.bent = tree_of_deformed(self.tree, surface, self.triangles)
        outside = np.flatnonzero(~points_inside(fibre_points, self.bent))
        _, nearest, distances = self.bent.nearest(fibre_points[outside])
        far = distances > self.gap[outside]
        out, nearest = outside[far], nearest[far]
        part = (self.gap[out] / distances[far])[:, None]
        fibre_points[out] = nearest + part * (fibre_points[out] - nearest)

    def _of_block(self, first: int) -> Floats:
        """Return all weights of the block of fibre points from number `first` on."""
        kept = self.weights.get(first)
        if kept is not None:
            return kept
        block = self.fibre_points[first : first + _BLOCK]
        weights = mean_value_coordinates(self.points, self.triangles, block)
        if self.size + weights.nbytes <= _LARGEST_CACHE:
            self.weights[first] = weights
            self.size += weights.nbytes
        return weights


class FibreTransport(Filter):
    """Carry fibres from a muscle at rest into the deformed muscle.

    With ``method="carried"`` fibres go where the taut fibres of PBDDeformer are, moved on by what its solve
    moved the surface from there: mean value coordinates take that to the fibre's points. Points that come to
    lie outside of the deformed muscle, farther than at rest, go to the nearest place on it. It needs the
    arrays ``Carried`` and ``FibrePoints`` of PBDDeformer for the very same fibres; where they are not there,
    ``"mean-value"`` takes the place.

    With ``rest_paths``, for fibres between aponeuroses, their ends stay as far from their bones along the
    muscle's paths as at rest, for tendon is stiff, but for those on a part of the muscle that is fixed
    to a bone, which go with that. Fibres that are straight at rest stay straight.

    With ``method="mean-value"``, that of the paper, each fibre point is expressed by mean value coordinates
    in the vertices of the muscle at rest; the same weighted mean of the deformed vertices is where it has
    moved. The weights are kept for as long as the rest fibres and the rest muscle are the same (in content),
    so that a frame costs one matrix product. Fibre points outside of the muscle are carried along as well,
    and counted.

    All weights of 1600 points on 9878 vertices take 126 MB. With ``weight_tolerance`` groups of vertices
    whose weights are much the same have one weight, and affine motions stay exact; 0.3 keeps one in ten.
    What that costs is in ``WeightError``: the largest error of a fibre point if the muscle is bent by about
    one radian.

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
        For fibres between aponeuroses: the lines at rest that the muscle was deformed with, from bone to
        bone. The fibres' ends stay as far along them from their bones as they are at rest.
    weight_tolerance
        Tolerance for merging vertices into groups that share one weight: with a larger one transport is
        faster, takes less memory and is less exact. 0 merges nothing; 0.3 keeps one weight in ten.
    method
        What fibres follow: the taut fibres that the muscle was deformed with, or its surface alone.

    Attributes
    ----------
    output
        The moved polylines, with the arrays of the rest fibres and the cell array ``RestLength`` (n_fibres,)
        [mm], and the field arrays ``PointsOutside``, the number of rest fibre points that are outside of the
        muscle, and ``WeightError`` [mm]. With the arrays of the muscle's paths, where the deformed muscle or
        the taut fibres have them: ``PathLength``, ``PathPoints`` and ``PathWrench_BONE``
        (:mod:`vtkmuscle.data.paths`).

    Raises
    ------
    ValueError
        If there are no fibres, if a muscle is no triangle mesh or the rest muscle is not closed, if a
        coordinate is not finite, if the deformed muscle has not as many points as the muscle at rest, or if
        ``paths`` are not one for each fibre.

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
        rest = self._rest_of(points, rest_muscle.points, rest_muscle.triangles)
        carried = self._carried(deformed_muscle, len(points))
        surface, fibre_points = (0.0, 0.0) if carried is None else carried
        moved = fibre_points + rest.moved(deformed - surface, self.report_progress)
        if rest.gap is None:
            rest.gap = np.linalg.norm(rest_muscle.geometry.solids.into(points) - points, axis=1)
        if rest_paths is not None:
            moved = self._held(moved, rest_fibres, rest_paths, rest_muscle, deformed_muscle)
        if carried is not None or rest_paths is not None:
            rest.keep_within(moved, deformed)
        result = rest_fibres.moved(moved)
        set_cell_array(result, "RestLength", polyline_lengths(points, rest_fibres.offsets))
        set_field_array(result, "PointsOutside", int((rest.gap > rest.slack).sum()))
        set_field_array(result, "WeightError", rest.error)
        add_paths(result, deformed_muscle.data, paths, "paths")
        return result

    def _carried(self, muscle: Surface, count: int) -> tuple[Floats, Floats] | None:
        """Return where taut fibres carry the surface and `count` fibre points; None where that is unknown."""
        if self.method != "carried" or not muscle.data.GetPointData().HasArray("Carried"):
            return None
        points = field_array(muscle.data, "FibrePoints")
        if points is None or points.shape != (count, 3):
            return None
        return np.array(muscle.array("Carried"), dtype=np.float64), np.array(points, dtype=np.float64)

    def _held(
        self,
        moved: Floats,
        fibres: Polylines,
        lines: Polylines,
        rest: Surface,
        muscle: Surface,
    ) -> Floats:
        """Return the fibres' points (p, 3) with their ends held by tendons."""
        now = field_array(muscle.data, PATH_POINTS)
        if now is None or len(now) != len(lines):
            return moved  # deformed without paths, as by the published solver
        now = np.asarray(now, dtype=np.float64).reshape(len(lines), -1, 3)
        counts = np.unique(np.diff(fibres.offsets))
        if len(counts) > 1:
            raise InputError(
                "rest_fibres",
                f"they have {counts[0]} to {counts[-1]} points each, but with rest_paths as many each",
                "FibreSource makes such fibres",
            )
        known = fibres.points, lines.points
        if self._tendons is None or not all(map(np.array_equal, self._tendons[0], known)):
            even = evenly_spaced(lines.points, lines.offsets, now.shape[1])
            shape = fibres.points.reshape(len(fibres), -1, 3)
            self._tendons = known, Tendons(shape, even, _fixed(rest, shape[:, [0, -1]]))
        held = self._tendons[1].held(moved.reshape(len(fibres), -1, 3), now)
        return held.reshape(-1, 3)

    def _rest_of(self, fibre_points: Floats, points: Floats, triangles: Ints) -> _Rest:
        # Comparing content costs a hundredth of a frame, and unlike comparing modification times it is right
        # for inputs that were copied, or changed behind VTK's back through a numpy view.
        if self._rest is None or not self._rest.is_of(fibre_points, points, triangles, self.weight_tolerance):
            self._rest = _Rest(fibre_points, points, triangles, self.weight_tolerance)
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
