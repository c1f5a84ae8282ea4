"""What a run reports of its muscles: measured from the geometry, not taken from the solver's word."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.inside import points_inside
from vtkmuscle.core.mesh import edge_lengths, signed_volume, unique_edges
from vtkmuscle.core.muscle_contact import depth_in
from vtkmuscle.core.rest_shape import dihedral_angles
from vtkmuscle.core.rigid import apply_transform, inverse
from vtkmuscle.core.topology import mesh_topology
from vtkmuscle.core.triangle_tree import triangle_tree
from vtkmuscle.filters.arrays import checked_surface, field_array, point_array, points_of, triangles_of
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.filters.neighbours import outward_tree
from vtkmuscle.filters.surface_distance import SurfaceDistance
from vtkmuscle.io.fibre_table import fibre_columns, fibre_summary, muscle_summary

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: A fibre point counts as inside its muscle up to this far outside [mm].
FIBRE_TOLERANCE = 0.5

#: An edge is folded back where its triangles are within 30 degrees of lying on each other; it counts where it
#: was at least 60 degrees off that at rest [degrees between their normals].
FOLDED, NOT_FOLDED = 150.0, 120.0
#: An edge that is shorter than this part of the mean edge at rest counts as that long: a sliver's is easily
#: many times its own length.
SHORT_EDGE = 0.25

#: Sections across the centroid path in which fibres are counted.
ARCHITECTURE_SECTIONS = 10

#: What the numbers of a report mean; it is part of every report.
DEFINITIONS = {
    "estimated_attachments": "attachment areas that were made from where the muscle touches bones",
    "volume_ratio": "volume / volume at rest",
    "edge_stretch_p95": "95th percentile, over the edges of the muscle, of length / length at rest; _p50 is "
    "the median",
    "edge_stretch_p5": "5th percentile of it",
    "edge_stretch_max": "the largest of them",
    "edge_stretch_floored_max": "the largest, where edges that are shorter at rest than a quarter of the "
    "mean edge count as that long",
    "folded_edges": "edges whose two triangles lie on each other, within 30 degrees, and did not at rest",
    "along_fibres_p5": "5th percentile of length / length at rest over the edges within 18 degrees of the "
    "fibres at rest; likewise _p50 and _p95; where the direction of the fibres is known",
    "across_fibres_p5": "the same for edges over 72 degrees from the fibres",
    "dihedral_error_p50_deg": "median of how much the angles between neighbouring triangles have changed, "
    "degrees; likewise _p95",
    "degenerate_edges": "edges whose angle was lost as a triangle beside them collapsed",
    "residual_mm": "root mean square of what the last iteration moved the points by",
    "estimated_distance_mm": "estimated distance to the converged shape (root mean square), where the solver "
    "knows one",
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
    "rest": "how deep free points are in bones at rest: segmented muscles often begin so",
    "verdict": "ok, look (use the results, but look at what the reasons name) or failed (do not use them): "
    "the worst of its reasons. Each reason has the check, the worst frame and its time, the value there, the "
    "limit that it is beyond, and what to do; not_checked says what could not be judged",
    "fixed_error_max_mm": "largest distance of a fixed point from where its bone carries it",
    "overlap_max_mm": "how deep the deepest point is inside another muscle that comes before it in the scene",
    "overlap_p95_mm": "95th percentile of that depth over the points that are inside one",
    "overlapping_points": "number of points inside another muscle that comes before it in the scene",
    "iterations": "iterations of the solver for the frame",
    "ms_constraints": "part of the time of the last step spent on edges and volume, milliseconds; likewise "
    "ms_prediction, ms_collision, ms_acceleration and ms_settling",
    "ms": "wall-clock time of the deformation of the frame, milliseconds; muscles run side by side",
    "points_inside": f"points of fibres at rest inside the muscle or within {FIBRE_TOLERANCE:g} mm of it",
    "twist_degrees": "how far sections are turned against each other along their contours, end to end",
    "superficial_angle_degrees": "angle between the superficial fibres given and those of the template "
    "on the surface, root mean square; superficial_angle_straight_degrees: the same without the twist",
    "fibre_measures": "per frame mean, standard deviation (of the population), least and largest over the "
    "fibres, of length, strain (length / length at rest - 1), pennation (angle to the surface), tortuosity "
    "(length / distance of the ends), curvature (mean and largest along a fibre) and penetration (of a "
    "fibre's deepest point into the exact surface of a bone; where a bone is closed)",
    "architecture": "of the muscle at rest: volume; physiological cross-sectional area, volume / mean fibre "
    "length, and its part along the line of action; the line of action, from the mean of the fibres' first "
    "points to that of their last; length of the centroid path; over ten sections across that path mean, "
    "standard deviation, least and largest of their area, of the number of fibres and of fibres per area",
    "moment_arms": "by each coordinate of the motion, -dl/dq of the fibres' lengths by local regression, "
    "positive where the muscle drives the coordinate up: mean, least and largest over fibres and frames, "
    "mean standard error, how many values a window of the regression holds, and the root mean square of what "
    "a quartic leaves of the lengths; positive: the coordinate's positive direction; reason, refused: why "
    "there are none, by any or by some coordinates",
    "seconds": "wall-clock time per stage; muscles run side by side",
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
#: What :func:`vtkmuscle.io.muscle_summary` has, likewise, and the power of the length that it is.
ARCHITECTURE = {
    "MuscleVolume": ("muscle_volume_mm3", 3),
    "PCSA": ("pcsa_mm2", 2),
    "PCSALine": ("pcsa_along_line_of_action_mm2", 2),
    "LineOfAction": ("line_of_action", 0),
    "CentroidPathLength": ("centroid_path_length_mm", 1),
    "SectionArea": ("section_area_mm2", 2),
    "SectionFibres": ("section_fibres", 0),
    "SectionDensity": ("section_density_per_mm2", -2),
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
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # e.g. VTK built from source, as in ParaView
            found[package] = "unknown"
    return found


class MuscleMeasure:
    """Measures a deformed muscle against its rest pose and the bones.

    Parameters
    ----------
    rest : vtkPolyData
        The muscle at rest with the point array ``FixedTo``.
    bones : sequence of str
        Names of the bones, in the order that ``FixedTo`` counts.
    distances : mapping of str to SurfaceDistance
        Of the bones that have an inside, at rest.
    millimetres : float
        Millimetres per unit of length.
    """

    def __init__(
        self,
        rest: vtkPolyData,
        bones: list[str],
        distances: Mapping[str, SurfaceDistance],
        millimetres: float,
    ) -> None:
        self._bones = bones
        self._distances = distances
        self._millimetres = millimetres
        self._rest = points_of(rest)
        self._triangles = triangles_of(rest, "muscle")
        self._fixed_to = np.array(point_array(rest, "FixedTo", "muscle"))
        edges = unique_edges(self._triangles)
        lengths = edge_lengths(self._rest, edges)
        self._edges, self._edge_lengths = edges[lengths > 0], lengths[lengths > 0]
        self._floored = np.maximum(self._edge_lengths, SHORT_EDGE * self._edge_lengths.mean())
        self._volume = signed_volume(self._rest, self._triangles)
        self._quads = mesh_topology(len(self._rest), self._triangles).quads
        angles, defined = dihedral_angles(self._rest, self._quads)
        self._unfolded = defined & (np.abs(angles) < np.radians(NOT_FOLDED))
        self._rest_depths: Floats | None = None
        self._fibre_rest_depths: Floats | None = None

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return max(len(self._edges), 1)

    @property
    def size(self) -> float:
        """Diagonal of the muscle's box at rest [mm]."""
        return float(np.linalg.norm(np.ptp(self._rest, axis=0))) * self._millimetres

    def at_rest(self) -> dict[str, Any]:
        """Return what the muscle is at rest."""
        fixed = {bone: int((self._fixed_to == i).sum()) for i, bone in enumerate(self._bones)}
        still = {bone: np.eye(4) for bone in self._bones}
        return {
            "points": len(self._rest),
            "triangles": len(self._triangles),
            "volume_mm3": self._volume * self._millimetres**3,
            "fixed_points": {bone: count for bone, count in fixed.items() if count},
            "rest": self._penetration(self._rest, still),
        }

    def frame(self, points: Floats, transforms: Mapping[str, Floats]) -> dict[str, Any]:
        """Return the figures of a frame.

        Parameters
        ----------
        points : (n, 3) array
            The deformed muscle.
        transforms : mapping of str to (4, 4) array
            Rest to now, of the bones that moved.

        Returns
        -------
        dict
            See :data:`DEFINITIONS`.
        """
        now = {bone: transforms.get(bone, np.eye(4)) for bone in self._bones}
        lengths = edge_lengths(points, self._edges)
        stretch = lengths / self._edge_lengths
        angles, _ = dihedral_angles(points, self._quads)
        folded = self._unfolded & (np.abs(angles) > np.radians(FOLDED))
        return {
            "volume_ratio": signed_volume(points, self._triangles) / self._volume,
            "edge_stretch_p5": float(np.percentile(stretch, 5)),
            "edge_stretch_p95": float(np.percentile(stretch, 95)),
            "edge_stretch_max": float(stretch.max()),
            "edge_stretch_floored_max": float((lengths / self._floored).max()),
            "folded_edges": int(folded.sum()),
            **self._penetration(points, now),
            **self._new_penetration(points, now),
            "fixed_error_max_mm": self._fixed_error(points, now),
        }

    def overlap(self, points: Floats, others: Iterable[vtkPolyData]) -> dict[str, Any]:
        """Return how deep the muscle's points (n, 3) are inside other muscles; see :data:`DEFINITIONS`."""
        depths = np.zeros(len(points))
        for other in others:
            tree = outward_tree(*checked_surface(other, "muscle"))
            np.maximum(depths, depth_in(tree, points), out=depths)
        depths *= self._millimetres
        inside = depths[depths > 0.0]
        return {
            "overlap_max_mm": float(depths.max()),
            "overlap_p95_mm": float(np.percentile(inside, 95)) if len(inside) else 0.0,
            "overlapping_points": len(inside),
        }

    def depths(self, points: Floats, transforms: Mapping[str, Floats]) -> Floats | None:
        """Return how deep points (n, 3) are inside the exact surfaces of the closed bones, (n,).

        In the scene's unit, 0 outside; None where no bone is closed.
        """
        if not self._distances:
            return None
        depths = np.zeros(len(points))
        low, high = points.min(axis=0), points.max(axis=0)
        middle, half = (high + low) / 2, (high - low) / 2
        for bone, distance in self._distances.items():
            to_rest = inverse(transforms.get(bone, np.eye(4)))
            there, reach = apply_transform(to_rest, middle[None])[0], np.abs(to_rest[:3, :3]) @ half
            low, high = distance.box
            if ((there + reach >= low) & (there - reach <= high)).all():
                np.maximum(depths, distance.depth(apply_transform(to_rest, points)), out=depths)
        return depths

    def fibres(
        self, fibre_points: Floats, offsets: Ints, points: Floats, transforms: Mapping[str, Floats]
    ) -> dict[str, Any]:
        """Return how far fibres are out of the muscle, and how much deeper in bones than at rest.

        Parameters
        ----------
        fibre_points : (p, 3) array
            Points of the fibres now, the same fibres each time.
        offsets : (k + 1,) int array
            Where each fibre begins among them.
        points : (n, 3) array
            The deformed muscle.
        transforms : mapping of str to (4, 4) array
            Rest to now, of the bones that moved.
        """
        outside = fibre_points[~points_inside(fibre_points, points, self._triangles)]
        farthest = 0.0
        if len(outside):
            farthest = float(triangle_tree(points, self._triangles).nearest(outside)[2].max())
        depths, grown = self.depths(fibre_points, transforms), None
        if depths is not None:
            deepest = np.maximum.reduceat(depths, offsets[:-1])
            rest = self._fibre_rest_depths
            grown = float(np.maximum(deepest - (0.0 if rest is None else rest), 0.0).max())
        return {
            "fibres_outside_max_mm": farthest * self._millimetres,
            "fibres_penetration_new_max_mm": None if grown is None else grown * self._millimetres,
        }

    def take_fibres_at_rest(self, fibre_points: Floats, offsets: Ints) -> None:
        """Note how deep fibres are in bones at rest: (p, 3) points, (k + 1,) where each fibre begins."""
        depths = self.depths(fibre_points, {bone: np.eye(4) for bone in self._bones})
        self._fibre_rest_depths = None if depths is None else np.maximum.reduceat(depths, offsets[:-1])

    def _penetration(self, points: Floats, now: Mapping[str, Floats]) -> dict[str, Any]:
        free = points[self._fixed_to < 0]
        depths = self.depths(free, now) if len(free) else None
        if depths is None:
            return {"penetration_max_mm": None, "penetration_p95_mm": None, "penetrating_points": None}
        depths *= self._millimetres
        return {
            "penetration_max_mm": float(depths.max()),
            "penetration_p95_mm": float(np.percentile(depths, 95)),
            "penetrating_points": int((depths > 0).sum()),
        }

    def _new_penetration(self, points: Floats, now: Mapping[str, Floats]) -> dict[str, Any]:
        """Return by how much free points are deeper in the bones than at rest."""
        free = self._fixed_to < 0
        depths = self.depths(points[free], now) if free.any() else None
        if depths is None:
            return {"penetration_new_max_mm": None, "penetration_new_p95_mm": None}
        if self._rest_depths is None:
            self._rest_depths = self.depths(self._rest[free], {bone: np.eye(4) for bone in self._bones})
        assert self._rest_depths is not None  # the bones have insides, as they had just now
        grown = np.maximum(depths - self._rest_depths, 0.0) * self._millimetres
        return {
            "penetration_new_max_mm": float(grown.max()),
            "penetration_new_p95_mm": float(np.percentile(grown, 95)),
        }

    def _fixed_error(self, points: Floats, now: Mapping[str, Floats]) -> float:
        worst = 0.0
        for i, bone in enumerate(self._bones):
            held = self._fixed_to == i
            if held.any():
                errors = np.linalg.norm(points[held] - apply_transform(now[bone], self._rest[held]), axis=1)
                worst = max(worst, float(errors.max()))
        return worst * self._millimetres


