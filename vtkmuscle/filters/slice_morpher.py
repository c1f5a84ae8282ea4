"""SliceMorpher: from the fitted template into the muscle, slice by slice."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.morphing.isolines import morph_by_isolines
from vtkmuscle.core.morphing.planes import morph_by_planes
from vtkmuscle.core.morphing.slices import Box, Morph, Slicing
from vtkmuscle.core.template.fitting import angle_to_nearest, areas_are_opposite, superficial_pieces
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports
from vtkmuscle.filters.harmonic_field import field_of, has_field

#: Deviation of superficial fibres from which on a warning is given, root mean square [degrees].
NOTICED = 10.0
#: ``slice_tolerance=None`` as a part of the box's length.
DEFAULT_TOLERANCE = 1e-3


class SliceMorpher(Filter):
    """Move fibres from the template's box into the muscle, one section after the other.

    By ``method="plane"`` a plane across the box's long axis cuts the box in a rectangle and the muscle in a
    contour. The contour is split into four parts, one for each side of the rectangle, so that their lengths
    match best, and the rectangle is mapped to the contour by mean value coordinates. Where a section has
    several loops, fibres fill the chain of loops that continue each other and enclose most of the muscle, and
    never change from one branch to another. Fibre parts beyond the end of this main branch are squeezed into
    its tip.

    By ``method="harmonic"`` the muscle is cut along isolines of a function that is 0 on the origin area, 1 on
    the insertion area and harmonic on the surface between them, as many as there are planes through the
    template: they follow a muscle however it bends. The function is the muscle's point array
    ``HarmonicField`` (of :class:`HarmonicField`), or else is computed from the attachments. The ends of
    fibres lie on the attachment areas.

    ``method="auto"`` takes isolines for a muscle that is too bent for parallel planes: at 16 heights, the
    main branch holds less than 80 % of the muscle's volume, or its centre line runs at more than 45 degrees
    to the box's axis over more than 15 % of its length. It needs attachments or the function for that, and a
    template whose areas are its bottom and its top; else it takes planes, with a warning. The choice is in
    ``MorphMethod``.

    Points may come to lie outside of a concave section, and isolines are not flat, so that the surface may be
    on either side of a point between them. These points are counted; :class:`FibreTrimmer` and
    :class:`FibreSmoother` put them in. Narrow parts of a section get next to no fibres;
    :class:`FibreSmoother` with the muscle connected fills them.

    The contour's point that corresponds to the rectangle's first corner is, in the paper, the vertex nearest
    to it in each slice. By default it is a new vertex, chosen for all slices together, so that neighbouring
    contours are not twisted against each other; ``continuity=0`` is the paper's rule.

    Parameters
    ----------
    template
        Fibres in the muscle's box, with the field array ``Transform`` (16, unit cube to box).
    muscle
        The muscle's surface: triangles, closed; optionally with the point array ``HarmonicField``.
    attachments
        Areas of both roles; for the harmonic method only, of a muscle without ``HarmonicField``.
    superficial
        Polylines on the muscle's surface, or near it. Their angle to the fibres is reported; it is
        TemplateFitter that turns the box to suit them.
    method
        How the muscle is sliced: by parallel planes, along isolines, or whichever suits it.
    slice_tolerance
        Points whose heights differ by no more than this share a slice; 0 is a slice for every height, None a
        thousandth of the box's length.
    continuity
        Part of the muscle's length over which slices resist being twisted against each other; 0 matches each
        slice by itself.

    Attributes
    ----------
    output
        The fibres in the muscle, with the arrays of the template and the field arrays ``MorphMethod``
        (``plane`` or ``harmonic``), ``PointsOutside`` (by planes: points that the map put outside of their
        section; along isolines: outside of the muscle), ``SplitError`` (largest deviation of a section's four
        parts from the rectangle's sides, as a part of its perimeter), ``VolumeShare`` (part of the muscle in
        the branch that the fibres fill), ``SteepShare`` (part of the planes' branch at more than 45 degrees
        to their axis, also where it is why isolines were taken; 0 where planes were not tried); with
        superficial fibres ``SuperficialAngle``, between them and the nearest fibres, root mean square
        [degrees]. Where that is more than 10 degrees there is a warning.

    Raises
    ------
    ValueError
        If the template has no ``Transform``, or one that is not a box; if the muscle is not a closed surface
        of triangles; if the template lies outside of it; if a point is not finite. By the harmonic method
        also if an attachment area is missing, or the origin and the insertion overlap, or the template's
        areas are not its bottom and top. If the superficial fibres have no length.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.3,
    extended in doi:10.1007/978-3-642-38241-3_3; Hormann, Floater 2006, *Mean value coordinates for
    arbitrary planar polygons*, doi:10.1145/1183287.1183295.

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
        self,
        template: Polylines,
        muscle: Surface,
        attachments: list[AttachmentArea] | None,
        superficial: Polylines | None,
    ) -> vtkPolyData:
        """Return the fibres in the muscle."""
        box, geometry = _box(template.data), muscle.geometry
        tolerance = self.slice_tolerance
        if tolerance is None:
            tolerance = DEFAULT_TOLERANCE * float(np.linalg.norm(box[:3, 2]))
        upright = _runs_upwards(template.data, box)
        slicing = Slicing(tolerance, self.continuity, self.report_progress)

        def morph(method: str) -> Morph:
            shape = (template.points, box, geometry.closed)
            if method == "plane":
                return morph_by_planes(*shape, slicing)
            return morph_by_isolines(*shape, field_of(muscle, attachments), slicing)

        if self.method == "harmonic" and not upright:
            raise InputError(
                "",
                "method='harmonic' needs a template whose areas are its bottom and its top, as of the kinds "
                "parallel, curved and fan",
                "use method='plane' for this one",
            )
        method = "harmonic" if self.method == "harmonic" else "plane"
        result = morph(method)
        known = attachments is not None or has_field(muscle.data)
        steep_share = result.steep_share
        if self.method == "auto" and not result.suits and upright and known:
            method, result = "harmonic", morph("harmonic")
        _warn(result, method)
        fields: dict[str, str | float] = {
            "MorphMethod": method,
            "PointsOutside": result.n_outside,
            "SplitError": result.split_error,
            "VolumeShare": result.volume_share,
            "SteepShare": steep_share,
        }
        if superficial is not None:
            seen = superficial_pieces(superficial.points, superficial.offsets, geometry.points)
            angle = float(np.degrees(angle_to_nearest(seen, result.points, template.offsets)))
            _warn_of_superficial(angle)
            fields["SuperficialAngle"] = angle
        return add_arrays(template.moved(result.points), fields=fields)


