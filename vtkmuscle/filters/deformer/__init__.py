"""The shape report of deformers: field arrays, and figures of a frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from vtkmuscle.core.mesh.rest_shape import ShapeReport
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array

#: Lengths among the field arrays, and their keys in a row of figures [mm].
LENGTHS = {"PenetrationMax": "penetration_max_mm", "PenetrationP95": "penetration_p95_mm"}

#: The other field arrays of the report, and their keys.
FIGURES = {
    "VolumeRatio": "volume_ratio",
    "EdgeStretchP95": "edge_stretch_p95",
    "EdgeStretchMax": "edge_stretch_max",
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "DegenerateEdges": "degenerate_edges",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
}


def shape_fields(shape: ShapeReport) -> dict[str, float]:
    """Return the field arrays of a shape report."""
    return {
        "VolumeRatio": shape.volume_ratio,
        "EdgeStretchP95": shape.edge_stretch_p95,
        "EdgeStretchMax": shape.edge_stretch_max,
        "DihedralErrorP95": shape.dihedral_error_p95,
        "DegenerateEdges": shape.degenerate_edges,
    }


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
    for names, unit in ((FIGURES, None), (LENGTHS, millimetres)):
        for name, key in names.items():
            if (array := field_array(deformed, name)) is not None:
                value = array[-1].item()
                row[key] = value if unit is None else value * unit
    return row