def fibres_at_rest(fibres: vtkPolyData, muscle: vtkPolyData, millimetres: float) -> dict[str, Any]:
    """Return how many fibres there are, and how many of their points are inside the muscle.

    Parameters
    ----------
    fibres, muscle : vtkPolyData
        At rest.
    millimetres : float
        Millimetres per unit of length.

    Returns
    -------
    dict
        JSON-able; see :data:`DEFINITIONS`.
    """
    points = points_of(fibres)
    surface = SurfaceDistance(muscle)
    outside = np.where(surface.depth(points) > 0, 0.0, surface.unsigned(points)) * millimetres
    inside = int((outside <= FIBRE_TOLERANCE).sum())
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
        **twist,
    }


def measures_of_fibres(fibres: vtkPolyData, millimetres: float) -> dict[str, dict[str, float]]:
    """Return mean, standard deviation, least and largest of what FibreMetrics measured, for one frame.

    Parameters
    ----------
    fibres : vtkPolyData
        From FibreMetrics.
    millimetres : float
        Millimetres per unit of length.

    Returns
    -------
    dict
        JSON-able, by the names of :data:`FIBRE_MEASURES`; see :data:`DEFINITIONS`.
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


def architecture_of(
    fibres: vtkPolyData, muscle: vtkPolyData, attachments: vtkMultiBlockDataSet | None, millimetres: float
) -> dict[str, Any]:
    """Return what is published of a muscle as a whole, at rest.

    Parameters
    ----------
    fibres, muscle : vtkPolyData
        At rest.
    attachments : vtkMultiBlockDataSet or None
        Of the muscle.
    millimetres : float
        Millimetres per unit of length.

    Returns
    -------
    dict
        JSON-able, by the names of :data:`ARCHITECTURE`; see :data:`DEFINITIONS`.
    """
    metrics = FibreMetrics(architecture=True, sections=ARCHITECTURE_SECTIONS)
    summary = muscle_summary(metrics(fibres, muscle, None, attachments))
    result: dict[str, Any] = {}
    for array, (name, power) in ARCHITECTURE.items():
        found, scale = summary[array], millimetres**power
        if isinstance(found, dict):
            result[name] = {word: value * scale for word, value in found.items()}
        else:
            result[name] = found if isinstance(found, list) else found * scale
    return result


def fibre_rows(frames: Sequence[vtkPolyData], times: Sequence[float], millimetres: float) -> str:
    """Return a table with a row per fibre and frame, and a column per measure, comma-separated.

    Parameters
    ----------
    frames : sequence of vtkPolyData
        Fibres of each frame, from FibreMetrics.
    times : sequence of float
        Pipeline time of each.
    millimetres : float
        Millimetres per unit of length.
    """
    arrays = [array for array in FIBRE_MEASURES if array in fibre_columns(frames[0])]
    lines = [",".join(["fibre", "time", *(FIBRE_MEASURES[array] for array in arrays)])]
    for time, fibres in zip(times, frames, strict=True):
        columns = fibre_columns(fibres)
        scaled = [columns[array] * _scale(FIBRE_MEASURES[array], millimetres) for array in arrays]
        for fibre, row in enumerate(zip(*scaled, strict=True)):
            lines.append(",".join([str(fibre), repr(time), *(f"{value:.10g}" for value in row)]))
    return "\n".join(lines) + "\n"