def _warn(result: Morph, method: str) -> None:
    """Warn where planes do not suit the muscle."""
    if method == "plane" and not result.suits:
        warnings.warn(
            "SliceMorpher: the muscle is bent too much for parallel planes: their main branch holds "
            f"{100 * result.volume_share:.0f} % of it, and {100 * result.steep_share:.0f} % of its course "
            "run at more than 45 degrees to the box's axis; use method='harmonic'",
            stacklevel=2,
        )


def _warn_of_superficial(angle: float) -> None:
    """Warn where superficial fibres run otherwise than the fibres beside them."""
    if angle > NOTICED:
        warnings.warn(
            f"SliceMorpher: the superficial fibres deviate by {angle:.0f} degrees from the fibres next to "
            "them (root mean square); another template, or another axis of TemplateFitter, may do better",
            stacklevel=3,
        )


def _runs_upwards(template: vtkPolyData | None, box: Floats) -> bool:
    """Return False for a template with areas that are not its bottom and its top."""
    areas = [field_array(template, name) for name in ("OriginArea", "InsertionArea")]
    if any(area is None or area.ndim != 2 or area.shape[1] != 3 for area in areas):
        return True
    inner = Box(box)
    origin, insertion = (inner.coordinates(np.asarray(area)) / inner.sides for area in areas)
    return areas_are_opposite(origin, insertion)


def _box(template: vtkPolyData | None) -> NDArray[np.float64]:
    """Return the transform of the unit cube to the box, (4, 4)."""
    values = field_array(template, "Transform")
    if values is None:
        raise InputError("template", "the field array 'Transform' is missing", "run TemplateFitter")
    if values.size == 16 and np.isfinite(values).all():
        box: NDArray[np.float64] = np.array(values, dtype=np.float64).reshape(4, 4)
        gram = box[:3, :3].T @ box[:3, :3]
        sides = np.sqrt(np.diag(gram))
        right = sides.min() > 0.0 and np.abs(gram / np.outer(sides, sides) - np.eye(3)).max() < 1e-6
        if right and np.array_equal(box[3], [0.0, 0.0, 0.0, 1.0]):
            return box
    raise InputError(
        "template",
        "the field array 'Transform' is not that of a box: 16 finite numbers, a rotation (or reflection) of "
        "a cube scaled along its axes, row by row",
        "run TemplateFitter",
    )
