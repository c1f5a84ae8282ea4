"""SliceMorpher: map the fitted template into the muscle, slice by slice."""

import warnings
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import inner_points
from vtkmuscle.core.morphing.isolines import IsolineCourse, attachment_field, morph_by_isolines
from vtkmuscle.core.morphing.slices import Box, Morph, Slicing, morph_by_planes
from vtkmuscle.core.template import angle_to_nearest, areas_are_opposite, superficial_pieces
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array
from vtkmuscle.data.attachments import ROLES, Areas
from vtkmuscle.data.muscle_geometry import MuscleGeometry, Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Deviation of superficial fibres that gives a warning, root mean square [degrees]: straight fibres deviate
#: as much from the tracts of a measured gastrocnemius.
NOTICED = 10.0
#: ``slice_tolerance=None``, as a part of the box's length: 0.3 mm for a muscle of 300 mm.
DEFAULT_TOLERANCE = 1e-3


class SliceMorpher(Filter):
    """Map fibres from box to muscle, section by section.

    ``method="plane"``: a plane across the box's long axis cuts the box in a rectangle and the muscle in a
    contour, divided into four parts that match the rectangle's sides by length; mean value coordinates map
    the rectangle to the contour. In sections with several loops, fibres fill the chain of consecutive loops
    with most of the muscle.

    ``method="harmonic"``: isolines cut the muscle, of a function that is 0 on the origin area, 1 on the
    insertion area and harmonic on the surface between, with positive cotangent weights. Isolines follow a
    bent muscle, and fibres end on the attachment areas.

    ``method="auto"`` takes isolines for a muscle too bent for planes: the main branch has less than 80 % of
    the volume, or more than 15 % of the centre line is at more than 45 degrees to the box's axis. Isolines
    need attachments, and a template with areas at bottom and top; otherwise ``auto`` takes planes, with a
    warning. ``continuity=0`` is the paper's rule for the first corner of a contour.

    Parameters
    ----------
    template
        Fibres in the muscle's box, with the field array ``Transform`` (16, unit cube to box).
    muscle
        The muscle's surface: triangles, closed.
    attachments
        Areas of both roles, for the harmonic method.
    superficial
        Polylines on the muscle's surface, or close to the surface. The angle to the fibres is reported;
        TemplateFitter turns the box to fit.
    method
        Sections: parallel planes, isolines, or the better of the two.
    slice_tolerance
        Largest difference in height of points in a slice; 0 is a slice per height, None a thousandth of the
        box's length.
    continuity
        Part of the muscle's length over which slices resist twisting against each other; 0 matches each slice
        independently.

    Attributes
    ----------
    output
        The fibres in the muscle, with the arrays of the template and the field arrays ``MorphMethod``
        (``plane`` or ``harmonic``), ``PointsOutside`` (number of fibre points, without ends, outside of the
        muscle), ``VolumeShare`` (part of the muscle in the filled branch), ``SteepShare`` (part of the
        planes' branch at more than 45 degrees to the axis, also if isolines were taken; 0 if planes were not
        tried); with superficial fibres ``SuperficialAngle``, to the nearest fibres, root mean square
        [degrees]. Angles above 10 degrees give a warning.

    Raises
    ------
    ValueError
        If the template has no ``Transform``, or a matrix that is not a box; if the muscle is not a closed
        surface of triangles; if the template lies outside of the muscle; if a point is not finite. For the
        harmonic method also if an attachment area is missing, if origin and insertion overlap, or if the
        template's areas are not bottom and top. If the superficial fibres have no length.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
    extended in doi:10.1007/978-3-642-38241-3_3; Kohout, Kukacka 2014, *Real-time modelling of fibrous
    muscle*, doi:10.1111/cgf.12354; Hormann, Floater 2006, *Mean value coordinates for arbitrary planar
    polygons*, doi:10.1145/1183287.1183295.

    Limitations
    -----------
    Points may lie outside of a concave section, and between isolines outside of the muscle: such points are
    counted, and :class:`FibreTrimmer` and :class:`FibreSmoother` move them inside. Narrow parts of a section
    have few fibres until FibreSmoother spreads them. Parallel planes fill a single branch of a forked muscle.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource, SliceMorpher, TemplateFitter
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> template = FibreTemplateSource(n_fibres=10).update().output
    >>> fitted = TemplateFitter()(template, muscle, phantom.attachments[name])
    >>> fibres = SliceMorpher()(fitted, muscle)
    >>> fibres.GetNumberOfCells()
    10
    """

    method = Parameter(str, default="auto", choices=("auto", "plane", "harmonic"))
    slice_tolerance: Parameter[float | None] = Parameter(float, default=None, minimum=0.0, units="mm")
    continuity = Parameter(float, default=0.2, minimum=0.0, maximum=10.0)

    template = ports.Lines()
    muscle = ports.Surface()
    attachments = ports.Areas(optional=True)
    superficial = ports.SeenLines(optional=True)
    output = OutputPort(vtkPolyData)

    def execute(
        self, template: Polylines, muscle: Surface, attachments: Areas | None, superficial: Polylines | None
    ) -> vtkPolyData:
        """Return the fibres in the muscle."""
        box, geometry = _box(template.data), muscle.geometry
        tolerance = self.slice_tolerance
        if tolerance is None:
            tolerance = DEFAULT_TOLERANCE * float(np.linalg.norm(box[:3, 2]))
        upright = _runs_upwards(template.data, box)
        slicing = Slicing(tolerance, self.continuity)

        def morph(method: str) -> Morph:
            if method == "plane":
                return morph_by_planes(template.points, box, geometry.closed, slicing)
            return morph_by_isolines(template.points, box, _course(geometry, attachments), slicing)

        if self.method == "harmonic" and not upright:
            problem = "method='harmonic' needs template areas at bottom and top (parallel, curved, fan)"
            raise InputError("", problem, "use method='plane' for other templates")
        method = "harmonic" if self.method == "harmonic" else "plane"
        result = morph(method)
        steep_share = result.steep_share
        if self.method == "auto" and not result.suits and upright and attachments is not None:
            method, result = "harmonic", morph("harmonic")
        if method == "plane" and not result.suits:
            shares = f"the main branch holds {100 * result.volume_share:.0f} % of it, and "
            shares += f"{100 * result.steep_share:.0f} % of the axis run steeper than 45 degrees to the box's"
            problem = f"the muscle is bent too much for parallel planes: {shares}; use method='harmonic'"
            warnings.warn(f"SliceMorpher: {problem}", stacklevel=2)
        inside = geometry.solids.inside(result.points[inner_points(template.offsets)])
        fields: dict[str, str | float] = {"MorphMethod": method, "PointsOutside": int((~inside).sum())}
        fields |= {"VolumeShare": result.volume_share, "SteepShare": steep_share}
        if superficial is not None:
            seen = superficial_pieces(superficial.points, superficial.offsets, geometry.points)
            angle = float(np.degrees(angle_to_nearest(seen, result.points, template.offsets)))
            if angle > NOTICED:
                problem = f"the superficial fibres deviate by {angle:.0f} degrees from the nearest fibres"
                remedy = "(root mean square); try another template, or another axis of TemplateFitter"
                warnings.warn(f"SliceMorpher: {problem} {remedy}", stacklevel=2)
            fields["SuperficialAngle"] = angle
        return add_arrays(template.moved(result.points), fields=fields)


