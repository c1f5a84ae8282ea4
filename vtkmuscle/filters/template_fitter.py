"""TemplateFitter: fit a fibre template around a muscle."""

from functools import partial

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core import template as boxes
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import ROUNDING, Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array, field_string
from vtkmuscle.data.attachments import ROLES, Areas, areas_of_role
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Field arrays with the corners of a template's areas.
_AREAS = "OriginArea", "InsertionArea"


class TemplateFitter(Filter):
    """Map a template's unit cube to a muscle's box.

    The box's z axis is the muscle's axis: with ``axis="attachments"`` the line between the centroids of the
    landmarks, with ``axis="principal"`` the direction of largest variance of the surface points.
    ``axis="auto"`` takes the smaller error: centroids fail for areas beside each other (pennate, bipennate).

    The box of a built-in template, which is its own mirror image, is left-handed where the muscle's longer
    tail says so: mirrored muscles have mirrored fibres. All other boxes are right-handed.

    The box is turned about the axis in steps; the best angle has the shortest distances between the corners
    of the template's areas and the landmarks. Several areas of a role count as a single area. The angle
    between superficial fibres and the closest template fibres also counts: a mean landmark distance of a
    tenth of the muscle's length weighs as much as 6 degrees (root mean square).

    Parameters
    ----------
    template
        Fibres in the unit cube, with the field arrays ``OriginArea`` and ``InsertionArea``.
    muscle
        The muscle's surface, triangles.
    attachments
        Areas of both roles.
    superficial
        Polylines on the muscle's surface, or close to the surface, as a guide for the template's fibres.
    axis
        The rule for the box's long axis.
    angle_step
        Step of the turn about the axis.

    Attributes
    ----------
    output
        The fibres and both field arrays in the box, with the field arrays ``Transform`` (16, row major: unit
        cube to world) and ``FitError`` (sum of distances from the corners of the template's areas to the
        nearest landmarks, in the unit of the points).

    Raises
    ------
    ValueError
        If a role has no attachment area; if the centroids of the landmarks coincide (with
        ``axis="attachments"``); if the template has no areas; if the muscle is flat or has faces other than
        triangles; if a point is not finite.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.2,
    extended in doi:10.1007/978-3-642-38241-3_3.

    Limitations
    -----------
    Rotations are the only degrees of freedom tried, at steps of ``angle_step``; the box always encloses the
    muscle. Two sides are indistinguishable for symmetric areas without superficial fibres.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource, TemplateFitter
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fitter = TemplateFitter(angle_step=10.0)
    >>> fitted = fitter(FibreTemplateSource().update().output, muscle, phantom.attachments[name])
    >>> fitted.GetFieldData().GetArray("Transform").GetNumberOfValues()
    16
    """

    axis = Parameter(str, default="auto", choices=("auto", "attachments", "principal"))
    angle_step = Parameter(float, default=5.0, minimum=0.01, maximum=90.0, units="degrees")

    template = ports.Lines()
    muscle = ports.Surface()
    attachments = ports.Areas()
    superficial = ports.SeenLines(optional=True)
    output = OutputPort(vtkPolyData)

    def execute(
        self, template: Polylines, muscle: Surface, attachments: Areas, superficial: Polylines | None
    ) -> vtkPolyData:
        """Return the fitted template."""
        areas = _area(template.data, _AREAS[0]), _area(template.data, _AREAS[1])
        sides = (areas_of_role(attachments, role) for role in ROLES)
        origin, insertion = (np.vstack([area.landmarks for area in side]) for side in sides)
        landmarks, mirrors = (origin, insertion), field_string(template.data, "Template") in boxes.KINDS
        points, guide = muscle.points[np.flatnonzero(np.bincount(muscle.triangles.ravel()))], None
        if superficial is not None:
            seen = boxes.superficial_pieces(superficial.points, superficial.offsets, points)

            def guide(box: Floats) -> float:
                return boxes.angle_to_nearest(seen, apply_transform(box, template.points), template.offsets)

        def fitted() -> list[boxes.BoxFit]:
            fit = partial(boxes.fit_box, landmarks=landmarks, areas=areas, guide=guide, mirrors=mirrors)
            return [fit(points, axis, angle_step=self.angle_step) for axis in self._axes(points, *landmarks)]

        settings = self.axis, self.angle_step, mirrors, *landmarks, *areas
        fits = fitted() if guide is not None else muscle.geometry.once("boxes", settings, fitted)
        least = min(fit.cost for fit in fits)
        best = next(fit for fit in fits if fit.cost <= least + ROUNDING)
        fields = {"Transform": best.transform.reshape(16), "FitError": best.error}
        for name, area in zip(_AREAS, areas, strict=True):
            fields[name] = apply_transform(best.transform, area)
        return add_arrays(template.moved(apply_transform(best.transform, template.points)), fields=fields)

    def _axes(self, points: Floats, origin: Floats, insertion: Floats) -> list[Floats]:
        """Return the axes to try, (3,) each."""
        axes = []
        if self.axis != "principal":
            try:
                axes.append(boxes.centroid_axis(origin, insertion))
            except ValueError:
                if self.axis == "attachments":
                    raise
        if self.axis != "attachments":
            axes.append(boxes.principal_axis(points, origin, insertion))
        return axes


def _area(template: vtkPolyData | None, name: str) -> Floats:
    values = field_array(template, name)
    if values is None or values.ndim != 2 or values.shape[1] != 3:
        problem = f"the field array {name!r} (3 components: corners of an area in the unit cube) is missing"
        raise InputError("template", problem, "FibreTemplateSource makes it")
    return np.array(values, dtype=np.float64)
