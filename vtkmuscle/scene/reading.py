"""Read a scene.toml and the files that it names; :mod:`vtkmuscle.scene.schema` has its keys."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.attachments.rings import ring_area, ring_length
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.template.kinds import read_template
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.attachments import SIDES, VIA, Aponeurosis, AttachmentArea
from vtkmuscle.data.estimated_areas import NEAR, estimated_areas
from vtkmuscle.io import (
    LiteratureCurve,
    curves_for,
    read_aponeurosis,
    read_landmarks,
    read_literature,
    read_polydata,
    read_surface,
)
from vtkmuscle.scene.data import MILLIMETRES, Muscle
from vtkmuscle.scene.faults import Faults, SceneError, errors_at
from vtkmuscle.scene.files import SceneFiles, parsed
from vtkmuscle.scene.mirror import mirrored_fields
from vtkmuscle.scene.motion import joints_of, motion_from
from vtkmuscle.scene.schema import Aponeuroses, Area, Estimate, MuscleTable, SceneTable
from vtkmuscle.scene.validation import validated

T = TypeVar("T")

#: Landmarks look like a ring where the last is next to the first, in units of the widest gap between others,
#: and 4 pi area / length^2 is more than the second. Curves of real muscles have over 2.4, or under 0.06.
NEXT_TO, ROUND = 1.5, 0.15


def read_fields(path: Path, values: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the fields of the scene in a scene.toml; see :meth:`vtkmuscle.Scene.load`.

    ``values`` stand for what is in the file, where they are given.
    """
    table = validated(parsed(path) if values is None else values, path)
    files, faults = SceneFiles(path), Faults()
    bones: dict[str, vtkPolyData] = {}
    for name, bone in table.bones.items():
        with faults.gathered():
            bones[name] = files.read(f"bones.{name}.surface", bone.surface, read_surface)
    motion = None
    with faults.gathered():
        motion = motion_from(table, files)
    muscles = {}
    for name, muscle in table.muscles.items():
        with faults.gathered():
            muscles[name] = _muscle(name, muscle, files, bones, motion, table)
    faults.raise_any()
    assert motion is not None
    joints = joints_of(table, files)
    for name, made in muscles.items():
        with faults.gathered():
            between = None if joints is None else joints.crossed(area.bone for area in made.attachments)
            crosses = _crossed(name, table.muscles[name], motion, between, path)
            muscles[name] = replace(made, crosses=crosses)
    faults.raise_any()
    fields = {
        "name": table.name or path.stem,
        "bones": bones,
        "muscles": muscles,
        "motion": motion,
        "units": table.units,
        "solver": table.solver.given(),
        "fixing": table.fixing.given(),
        "muscle_contact": table.muscle_contact,
        "model": table.model,
        "quality": table.quality,
        "files": files.paths,
    }
    return fields if table.mirror is None else mirrored_fields(fields, table.mirror)


def read_motion(path: Path) -> RigidMotion:
    """Read the motion of a scene.toml and the tables it names, and none of its surfaces.

    Raises
    ------
    SceneError
        If the file cannot be read, or is not right; the message says where and why.
    """
    return motion_from(validated(parsed(path), path), SceneFiles(path))


def _muscle(
    name: str,
    table: MuscleTable,
    files: SceneFiles,
    bones: dict[str, vtkPolyData],
    motion: RigidMotion | None,
    scene: SceneTable,
) -> Muscle:
    key, faults, frame = f"muscles.{name}", Faults(), scene.frame
    surface = superficial = None
    areas: tuple[AttachmentArea, ...] = ()
    sheets: tuple[Aponeurosis, ...] = ()
    literature: tuple[LiteratureCurve, ...] = ()
    fibres = None if table.fibres is None else table.fibres.given()
    with faults.gathered():
        surface = files.read(f"{key}.surface", table.surface, read_surface)
        estimate = table.attachments
        if isinstance(estimate, Estimate) and motion is not None:
            within, where = NEAR / MILLIMETRES[scene.units], f"{key}.attachments"
            areas = _estimated(where, estimate.bones, files, surface, bones, motion, within)
    if not isinstance(table.attachments, Estimate):
        areas = _areas(f"{key}.attachments", table.attachments, files, faults, frame)
    if table.aponeuroses is not None:
        sheets = _aponeuroses(f"{key}.aponeuroses", table.aponeuroses, files, faults, frame)
    if fibres is not None and fibres.get("template_file") is not None:
        with faults.gathered():
            where = f"{key}.fibres.template_file"
            files.read(where, fibres["template_file"], read_template)
            fibres["template_file"] = str(files.paths[where].resolve())  # any folder can name it so
    if table.superficial_fibres is not None:
        with faults.gathered():
            where = f"{key}.superficial_fibres"
            superficial = files.read(where, table.superficial_fibres, read_polydata)
    if table.literature is not None:
        with faults.gathered():
            literature = _literature(f"{key}.literature", name, table.literature, files)
    faults.raise_any()
    return Muscle(
        surface,
        areas,
        fibres,
        table.solver.given(),
        table.fixing.given(),
        superficial,
        literature,
        hill={} if table.hill is None else table.hill.given(),
        aponeuroses=sheets,
    )


