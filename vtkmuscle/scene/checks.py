"""Check the surfaces, landmarks and lines of a scene before it is run."""

from __future__ import annotations

import warnings
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.paths.via_rings import passes_through, via_ring
from vtkmuscle.data.arrays import checked_surface, points_of
from vtkmuscle.data.attachments import VIA, AttachmentArea
from vtkmuscle.data.paths import checked_superficial
from vtkmuscle.filters.deformer.settings import check_together
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.scene.data import Muscle, SceneData
from vtkmuscle.scene.faults import Faults, SceneError, errors_at
from vtkmuscle.scene.mirror import turned_over
from vtkmuscle.scene.validation import validated
from vtkmuscle.scene.writing import tables_of

#: Landmarks farther from their muscle than this, in its diagonals, are another muscle's, or in another unit.
_FARTHEST_LANDMARKS = 1.0
#: Largest coordinate; the squares of larger ones may overflow.
_LARGEST = 1e60


def checked(scene: SceneData) -> tuple[dict[str, vtkPolyData], dict[str, Muscle]]:
    """Return the bones and the muscles of a scene, each checked, the muscles facing outward.

    Raises
    ------
    SceneError
        With a fault for each key, surface, landmark or line that cannot be used.
    """
    validated(tables_of(scene), scene.files.get(""))
    faults = Faults()
    bones, muscles = {}, {}
    for name, bone in scene.bones.items():
        with faults.gathered():
            _checked_surface(scene, f"bones.{name}.surface", bone)
            bones[name] = bone
    for name, muscle in scene.muscles.items():
        key = f"muscles.{name}"
        with faults.gathered():
            _check_solver(scene, name)
            surface = _closed(scene, f"{key}.surface", muscle.surface)
            muscles[name] = replace(muscle, surface=surface)
            for number, area in enumerate(muscle.attachments):
                with faults.gathered():
                    _check_area(scene, f"{key}.attachments[{number}]", area, surface)
            _check_superficial(scene, f"{key}.superficial_fibres", muscle, points_of(surface))
    faults.raise_any()
    return bones, muscles


def _check_solver(scene: SceneData, name: str) -> None:
    """Check that the settings of a muscle's deformer go together."""
    if scene.model != "volume":
        return
    key = f"muscles.{name}.solver" if scene.muscles[name].solver else "solver"
    with _placed(scene, key):
        check_together(PBDDeformer(**scene.solver_of(name)).parameters())


def _placed(scene: SceneData, key: str, remedy: str = "") -> AbstractContextManager[None]:
    return errors_at(key, scene.files.get(key, scene.files.get("")), remedy)


def _error(scene: SceneData, key: str, problem: str, remedy: str) -> SceneError:
    return SceneError(problem, key, remedy, scene.files.get(key, scene.files.get("")))


