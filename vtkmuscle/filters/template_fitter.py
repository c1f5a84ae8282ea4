"""TemplateFitter: put a fibre template around a muscle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.template.fitting import (
    TIE,
    BoxFit,
    SuperficialFibres,
    angle_to_nearest,
    centroid_axis,
    fit_box,
    principal_axis,
    superficial_pieces,
)
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class TemplateFitter(Filter):
    """Map the unit cube of a fibre template to the oriented box around a muscle that suits it best.

    The box's z axis is the muscle's axis. By ``axis="attachments"`` that is the line from the centroid of
    the origin's landmarks to the centroid of the insertion's; by ``axis="principal"`` the direction in
    which the surface's points spread most. ``axis="auto"`` tries both and keeps the one with the smaller
    error. The first rule fails where an attachment's centroid is not on it, and where areas lie beside each
    other (pennate, bipennate), so that the line follows the fibres rather than the muscle.

    The box is turned about this axis step by step, and the angle is kept at which the corners of the
    template's areas are nearest to the landmarks. Several areas of one role count as one.

    Where superficial fibres are connected, boxes are also judged by the angle between them and the template's
    fibres next to them: a mean distance from the landmarks of a tenth of the muscle's length counts as much
    as an angle of 6 degrees (root mean square). That decides to which side fibres lean or arch where
    landmarks leave it open.

    Only rotations are tried. ``mirror=True`` is for the muscle of the other side of the body: it gives the
    mirror image of the fit to the mirrored muscle.

    Parameters
    ----------
    template
        Fibres in the unit cube, with the field arrays ``OriginArea`` and ``InsertionArea``.
    muscle
        The muscle's surface, triangles.
    attachments
        Areas of both roles.
    superficial
        Polylines on the muscle's surface, or near it, that the template's fibres are to follow.
    axis
        The rule for the box's long axis.
    angle_step
        Step of the turn about the axis.
    mirror
        Mirror the template.

    Attributes
    ----------
    output
        The fibres and the two field arrays in the box, with the field arrays ``Transform`` (16, row major:
        unit cube to world) and ``FitError`` (sum of the distances from the corners of the template's areas to
        the nearest landmarks, in the unit of the points).

    Raises
    ------
    ValueError
        If a role has no attachment area; if the centroids of the landmarks coincide (by
        ``axis="attachments"``); if the template has no areas; if the muscle is flat or has faces that are not
        triangles; if a point is not finite.

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

    axis = Parameter(str, default="auto", choices=("auto", "attachments", "principal"))
    angle_step = Parameter(float, default=5.0, minimum=0.01, maximum=90.0, units="degrees")
    mirror = Parameter(bool, default=False)

    template = ports.Lines()
    muscle = ports.Surface()
    attachments = ports.Areas()
    superficial = ports.SeenLines(optional=True)
    output = OutputPort(vtkPolyData)

    def execute(
        self,
        template: Polylines,
        muscle: Surface,
        attachments: list[AttachmentArea],
        superficial: Polylines | None,
    ) -> vtkPolyData:
        """Return the fitted template."""
        areas = _area(template.data, "OriginArea"), _area(template.data, "InsertionArea")
        # The mirror image of the fit to the mirrored muscle.
        reflection = np.diag([-1.0, 1.0, 1.0, 1.0]) if self.mirror else np.eye(4)
        origin, insertion = (apply_transform(reflection, _landmarks(attachments, role)) for role in ROLES)
        geometry = muscle.geometry

        def points() -> Floats:
            uses = np.bincount(geometry.triangles.reshape(-1), minlength=len(geometry.points))
            return apply_transform(reflection, geometry.points[uses > 0])

        landmarks = origin, insertion
        if superficial is not None:
            mirrored = apply_transform(reflection, superficial.points)
            shape = points()
            seen = superficial_pieces(mirrored, superficial.offsets, shape)
            fits = self._fits(shape, landmarks, areas, partial(_angle, seen, template))
        else:  # boxes that do not depend on the template's fibres
            settings = self.axis, self.angle_step, self.mirror
            arrays = (*landmarks, *areas)
            key = "boxes", settings, *(np.ascontiguousarray(array).tobytes() for array in arrays)
            fits = geometry.once(key, lambda: self._fits(points(), landmarks, areas, None))
        least = min(fit.cost for fit in fits)
        best = next(fit for fit in fits if fit.cost <= least + TIE)
        transform = reflection @ best.transform
        return add_arrays(
            template.moved(apply_transform(transform, template.points)),
            fields={
                "OriginArea": apply_transform(transform, areas[0]),
                "InsertionArea": apply_transform(transform, areas[1]),
                "Transform": transform.reshape(16),
                "FitError": best.error,
            },
        )

    def _axes(self, points: Floats, origin: Floats, insertion: Floats) -> list[Floats]:
        """Return the axes to try, (3,) each."""
        axes = []
        if self.axis != "principal":
            try:
                axes.append(centroid_axis(origin, insertion))
            except ValueError:
                if self.axis == "attachments":
                    raise
        if self.axis != "attachments":
            axes.append(principal_axis(points, origin, insertion))
        return axes

    def _fits(
        self,
        points: Floats,
        landmarks: tuple[Floats, Floats],
        areas: tuple[Floats, Floats],
        guide: Callable[[Floats], float] | None,
    ) -> list[BoxFit]:
        """Return the best box for each axis; ``guide`` gives the angle of superficial fibres in a box."""
        return [
            fit_box(points, axis, landmarks=landmarks, areas=areas, angle_step=self.angle_step, guide=guide)
            for axis in self._axes(points, *landmarks)
        ]


def _angle(seen: SuperficialFibres, lines: Polylines, box: Floats) -> float:
    """Return the angle between superficial fibres and those of a template in a box."""
    return angle_to_nearest(seen, apply_transform(box, lines.points), lines.offsets)


def _area(template: vtkPolyData | None, name: str) -> Floats:
    values = field_array(template, name)
    if values is None or values.ndim != 2 or values.shape[1] != 3:
        raise InputError(
            "template",
            f"the field array {name!r} (3 components: corners of an area in the unit cube) is missing",
            "FibreTemplateSource makes it",
        )
    return np.array(values, dtype=np.float64)


def _landmarks(areas: Sequence[AttachmentArea], role: str) -> Floats:
    mine = [area.landmarks for area in areas if area.role == role]
    if not mine:
        raise InputError("attachments", f"there is no area with the role {role!r}", "add its landmarks")
    return np.vstack(mine)
