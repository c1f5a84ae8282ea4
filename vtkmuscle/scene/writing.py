"""Write a scene to a folder, as :mod:`vtkmuscle.scene.reading` reads it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.attachments import SIDES, VIA, AttachmentArea, aponeuroses_data
from vtkmuscle.io import write_literature, write_motion_table, write_polydata, write_text
from vtkmuscle.io.writing import Outputs
from vtkmuscle.scene.data import Muscle, SceneData

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
        if muscle.aponeuroses:
            sheets = aponeuroses_data(muscle.aponeuroses)
            for number in range(len(muscle.aponeuroses)):
                write_polydata(folder / _aponeurosis_file(name, number, muscle), sheets.GetBlock(number))
        write_areas(folder, name, muscle.attachments, scene.frame)
    for bone in scene.motion.transforms:
        write_motion_table(folder / _motion_file(scene.motion, bone), scene.motion, bone)
    path = folder / "scene.toml"
    write_text(path, to_toml(scene))
    return path


def save_unless_there(scene: SceneData, folder: Path, *, overwrite: bool) -> Path:
    """Write a scene to a folder without a scene.toml, and return the path of scene.toml.

    A scene.toml in the folder stays, unless ``overwrite`` is true. ValueError if other files are in the way.
    """
    path = folder / "scene.toml"
    if overwrite or not path.exists():
        with Outputs(folder, overwrite=overwrite):
            write_scene(scene, folder)
    return path


def to_toml(scene: SceneData) -> str:
    """Return the text of scene.toml for the files of :func:`write_scene`."""
    header = "# All lengths are in this unit. Paths are relative to this file.\n"
    return header + tomli_w.dumps(tables_of(scene), indent=2)


def tables_of(scene: SceneData) -> dict[str, Any]:
    """Return the tables of scene.toml for the files of :func:`write_scene`."""
    tables = {
        "name": scene.name,
        "units": scene.units,
        "quality": scene.quality,
        "frame": None if scene.frame == "LPS" else scene.frame,
        "guessed": dict(scene.guessed) or None,
        "muscle_contact": None if scene.muscle_contact == "off" else scene.muscle_contact,
        "deformer": None if scene.deformer == "paths" else scene.deformer,
        "bones": {name: {"surface": f"bones/{name}.vtp"} for name in scene.bones},
        "motion": _motion(scene.motion),
        "muscles": {name: _muscle(name, muscle) for name, muscle in scene.muscles.items()},
        "paths": None if scene.paths is None else dict(scene.paths),
        "solver": scene.solver or None,
        "fixing": scene.fixing or None,
    }
    plain: dict[str, Any] = _plain(tables)
    return plain


def inline_toml(value: Any) -> str:
    """Return a value in TOML, tables in one line."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {inline_toml(item)}' for key, item in value.items())} }}"
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
        write_text(
            folder / table["landmarks"], json.dumps({"@schema": _SCHEMA, "markups": [curve]}, indent=1)
        )
    return tables


def _area_tables(muscle: str, areas: Sequence[AttachmentArea]) -> list[dict[str, Any]]:
    return [
        {
            "role": area.role,
            "bone": area.bone,
            "landmarks": f"attachments/{muscle}_{area.role}_{number}.mrk.json",
            **({"closed": False} if area.role == VIA and not area.closed else {}),
            **({"estimated": True} if area.estimated else {}),
            **({} if area.confidence is None else {"confidence": round(float(area.confidence), 4)}),
        }
        for number, area in enumerate(areas)
    ]


def _muscle(name: str, muscle: Muscle) -> dict[str, Any]:
    sheets: dict[str, list[str]] = {side: [] for side in SIDES} if muscle.aponeuroses else {}
    for number, sheet in enumerate(muscle.aponeuroses):
        sheets[sheet.side].append(_aponeurosis_file(name, number, muscle))
    return {
        "surface": f"muscles/{name}.vtp",
        "superficial_fibres": muscle.superficial_fibres and f"superficial_fibres/{name}.vtp",
        "literature": f"literature/{name}.csv" if muscle.literature else None,
        "attachments": _area_tables(name, muscle.attachments),
        "aponeuroses": sheets or None,
        "fibres": muscle.fibres,
        "solver": muscle.solver or None,
        "fixing": muscle.fixing or None,
        "crosses": None if muscle.crosses is None else list(muscle.crosses),
        "hill": dict(muscle.hill) or None,
        "muscle": muscle.muscle or None,
    }


def _motion(motion: RigidMotion) -> dict[str, Any]:
    files = {bone: _motion_file(motion, bone) for bone in motion.transforms}
    alone = next(iter(files)) if len(files) == 1 else None
    return {
        "bone": alone,
        "transforms": files if alone is None else files[alone],
        "time": "time",
        "centre": motion.centre_of(alone) if alone and isinstance(motion.centre, Mapping) else motion.centre,
        "coordinates": {
            name: {"unit": coordinate.unit, "positive": coordinate.positive or None}
            for name, coordinate in motion.coordinates.items()
        }
        or None,
    }


def _aponeurosis_file(name: str, number: int, muscle: Muscle) -> str:
    return f"aponeuroses/{name}_{muscle.aponeuroses[number].side}_{number}.vtp"


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
