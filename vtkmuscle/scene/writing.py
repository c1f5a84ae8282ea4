"""Write a scene to a folder, as :mod:`vtkmuscle.scene.reading` reads it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.io import write_literature, write_motion_table, write_polydata, write_text
from vtkmuscle.scene.model import Muscle, Scene


def write_scene(scene: Scene, folder: Path) -> Path:
    """Write a scene and its files to a folder; see :meth:`vtkmuscle.Scene.save`."""
    for name, surface in scene.bones.items():
        write_polydata(folder / f"bones/{name}.vtp", surface)
    for name, muscle in scene.muscles.items():
        write_polydata(folder / f"muscles/{name}.vtp", muscle.surface)
        if muscle.superficial_fibres is not None:
            write_polydata(folder / _superficial_file(name), muscle.superficial_fibres)
        if muscle.literature:
            write_literature(folder / _literature_file(name), muscle.literature)
        areas = attachments_from(muscle.attachments)
        for number in range(len(muscle.attachments)):
            write_polydata(folder / _landmark_file(name, number, muscle), areas.GetBlock(number))
    for bone in scene.motion.transforms:
        write_motion_table(folder / _motion_file(scene, bone), scene.motion, bone)
    path = folder / "scene.toml"
    write_text(path, to_toml(scene))
    return path


def to_toml(scene: Scene) -> str:
    """Return the scene.toml that goes with the files that :func:`write_scene` writes."""
    lines = [
        "# All lengths are in this unit. Paths are relative to this file.",
        f"name = {_quoted(scene.name)}",
        f"units = {_quoted(scene.units)}",
    ]
    optional = {
        "quality": (scene.quality, None),
        "muscle_contact": (scene.muscle_contact, "off"),
        "model": (scene.model, "volume"),
    }
    lines += [f"{key} = {_quoted(str(v))}" for key, (v, default) in optional.items() if v != default]
    for name in scene.bones:
        lines += ["", f"[bones.{_key(name)}]", f"surface = {_quoted(f'bones/{name}.vtp')}"]
    lines += _motion_lines(scene)
    for name, muscle in scene.muscles.items():
        lines += ["", f"[muscles.{_key(name)}]", f"surface = {_quoted(f'muscles/{name}.vtp')}"]
        for word, settings in (
            ("fibres", muscle.fibres),
            ("solver", muscle.solver),
            ("fixing", muscle.fixing),
        ):
            if settings or (word == "fibres" and settings is not None):
                lines.append(f"{word} = {_inline(settings)}")
        if muscle.superficial_fibres is not None:
            lines.append(f"superficial_fibres = {_quoted(_superficial_file(name))}")
        if muscle.literature:
            lines.append(f"literature = {_quoted(_literature_file(name))}  # published moment arms")
        if muscle.attachments:
            lines.append("attachments = [")
            for number, area in enumerate(muscle.attachments):
                entry = {
                    "role": area.role,
                    "bone": area.bone,
                    "landmarks": _landmark_file(name, number, muscle),
                    "estimated": area.estimated or None,
                }
                lines.append(f"  {_inline(entry)},")
            lines.append("]")
    for word, settings in (("solver", scene.solver), ("fixing", scene.fixing)):
        if settings:
            lines += ["", f"[{word}]", *_pairs(settings)]
    return "\n".join(lines) + "\n"


def _motion_lines(scene: Scene) -> list[str]:
    lines = ["", "[motion]"]
    moving = list(scene.motion.transforms)
    if len(moving) == 1:
        lines += [
            f"bone = {_quoted(moving[0])}  # every other bone stays where it is",
            f"transforms = {_quoted(_motion_file(scene, moving[0]))}  # T00..T33: rest to pose, row major",
        ]
    else:
        listed = ", ".join(f"{_key(bone)} = {_quoted(_motion_file(scene, bone))}" for bone in moving)
        lines.append(f"transforms = {{ {listed} }}")
    lines.append('time = "time"  # the column that is the pipeline\'s time')
    if scene.motion.centre is not None:
        lines.append(f"centre = {_value(scene.motion.centre)}  # joint centre at rest")
    if scene.motion.coordinates:
        kinds = {
            name: {"unit": one.unit, "positive": one.positive or None}
            for name, one in scene.motion.coordinates.items()
        }
        listed = ", ".join(f"{_key(name)} = {_inline(kind)}" for name, kind in kinds.items())
        lines.append(f"coordinates = {{ {listed} }}  # columns by which moment arms are taken")
    return lines


def _landmark_file(name: str, number: int, muscle: Muscle) -> str:
    return f"attachments/{name}_{muscle.attachments[number].role}_{number}.vtp"


def _superficial_file(name: str) -> str:
    return f"superficial_fibres/{name}.vtp"


def _literature_file(name: str) -> str:
    return f"literature/{name}.csv"


def _motion_file(scene: Scene, bone: str) -> str:
    return "motion.csv" if len(scene.motion.transforms) == 1 else f"motions/{bone}.csv"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted(name)


def _quoted(text: str) -> str:
    # A JSON string is a TOML basic string, DEL apart, which no checked name holds.
    return json.dumps(text, ensure_ascii=False)


def _pairs(settings: Mapping[str, Any]) -> list[str]:
    # TOML has no None; None is what a setting is without its key.
    return [f"{_key(name)} = {_value(value)}" for name, value in settings.items() if value is not None]


def _inline(settings: Mapping[str, Any]) -> str:
    pairs = ", ".join(_pairs(settings))
    return f"{{ {pairs} }}" if pairs else "{}"


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return "[" + ", ".join(_value(component) for component in value) + "]"
