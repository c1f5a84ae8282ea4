"""HarmonicField: a harmonic function on a muscle, from origin to insertion."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.morphing.isolines import attachment_field
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import add_arrays, shallow_copy
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, OutputPort, ports

#: The point array's name.
FIELD = "HarmonicField"


class HarmonicField(Filter):
    """Add the harmonic function from origin (0) to insertion (1).

    The attachment areas are the areas of FixedPointDetector: the landmarks' rings projected to the muscle.
    The Laplacian has cotangent weights, kept positive on bad triangles, so that the function has no extremum
    between the areas and every isoline runs around the muscle. :class:`SliceMorpher` computes the function
    for muscles without the array. The point array passes through the deformer, and remains valid on a moving
    muscle.

    Parameters
    ----------
    muscle
        The muscle's surface, triangles.
    attachments
        Areas of both roles, landmarks near the muscle.

    Attributes
    ----------
    output
        The muscle with the point array ``HarmonicField`` (from 0 at the origin to 1).

    Raises
    ------
    ValueError
        If a role has no area, or an area off the muscle; if the areas of both roles overlap; if no connected
        part of the muscle has both areas.

    References
    ----------
    Kohout, Kukacka 2014, *Real-time modelling of fibrous muscle*, doi:10.1111/cgf.12354.

    Limitations
    -----------
    A muscle with more than two separate areas has one function: all areas of a role have the same value.
    Clamped weights on obtuse triangles make the function less accurate there.

    Examples
    --------
    >>> from vtkmuscle.filters import HarmonicField
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> with_field = HarmonicField()(muscle, phantom.attachments[name])
    >>> with_field.GetPointData().GetArray("HarmonicField").GetRange()
    (0.0, 1.0)
    """

    muscle = ports.Surface()
    attachments = ports.Areas()
    output = OutputPort(vtkPolyData)

    def execute(self, muscle: Surface, attachments: list[AttachmentArea]) -> vtkPolyData:
        """Return the muscle with the function."""
        return add_arrays(shallow_copy(muscle.data), points={FIELD: _computed(muscle, attachments)})


def has_field(muscle: vtkPolyData) -> bool:
    """Return whether a muscle has the harmonic function."""
    return bool(muscle.GetPointData().HasArray(FIELD))


def field_of(muscle: Surface, areas: list[AttachmentArea] | None) -> Floats:
    """Return the harmonic function (n,): stored, or computed from the areas."""
    if has_field(muscle.data):
        field: Floats = np.array(muscle.array(FIELD), dtype=np.float64)
        if field.ndim != 1 or not np.isfinite(field).all() or field.min() < 0.0 or field.max() > 1.0:
            problem = f"the point array {FIELD!r} must have one number in [0, 1] per point"
            raise InputError(muscle.where, problem, "HarmonicField makes it")
        return field
    if areas is None:
        problem = f"no attachments are connected, and the muscle has no point array {FIELD!r}"
        raise InputError("", problem, "connect attachments, or run HarmonicField on the muscle")
    return _computed(muscle, areas)


def _computed(muscle: Surface, areas: list[AttachmentArea]) -> Floats:
    geometry = muscle.geometry
    origin, insertion = (geometry.attached(areas, role) for role in ROLES)
    key = "harmonic field", origin.tobytes(), insertion.tobytes()
    mesh = geometry.points, geometry.triangles
    return geometry.once(key, lambda: attachment_field(*mesh, origin, insertion)).copy()
