"""The shape report of deformers: field arrays, and figures of a frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from vtkmuscle.core.mesh.rest_shape import ShapeReport
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array

#: Field arrays of a shape report.
SHAPE = {
    "VolumeRatio": "volume_ratio",
    "EdgeStretchP95": "edge_stretch_p95",
    "EdgeStretchMax": "edge_stretch_max",
    "DihedralErrorP95": "dihedral_error_p95",
    "DegenerateEdges": "degenerate_edges",
}
#: Keys of a row of figures, by field array.
FIGURES = SHAPE | {
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}


def shape_fields(shape: ShapeReport) -> dict[str, float]:
    """Return the field arrays of a shape report."""
    return {name: getattr(shape, attribute) for name, attribute in SHAPE.items()}


def penetration_fields(depths: Floats) -> dict[str, float]:
    """Return the field arrays of penetration depths (f,)."""
    return {
        "PenetrationMax": float(depths.max(initial=0.0)),
        "PenetrationP95": float(np.percentile(depths, 95)) if len(depths) else 0.0,
        "PenetratingPoints": int((depths > 0.0).sum()),
    }


def read_shape(deformed: Any, millimetres: float = 1.0) -> dict[str, float]:
    """Return the figures of a deformed muscle by key, lengths in millimetres."""
    row: dict[str, float] = {}
    for name, key in FIGURES.items():
        if (array := field_array(deformed, name)) is not None:
            row[key] = array[-1].item() * (millimetres if key.endswith("_mm") else 1)
    return row
