"""FibreSmoother: smooth fibres and spread them over a muscle."""

from functools import partial

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.spreading import (
    cloud,
    move_ends,
    smooth_about_course,
    smoothing_of,
    steps_to_centres,
)
from vtkmuscle.core.mesh.polylines import inner_points, polyline_lengths, smooth_polylines
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array, field_string
from vtkmuscle.data.attachments import ROLES, Areas
from vtkmuscle.data.muscle_geometry import MuscleGeometry, Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Sample positions in the muscle for spreading: per fibre, and in total at least. By 64 a single fibre in a
#: ball of 10 mm is led 2.3 mm off the middle, by 1024 to 4096 0.6 mm.
SAMPLES, LEAST_SAMPLES = 64, 2048
#: ``spreading`` of fibres that fill the muscle: the step with the fewest passes to even spacing.
SPREADING = 1.5


class FibreSmoother(Filter):
    """Smooth fibres, and spread them over a muscle.

    Each pass moves the inner points to (p_{i-1} + k p_i + p_{i+1}) / (k + 2), which straightens fibres. With
    a muscle connected, the mean course of all fibres is kept, and the deviation of each fibre is smoothed
    (:func:`vtkmuscle.core.fibres.spreading.smooth_about_course`), as far along the fibre as in fibres of 15
    segments, however many segments there are; points outside move to the surface. Each pass then also moves
    every fibre towards the centroid of its Voronoi cell in the muscle (Lloyd's relaxation), by ``spreading``
    times the distance. Fibre ends move along connected attachment areas, and stay without areas. Spreading
    suits parallel fibres, and fibres that were led to the areas; pennate fibres would be drawn into the
    corners.

    Parameters
    ----------
    fibres
        Polylines, any number of points each.
    muscle
        Closed triangles around the fibres.
    attachments
        Areas for the fibre ends to move on during spreading.
    smoothing_passes
        Number of smoothing passes.
    smoothing_weight
        Weight of the middle point; with a muscle connected, in fibres of 15 segments.
    spreading
        Relative step of each pass towards the cell's centroid: 1 is the full distance, 1.5 converges in the
        fewest passes, 0 smooths only. None is 1.5 for parallel fibres (field array ``Template``) and for
        fibres of which half or more were led to new ends (``EndsKept`` of FibreTrimmer); else 0.

    Attributes
    ----------
    output
        The smoothed polylines, with the arrays of the input, and the cell array ``LengthChange`` (n_fibres,):
        length after minus length before [mm].

    Raises
    ------
    ValueError
        If attachments are connected without the muscle, or an area is not on the muscle.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4,
    extended in doi:10.1007/978-3-642-38241-3_3; Lloyd 1982, *Least squares quantization in PCM*,
    doi:10.1109/TIT.1982.1056489.

    Limitations
    -----------
    Smoothing without a muscle shortens curved fibres and may move them outside. Spreading uses 64 sample
    positions per fibre; even spacing is not guaranteed.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource
    >>> fibres = FibreTemplateSource(template="fan", n_fibres=4) >> FibreSmoother(smoothing_passes=2)
    >>> fibres.update().output.GetNumberOfCells()
    4
    """

    smoothing_passes = Parameter(int, default=5, minimum=0, maximum=10_000)
    smoothing_weight = Parameter(float, default=4.0, minimum=0.0, maximum=1000.0)
    spreading: Parameter[float | None] = Parameter(float, default=None, minimum=0.0, maximum=2.0)

    fibres = ports.Lines()
    muscle = ports.Surface(optional=True)
    attachments = ports.Areas(optional=True)
    output = OutputPort(vtkPolyData)

    def execute(self, fibres: Polylines, muscle: Surface | None, attachments: Areas | None) -> vtkPolyData:
        """Return the smoothed fibres."""
        points, offsets = fibres.points, fibres.offsets
        if muscle is not None:
            smoothed = self._in_muscle(fibres, muscle.geometry, attachments)
        elif attachments is not None:
            problem = "attachments are areas on the muscle, but the port 'muscle' is not connected"
            raise InputError("", problem, "connect the muscle")
        else:
            smoothed = smooth_polylines(points, offsets, self.smoothing_weight, self.smoothing_passes)
        change = polyline_lengths(smoothed, offsets) - polyline_lengths(points, offsets)
        return add_arrays(fibres.moved(smoothed), cells={"LengthChange": change})

    def _in_muscle(self, lines: Polylines, geometry: MuscleGeometry, attachments: Areas | None) -> Floats:
        """Return smoothed and spread points, projected into the muscle."""
        spreading = self.spreading
        if spreading is None:
            # Parallel fibres, and fibres led to new ends, lack a course of their own.
            kept = field_array(lines.data, "EndsKept")
            led = kept is not None and float(kept.min()) <= 0.5
            spreading = SPREADING if led or field_string(lines.data, "Template") == "parallel" else 0.0
        areas = [None if attachments is None else geometry.covered(attachments, role) for role in ROLES]
        ends, inner = (lines.offsets[:-1], lines.offsets[1:] - 1), inner_points(lines.offsets)
        count = max(SAMPLES * len(lines), LEAST_SAMPLES) if spreading and self.smoothing_passes else 0
        samples, surface = geometry.samples(count), (geometry.points, geometry.triangles)
        made = partial(cloud, samples, *surface)
        within = geometry.once("cloud", (len(samples),), made) if len(samples) else None
        points, segments = lines.points, len(inner) / max(len(lines), 1) + 1.0
        weight, passes = smoothing_of(segments, self.smoothing_weight)
        for done in range(self.smoothing_passes):
            points = smooth_about_course(points, lines.offsets, weight, passes)
            if within is not None:
                goals = points + spreading * steps_to_centres(points, lines.offsets, within)
                for end, other, area in zip(ends, reversed(ends), areas, strict=True):
                    if area is None:
                        goals[end] = points[end]
                    else:
                        move_ends(goals, end, other, area.onto(goals[end]))
                points = goals
            points[inner] = geometry.solids.into(points[inner])
            self.report_progress((done + 1) / self.smoothing_passes)
        return points
