"""What a run reports of its muscles: measured from the geometry, not taken from the solver's word."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.fibres.arrangement import arrangement
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface, field_array, points_of, polylines_of
from vtkmuscle.data.muscle_geometry import muscle_geometry
from vtkmuscle.io.fibre_table import fibre_columns, fibre_summary
from vtkmuscle.run import architecture
from vtkmuscle.run.table import Table

#: A fibre point counts as inside its muscle up to this far outside [mm].
FIBRE_TOLERANCE = 0.5

#: What is said of errors in a report.
ERROR_DEFINITIONS = {
    "errors": "of the mean length of the paths (length) and of the fibres (fibre_length), the paths' mean "
    "moment arm by each coordinate, volume, "
    "physiological cross-sectional area with and without tendon, and fascicle length: the value, mean over "
    "the frames; parts, what each cause adds, and total, the root of the sum of their squares, each as the "
    "root mean square over the frames. All are half widths of intervals of about 95 % confidence. Causes "
    "that are not there are not known: errors_not_known says why",
    "errors.solve": "of a volume, by how much it is not kept",
    "errors.segments": "fibres of straight segments for curved ones; part of slices where these are known",
    "errors.fibres": "number of fibres that a mean is taken of",
    "errors.slopes": "what the lever of a path's pull and -dl/dq of its length differ by",
    "errors.facets": "flat triangles for a round surface",
    "errors.tendon": "what counts as tendon",
    "errors.aponeuroses": "none are given, and fascicles between them are shorter than what is no tendon",
    "errors.model": "difference between the muscle's fibres and the taut paths alone",
    "errors.mesh": "difference to a mesh with edges half as long",
    "errors.slices": "difference to a slice for every height and fibres of twice the segments",
    "errors.pruning": "difference to fibres carried by all vertices",
    "errors.landmarks": "spread over runs with the areas moved about",
}

#: What the numbers of a report mean; it is part of every report.
DEFINITIONS = {
    "estimated_attachments": "attachment areas that were made from where the muscle is near bones",
    "attachment_sureness": "how sure the least sure of them is, 0 to 1; null where nothing was estimated",
    "volume_ratio": "volume / volume at rest",
    "edge_stretch_p95": "95th percentile, over the edges of the muscle, of length / length at rest",
    "edge_stretch_max": "the largest of them",
    "misshapen_area": "share of the surface, by its area at rest, that is stretched more than 2.4 times, or "
    "squeezed to less than a third, in some direction",
    "folded_edges": "edges whose two triangles lie on each other, within 30 degrees, and did not at rest",
    "along_fibres_p5": "5th percentile of length / length at rest over the edges within 18 degrees of the "
    "fibres at rest; likewise _p50 and _p95; where the direction of the fibres is known",
    "across_fibres_p5": "the same for edges over 72 degrees from the fibres",
    "dihedral_error_p95_deg": "95th percentile of how much the angles between neighbouring triangles have "
    "changed, degrees",
    "degenerate_edges": "edges whose angle was lost as a triangle beside them collapsed",
    "colliding_points": "points that met a bone in the last step",
    "penetration_max_mm": "how deep the deepest free point is inside the exact surface of a bone, whose "
    "holes count as closed; null where no bone has an inside",
    "penetration_p95_mm": "95th percentile of that depth over all free points, 0 outside the bones",
    "penetrating_points": "number of free points inside a bone",
    "penetration_new_max_mm": "by how much the depth of a free point has grown since rest, at most; "
    "penetration_new_p95_mm: 95th percentile over all free points, 0 where it has not",
    "fibres_outside_max_mm": "how far the farthest point of a fibre is out of the muscle",
    "fibres_penetration_new_max_mm": "by how much the deepest point of a fibre is deeper in a bone than that "
    "of the same fibre at rest, at most",
    "squeezed_p95_mm": "room that a path lacks between two bones, 95th percentile over all paths",
    "rest": "how deep free points are in bones at rest: segmented muscles often begin so",
    "verdict": "ok, look (use the results, but look at what the reasons name) or failed (do not use them): "
    "the worst of its reasons. Each reason has the check, the worst frame and its time, the value there, the "
    "limit that it is beyond, and what to do; not_checked says what could not be judged",
    "fixed_error_max_mm": "largest distance of a fixed point from where its bone carries it",
    "overlap_max_mm": "how deep the deepest point is inside another muscle that comes before it in the scene",
    "overlap_p95_mm": "95th percentile of that depth over the points that are inside one",
    "overlapping_points": "number of points inside another muscle that comes before it in the scene",
    "ms": "wall-clock time of the deformation of the frame, milliseconds; muscles run side by side",
    "ms_fibres": "the same of carrying its fibres along and measuring them",
    "points_inside": f"points of fibres at rest inside the muscle or within {FIBRE_TOLERANCE:g} mm of it",
    "twist_degrees": "how far sections are turned against each other along their contours, end to end",
    "superficial_angle_degrees": "angle between the superficial fibres given and those of the template "
    "on the surface, root mean square; superficial_angle_straight_degrees: the same without the twist",
    "crossing_share": "part of neighbouring fibres that change sides near an end, at rest; hooked_share: "
    "part of the fibres that turn by more than 90 degrees between two segments; turning_p95_deg: sum of the "
    "turns along a fibre, 95th percentile; bare_share: part of the volume that is farther from any fibre "
    "than neighbours are from each other in the belly",
    "fibre_measures": "per frame mean, standard deviation (of the population), least and largest over the "
    "fibres, of length, strain (length / length at rest - 1), pennation (angle to the surface), tortuosity "
    "(length / distance of the ends), curvature (mean and largest along a fibre) and penetration (of a "
    "fibre's deepest point into the exact surface of a bone; where a bone is closed)",
    "moment_arms": "by each coordinate of the motion the levers of the paths' pulls about its axis, positive "
    "where the muscle drives the coordinate up: mean, least and largest over paths and frames; "
    "slope_difference_mm, root mean square of what they and -dl/dq of the paths' lengths, by differences "
    "between frames, differ by; and the root mean square of what a quartic leaves of the lengths; positive: "
    "the coordinate's positive direction; reason, refused: why there are none, by any or by some coordinates",
    "seconds": "wall-clock time per stage; muscles run side by side",
    **architecture.DEFINITIONS,
    "taken_over": "muscles that an earlier run into the folder had finished, with the same inputs and "
    "settings",
    **ERROR_DEFINITIONS,
}

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
    found = arrangement(lines.points, lines.offsets, geometry.samples(architecture.SAMPLES))
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
