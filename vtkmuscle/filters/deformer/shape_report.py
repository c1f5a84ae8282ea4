"""How well a frame of PBDDeformer keeps the muscle's shape: field arrays, and rows of figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from vtkmuscle.core.mesh.rest_shape import ShapeReport
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array

#: Percentiles of the ratios of edges along and across the fibres.
_SPREAD = ("P5", "P50", "P95")

#: Field arrays of the report that are lengths, and the key of each in a row of figures [mm].
LENGTHS = {
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}

#: The other field arrays of the report, and their keys.
FIGURES = {
    "VolumeRatio": "volume_ratio",
    "EdgeStretchP95": "edge_stretch_p95",
    "EdgeStretchMax": "edge_stretch_max",
    **{f"AlongFibres{part}": f"along_fibres_{part.lower()}" for part in _SPREAD},
    **{f"AcrossFibres{part}": f"across_fibres_{part.lower()}" for part in _SPREAD},
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "DegenerateEdges": "degenerate_edges",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
    "Milliseconds": "ms",
}


def shape_fields(
    shape: ShapeReport, *, colliding: int, depths: Floats | None, milliseconds: float
) -> dict[str, float]:
    """Return the field arrays of a frame's report, those that are known.

    Parameters
    ----------
    shape : ShapeReport
        How the muscle keeps its shape in it.
    colliding : int
        Points that met a bone.
    depths : (f,) array or None
        How deep the free points are in the bones, where measured.
    milliseconds : float
        Time that the frame took.
    """
    fields: dict[str, float] = {
        "VolumeRatio": shape.volume_ratio,
        "EdgeStretchP95": shape.edge_stretch_p95,
        "EdgeStretchMax": shape.edge_stretch_max,
        "DihedralErrorP95": shape.dihedral_error_p95,
        "DegenerateEdges": shape.degenerate_edges,
        "CollidingPoints": colliding,
        "Milliseconds": milliseconds,
    }
    for name, spread in (("Along", shape.along), ("Across", shape.across)):
        if spread is not None:
            fields.update({f"{name}Fibres{part}": value for part, value in zip(_SPREAD, spread, strict=True)})
    if depths is not None:
        fields["PenetrationMax"] = float(depths.max(initial=0.0))
        fields["PenetrationP95"] = float(np.percentile(depths, 95)) if len(depths) else 0.0
        fields["PenetratingPoints"] = int((depths > 0.0).sum())
    return fields


def shape_row(fields: dict[str, float], millimetres: float = 1.0) -> dict[str, float]:
    """Return a frame's figures by their keys, lengths in millimetres.

    Parameters
    ----------
    fields : dict of str to float
        Field arrays, as of :func:`shape_fields`.
    millimetres : float, optional
        Millimetres per unit of length.
    """
    row = {key: fields[name] for name, key in FIGURES.items() if name in fields}
    row.update({key: fields[name] * millimetres for name, key in LENGTHS.items() if name in fields})
    return row


def read_shape(deformed: Any, millimetres: float = 1.0) -> dict[str, float]:
    """Return the figures of a muscle that PBDDeformer made, by their keys; see :func:`shape_row`."""
    arrays = {name: field_array(deformed, name) for name in (*FIGURES, *LENGTHS)}
    fields = {name: array[-1].item() for name, array in arrays.items() if array is not None}
    return shape_row(fields, millimetres)
