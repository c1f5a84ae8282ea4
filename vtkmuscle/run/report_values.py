"""What a run reports of its muscles: measured from the geometry, not taken from the solver's word."""

from __future__ import annotations

import platform
import tomllib
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.fibres.arrangement import arrangement
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface, field_array, points_of, polylines_of
from vtkmuscle.data.muscle_geometry import muscle_geometry
from vtkmuscle.io.fibre_table import fibre_columns, fibre_summary
from vtkmuscle.run.architecture import SAMPLES
from vtkmuscle.run.table import Table

#: A fibre point counts as inside its muscle up to this far outside [mm].
FIBRE_TOLERANCE = 0.5

#: What the numbers of a report mean, by their keys; part of every report.
DEFINITIONS: Mapping[str, str] = tomllib.loads(
    (files("vtkmuscle.run") / "definitions.toml").read_text(encoding="utf-8")
)

#: Cell arrays of FibreMetrics, and what they are called in a report and in tables.
FIBRE_MEASURES = {
    "Length": "length_mm",
    "Strain": "strain",
    "PennationOrigin": "pennation_origin_deg",
    "PennationInsertion": "pennation_insertion_deg",
    "Tortuosity": "tortuosity",
    "CurvatureMean": "curvature_mean_per_mm",
    "CurvatureMax": "curvature_max_per_mm",
    "Penetration": "penetration_mm",
}
#: Field arrays of SliceMorpher, likewise.
TWIST_MEASURES = {
    "Twist": "twist_degrees",
    "SuperficialAngle": "superficial_angle_degrees",
    "SuperficialAngleStraight": "superficial_angle_straight_degrees",
}

_PACKAGES = ("vtkmuscle", "numpy", "scipy", "numba", "vtk", "pyvista")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that have a part in the numbers."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    return found | {package: version_of(package) for package in _PACKAGES}


def version_of(package: str) -> str:
    """Return the version of a package."""
    try:
        return version(package)
    except PackageNotFoundError:  # e.g. VTK built from source, as in ParaView
        return "unknown"


def fibres_at_rest(fibres: vtkPolyData, muscle: vtkPolyData, millimetres: float) -> dict[str, Any]:
    """Return how many fibres there are, and how many of their points are inside the muscle, both at rest.

    JSON-able, see :data:`DEFINITIONS`; ``millimetres`` is the length of the scene's unit.
    """
    points = points_of(fibres)
    outside = np.maximum(solids_of(*checked_surface(muscle, "muscle")).distances(points), 0.0) * millimetres
    inside = int((outside <= FIBRE_TOLERANCE).sum())
    lines, geometry = polylines_of(fibres, "fibres"), muscle_geometry(muscle, "muscle")
    found = arrangement(lines.points, lines.offsets, geometry.samples(SAMPLES))
    twist = {
        name: float(values[0])
        for array, name in TWIST_MEASURES.items()
        if (values := field_array(fibres, array)) is not None
    }
    return {
        "fibres": fibres.GetNumberOfCells(),
        "points": len(points),
        "points_inside": inside,
        "points_outside": len(points) - inside,
        "farthest_outside_mm": float(outside.max()),
        "crossing_share": found.crossing,
        "hooked_share": found.hooked,
        "turning_p95_deg": found.turning,
        "bare_share": found.bare,
        **twist,
    }


def measures_of_fibres(fibres: vtkPolyData, millimetres: float) -> dict[str, dict[str, float]]:
    """Return mean, standard deviation, least and largest of what FibreMetrics measured, for one frame.

    JSON-able, by the names of :data:`FIBRE_MEASURES`; ``millimetres`` is the length of the scene's unit.
    """
    summary = fibre_summary(fibres)
    return {
        name: {word: value * _scale(name, millimetres) for word, value in found.items()}
        for array, name in FIBRE_MEASURES.items()
        if (found := summary.get(array)) is not None
    }


def _scale(name: str, millimetres: float) -> float:
    """Return the factor from the scene's unit to that in a measure's name."""
    if name.endswith("_per_mm"):
        return 1.0 / millimetres
    return millimetres if name.endswith("_mm") else 1.0


def fibre_table(frames: Sequence[vtkPolyData], times: Sequence[float], millimetres: float) -> Table:
    """Return the measures of FibreMetrics in all frames, a row per fibre and frame.

    ``millimetres`` is the length of the scene's unit.
    """
    known = [name for array, name in FIBRE_MEASURES.items() if array in fibre_columns(frames[0])]

    def measures(time: float, fibres: vtkPolyData) -> dict[str, Any]:
        columns = {FIBRE_MEASURES.get(array): values for array, values in fibre_columns(fibres).items()}
        scaled = {name: columns[name] * _scale(name, millimetres) for name in known}
        return {"fibre": np.arange(fibres.GetNumberOfCells()), "time": time, **scaled}

    return Table.stacked(("fibre", "time", *known), map(measures, times, frames))
