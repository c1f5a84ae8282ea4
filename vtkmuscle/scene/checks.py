"""Checks of a scene's surfaces, landmarks and lines before a run."""

import warnings
from contextlib import AbstractContextManager
from dataclasses import replace

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkReverseSense

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.solids import closed_shells
from vtkmuscle.core.mesh.surface import MOST_REPAIRED, box_of, signed_volume, survey, used_alone
from vtkmuscle.core.paths.via_rings import passes_through, via_ring
from vtkmuscle.core.types import TINY, Floats, Ints
from vtkmuscle.data.arrays import checked_surface, output_of, points_of, surface_from
from vtkmuscle.data.attachments import VIA, AttachmentArea
from vtkmuscle.data.paths import checked_superficial
from vtkmuscle.scene.data import Faults, Muscle, SceneData, scene_errors_at, words_of
from vtkmuscle.scene.validation import validated
from vtkmuscle.scene.writing import tables_of

#: Largest coordinate: files have single precision.
_LARGEST = float(np.finfo(np.float32).max)


def checked(scene: SceneData) -> dict[str, Muscle]:
    """Return the muscles of a checked scene, facing outward. SceneError for all faults."""
    validated(tables_of(scene), None)  # a file is validated as it is read
    faults, muscles = Faults(), dict[str, Muscle]()
    again = "correct the points, or export the surface again"

    def at(key: str, remedy: str = "") -> AbstractContextManager[None]:
        return scene_errors_at(key, scene.files.get(key, scene.files.get("")), remedy)

    for name, bone in scene.bones.items():
        key = f"bones.{name}.surface"
        with faults.gathered(), at(key, again):
            _arrays(bone)
    for name, muscle in scene.muscles.items():
        key = f"muscles.{name}"
        with faults.gathered():
            with at(f"{key}.surface", again):
                surface, turned = closed_surface(muscle.surface)
            if turned:
                where = f"{scene.files.get(f'{key}.surface') or 'scene'}: {key}.surface"
                words = "the surface is inside out; its triangles were turned to face outward"
                warnings.warn(f"{where}: {words}", stacklevel=4)
            muscles[name] = replace(muscle, surface=surface)
            for number, area in enumerate(muscle.attachments):
                remedy = "give landmarks round the muscle, in order"
                with faults.gathered(), at(f"{key}.attachments[{number}].landmarks", remedy):
                    _check_area(area, surface, scene.units)
            if muscle.superficial_fibres is not None:
                remedy = "give a polyline of two points or more per fibre"
                with at(f"{key}.superficial_fibres", remedy):
                    lines = checked_superficial(muscle.superficial_fibres, "")
                    _check_distance("the fibres are", lines.points, points_of(surface), scene.units)
    faults.raise_any()
    return muscles


def _arrays(surface: vtkPolyData) -> tuple[Floats, Ints]:
    """Return the points (n, 3) and triangles (m, 3) of a surface."""
    points, triangles = checked_surface(surface, "")
    if np.abs(points).max() > _LARGEST:
        point = int(np.abs(points).max(axis=1).argmax())
        raise InputError("", *words_of("huge", point=point, size=np.abs(points[point]).max()))
    return points, triangles


def closed_surface(surface: vtkPolyData) -> tuple[vtkPolyData, bool]:
    """Return a closed muscle surface facing outward, and whether it was turned."""
    report = survey(*_arrays(surface))
    faults = {
        "open": not report.closed,
        "not_manifold": not report.manifold,
        "not_oriented": not report.oriented,
        "flat": report.volume == 0,
        "pieces": report.n_components > 1,
        "unused_points": report.n_unused_points > 0,
    }
    for fault, present in faults.items():
        if present:
            raise InputError("", *words_of(fault, report=report))
    return (surface, False) if report.volume > 0 else (turned_over(surface), True)


def repaired_surface(surface: vtkPolyData) -> tuple[vtkPolyData, str]:
    """Return the largest part of a muscle surface, closed and facing outward, and the repairs in words.

    An InputError says that holes or lost parts are more than :data:`MOST_REPAIRED`.
    """
    points, triangles = _arrays(surface)
    before, closed = survey(points, triangles), closed_shells(points, triangles)
    volumes = np.array([abs(signed_volume(closed.points, shell)) for shell in closed.shells])
    added = survey(closed.points, np.concatenate(closed.shells)).area / before.area - 1.0
    lost = 1.0 - volumes.max() / max(volumes.sum(), TINY)
    for fault, share in (("large_holes", added), ("large_parts", lost)):
        if share > MOST_REPAIRED:
            raise InputError("", *words_of(fault, share=share, most=MOST_REPAIRED))
    done = [*closed.remarks, *[f"{len(volumes) - 1} small part(s) were left out"] * (len(volumes) > 1)]
    return surface_from(*used_alone(closed.points, closed.shells[int(volumes.argmax())])), "; ".join(done)


def turned_over(surface: vtkPolyData) -> vtkPolyData:
    """Return a surface with reversed triangles."""
    return output_of(vtkReverseSense(), InputData=surface)


def _check_area(area: AttachmentArea, surface: vtkPolyData, units: str) -> None:
    landmarks = np.asarray(area.landmarks, dtype=np.float64)
    if landmarks.ndim != 2 or landmarks.shape[1] != 3 or not np.isfinite(landmarks).all():
        raise InputError("", *words_of("landmarks"))
    if len(landmarks) < (fewest := 3 if area.closed else 1):
        raise InputError("", *words_of("few_landmarks", count=len(landmarks), fewest=fewest))
    points, triangles = checked_surface(surface, "")
    _check_distance("the landmarks are", landmarks, points, units)
    if area.role != VIA:
        return
    ring = via_ring(landmarks)
    if not passes_through(ring, points, triangles):
        gap = np.linalg.norm(points - ring.centre, axis=1).min()
        raise InputError("", *words_of("beside_ring", gap=gap, units=units))


def _check_distance(subject: str, positions: Floats, points: Floats, units: str) -> None:
    """Check that positions lie close to a muscle's points."""
    lowest, highest = box_of(points)
    gaps = np.linalg.norm(np.maximum(np.maximum(lowest - positions, positions - highest), 0), axis=1)
    diagonal = np.linalg.norm(highest - lowest)
    if gaps.min() > diagonal:  # the muscle or the unit is wrong
        sizes = {"gap": gaps.min(), "size": diagonal, "units": units}
        raise InputError("", *words_of("away", subject=subject, **sizes))