def _course(geometry: MuscleGeometry, areas: Areas | None) -> IsolineCourse:
    """Return the isolines from the origin to the insertion."""
    if areas is None:
        problem = "method='harmonic' needs attachment areas, but the port 'attachments' is not connected"
        raise InputError("", problem, "connect attachments")
    ends, muscle = tuple(geometry.attached(areas, role) for role in ROLES), geometry.closed
    mesh = muscle.points, muscle.triangles
    return geometry.once("course", ends, lambda: IsolineCourse(muscle, attachment_field(*mesh, *ends)))


def _runs_upwards(template: Any, box: Floats) -> bool:
    """Return whether the template's areas are bottom and top."""
    areas = [field_array(template, name) for name in ("OriginArea", "InsertionArea")]
    if any(area is None or area.ndim != 2 or area.shape[1] != 3 for area in areas):
        return True
    inner = Box(box)
    return areas_are_opposite(*(inner.coordinates(np.asarray(area)) / inner.sides for area in areas))


def _box(template: Any) -> Floats:
    """Return the transform of the unit cube to the box, (4, 4)."""
    values = field_array(template, "Transform")
    if values is None:
        raise InputError("template", "the field array 'Transform' is missing", "run TemplateFitter")
    if values.size == 16 and np.isfinite(values).all():
        box: Floats = np.array(values, dtype=np.float64).reshape(4, 4)
        axes = unit_vectors(box[:3, :3].T)
        if np.array_equal(box[3], [0.0, 0.0, 0.0, 1.0]) and np.abs(axes @ axes.T - np.eye(3)).max() < 1e-6:
            return box
    problem = "the field array 'Transform' is not the matrix of a box: a rotated, scaled cube, row by row"
    raise InputError("template", problem, "run TemplateFitter")
