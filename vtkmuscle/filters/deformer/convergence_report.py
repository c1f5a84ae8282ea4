"""How far a frame of PBDDeformer is from where its solve leads: field arrays, and rows of figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from vtkmuscle.core.pbd.rest_shape import ShapeReport
from vtkmuscle.core.pbd.stages import STAGES
from vtkmuscle.core.pbd.state import MuscleState
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array

#: Percentiles of the ratios of edges along and across the fibres.
_SPREAD = ("P5", "P50", "P95")

#: Field arrays of the convergence report that are lengths, and the key of each in a row of figures [mm].
LENGTHS = {
    "Residual": "residual_mm",
    "EstimatedDistance": "estimated_distance_mm",
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}

#: The other field arrays of the report, and their keys.
FIGURES = {
    "Iterations": "iterations",
    "VolumeRatio": "volume_ratio",
    "EdgeStretchP50": "edge_stretch_p50",
    "EdgeStretchP95": "edge_stretch_p95",
    "EdgeStretchMax": "edge_stretch_max",
    **{f"AlongFibres{part}": f"along_fibres_{part.lower()}" for part in _SPREAD},
    **{f"AcrossFibres{part}": f"across_fibres_{part.lower()}" for part in _SPREAD},
    "DihedralErrorP50": "dihedral_error_p50_deg",
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "DegenerateEdges": "degenerate_edges",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
    "Milliseconds": "ms",
    **{f"Milliseconds{stage.capitalize()}": f"ms_{stage}" for stage in STAGES},
}


def convergence_fields(
    shape: ShapeReport,
    state: MuscleState,
    *,
    depths: Floats | None,
    milliseconds: float,
) -> dict[str, float]:
    """Return the field arrays of a frame's convergence report, those that are known.

    Parameters
    ----------
    shape : ShapeReport
        How the muscle keeps its shape in it.
    state : MuscleState
        The frame.
    depths : (f,) array or None
        How deep the free points are in the bones, where measured.
    milliseconds : float
        Time that the frame took.
    """
    fields: dict[str, float] = {
        "Iterations": state.iterations,
        "Residual": state.residual,
        "VolumeRatio": shape.volume_ratio,
        "EdgeStretchP50": shape.edge_stretch_p50,
        "EdgeStretchP95": shape.edge_stretch_p95,
        "EdgeStretchMax": shape.edge_stretch_max,
        "DihedralErrorP50": shape.dihedral_error_p50,
        "DihedralErrorP95": shape.dihedral_error_p95,
        "DegenerateEdges": shape.degenerate_edges,
        "CollidingPoints": state.colliding,
        "Milliseconds": milliseconds,
    }
    if state.distance is not None:
        fields["EstimatedDistance"] = state.distance
    for name, spread in (("Along", shape.along), ("Across", shape.across)):
        if spread is not None:
            fields.update({f"{name}Fibres{part}": value for part, value in zip(_SPREAD, spread, strict=True)})
    if depths is not None:
        fields["PenetrationMax"] = float(depths.max(initial=0.0))
        fields["PenetrationP95"] = float(np.percentile(depths, 95)) if len(depths) else 0.0
        fields["PenetratingPoints"] = int((depths > 0.0).sum())
    fields.update({f"Milliseconds{stage.capitalize()}": ms for stage, ms in state.milliseconds.items()})
    return fields


def convergence_row(fields: dict[str, float], millimetres: float = 1.0) -> dict[str, float]:
    """Return a frame's figures by their keys, lengths in millimetres.

    Parameters
    ----------
    fields : dict of str to float
        Field arrays, as of :func:`convergence_fields`.
    millimetres : float, optional
        Millimetres per unit of length.
    """
    row = {key: fields[name] for name, key in FIGURES.items() if name in fields}
    row.update({key: fields[name] * millimetres for name, key in LENGTHS.items() if name in fields})
    return row


def read_convergence(deformed: Any, millimetres: float = 1.0) -> dict[str, float]:
    """Return the figures of a muscle that PBDDeformer made, by their keys; see :func:`convergence_row`."""
    arrays = {name: field_array(deformed, name) for name in (*FIGURES, *LENGTHS)}
    fields = {name: array[-1].item() for name, array in arrays.items() if array is not None}
    return convergence_row(fields, millimetres)
