"""Read a scene.toml and its files; :mod:`vtkmuscle.scene.schema` has the keys."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.attachments.patches import ring_area, ring_length
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.template import read_template
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.attachments import SIDES, VIA, Aponeurosis, AttachmentArea
from vtkmuscle.filters.attachment_estimator import NEAR, estimated_areas
from vtkmuscle.io import (
    LiteratureCurve,
    curves_for,
    read_aponeurosis,
    read_landmarks,
    read_literature,
    read_polydata,
    read_surface,
)
from vtkmuscle.scene.checks import turned_over
from vtkmuscle.scene.data import MILLIMETRES, Muscle
from vtkmuscle.scene.faults import Faults, SceneError, SceneFiles, errors_at, parsed
from vtkmuscle.scene.joints import joints_of, motion_from
from vtkmuscle.scene.schema import Aponeuroses, Area, Estimate, SceneTable
from vtkmuscle.scene.validation import validated

#: Landmarks look like a ring if the closing gap is below the first number, in widest gaps, and if
#: 4 pi area / length^2 exceeds the second. Open curves of real muscles have over 2.4, or under 0.06.
NEXT_TO, ROUND = 1.5, 0.15


def read_fields(path: Path, values: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the fields of a scene.toml; see :meth:`vtkmuscle.Scene.load`.

    ``values`` replace the content of the file. First all keys are checked, then all files are read; each step
    reports its faults together. The scene's constructor checks the surfaces.
    """
    table = validated(parsed(path) if values is None else values, path)
    files, faults = SceneFiles(path), Faults()
    bones: dict[str, vtkPolyData] = {}
    muscles: dict[str, Muscle] = {}
    motion = crossed = None
    for name, bone in table.bones.items():
        with faults.gathered():
            bones[name] = files.read(f"bones.{name}.surface", bone.surface, read_surface)
    with faults.gathered():
        joints = joints_of(table, files)
        motion = motion_from(table, files, joints)
        crossed = None if joints is None else joints.crossed
    for name in table.muscles:
        with faults.gathered():
            muscles[name] = _muscle(name, table, files, bones, motion, crossed)
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
        "deformer": table.deformer,
        "paths": None if table.paths is None else table.paths.given(),
        "quality": table.quality,
        "frame": table.frame,
        "guessed": table.guessed,
        "files": files.paths,
    }
    return fields if table.mirror is None else _mirrored(fields, table.mirror)


def read_motion(path: Path) -> RigidMotion:
    """Read the motion of a scene.toml without surfaces; SceneError for faults."""
    table, files = validated(parsed(path), path), SceneFiles(path)
    return motion_from(table, files, joints_of(table, files))


def _muscle(
    name: str,
    scene: SceneTable,
    files: SceneFiles,
    bones: dict[str, vtkPolyData],
    motion: RigidMotion | None,
    crossed: Callable[[Iterable[str]], tuple[str, ...]] | None,
) -> Muscle:
    """Read the files of a muscle.

    The motion is None if unreadable; ``crossed`` returns the coordinates of joints between bones.
    """
    key, table, faults = f"muscles.{name}", scene.muscles[name], Faults()
    fibres = None if table.fibres is None else table.fibres.given()
    estimated = isinstance(table.attachments, Estimate)
    fields: dict[str, Any] = {
        "attachments": [] if estimated else _areas(key, table.attachments, files, faults, scene),
        "fibres": fibres,
        "solver": table.solver.given(),
        "fixing": table.fixing.given(),
        "hill": {} if table.hill is None else table.hill.model_dump(exclude_none=True),
        "muscle": table.muscle or "",
    }
    with faults.gathered():
        fields["surface"] = files.read(f"{key}.surface", table.surface, read_surface)
        if isinstance(table.attachments, Estimate) and motion is not None:
            estimate = partial(_estimated, table.attachments.bones, fields["surface"], bones, motion)
            with errors_at(f"{key}.attachments", files.paths[""]):
                fields["attachments"] = estimate(within=NEAR / MILLIMETRES[scene.units])
    if table.aponeuroses is not None:
        fields["aponeuroses"] = _aponeuroses(key, table.aponeuroses, files, faults, scene)
    if fibres is not None and fibres.get("template_file") is not None:
        with faults.gathered():
            where = f"{key}.fibres.template_file"
            files.read(where, fibres["template_file"], read_template)
            fibres["template_file"] = str(files.paths[where].resolve())  # valid from any folder
    if table.superficial_fibres is not None:
        with faults.gathered():
            where = f"{key}.superficial_fibres"
            fields["superficial_fibres"] = files.read(where, table.superficial_fibres, read_polydata)
    if table.literature is not None:
        with faults.gathered():
            fields["literature"] = _literature(f"{key}.literature", name, table.literature, files)
    if table.crosses is not None:
        fields["crosses"] = tuple(table.crosses)
        coordinates = table.crosses if motion is None else motion.coordinates
        for missing in (name for name in table.crosses if name not in coordinates):
            problem, remedy = f"the motion has no coordinate {missing!r}", suggestion(missing, coordinates)
            faults.errors.append(SceneError(problem, f"{key}.crosses", remedy, files.paths[""]))
    faults.raise_any()
    if crossed is not None and table.crosses is None:
        fields["crosses"] = crossed(area.bone for area in fields["attachments"])
    return Muscle(**fields)


