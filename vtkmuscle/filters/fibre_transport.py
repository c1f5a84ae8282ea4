"""Fibres in a deformed muscle: moved with it, and with the tendons at their ends held."""

from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.embedding import EmbeddedPoints, Tendons
from vtkmuscle.core.mesh.triangle_tree import shared_tree
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.data.arrays import Polylines, add_arrays
from vtkmuscle.data.muscle_geometry import ROUGHNESS, Surface
from vtkmuscle.data.paths import PathLines
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class FibreTransport(Filter):
    """Move fibres from a muscle at rest into the deformed muscle.

    A fibre point is a weighted mean of the muscle's vertices at rest (mean value coordinates), and moves to
    the same mean of the deformed vertices. Weights are kept while rest fibres and rest muscle are the same.
    All weights of 1600 points on 9878 vertices take 126 MB. With ``weight_tolerance`` groups of vertices with
    similar weights share a weight, and affine motions stay exact; ``WeightError`` is the cost.

    Parameters
    ----------
    rest_fibres
        Polylines in the muscle at rest.
    rest_muscle
        The muscle at rest, closed, triangles.
    deformed_muscle
        The same points as the muscle at rest, moved.
    weight_tolerance
        Tolerance for merging vertices into groups with a common weight. 0 merges nothing; 0.3 keeps a tenth
        of the weights.

    Attributes
    ----------
    output
        The moved polylines, with the arrays of the rest fibres and the cell array ``RestLength`` (n_fibres,)
        [mm], and the field arrays ``PointsOutside``, the number of rest fibre points outside of the muscle,
        and ``WeightError`` [mm], the largest error of a fibre point if the muscle is bent by a radian.

    Raises
    ------
    ValueError
        If the rest muscle is not closed; if the muscles have different numbers of points or triangles.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*, eq. 8,
    doi:10.1007/978-3-030-72379-8_24; Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular
    meshes*, doi:10.1145/1073204.1073229.

    Limitations
    -----------
    Mean value coordinates ignore fibres: a fibre's length follows the surface alone. A fibre may leave a
    strongly bent muscle. Weights may be negative in concave muscles.

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

    rest_fibres = ports.Lines()
    rest_muscle = ports.RestSurface()
    deformed_muscle = ports.Surface()
    output = OutputPort(vtkPolyData)

    times_from = "deformed_muscle"

    def execute(self, rest_fibres: Polylines, rest_muscle: Surface, deformed_muscle: Surface) -> vtkPolyData:
        """Return the fibres in the deformed muscle."""
        points, vertices, moved = rest_fibres.points, rest_muscle.points, deformed_muscle.points
        rest_muscle.closed("but mean value coordinates need a closed muscle")
        _check_same(rest_muscle, deformed_muscle)
        inputs = points, vertices, rest_muscle.triangles, self.weight_tolerance
        embedded = self.once("embedded", inputs, EmbeddedPoints)
        result = rest_fibres.moved(embedded.moved(moved, self.report_progress))
        cells = {"RestLength": rest_fibres.lengths}
        fields = {"PointsOutside": embedded.n_outside, "WeightError": embedded.error}
        return add_arrays(result, cells=cells, fields=fields)


class StiffTendons(Filter):
    """Keep fibre ends at a constant distance from their bones.

    A tendon is 3.3 % longer at its muscle's largest force (Zajac 1989, *Muscle and tendon*, Critical Reviews
    in Biomedical Engineering 17, 359-411), while fibres may shorten by half. The distance is measured along
    the muscle's paths, between a fibre end and the bone. Ends on a part of the muscle fixed to a bone stay
    with the part. Straight fibres at rest stay straight. Points farther outside of the deformed muscle than
    at rest are moved back towards the muscle.

    Parameters
    ----------
    fibres
        The fibres in the deformed muscle, from FibreTransport.
    rest_fibres
        The fibres at rest, between aponeuroses, with equal numbers of points.
    rest_muscle
        The muscle at rest; with the point array ``FixedTo``, ends on fixed triangles are detected.
    deformed_muscle
        The deformed muscle.
    paths
        The paths of the muscle in the pose, from TautPaths.

    Attributes
    ----------
    output
        The fibres with their arrays.

    Raises
    ------
    ValueError
        If fibres differ in their numbers of points; if there are no paths.

    Limitations
    -----------
    Tendons have no strain: the whole change of a path's length is the change of the fibre's length. Fibres
    need equal numbers of points.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import MusclePipeline
    >>> phantom = spindle_over_hinge()
    >>> muscle, areas = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> pipeline = MusclePipeline(
    ...     muscle, phantom.bones, phantom.motion, areas, fixing={}, fibres={"n_fibres": 8}
    ... )
    >>> from vtkmuscle.filters import FibreTransport, StiffTendons
    >>> moved = FibreTransport(
    ...     rest_fibres=pipeline.fibres, rest_muscle=pipeline.fixed, deformed_muscle=pipeline.deformer
    ... )
    >>> held = StiffTendons(
    ...     fibres=moved, rest_fibres=pipeline.fibres, rest_muscle=pipeline.fixed,
    ...     deformed_muscle=pipeline.deformer, paths=pipeline.taut_paths,
    ... )
    >>> held.update(time=20.0).output.GetNumberOfCells()
    8
    """

    fibres = ports.Lines()
    rest_fibres = ports.Lines()
    rest_muscle = ports.RestSurface()
    deformed_muscle = ports.Surface()
    paths = ports.Paths()
    output = OutputPort(vtkPolyData)

    def execute(
        self, fibres: Polylines, rest_fibres: Polylines, rest_muscle: Surface, deformed_muscle: Surface,
        paths: PathLines | None,
    ) -> vtkPolyData:  # fmt: skip
        """Return the fibres with their ends held."""
        if paths is None:
            raise InputError("paths", "the data set has no paths", "fix the muscle to two bones")
        if not np.array_equal(fibres.offsets, rest_fibres.offsets):
            problem = "numbers of points differ from rest_fibres"
            raise InputError("fibres", problem, "connect the same fibres, at rest and moved")
        _check_same(rest_muscle, deformed_muscle)
        lines = rest_fibres.stacked("rest_fibres", "FibreSource makes such fibres")

        array = rest_muscle.data.GetPointData().GetArray("FixedTo")
        fixed_to = np.full(len(rest_muscle.points), -1) if array is None else np.array(array)

        def tendons(lines: Floats, paths: Floats, *_: Any) -> Tendons:
            return Tendons(lines, paths, _on_bone(rest_muscle, fixed_to, lines[:, [0, -1]]))

        at_rest = lines, paths.rest, rest_muscle.points, rest_muscle.triangles, fixed_to
        held = self.once("tendons", at_rest, tendons)
        moved = held.placed(fibres.points.reshape(lines.shape), paths.points).reshape(-1, 3)
        inputs = rest_fibres.points, rest_muscle.points, rest_muscle.triangles, 0.0
        self.once("embedded", inputs, EmbeddedPoints).keep_within(moved, deformed_muscle.points)
        self.report_progress(1.0)
        return fibres.moved(moved)


def _check_same(rest: Surface, deformed: Surface) -> None:
    """Raise an InputError for different numbers of points, or other triangles."""
    own, other = len(deformed.points), len(rest.points)
    if own != other or not np.array_equal(deformed.triangles, rest.triangles):
        problem = f"deformed_muscle, of {own} points, has other triangles than rest_muscle, of {other}"
        raise InputError("", problem, "connect the same mesh, before and after the deformation")


def _on_bone(muscle: Surface, fixed_to: Ints, ends: Floats) -> Bools:
    """Return a mask of ends (k, 2, 3) on triangles of fixed points."""
    geometry = muscle.geometry
    faces, _, apart = shared_tree(geometry.points, geometry.triangles).nearest(ends.reshape(-1, 3))
    on_bone = (fixed_to >= 0)[geometry.triangles[faces]].all(axis=1)
    return (on_bone & (apart <= ROUGHNESS * geometry.mean_edge)).reshape(ends.shape[:2])
