"""Read a scene.toml and its files; :mod:`vtkmuscle.scene.schema` has the keys."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle import io
from vtkmuscle.core.attachments.patches import ring_area, ring_length
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.template import read_template
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.attachments import ROLES, SIDES, VIA, Aponeurosis, AttachmentArea
from vtkmuscle.filters.attachment_estimator import NEAR, estimated_areas
from vtkmuscle.scene.checks import turned_over
from vtkmuscle.scene.data import MILLIMETRES, Faults, Muscle, SceneError, SceneFiles, errors_at, parsed
from vtkmuscle.scene.joints import joints_of, motion_from
from vtkmuscle.scene.schema import Aponeuroses, Area, Estimate, SceneTable
from vtkmuscle.scene.validation import validated

#: Landmarks look like a ring if the closing gap is below the first number, in widest gaps, and if
#: 4 pi area / length^2 exceeds the second. Open curves of real muscles have over 2.4, or under 0.06.
NEXT_TO, ROUND = 1.5, 0.15


def read_fields(path: Path) -> dict[str, Any]:
    """Return the fields of a scene.toml; see :meth:`vtkmuscle.Scene.load`."""
    table = validated(parsed(path), path)
    files, faults = SceneFiles(path), Faults()
    bones: dict[str, vtkPolyData] = {}
    muscles: dict[str, Muscle] = {}
    motion = crossed = None
    for name, bone in table.bones.items():
        with faults.gathered():
            bones[name] = files.read(f"bones.{name}.surface", bone.surface, io.read_surface)
    with faults.gathered():
        joints = joints_of(table, files)
        motion = motion_from(table, files, joints)
        crossed = None if joints is None else joints.crossed
    for name in table.muscles:
        with faults.gathered():
            muscles[name] = _muscle(name, table, files, bones, motion, crossed)
    faults.raise_any()
    same = ("units", "muscle_contact", "deformer", "quality", "frame", "guessed")
    fields = {
        **{key: getattr(table, key) for key in same},
        "name": table.name or path.stem,
        "bones": bones,
        "muscles": muscles,
        "motion": motion,
        "solver": table.solver.given(),
        "fixing": table.fixing.given(),
        "files": files.paths,
        "paths": None if table.paths is None else table.paths.given(),
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
    """Read the files of a muscle."""
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
        fields["surface"] = files.read(f"{key}.surface", table.surface, io.read_surface)
        if isinstance(table.attachments, Estimate) and motion is not None:
            with errors_at(f"{key}.attachments", files.paths[""]):
                within, named = NEAR / MILLIMETRES[scene.units], table.attachments.bones
                fields["attachments"] = _estimated(named, fields["surface"], bones, motion, within)
    if table.aponeuroses is not None:
        fields["aponeuroses"] = _aponeuroses(key, table.aponeuroses, files, faults, scene)
    if fibres is not None and fibres.get("template_file") is not None:
        with faults.gathered():
            where = f"{key}.fibres.template_file"
            files.read(where, fibres["template_file"], read_template)
            fibres["template_file"] = str(files.paths[where].resolve())  # valid from any folder
    own_literature: Callable[[Path], Any] = partial(_literature, muscle=name)
    for entry, reader in (("superficial_fibres", io.read_polydata), ("literature", own_literature)):
        if (text := getattr(table, entry)) is not None:
            with faults.gathered():
                fields[entry] = files.read(f"{key}.{entry}", text, reader)
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
            read = partial(io.read_landmarks, frame=scene.frame)
            landmarks, closed = files.read(where, area.landmarks, read)
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
        texts, read = getattr(table, side), partial(io.read_aponeurosis, side=side, frame=scene.frame)
        for number, text in enumerate(texts):
            where = f"{key}.aponeuroses.{side}" + (f"[{number}]" if len(texts) > 1 else "")
            with faults.gathered():
                sheets.append(files.read(where, text, read))
    return sheets


def _literature(path: Path, muscle: str) -> tuple[io.LiteratureCurve, ...]:
    """Return the published moment arms of a muscle in a file."""
    curves = io.read_literature(path)
    if not (own := io.curves_for(curves, muscle=muscle)):
        listed = f"muscles in the file: {', '.join(sorted({curve.muscle for curve in curves}))}"
        raise InputError(path, f"the file has no moment arms of {muscle!r}", listed)
    return own


def _estimated(
    named: tuple[str, ...],
    surface: vtkPolyData,
    bones: dict[str, vtkPolyData],
    motion: RigidMotion,
    within: float,
) -> list[AttachmentArea]:
    """Return estimated attachments; by default the insertion is on the moving bone."""
    origin, insertion = named or (None, None)
    bodies: dict[bytes, list[str]] = {}
    for bone in bones:  # bones without transforms do not move
        bodies.setdefault(motion.transforms.get(bone, motion.times[:0]).tobytes(), []).append(bone)
    ends: dict[str, Any] = {"origin": origin, "insertion": insertion, "bodies": [*bodies.values()]}
    areas = estimated_areas(surface, bones, within=within, **ends)
    moving = {area.role: area.bone in motion.transforms for area in areas}
    if not named and moving["origin"] and not moving["insertion"]:
        areas = [replace(area, role=ROLES[area.role == ROLES[0]]) for area in areas]
    return areas


def _mirrored(fields: dict[str, Any], axis: str) -> dict[str, Any]:
    """Return a scene's fields mirrored along x, y or z; values of coordinates stay."""
    signs = np.where(np.array(list("xyz")) == axis, -1.0, 1.0)
    both, motion = np.diag([*signs, 1.0]), fields["motion"]

    def mirrored(data: vtkPolyData) -> Any:
        return with_points(data, signs * points_of(data))

    bones = {name: mirrored(turned_over(bone)) for name, bone in fields["bones"].items()}
    muscles = {}
    for name, old in fields["muscles"].items():
        areas = (replace(area, landmarks=signs * area.landmarks) for area in old.attachments)
        turned = ((each, signs * each.points, each.triangles[:, ::-1]) for each in old.aponeuroses)
        sheets = (replace(each, points=points, triangles=faces) for each, points, faces in turned)
        muscle = replace(old, surface=mirrored(turned_over(old.surface)), attachments=tuple(areas))
        lines = old.superficial_fibres and mirrored(old.superficial_fibres)
        muscles[name] = replace(muscle, aponeuroses=tuple(sheets), superficial_fibres=lines)
    motion = replace(
        motion,
        transforms={bone: both @ table @ both for bone, table in motion.transforms.items()},
        centre={bone: signs * motion.centre_of(bone) for bone in motion.transforms},
        coordinates={name: old.carried(both) for name, old in motion.coordinates.items()},
    )
    return fields | {"bones": bones, "muscles": muscles, "motion": motion}