def _areas(
    key: str, tables: list[Area], files: SceneFiles, faults: Faults, scene: SceneTable
) -> list[AttachmentArea]:
    areas = []
    for number, area in enumerate(tables):
        where = f"{key}.attachments[{number}].landmarks"
        with faults.gathered():
            landmarks, closed = files.read(where, area.landmarks, partial(read_landmarks, frame=scene.frame))
            if area.closed is None and not closed and area.role != VIA and _goes_round(landmarks):
                problem = "the landmarks surround an area, but are read as an open curve: the file does not "
                problem += "repeat the first landmark at the end"
                remedy = "write closed = true for the area within, closed = false for the curve alone"
                warnings.warn(str(SceneError(problem, where, remedy, files.paths[""])), stacklevel=2)
            closed = area.role == VIA or (closed if area.closed is None else area.closed)
            sure = area.estimated, area.confidence
            areas.append(AttachmentArea(area.role, area.bone, landmarks, closed, *sure))
    return areas


def _goes_round(landmarks: Floats) -> bool:
    """Return whether landmarks nearly close and enclose an area."""
    if len(landmarks) < 4:
        return False
    gaps = np.linalg.norm(np.diff(landmarks, axis=0, append=landmarks[:1]), axis=1)
    enclosed = 4.0 * np.pi * ring_area(landmarks) / max(ring_length(landmarks), 1e-300) ** 2
    return bool(gaps[-1] < NEXT_TO * gaps[:-1].max() and enclosed > ROUND)


def _aponeuroses(
    key: str, table: Aponeuroses, files: SceneFiles, faults: Faults, scene: SceneTable
) -> list[Aponeurosis]:
    sheets = []
    for side in SIDES:
        texts, read = getattr(table, side), partial(read_aponeurosis, side=side, frame=scene.frame)
        for number, text in enumerate(texts):
            where = f"{key}.aponeuroses.{side}" + (f"[{number}]" if len(texts) > 1 else "")
            with faults.gathered():
                sheets.append(files.read(where, text, read))
    return sheets


def _literature(key: str, muscle: str, text: str, files: SceneFiles) -> tuple[LiteratureCurve, ...]:
    """Return the published moment arms of a muscle in a file."""
    curves = files.read(key, text, read_literature)
    own = curves_for(curves, muscle=muscle)
    if not own:
        names = sorted({curve.muscle for curve in curves})
        problem = f"the file has no moment arms of {muscle!r}"
        raise SceneError(problem, key, f"muscles in the file: {', '.join(names)}", files.paths[key])
    return own


def _estimated(
    named: tuple[str, ...],
    surface: vtkPolyData,
    bones: dict[str, vtkPolyData],
    motion: RigidMotion,
    *,
    within: float,
) -> list[AttachmentArea]:
    """Return estimated attachments; by default the insertion is on the moving bone."""
    origin, insertion = named or (None, None)
    bodies: dict[bytes, list[str]] = {}
    for bone in bones:  # bones without transforms do not move
        bodies.setdefault(motion.transforms.get(bone, motion.times[:0]).tobytes(), []).append(bone)
    areas = estimated_areas(
        surface, bones, within=within, origin=origin, insertion=insertion, bodies=[*bodies.values()]
    )
    moving = {area.role: area.bone in motion.transforms for area in areas}
    if not named and moving["origin"] and not moving["insertion"]:
        other = {"origin": "insertion", "insertion": "origin"}
        areas = [replace(area, role=other[area.role]) for area in areas]
    return areas


def _mirrored(fields: dict[str, Any], axis: str) -> dict[str, Any]:
    """Return a scene's fields mirrored along x, y or z; values of coordinates stay."""
    signs = np.where(np.array(list("xyz")) == axis, -1.0, 1.0)
    both, motion = np.diag([*signs, 1.0]), fields["motion"]
    bones = {name: _mirrored_surface(bone, signs) for name, bone in fields["bones"].items()}
    muscles = {name: _mirrored_muscle(muscle, signs) for name, muscle in fields["muscles"].items()}
    motion = replace(
        motion,
        transforms={bone: both @ table @ both for bone, table in motion.transforms.items()},
        centre={bone: signs * motion.centre_of(bone) for bone in motion.transforms},
        coordinates={name: old.carried(both) for name, old in motion.coordinates.items()},
    )
    return fields | {"bones": bones, "muscles": muscles, "motion": motion}


def _mirrored_surface(surface: vtkPolyData, signs: Floats) -> vtkPolyData:
    """Return a surface with points times signs (3,) and the same outward side."""
    return turned_over(with_points(surface, signs * points_of(surface)))


def _mirrored_muscle(muscle: Muscle, signs: Floats) -> Muscle:
    lines = muscle.superficial_fibres
    return replace(
        muscle,
        surface=_mirrored_surface(muscle.surface, signs),
        attachments=tuple(replace(area, landmarks=signs * area.landmarks) for area in muscle.attachments),
        aponeuroses=tuple(
            replace(sheet, points=signs * sheet.points, triangles=sheet.triangles[:, ::-1])
            for sheet in muscle.aponeuroses
        ),
        superficial_fibres=None if lines is None else with_points(lines, signs * points_of(lines)),
    )
