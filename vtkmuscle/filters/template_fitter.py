"""TemplateFitter: put a fibre template around a muscle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.fitting import centroid_axis, fit_box, lie_opposite, principal_axis
from vtkmuscle.core.rigid import apply_transform
from vtkmuscle.filters.arrays import (
    Polylines,
    checked_surface,
    field_array,
    polylines_of,
    set_field_array,
    with_polylines,
)
from vtkmuscle.filters.attachments import AttachmentArea, attachments_of
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.parameters import InputPort, OutputPort, Parameter

Floats = NDArray[np.float64]


class TemplateFitter(Filter):
    """Map the unit cube of a fibre template to the oriented box around a muscle that suits it best.

    The box's z axis is the muscle's axis. By ``axis="attachments"`` that is the line from the centroid of
    the origin's landmarks to the centroid of the insertion's; by ``axis="principal"`` the direction in
    which the surface's points spread most. ``axis="auto"`` takes the former for a template whose areas lie
    above each other in the cube, and the latter for one whose areas lie beside each other (pennate,
    bipennate): there the line between the centroids follows the fibres rather than the muscle. The box is
    turned about this axis step by step, and the angle is kept at which the corners of the template's areas
    are nearest to the landmarks. It is never mirrored. Several areas of one role count as one.

    Raises
    ------
    ValueError
        If a role has no attachment area; if the centroids of the landmarks coincide; if the template has no
        areas; if the muscle is flat or has faces that are not triangles; if a point is not finite.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.2,
    extended in doi:10.1007/978-3-642-38241-3_3.

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

    axis = Parameter(
        str,
        default="auto",
        choices=("auto", "attachments", "principal"),
        doc="What the box's long axis follows.",
    )
    angle_step = Parameter(
        float, default=5.0, above=0.0, maximum=90.0, units="degrees", doc="Step of the turn about the axis."
    )

    template = InputPort(
        vtkPolyData,
        content="template",
        doc="Fibres in the unit cube, with the field arrays ``OriginArea`` and ``InsertionArea``.",
    )
    muscle = InputPort(vtkPolyData, content="muscle", doc="The muscle's surface, triangles.")
    attachments = InputPort(vtkMultiBlockDataSet, content="attachments", doc="Areas of both roles.")
    output = OutputPort(
        vtkPolyData,
        doc="The fibres and the two field arrays in the box, with the field arrays ``Transform`` (16, row "
        "major: unit cube to world) and ``FitError`` (sum of the distances from the corners of the "
        "template's areas to the nearest landmarks, in the unit of the points).",
    )

    def execute(
        self, template: vtkPolyData, muscle: vtkPolyData, attachments: vtkMultiBlockDataSet
    ) -> vtkPolyData:
        """Return the fitted template."""
        lines = polylines_of(template, "TemplateFitter: template")
        origin_area, insertion_area = (_area(template, n) for n in ("OriginArea", "InsertionArea"))
        points, triangles = checked_surface(muscle, "TemplateFitter: muscle")
        points = points[np.bincount(triangles.reshape(-1), minlength=len(points)) > 0]
        areas = attachments_of(attachments, "TemplateFitter: attachments")
        origin, insertion = _landmarks(areas, "origin"), _landmarks(areas, "insertion")
        by_centroids = self.axis == "attachments" or (
            self.axis == "auto" and lie_opposite(origin_area, insertion_area)
        )
        try:
            along = (
                centroid_axis(origin, insertion)
                if by_centroids
                else principal_axis(points, origin, insertion)
            )
            fit = fit_box(
                points,
                along,
                origin=origin,
                insertion=insertion,
                origin_area=origin_area,
                insertion_area=insertion_area,
                angle_step=self.angle_step,
            )
        except ValueError as error:
            raise ValueError(f"TemplateFitter: {error}") from error
        fitted = with_polylines(
            template, Polylines(apply_transform(fit.transform, lines.points), lines.offsets)
        )
        set_field_array(fitted, "OriginArea", apply_transform(fit.transform, origin_area))
        set_field_array(fitted, "InsertionArea", apply_transform(fit.transform, insertion_area))
        set_field_array(fitted, "Transform", fit.transform.reshape(16))
        set_field_array(fitted, "FitError", fit.error)
        return fitted


def _area(template: vtkPolyData, name: str) -> Floats:
    values = field_array(template, name)
    if values is None or values.ndim != 2 or values.shape[1] != 3:
        raise ValueError(
            f"TemplateFitter: template: the field array {name!r} (3 components: corners of an area in the "
            "unit cube) is missing; FibreTemplateSource makes it"
        )
    return np.array(values, dtype=np.float64)


def _landmarks(areas: Sequence[AttachmentArea], role: str) -> Floats:
    mine = [area.landmarks for area in areas if area.role == role]
    if not mine:
        raise ValueError(f"TemplateFitter: attachments: there is no area with the role {role!r}")
    return np.vstack(mine)
