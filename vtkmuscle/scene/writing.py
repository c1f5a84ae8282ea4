"""Write a scene to a folder, as :mod:`vtkmuscle.scene.reading` reads it."""

import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import ROUNDING
from vtkmuscle.data.arrays import blocks_of
from vtkmuscle.data.attachments import SIDES, VIA, AttachmentArea, aponeuroses_data
from vtkmuscle.io import write_literature, write_motion_table, write_polydata, write_text
from vtkmuscle.io.csv_table import write_rows
from vtkmuscle.io.writing import Outputs, write_json
from vtkmuscle.scene.data import Muscle, SceneData, SceneFiles, parsed
from vtkmuscle.scene.joints import joints_of
from vtkmuscle.scene.schema import SceneTable

#: Schema by which 3D Slicer recognises its curves.
_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/"
    "Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#"
)


def write_scene(scene: SceneData, folder: Path) -> Path:
    """Write a scene and its files to a folder; see :meth:`vtkmuscle.Scene.save`."""
    for name, surface in scene.bones.items():
        write_polydata(folder / f"bones/{name}.vtp", surface)
    for name, muscle in scene.muscles.items():
        write_polydata(folder / f"muscles/{name}.vtp", muscle.surface)
        if muscle.superficial_fibres is not None:
            write_polydata(folder / f"superficial_fibres/{name}.vtp", muscle.superficial_fibres)
        if muscle.literature:
            write_literature(folder / f"literature/{name}.csv", muscle.literature)
        for block, sheet in blocks_of(aponeuroses_data(muscle.aponeuroses)):  # named SIDE_NUMBER
            write_polydata(folder / f"aponeuroses/{name}_{block}.vtp", sheet)
        write_areas(folder, name, muscle.attachments, scene.frame)
    tables = tables_of(scene, chain(*scene.joints.values()) if (joints := _joints(scene)) else ())
    if joints:
        tables |= {"joints": joints, "motion": {"file": "motion.csv"}}
        columns = {name: own.values for name, own in _free(scene.motion, joints).items()}
        values = np.transpose([scene.motion.times, *columns.values()]).tolist()
        write_rows(folder / "motion.csv", [["time", *columns], *values])
    for bone in () if joints else scene.motion.transforms:
        write_motion_table(folder / _motion_file(scene.motion, bone), scene.motion, bone)
    path = folder / "scene.toml"
    header = "# All lengths are in this unit. Paths are relative to this file.\n"
    write_text(path, header + tomli_w.dumps(tables, indent=2))
    return path


def save_unless_there(scene: SceneData, folder: Path, *, overwrite: bool) -> Path:
    """Write a scene to a folder without a scene.toml, and return the path of scene.toml."""
    path = folder / "scene.toml"
    if overwrite or not path.exists():
        with Outputs(folder, overwrite=overwrite):
            write_scene(scene, folder)
    return path


def tables_of(scene: SceneData, still: Iterable[str] = ()) -> dict[str, Any]:
    """Return the tables of scene.toml for the files of :func:`write_scene`.

    ``still`` are coordinates of joints beside those of the motion.
    """
    known = {*scene.motion.coordinates, *still}
    defaults = {"frame": "LPS", "guessed": {}, "muscle_contact": "off", "deformer": "paths"}
    tables = {
        **{key: getattr(scene, key) for key in ("name", "units", "quality")},
        **{key: value for key, usual in defaults.items() if (value := getattr(scene, key)) != usual},
        "bones": {name: {"surface": f"bones/{name}.vtp"} for name in scene.bones},
        "motion": _motion(scene.motion),
        "muscles": {name: _muscle(name, each, known) for name, each in scene.muscles.items()},
        "paths": scene.paths,
        **{key: getattr(scene, key) or None for key in ("solver", "fixing")},
    }
    return {key: _plain(value) for key, value in tables.items() if value is not None}


def inline_toml(value: Any) -> str:
    """Return a value in TOML, tables in one line."""
    if isinstance(value, Mapping):
        named = {key if re.fullmatch(r"[\w-]+", key, re.A) else json.dumps(key): value[key] for key in value}
        return f"{{ {', '.join(f'{key} = {inline_toml(item)}' for key, item in named.items())} }}"
    if isinstance(value, list):
        lines = ",\n  " if any(isinstance(item, Mapping) for item in value) else ", "
        inner = lines.join(inline_toml(item) for item in value)
        return f"[\n  {inner},\n]" if "\n" in lines else f"[{inner}]"
    return f"{value:.10g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def write_areas(
    folder: Path, muscle: str, areas: Sequence[AttachmentArea], frame: str = "LPS"
) -> list[dict[str, Any]]:
    """Write a muscle's landmarks to a scene's folder, as curves of 3D Slicer, and return their tables."""
    tables = _area_tables(muscle, areas)
    for table, area in zip(tables, areas, strict=True):
        kind = "ClosedCurve" if area.closed else "Curve" if len(area.landmarks) > 1 else "Fiducial"
        points = [{"position": point, "positionStatus": "defined"} for point in area.landmarks.tolist()]
        curve = {"type": kind, "coordinateSystem": frame, "controlPoints": points}
        write_json(folder / table["landmarks"], {"@schema": _SCHEMA, "markups": [curve]}, indent=1)
    return tables