def _checked_surface(
    scene: SceneData, key: str, surface: vtkPolyData
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    with _placed(scene, key, "correct them, or export the surface again"):
        points, triangles = checked_surface(surface, "")
    if np.abs(points).max() > _LARGEST:
        point = int(np.abs(points).max(axis=1).argmax())
        problem = f"point {point} has a coordinate of {np.abs(points[point]).max():.4g}"
        raise _error(scene, key, problem, "correct that point, or remove it")
    return points, triangles


def _closed(scene: SceneData, key: str, surface: vtkPolyData) -> vtkPolyData:
    """Return the surface of a muscle: closed, in one piece, and facing outward."""
    points, triangles = _checked_surface(scene, key, surface)
    report = survey(points, triangles)
    problem = remedy = ""
    if not report.closed:
        problem = f"the surface is open: {report.n_boundary_edges} edges belong to one triangle only"
        remedy = (
            "fill its holes (pyvista: mesh.fill_holes(size)); if none are visible, merge coincident points "
        )
        remedy += "(pyvista: mesh.clean())"
    elif not report.manifold:
        problem = (
            f"the surface is not manifold: {report.n_nonmanifold_edges} edges have more than two triangles"
        )
        remedy = "delete the extra triangles, e.g. with MeshLab's 'repair non manifold edges'"
    elif not report.oriented:
        problem = f"neighbouring triangles disagree on their side at {report.n_misoriented_edges} edges"
        remedy = "orient them alike (pyvista: mesh.compute_normals(consistent_normals=True))"
    elif report.volume == 0:
        problem, remedy = "the surface has no volume", "export it again"
    elif report.n_components > 1:
        problem = f"the surface falls into {report.n_components} separate pieces"
        remedy = "keep the largest (pyvista: mesh.extract_largest()), or make each piece its own muscle"
    elif report.n_unused_points > 0:
        problem = f"{report.n_unused_points} points belong to no triangle"
        remedy = "remove them (pyvista: mesh.clean())"
    if problem:
        raise _error(scene, key, problem, remedy)
    if report.volume > 0:
        return surface
    problem = "the surface is inside out; its triangles were turned to face outward"
    warnings.warn(f"{scene.files.get(key) or 'scene'}: {key}: {problem}", stacklevel=5)
    return turned_over(surface)


def _check_area(scene: SceneData, key: str, area: AttachmentArea, surface: vtkPolyData) -> None:
    landmarks = np.asarray(area.landmarks, dtype=np.float64)
    key = f"{key}.landmarks"
    if landmarks.ndim != 2 or landmarks.shape[1] != 3 or not np.isfinite(landmarks).all():
        raise _error(scene, key, "the landmarks are not finite points x, y, z", "correct them")
    fewest = 3 if area.closed else 1
    if len(landmarks) < fewest:
        problem = f"there are {len(landmarks)} landmarks, but a ring needs {fewest}"
        raise _error(scene, key, problem, "add landmarks")
    _check_near(scene, key, "the landmarks are", landmarks, points_of(surface))
    if area.role == VIA:
        _check_ring(scene, key, area, surface)


def _check_ring(scene: SceneData, key: str, area: AttachmentArea, surface: vtkPolyData) -> None:
    """Check that the landmarks form a ring, and that the muscle passes through it."""
    with _placed(scene, key, "give landmarks round the muscle, in order"):
        ring = via_ring(area.landmarks)
    points, triangles = checked_surface(surface, key)
    if not passes_through(ring, points, triangles):
        gap = np.linalg.norm(points - ring.centre, axis=1).min()
        problem = (
            f"the muscle does not pass through the via ring, whose centre is {gap:.4g} {scene.units} from "
            "the muscle's nearest point"
        )
        remedy = "digitise the ring round the muscle at rest, in the same unit and frame"
        raise _error(scene, key, problem, remedy)


def _check_superficial(scene: SceneData, key: str, muscle: Muscle, points: NDArray[Any]) -> None:
    if muscle.superficial_fibres is None:
        return
    with _placed(scene, key, "give polylines, one for each fibre, two points or more"):
        lines = checked_superficial(muscle.superficial_fibres, "")
    _check_near(scene, key, "the fibres are", lines.points, points)


def _check_near(scene: SceneData, key: str, what: str, places: NDArray[Any], points: NDArray[Any]) -> None:
    """Check that some points lie about where the muscle with other points is."""
    lowest, highest = points.min(axis=0), points.max(axis=0)
    gaps = np.linalg.norm(np.maximum(np.maximum(lowest - places, places - highest), 0), axis=1)
    diagonal = np.linalg.norm(highest - lowest)
    if gaps.min() > _FARTHEST_LANDMARKS * diagonal:
        problem = (
            f"{what} {gaps.min():.4g} {scene.units} away from the muscle, which is {diagonal:.4g} "
            f"{scene.units} long"
        )
        remedy = "check that they belong to this muscle and are in the same unit and frame"
        raise _error(scene, key, problem, remedy)
