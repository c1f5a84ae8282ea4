"""SliceMorpher: from the fitted template into the muscle, slice by slice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.morphing import morph_by_planes
from vtkmuscle.filters.arrays import Polylines, checked_surface, field_array, polylines_of, with_polylines
from vtkmuscle.filters.base import Filter
from vtkmuscle.filters.parameters import InputPort, OutputPort, Parameter

#: ``slice_tolerance=None`` as a part of the box's length.
DEFAULT_TOLERANCE = 1e-3


class SliceMorpher(Filter):
    """Move fibres from the template's box into the muscle, one plane section after the other.

    A plane across the box's long axis cuts the box in a rectangle and the muscle in a contour. The contour
    is split into four parts, one for each side of the rectangle, so that their lengths match best; a fibre
    point's mean value coordinates in the rectangle, applied to the contour, give its place in the muscle.

    Where a section has several loops, the chain of loops that continue each other and enclose most of the
    muscle is followed from end to end: fibres fill this main branch, and never change from one branch to
    another. Fibre parts beyond the end of the branch are squeezed into its tip.

    The contour's point that goes with the rectangle's first corner is, in the paper, the vertex nearest to it
    in each slice. By default it is chosen for all slices together, so that neighbouring contours are not
    twisted against each other; ``continuity=0`` is the paper's rule.

    Sections can be concave, and then a few points may be mapped to just outside of the muscle. A muscle that
    is bent so much that a plane meets it more than once along its course is not filled by this method.

    Raises
    ------
    ValueError
        If the template has no ``Transform``, or one that is not a box; if the muscle is not a closed surface
        of triangles; if the template lies outside of it; if a point is not finite.

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

    method = Parameter(
        str, default="plane", choices=("plane",), doc="How the muscle is sliced: by parallel planes."
    )
    slice_tolerance: Parameter[float | None] = Parameter(
        float,
        default=None,
        minimum=0.0,
        units="mm",
        doc="Points whose heights differ by no more than this share a slice; 0 is a slice for every height, "
        "None a thousandth of the box's length.",
    )
    continuity = Parameter(
        float,
        default=0.2,
        minimum=0.0,
        doc="Part of the box's length over which slices resist being twisted against each other; 0 matches "
        "each slice by itself.",
    )

    template = InputPort(
        vtkPolyData,
        content="fitted template",
        doc="Fibres in the muscle's box, with the field array ``Transform`` (16, unit cube to box).",
    )
    muscle = InputPort(vtkPolyData, content="muscle", doc="The muscle's surface: triangles, closed.")
    attachments = InputPort(
        vtkMultiBlockDataSet, content="attachments", optional=True, doc="Not needed by the plane method."
    )
    output = OutputPort(vtkPolyData, doc="The fibres in the muscle, with the arrays of the template.")

    def execute(
        self, template: vtkPolyData, muscle: vtkPolyData, attachments: vtkMultiBlockDataSet | None
    ) -> vtkPolyData:
        """Return the fibres in the muscle."""
        lines = polylines_of(template, "SliceMorpher: template")
        box = _box(template)
        points, triangles = checked_surface(muscle, "SliceMorpher: muscle")
        tolerance = self.slice_tolerance
        if tolerance is None:
            tolerance = DEFAULT_TOLERANCE * float(np.linalg.norm(box[:3, 2]))
        try:
            moved = morph_by_planes(
                lines.points,
                box,
                points,
                triangles,
                slice_tolerance=tolerance,
                continuity=self.continuity,
                report_progress=self.report_progress,
            )
        except ValueError as error:
            raise ValueError(f"SliceMorpher: {error}") from error
        return with_polylines(template, Polylines(moved, lines.offsets))


def _box(template: vtkPolyData) -> NDArray[np.float64]:
    """Return the transform of the unit cube to the box, (4, 4)."""
    values = field_array(template, "Transform")
    if values is None:
        raise ValueError("SliceMorpher: template: the field array 'Transform' is missing; run TemplateFitter")
    if values.size == 16 and np.isfinite(values).all():
        box: NDArray[np.float64] = np.array(values, dtype=np.float64).reshape(4, 4)
        gram = box[:3, :3].T @ box[:3, :3]
        sides = np.sqrt(np.diag(gram))
        right = sides.min() > 0.0 and np.abs(gram / np.outer(sides, sides) - np.eye(3)).max() < 1e-6
        if right and np.linalg.det(box[:3, :3]) > 0.0 and np.array_equal(box[3], [0.0, 0.0, 0.0, 1.0]):
            return box
    raise ValueError(
        "SliceMorpher: template: the field array 'Transform' is not that of a box: 16 finite numbers, a "
        "right-handed rotation of a cube scaled along its axes, row by row"
    )