def _area_tables(muscle: str, areas: Sequence[AttachmentArea]) -> list[dict[str, Any]]:
    tables: list[dict[str, Any]] = []
    for number, area in enumerate(areas):
        landmarks = f"attachments/{muscle}_{area.role}_{number}.mrk.json"
        tables.append({"role": area.role, "bone": area.bone, "landmarks": landmarks})
        tables[-1] |= {"closed": False} if area.role == VIA and not area.closed else {}
        tables[-1] |= {"estimated": True} if area.estimated else {}
        tables[-1] |= {} if area.confidence is None else {"confidence": round(float(area.confidence), 4)}
    return tables


def _muscle(name: str, muscle: Muscle, known: Collection[str]) -> dict[str, Any]:
    crosses = muscle.crosses and [each for each in muscle.crosses if each in known]
    sheets: dict[str, list[str]] = {side: [] for side in SIDES} if muscle.aponeuroses else {}
    for number, sheet in enumerate(muscle.aponeuroses):
        sheets[sheet.side].append(f"aponeuroses/{name}_{sheet.side}_{number}.vtp")
    return {
        "surface": f"muscles/{name}.vtp",
        "superficial_fibres": muscle.superficial_fibres and f"superficial_fibres/{name}.vtp",
        "literature": f"literature/{name}.csv" if muscle.literature else None,
        "attachments": _area_tables(name, muscle.attachments),
        "aponeuroses": sheets or None,
        "fibres": muscle.fibres,
        **{key: getattr(muscle, key) or None for key in ("solver", "fixing")},
        "crosses": crosses,
        **{key: getattr(muscle, key) or None for key in ("hill", "muscle")},
    }


def _joints(scene: SceneData) -> dict[str, Any]:
    """Return the joints of the scene's own file. None if they move bones otherwise than the scene."""
    path, motion, still = scene.files.get(""), scene.motion, np.eye(4)
    with suppress(ValueError):  # the file, or the coordinates, are others by now
        table = parsed(path) if path and scene.joints else {}
        joints: dict[str, Any] = {} if "mirror" in table else table.get("joints", {})
        if path and joints and (own := joints_of(SceneTable.model_validate(table), SceneFiles(path))):
            angles = {each.name for each in own.tree.coordinates if each.is_angle}
            values = {name: q.values for name, q in _free(motion, joints).items()}
            read = {name: np.radians(each) if name in angles else each for name, each in values.items()}
            theirs = own.motion_of(motion.times, read, ()).transforms
            both = [(motion.transforms.get(bone, still), theirs.get(bone, still)) for bone in scene.bones]
            if all(np.allclose(ours, moved, rtol=ROUNDING, atol=ROUNDING) for ours, moved in both):
                return joints
    return {}


def _free(motion: RigidMotion, joints: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Return the coordinates that follow no other one."""
    tables = (own for joint in joints.values() if isinstance(own := joint.get("coordinates"), Mapping))
    follow = {name for own in tables for name, entry in own.items() if "follows" in entry}
    return {name: own for name, own in motion.coordinates.items() if name not in follow}


def _motion(motion: RigidMotion) -> dict[str, Any]:
    bone, centre = None, motion.centre
    files: Any = {name: _motion_file(motion, name) for name in motion.transforms}
    if len(files) == 1:
        ((bone, files),) = files.items()
        centre = motion.centre_of(bone) if isinstance(centre, Mapping) else centre
    axes = motion.coordinates.items()
    tables = {name: {"unit": own.unit, "positive": own.positive or None} for name, own in axes} or None
    return {"bone": bone, "transforms": files, "time": "time", "centre": centre, "coordinates": tables}


def _motion_file(motion: RigidMotion, bone: str) -> str:
    return "motion.csv" if len(motion.transforms) == 1 else f"motions/{bone}.csv"


def _plain(value: Any) -> Any:
    """Return a value in TOML's types, without None."""
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items() if item is not None}
    if hasattr(value, "tolist"):  # NumPy's
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