def _crossed(
    name: str, table: MuscleTable, motion: RigidMotion, between: tuple[str, ...] | None, path: Path
) -> tuple[str, ...] | None:
    """Return the coordinates that a muscle crosses: those it names, or those between its bones."""
    if table.crosses is not None:
        for one in table.crosses:
            if one not in motion.coordinates:
                problem = f"the motion has no coordinate {one!r}"
                raise SceneError(
                    problem, f"muscles.{name}.crosses", suggestion(one, motion.coordinates), path
                )
        return tuple(table.crosses)
    return between


def _areas(
    key: str, tables: list[Area], files: SceneFiles, faults: Faults, frame: str
) -> tuple[AttachmentArea, ...]:
    areas = []
    read = partial(read_landmarks, frame=frame)
    for number, area in enumerate(tables):
        with faults.gathered():
            landmarks, closed = files.read(f"{key}[{number}].landmarks", area.landmarks, read)
            if area.closed is None and not closed and area.role != VIA and _goes_round(landmarks):
                problem = "the landmarks go round an area, but are taken for an open curve: the file does "
                problem += "not end with its first landmark"
                remedy = "write closed = true for the area within, closed = false for the curve alone"
                where = f"{key}[{number}].landmarks"
                warnings.warn(str(SceneError(problem, where, remedy, files.paths[""])), stacklevel=2)
            # A via ring is one whether or not its file repeats the first landmark.
            closed = closed or area.role == VIA if area.closed is None else area.closed
            areas.append(AttachmentArea(area.role, area.bone, landmarks, closed, area.estimated))
    return tuple(areas)


def _goes_round(landmarks: Floats) -> bool:
    """Return whether the last landmark is beside the first, and what is between them is an area."""
    if len(landmarks) < 4:
        return False
    gaps = np.linalg.norm(np.diff(landmarks, axis=0, append=landmarks[:1]), axis=1)
    enclosed = 4.0 * np.pi * ring_area(landmarks) / max(ring_length(landmarks), 1e-300) ** 2
    return bool(gaps[-1] < NEXT_TO * gaps[:-1].max() and enclosed > ROUND)


def _aponeuroses(
    key: str, table: Aponeuroses, files: SceneFiles, faults: Faults, frame: str
) -> tuple[Aponeurosis, ...]:
    sheets = []
    for side in SIDES:
        texts = getattr(table, side)
        for number, text in enumerate(texts):
            where = f"{key}.{side}" + (f"[{number}]" if len(texts) > 1 else "")
            with faults.gathered():
                sheets.append(files.read(where, text, partial(read_aponeurosis, side=side, frame=frame)))
    return tuple(sheets)


def _literature(key: str, muscle: str, text: str, files: SceneFiles) -> tuple[LiteratureCurve, ...]:
    """Return the published moment arms of a muscle: those of its name in a file."""
    curves = files.read(key, text, read_literature)
    mine = curves_for(curves, muscle=muscle)
    if not mine:
        names = sorted({curve.muscle for curve in curves})
        problem = f"the file has no moment arms of {muscle!r}"
        raise SceneError(problem, key, f"it has those of {', '.join(names)}", files.paths[key])
    return mine


def _estimated(
    key: str,
    between: tuple[str, ...],
    files: SceneFiles,
    surface: vtkPolyData,
    bones: dict[str, vtkPolyData],
    motion: RigidMotion,
    within: float,
) -> tuple[AttachmentArea, ...]:
    """Return estimated attachments; of two bones that are not named the moving one has the insertion."""
    origin, insertion = between or (None, None)
    bodies: dict[bytes, list[str]] = {}
    for bone in bones:  # those without transforms stay where they are
        bodies.setdefault(motion.transforms.get(bone, motion.times[:0]).tobytes(), []).append(bone)
    with errors_at(key, files.paths[""]):
        areas = estimated_areas(
            surface, bones, within=within, origin=origin, insertion=insertion, bodies=[*bodies.values()]
        )
    if between:
        return tuple(areas)
    moving = {area.role: area.bone in motion.transforms for area in areas}
    if moving["origin"] and not moving["insertion"]:
        other = {"origin": "insertion", "insertion": "origin"}
        areas = [replace(area, role=other[area.role]) for area in areas]
    return tuple(areas)
