"""Architecture of muscles from surfaces alone."""

from collections.abc import Sequence

import numpy as np
import pyvista
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.sampling import own_axes
from vtkmuscle.data.arrays import points_of
from vtkmuscle.data.attachments import ROLES, AttachmentArea, attachments_from
from vtkmuscle.filters import FibreSource
from vtkmuscle.run.report_values import architecture_of

#: Part of a muscle's length at each tip that counts as attached where no area is known. With 0.03 to 0.1
#: fascicles of 14 muscles of a hip, a knee and an arm differ by 2 to 14 %.
TIP = 0.1
#: Columns of :func:`architecture_row`.
COLUMNS: tuple[str, ...] = (
    "areas", "fibre_length_mm", "fascicle_from", "fascicle_length_mm", "fascicle_low_mm", "fascicle_high_mm",
    "pennation_origin_deg", "pennation_insertion_deg", "pcsa_mm2", "pcsa_low_mm2", "pcsa_high_mm2",
)  # fmt: skip


def architecture_row(name: str, muscle: vtkPolyData, areas: Sequence[AttachmentArea]) -> list[object]:
    """Return a muscle's architecture, by :data:`COLUMNS`.

    The surface is closed and in mm. Without areas of both roles the muscle is attached at the tips, the
    parts beyond 0.1 and 0.9 of the longest axis: right for slender muscles, too long by up to a factor of two
    for broad ones. ValueError if fibres cannot be made.
    """
    known = {area.role for area in areas}.issuperset(ROLES)
    source = "tips" if not known else "estimated" if any(area.estimated for area in areas) else "landmarks"
    fibres = FibreSource()(muscle, attachments_from(areas if known else areas_at_tips(muscle)))
    measured = architecture_of(fibres, muscle, 1.0, name=name)
    pennations = (measured[f"fascicle_pennation_{end}_deg"]["mean"] for end in ROLES)
    fascicles = measured["fascicle_length_mm"]["mean"], *measured["fascicle_length_range_mm"]
    areas_of = measured["pcsa_without_tendon_mm2"], *measured["pcsa_without_tendon_range_mm2"]
    whole = measured["tendon_length_mm"] + fascicles[0]
    return [source, whole, measured["tendon_from"], *fascicles, *pennations, *areas_of]


def areas_at_tips(muscle: vtkPolyData) -> list[AttachmentArea]:
    """Return areas of both roles: rings round the tips of a surface, the upper one the origin."""
    points = points_of(muscle)
    centre, (axis, *_) = own_axes(points)
    axis = axis if axis[2] >= 0.0 else -axis
    heights = (points - centre) @ axis
    areas = []
    for role, share in zip(ROLES, (1.0 - TIP, TIP), strict=True):
        height = heights.min() + share * np.ptp(heights)
        cut = pyvista.wrap(muscle).slice(axis, origin=centre + height * axis).strip(max_length=len(points))
        ring = max((cut.get_cell(number).points for number in range(cut.n_cells)), key=len)
        areas.append(AttachmentArea(role, "tip", ring[:-1], closed=True, estimated=True))
    return areas
