"""Attachment areas within a muscle: aponeuroses and tendons that its fibres end on, not its surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.attachments.rings import discs_over
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.data.muscle_geometry import MuscleGeometry


def inner_areas(areas: Sequence[AttachmentArea], geometry: MuscleGeometry) -> tuple[Floats, Ints]:
    """Return triangles (m, 3) that span those rings of landmarks which are within a muscle, and points.

    That is, more than half of what a ring spans is deeper in the muscle than the mean length of its edges.
    """

    def within(ring: Floats) -> bool:
        points, triangles = discs_over([ring])
        depths = geometry.solids.depth(points[triangles].mean(axis=1))
        return bool(len(depths) and np.median(depths) > geometry.mean_edge)

    return discs_over([area.landmarks for area in areas if area.closed and within(area.landmarks)])
