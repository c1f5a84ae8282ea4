"""Read a scene.toml and its files; :mod:`vtkmuscle.scene.schema` has the keys."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle import io
from vtkmuscle.core.attachments.patches import ring_area, ring_sides
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.template import read_template
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.attachments import ROLES, SIDES, VIA, Aponeurosis, AttachmentArea
from vtkmuscle.filters.attachment_estimator import NEAR, estimated_areas
from vtkmuscle.io.literature import literature_of
from vtkmuscle.scene.checks import turned_over
from vtkmuscle.scene.data import Muscle, SceneError, SceneFiles, parsed, scene_errors_at, words_of
from vtkmuscle.scene.joints import SceneJoints, joints_of, motion_from
from vtkmuscle.scene.schema import Aponeuroses, Area, Estimate, MuscleTable, SceneTable
from vtkmuscle.scene.validation import validated

#: Landmarks look like a ring if the closing gap is below the first number, in widest gaps, and if
#: 4 pi area / length^2 exceeds the second. Open curves of real muscles have over 2.4, or under 0.06.
NEXT_TO, ROUND = 1.5, 0.15


def read_fields(path: Path) -> dict[str, Any]:
    """Return the fields of a scene.toml; see :meth:`vtkmuscle.Scene.load`."""
    table, files = validated(parsed(path), path), SceneFiles(path)
    read = {n: files.tried(f"bones.{n}.surface", b.surface, io.read_surface) for n, b in table.bones.items()}
    bones = {name: surface for name, surface in read.items() if surface is not None}
    joints = motion = None
    with files.faults.gathered():
        joints = joints_of(table, files)
        motion = motion_from(table, files, joints)
    muscles = {name: _muscle(name, table, files, bones, motion, joints) for name in table.muscles}
    files.faults.raise_any()
    same = ("units", "muscle_contact", "deformer", "quality", "frame", "guessed")
    fields = {key: getattr(table, key) for key in same} | _settings(table)
    fields |= {"name": table.name or path.stem, "bones": bones, "muscles": muscles, "motion": motion}
    fields |= {"files": files.paths, "joints": {} if joints is None else joints.coordinates()}
    fields["paths"] = None if table.paths is None else table.paths.settings()
    return fields if table.mirror is None else _mirrored(fields, table.mirror)


def read_motion(path: Path) -> RigidMotion:
    """Read the motion of a scene.toml without surfaces; SceneError for faults."""
    table, files = validated(parsed(path), path), SceneFiles(path)
    return motion_from(table, files, joints_of(table, files))


def _muscle(
    name: str, scene: SceneTable, files: SceneFiles, bones: dict[str, vtkPolyData],
    motion: RigidMotion | None, joints: SceneJoints | None,
) -> Muscle | None:  # fmt: skip
    """Read the files of a muscle; None after a fault of any file."""
    key, table, faults = f"muscles.{name}", scene.muscles[name], files.faults
    areas = _areas(key, table.attachments, files, scene)
    surface = files.tried(f"{key}.surface", table.surface, io.read_surface)
    if isinstance(table.attachments, Estimate) and surface is not None and motion is not None:
        with faults.gathered(), scene_errors_at(f"{key}.attachments", files.paths[""]):
            tables = motion.transforms
            chains = {bone: [tables[bone].tobytes()] if bone in tables else [] for bone in bones}
            within, named = NEAR / MILLIMETRES[scene.units], zip(ROLES, table.attachments.bones, strict=False)
            areas = areas_in_contact(surface, bones, chains, within=within, **dict(named))
    sheets = [] if table.aponeuroses is None else _aponeuroses(key, table.aponeuroses, files, scene)
    fibres = None if table.fibres is None else table.fibres.settings()
    if fibres is not None and fibres.get("template_file") is not None:
        where = f"{key}.fibres.template_file"
        files.tried(where, fibres["template_file"], read_template)
        fibres["template_file"] = str(files.paths[where].resolve())  # valid from any folder
    lines = files.tried(f"{key}.superficial_fibres", table.superficial_fibres, io.read_polydata)
    published = files.tried(f"{key}.literature", table.literature, partial(literature_of, muscles=[name]))
    # What does not change is no coordinate of the motion.
    still = *(scene.motion.coordinates or ()), *(() if joints is None else joints.tree.free)
    coordinates = (table.crosses or ()) if motion is None else {*motion.coordinates, *still}
    for missing in (name for name in table.crosses or () if name not in coordinates):
        problem, remedy = f"the motion has no coordinate {missing!r}", suggestion(missing, coordinates)
        faults.errors.append(SceneError(problem, f"{key}.crosses", remedy, files.paths[""]))
    if surface is None or faults.errors:
        return None
    crosses = None if table.crosses is None else tuple(table.crosses)
    if joints is not None and crosses is None:
        crosses = joints.crossed(area.bone for area in areas)
    known: dict[str, Any] = {"literature": (published or {}).get(name, ()), "muscle": table.muscle or ""}
    known |= {"superficial_fibres": lines, "aponeuroses": tuple(sheets), "crosses": crosses}
    known["hill"] = {} if table.hill is None else table.hill.model_dump(exclude_none=True)
    return Muscle(surface, tuple(areas), fibres, **_settings(table), **known)


def _settings(table: SceneTable | MuscleTable) -> dict[str, Any]:
    return {"solver": table.solver.settings(), "fixing": table.fixing.settings()}


def _areas(key: str, tables: list[Area], files: SceneFiles, scene: SceneTable) -> list[AttachmentArea]:
    areas = []
    for number, area in enumerate(tables):
        where = f"{key}.attachments[{number}].landmarks"
        read = files.tried(where, area.landmarks, partial(io.read_landmarks, frame=scene.frame))
        if read is None:
            continue
        landmarks, closed = read
        if area.closed is None and not closed and area.role != VIA and goes_round(landmarks):
            problem, remedy = words_of("open_curve")
            warnings.warn(str(SceneError(problem, where, remedy, files.paths[""])), stacklevel=2)
        closed = area.role == VIA or (closed if area.closed is None else area.closed)
        areas.append(AttachmentArea(area.role, area.bone, landmarks, closed, area.estimated, area.confidence))
    return areas


def goes_round(landmarks: Floats) -> bool:
    """Return whether landmarks nearly close and enclose an area."""
    gaps, area = ring_sides(landmarks), 4.0 * np.pi * ring_area(landmarks)
    return bool(len(gaps) > 3 and gaps[-1] < NEXT_TO * gaps[:-1].max() and area > ROUND * gaps.sum() ** 2)


def _aponeuroses(key: str, table: Aponeuroses, files: SceneFiles, scene: SceneTable) -> list[Aponeurosis]:
    sheets = []
    for side in SIDES:
        texts, read = getattr(table, side), partial(io.read_aponeurosis, side=side, frame=scene.frame)
        for number, text in enumerate(texts):
            where = f"{key}.aponeuroses.{side}" + (f"[{number}]" if len(texts) > 1 else "")
            sheets.append(files.tried(where, text, read))
    return [sheet for sheet in sheets if sheet is not None]


def areas_in_contact(
    surface: vtkPolyData, bones: Mapping[str, vtkPolyData], chains: Mapping[str, list[Any]], **options: Any
) -> list[AttachmentArea]:
    """Return a muscle's areas in contact with bones, by :func:`estimated_areas` with options.

    ``chains`` are the moving bodies of each bone, upwards. Without named bones, the insertion is on the bone
    of the longer chain.
    """
    bodies = {bone: next(iter(chains[bone]), None) for bone in bones}
    groups = [[bone for bone in bones if bodies[bone] == body] for body in dict.fromkeys(bodies.values())]
    areas = estimated_areas(surface, bones, bodies=groups, **options)
    depth = {area.role: len(chains[area.bone]) for area in areas}
    if not {*ROLES} & {*options} and depth["origin"] > depth["insertion"]:
        areas = [replace(area, role=ROLES[area.role == ROLES[0]]) for area in areas]
    return areas


def _mirrored(fields: dict[str, Any], axis: str) -> dict[str, Any]:
    """Return a scene's fields mirrored along x, y or z. Values of coordinates stay."""
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
    transforms = {bone: both @ table @ both for bone, table in motion.transforms.items()}
    centre = {bone: signs * motion.centre_of(bone) for bone in transforms}
    coordinates = {name: old.carried(both) for name, old in motion.coordinates.items()}
    motion = replace(motion, transforms=transforms, centre=centre, coordinates=coordinates)
    return fields | {"bones": bones, "muscles": muscles, "motion": motion}
