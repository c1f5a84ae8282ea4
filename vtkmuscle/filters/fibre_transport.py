"""FibreTransport: move fibres with their muscle."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.embedding import EmbeddedPoints
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.data.arrays import Polylines, add_arrays
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class FibreTransport(Filter):
    """Move fibres from a muscle at rest into the deformed muscle.

    A fibre point is a weighted mean of the muscle's vertices at rest (mean value coordinates), and moves to
    the same mean of the deformed vertices. Weights are kept while the contents of the rest fibres and the
    rest muscle are the same, so that a frame costs one matrix product. Fibre points outside of the muscle are
    moved and counted.

    All weights of 1600 points on 9878 vertices take 126 MB. With ``weight_tolerance`` groups of vertices with
    similar weights share a weight, and affine motions stay exact; 0.3 keeps a tenth of the weights.
    ``WeightError`` is the cost.

    Parameters
    ----------
    rest_fibres
        Polylines in the muscle at rest.
    rest_muscle
        The muscle at rest, closed, triangles.
    deformed_muscle
        The same points as the muscle at rest, moved.
    weight_tolerance
        Tolerance for merging vertices into groups with a common weight: a larger tolerance is faster, takes
        less memory and is less exact. 0 merges nothing; 0.3 keeps a tenth of the weights.

    Attributes
    ----------
    output
        The moved polylines, with the arrays of the rest fibres and the cell array ``RestLength`` (n_fibres,)
        [mm], and the field arrays ``PointsOutside``, the number of rest fibre points outside of the muscle,
        and ``WeightError`` [mm], the largest error of a fibre point if the muscle is bent by about one
        radian.

    Raises
    ------
    ValueError
        If the rest muscle is not closed; if the muscles have different numbers of points.

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
    rest_muscle = ports.Surface()
    deformed_muscle = ports.Surface()
    output = OutputPort(vtkPolyData)

    times_from = "deformed_muscle"
    _embedded: EmbeddedPoints | None = None

    def execute(self, rest_fibres: Polylines, rest_muscle: Surface, deformed_muscle: Surface) -> vtkPolyData:
        """Return the fibres in the deformed muscle."""
        points, vertices, moved = rest_fibres.points, rest_muscle.points, deformed_muscle.points
        if len(moved) != len(vertices):
            problem = f"deformed_muscle has {len(moved)} points, but rest_muscle has {len(vertices)}"
            raise InputError("", problem, "connect the same mesh, before and after the deformation")
        rest_muscle.closed("but mean value coordinates need a closed muscle")
        inputs = points, vertices, rest_muscle.triangles, self.weight_tolerance
        if self._embedded is None or not self._embedded.same_as(*inputs):
            self._embedded = EmbeddedPoints(*inputs)
        return add_arrays(
            rest_fibres.moved(self._embedded.moved(moved, self.report_progress)),
            cells={"RestLength": polyline_lengths(points, rest_fibres.offsets)},
            fields={"PointsOutside": self._embedded.n_outside, "WeightError": self._embedded.error},
        )
