"""Scenes of one muscle that differ from the given one in a single thing, and the lengths they give."""

from __future__ import annotations

import threading
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vtkmuscle.core.mesh.halving import halved
from vtkmuscle.core.mesh.line_lengths import polyline_lengths
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, polylines_of, surface_from, triangles_of
from vtkmuscle.data.attachments import VIA
from vtkmuscle.data.paths import wrenches_over_time
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.run.muscles import muscle_pipeline
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.scene.data import Muscle, SceneData


@dataclass(frozen=True, eq=False)
class Solution:
    """Lengths of a variant.

    Attributes
    ----------
    lengths, fibre_lengths : (f, k) arrays
        Of the paths and of the fibres in each kept frame [mm].
    wrenches : dict of str to (f, k, 6) array
        Of the paths, by bone.
    rest : (k,) array
        Of the fibres at rest [mm].
    """

    lengths: Floats
    fibre_lengths: Floats
    wrenches: dict[str, Floats]
    rest: Floats


def other_model(scene: SceneData, name: str) -> SceneData:
    """Return the scene with the fibres pulled taut where the muscle is deformed, and the other way round."""
    return _of_one(scene, name, model="paths" if scene.model == "volume" else "volume")


def finer_mesh(scene: SceneData, name: str) -> SceneData:
    """Return the scene with all edges of the muscle half as long, its surface the same."""
    surface = scene.muscles[name].surface
    points, triangles, _ = halved(points_of(surface), triangles_of(surface, name))
    return _of_one(scene, name, surface=surface_from(points, triangles))


def finer_slices(scene: SceneData, name: str) -> SceneData:
    """Return the scene with a slice for every height, and fibres of twice the segments."""
    given = dict(scene.muscles[name].fibres or {})
    default = FibreTemplateSource.parameter_declarations["resolution"].default
    given |= {"slice_tolerance": 0.0, "resolution": 2 * int(given.get("resolution", default))}
    return _of_one(scene, name, fibres=given)


def moved_landmarks(scene: SceneData, name: str, *, distance: float, rng: np.random.Generator) -> SceneData:
    """Return the scene with every area of the muscle moved as a whole, each somewhere else.

    All directions are equally likely; via rings stay. The fibres alone are pulled taut.

    Parameters
    ----------
    scene, name : SceneData, str
        Which muscle, of which scene.
    distance : float
        By how much areas are moved [mm].
    rng : numpy.random.Generator
        Gives the directions.
    """
    moved = with_moved_areas(scene.muscles[name], distance / scene.millimetres, rng)
    return _of_one(scene, name, model="paths", attachments=moved.attachments)


def with_moved_areas(muscle: Muscle, distance: float, rng: np.random.Generator) -> Muscle:
    """Return a muscle with every area moved as a whole by a distance, in a direction of its own; no via ring.

    The distance is in the unit of the coordinates; all directions are equally likely.
    """
    areas = []
    for area in muscle.attachments:
        direction = rng.normal(size=3)
        shift = distance * direction / np.linalg.norm(direction)
        areas.append(
            area if area.role == VIA else replace(area, landmarks=np.asarray(area.landmarks) + shift)
        )
    return replace(muscle, attachments=tuple(areas))


#: What makes the variant of each kind that is one further solve.
MADE = {"model": other_model, "mesh": finer_mesh, "slices": finer_slices}


def _of_one(scene: SceneData, name: str, *, model: str | None = None, **changed: Any) -> SceneData:
    """Return the scene of one muscle, with other fields of that."""
    muscle: Muscle = replace(scene.muscles[name], **changed)
    given = {field.name: getattr(scene, field.name) for field in fields(SceneData)}
    given |= {"muscles": {name: muscle}, "model": model or scene.model, "muscle_contact": "off"}
    return SceneData(**given)


def solved(
    scene: SceneData,
    name: str,
    numbers: range,
    stop: threading.Event,
) -> Solution:
    """Return the lengths of a muscle's paths and fibres in some frames, and nothing else.

    Parameters
    ----------
    scene, name : SceneData, str
        Which muscle, of which scene.
    numbers : range
        Of the frames; those before are solved as well, where the shape depends on them.
    stop : threading.Event
        Set from outside to end early.

    Raises
    ------
    AbortedError
        If it was stopped.
    ValueError
        If it cannot be solved.
    """
    pipeline = muscle_pipeline(scene, name)
    assert pipeline.metrics is not None  # variants are made of muscles with fibres
    track = MuscleTrack()
    for number in range(numbers[-1] + 1) if pipeline.deformer is not None else numbers:
        if stop.is_set():
            raise AbortedError(f"errors of {name} were stopped")
        time = float(scene.motion.times[number])
        if pipeline.deformer is not None:
            pipeline.deformer.update(time=time)
        if number in numbers:
            found = pipeline.metrics.update(time=time).output
            track.keep(found, scene.millimetres)
            track.fibres.clear()
    rest = polylines_of(pipeline.fibres.update().output, "fibres")
    return Solution(
        np.array(track.lengths),
        np.array(track.fibre_lengths),
        wrenches_over_time(track.wrenches),
        polyline_lengths(rest.points, rest.offsets) * scene.millimetres,
    )
