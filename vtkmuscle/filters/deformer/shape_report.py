"""Shape report of a frame: field arrays and rows of figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from vtkmuscle.core.mesh.rest_shape import ShapeReport
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array

#: Lengths among the field arrays, and their keys in a row of figures [mm].
LENGTHS = {
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}

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


def shape_row(fields: dict[str, float], millimetres: float = 1.0) -> dict[str, float]:
    """Return a frame's figures by key, lengths in millimetres.

    Parameters
    ----------
    fields : dict of str to float
        Field arrays, as from :func:`shape_fields`.
    millimetres : float, optional
        Millimetres per unit of length.
    """
    row = {key: fields[name] for name, key in FIGURES.items() if name in fields}
    row.update({key: fields[name] * millimetres for name, key in LENGTHS.items() if name in fields})
    return row


def read_shape(deformed: Any, millimetres: float = 1.0) -> dict[str, float]:
    """Return the figures of a deformed muscle by key; see :func:`shape_row`."""
    arrays = {name: field_array(deformed, name) for name in (*FIGURES, *LENGTHS)}
    fields = {name: array[-1].item() for name, array in arrays.items() if array is not None}
    return shape_row(fields, millimetres)
