"""scene.toml: how a scene is written on disk.

::

    name = "hip"                       # optional: the file's name
    units = "mm"                       # "mm", "cm" or "m"; optional: "mm"
    quality = "balanced"               # or "preview", "accurate"; [solver] counts more; optional
    model = "volume"                   # or "paths": taut fibres alone, without deforming muscles; optional
    muscle_contact = "off"             # or "on", "measure": each muscle against those before it; optional

    [bones.pelvis]
    surface = "bones/pelvis.vtp"       # .vtp, .vtk, .stl, .obj or .ply, relative to this file

    [bones.femur]
    surface = "bones/femur.stl"

    [motion]                           # a table of transforms ...
    bone = "femur"                     # every other bone stays where it is
    transforms = "flexion.csv"         # columns T00 .. T33: rest to pose, row major
    time = "angle"                     # the column that is the time; optional: rows are numbered
    centre = [0.0, 0.0, 0.0]           # joint centre at rest; optional
    coordinates = ["angle"]            # columns that are joint coordinates; optional: the time, if it is one

    [motion.hinge]                     # ... or a hinge, instead of the above
    bone = "femur"
    centre = [0.0, 0.0, 0.0]
    axis = [1.0, 0.0, 0.0]             # angles turn right-handed about it
    angles = [0, 90, 2]                # start, stop (included), step; degrees from rest
    coordinate = "hip_flexion"         # what the angle is called; optional: "femur_angle"

    [muscles.iliacus]
    surface = "muscles/iliacus.vtp"    # closed
    fibres = { template = "parallel", n_fibres = 100, resolution = 15 }   # optional: no fibres
    attachments = [
      { role = "origin", bone = "pelvis", landmarks = "origin.vtp" },     # .vtp, .vtk, .csv, .json
      { role = "insertion", bone = "femur", landmarks = "insertion.csv", closed = true },
      { role = "via", bone = "pelvis", landmarks = "ring.csv" },          # a ring round the muscle
    ]                                  # or "estimate": from where the muscle touches the bones
    solver = { iterations = 20 }       # optional: what differs from [solver]
    fixing = { method = "proximity" }  # optional: what differs from [fixing]
    superficial_fibres = "seen.vtp"    # optional: polylines seen on the surface, which orient the fibres
    literature = "moment_arms.csv"     # optional: published moment arms, drawn beside those of a run

    [solver]                           # optional: parameters of PBDDeformer
    iterations = 10

    [fixing]                           # optional: parameters of FixedPointDetector
    method = "attachment"

Where several bones move, ``transforms`` is a table of files, ``{ femur = "a.csv", tibia = "b.csv" }``,
with the same times in each, and ``bone`` is left out.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.files import MOST_TEXT, check_is_file
from vtkmuscle.core.motion.coordinates import ANGLES, TRANSLATIONS, Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge
from vtkmuscle.core.template.template_files import read_template
from vtkmuscle.core.words import shown, suggestion
from vtkmuscle.data.attachments import VIA, AttachmentArea, attachments_of
from vtkmuscle.filters.attachment_estimator import AttachmentEstimator
from vtkmuscle.io import (
    LiteratureCurve,
    curves_for,
    motion_columns,
    read_landmarks,
    read_literature,
    read_motion_table,
    read_polydata,
    read_surface,
)
from vtkmuscle.scene.checks import ESTIMATE
from vtkmuscle.scene.model import Muscle, Scene, SceneError

T = TypeVar("T")

#: More frames than this are a slip of the pen in a hinge's step.
_MOST_FRAMES = 10_000


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no float is as large as
        return False


_HINGE_KEYS = ("bone", "centre", "axis", "angles", "coordinate")


class _Table:
    """A table of the file, whose values are taken with their kind checked."""

    def __init__(self, file: Path, key: str, values: Any, known: tuple[str, ...]) -> None:
        self.file, self.key = file, key
        if not isinstance(values, dict):
            raise self.error("", f"must be a table, not {shown(values)}", "see the format of a scene.toml")
        self.values: dict[str, Any] = values
        for name in values if known else ():
            if name not in known:
                raise self.error(name, "there is no such key", suggestion(name, known))

    def path_to(self, name: str) -> str:
        return ".".join(part for part in (self.key, name) if part)

    def error(self, name: str, problem: str, mend: str, *, file: Path | None = None) -> SceneError:
        return SceneError(problem, key=self.path_to(name), mend=mend, file=file or self.file)

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def required(self, name: str, example: str) -> Any:
        if name not in self.values:
            raise self.error(name, "the key is missing", f"add {example}")
        return self.values[name]

    def text(self, name: str, example: str) -> str:
        value = self.required(name, f"{name} = {example}")
        if not isinstance(value, str) or not value:
            raise self.error(name, f"must be a text, not {shown(value)}", f"write {name} = {example}")
        return value

    def numbers(self, name: str, example: str, count: int = 3) -> list[float]:
        value = self.required(name, f"{name} = {example}")
        good = isinstance(value, list) and len(value) == count
        if not good or not all(
            isinstance(v, int | float) and not isinstance(v, bool) and _is_finite(v) for v in value
        ):
            problem = f"must be {count} finite numbers, not {shown(value)}"
            raise self.error(name, problem, f"write {name} = {example}")
        return [float(v) for v in value]

    def flag(self, name: str, mend: str, default: bool) -> bool:
        value = self.values.get(name, default)
        if not isinstance(value, bool):
            raise self.error(name, f"must be true or false, not {shown(value)}", mend)
        return value

    def settings(self, name: str) -> dict[str, Any]:
        return _Table(self.file, self.path_to(name), self.values.get(name, {}), ()).values

    def tables(self, name: str, known: tuple[str, ...]) -> Iterator[tuple[str, _Table]]:
        values = self.required(name, f"a table [{self.path_to(name)}.NAME]")
        for word, value in _Table(self.file, self.path_to(name), values, ()).values.items():
            yield word, _Table(self.file, f"{self.path_to(name)}.{word}", value, known)

    def read(self, name: str, example: str, reader: Callable[[Path], T]) -> tuple[T, Path]:
        """Return what a reader makes of the file that a key names, and that file."""
        return self.read_path(name, self.text(name, example), reader)

    def read_path(self, name: str, text: str, reader: Callable[[Path], T]) -> tuple[T, Path]:
        path = self.file.parent / text
        try:
            return reader(path), path
        except (OSError, ValueError) as error:
            problem, _, mend = _one_line(error).removeprefix(f"{path}: ").partition("; ")
            mend = mend or f"check {name} = {text!r} and the file it names"
            raise self.error(name, problem, mend, file=path) from error


def _one_line(error: Exception) -> str:
    """Return what an error says: also an OSError that only has a number and a name."""
    if isinstance(error, OSError) and error.strerror:
        return str(error.strerror)
    return " ".join(str(error).split())


def read_scene(path: Path) -> Scene:
    """Read a scene.toml and the files it names; see :meth:`vtkmuscle.Scene.load`."""
    root = _Table(
        path,
        "",
        _parsed(path),
        (
            "name",
            "units",
            "bones",
            "motion",
            "muscles",
            "solver",
            "fixing",
            "muscle_contact",
            "model",
            "quality",
        ),
    )
    files: dict[str, Path] = {"": path}
    bones = {}
    for name, table in root.tables("bones", ("surface",)):
        bones[name], files[f"{table.key}.surface"] = table.read("surface", '"FILE.vtp"', read_surface)
    motion = _motion(root, bones, files)
    muscles = {}
    known = ("surface", "attachments", "fibres", "solver", "fixing", "superficial_fibres", "literature")
    for name, table in root.tables("muscles", known):
        surface, files[f"{table.key}.surface"] = table.read("surface", '"FILE.vtp"', read_surface)
        muscles[name] = Muscle(
            surface,
            _attachments(table, files, surface, bones, motion),
            _fibres(table, files) if "fibres" in table else None,
            table.settings("solver"),
            table.settings("fixing"),
            _superficial(table, files) if "superficial_fibres" in table else None,
            _literature(table, files, name) if "literature" in table else (),
        )
    return Scene(
        name=root.text("name", '"hip"') if "name" in root else path.stem,
        bones=bones,
        muscles=muscles,
        motion=motion,
        units=root.text("units", '"mm"') if "units" in root else "mm",
        solver=root.settings("solver"),
        fixing=root.settings("fixing"),
        muscle_contact=root.text("muscle_contact", '"on"') if "muscle_contact" in root else "off",
        model=root.text("model", '"paths"') if "model" in root else "volume",
        quality=root.text("quality", '"balanced"') if "quality" in root else None,
        files=files,
    )


def _superficial(table: _Table, files: dict[str, Path]) -> vtkPolyData:
    """Return fibres seen on a muscle's surface: the lines of a file."""
    word = "superficial_fibres"
    data, files[table.path_to(word)] = table.read(word, '"FILE.vtp"', read_polydata)
    return data


def _literature(table: _Table, files: dict[str, Path], muscle: str) -> tuple[LiteratureCurve, ...]:
    """Return the published moment arms of a muscle: those of its name in a file."""
    curves, file = table.read("literature", '"FILE.csv"', read_literature)
    files[table.path_to("literature")] = file
    mine = curves_for(curves, muscle=muscle)
    if not mine:
        names = sorted({curve.muscle for curve in curves})
        problem = f"the file has no moment arms of {muscle!r}"
        raise table.error("literature", problem, f"it has those of {', '.join(names)}", file=file)
    return mine


def _fibres(table: _Table, files: dict[str, Path]) -> dict[str, Any]:
    """Return the settings of a muscle's fibres, a template's file as one that any folder can name."""
    settings = table.settings("fibres")
    word = "template_file"
    if word in settings:
        mine = _Table(table.file, table.path_to("fibres"), settings, ())
        _, path = mine.read(word, '"FILE.toml"', read_template)
        files[mine.path_to(word)] = path
        settings = {**settings, word: str(path.resolve())}
    return settings


def read_motion(path: Path) -> RigidMotion:
    """Read the motion of a scene.toml and the tables it names, and nothing else of the scene.

    Parameters
    ----------
    path : path
        A scene.toml.

    Returns
    -------
    RigidMotion
        Of the bones that the scene names.

    Raises
    ------
    SceneError
        If the file cannot be read, or its motion is not right; the message says where and why.
    """
    root = _Table(path, "", _parsed(path), ())
    bones = _Table(path, "bones", root.required("bones", "a table [bones.NAME]"), ())
    return _motion(root, bones.values, {})


def _parsed(path: Path) -> dict[str, Any]:
    if path.is_dir():
        mend = f"give its scene file, e.g. {path / 'scene.toml'}"
        raise SceneError("this is a folder, not a scene file", key="", mend=mend, file=path)
    try:
        check_is_file(path, most=MOST_TEXT)
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        problem = "there is no such file" if not path.exists() else "is a pipe or a device, not a file"
        raise SceneError(problem, key="", mend="check the path", file=path) from error
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror}", key="", mend="", file=path) from error
    except UnicodeDecodeError as error:
        raise SceneError("is not text in UTF-8", key="", mend="save it as UTF-8", file=path) from error
    except tomllib.TOMLDecodeError as error:
        mend = "correct that line; texts stand in double quotes"
        raise SceneError(f"is not valid TOML: {error}", key="", mend=mend, file=path) from error
    except (ValueError, RecursionError) as error:  # too large, an endless number, or too many brackets
        why = str(error).removeprefix(f"{path}: ").partition(";")[0]
        raise SceneError(f"cannot be read: {why}", key="", mend="correct it", file=path) from error


def _attachments(
    muscle: _Table,
    files: dict[str, Path],
    surface: vtkPolyData,
    bones: Mapping[str, vtkPolyData],
    motion: RigidMotion,
) -> tuple[AttachmentArea, ...]:
    listed = muscle.values.get("attachments", [])
    if listed == ESTIMATE:
        return _estimated(muscle, surface, bones, motion)
    example = '[{ role = "origin", bone = "NAME", landmarks = "FILE.vtp" }]'
    if not isinstance(listed, list):
        mend = f'write {example}, or "{ESTIMATE}"'
        raise muscle.error("attachments", f"must be a list, not {shown(listed)}", mend)
    areas = []
    for number, value in enumerate(listed):
        key = f"{muscle.key}.attachments[{number}]"
        table = _Table(muscle.file, key, value, ("role", "bone", "landmarks", "closed", "estimated"))
        role, bone = table.text("role", '"origin", "insertion" or "via"'), table.text("bone", '"NAME"')
        (landmarks, closed), files[f"{key}.landmarks"] = table.read("landmarks", '"FILE.vtp"', read_landmarks)
        # A via ring is one whether or not its file repeats the first landmark.
        closed = table.flag("closed", "write true for a ring, false for an open curve", closed or role == VIA)
        estimated = table.flag("estimated", "write true where nobody has seen the landmarks", False)
        areas.append(AttachmentArea(role, bone, landmarks, closed, estimated))
    return tuple(areas)


def _estimated(
    muscle: _Table, surface: vtkPolyData, bones: Mapping[str, vtkPolyData], motion: RigidMotion
) -> tuple[AttachmentArea, ...]:
    """Return estimated attachments; of two bones the one that moves has the insertion."""
    try:
        areas = attachments_of(AttachmentEstimator(muscle=surface, bones=bones).output, muscle.key)
    except ValueError as error:
        problem, _, mend = str(error).partition("; ")
        raise muscle.error("attachments", problem, mend) from error
    moving = {area.role: area.bone in motion.transforms for area in areas}
    if moving["origin"] and not moving["insertion"]:
        other = {"origin": "insertion", "insertion": "origin"}
        areas = [replace(area, role=other[area.role]) for area in areas]
    return tuple(areas)


def _motion(root: _Table, bones: Mapping[str, Any], files: dict[str, Path]) -> RigidMotion:
    values = root.required("motion", "a table [motion] with bone and transforms, or [motion.hinge]")
    known = ("bone", "transforms", "time", "centre", "coordinates", "hinge")
    table = _Table(root.file, "motion", values, known)
    if "hinge" in table:
        for name in known[:-1]:
            if name in table:
                mend = "leave out one of them; a hinge has its keys in [motion.hinge]"
                raise table.error(name, "stands beside motion.hinge", mend)
        return _hinge(table, bones)
    listed = table.required("transforms", 'transforms = "FILE.csv", or a table [motion.hinge]')
    options: dict[str, Any] = {
        "time": table.text("time", '"COLUMN"') if "time" in table else None,
        "centre": table.numbers("centre", "[0.0, 0.0, 0.0]") if "centre" in table else None,
        "coordinates": _coordinates(table) if "coordinates" in table else None,
    }
    if not isinstance(listed, dict):
        bone = _known_bone(table, bones)
        motion, files["motion.transforms"] = table.read(
            "transforms", '"FILE.csv"', lambda path: read_motion_table(path, bone, **options)
        )
        return motion
    return _motion_of_several(table, bones, files, options)


def _coordinates(motion: _Table) -> dict[str, dict[str, str]]:
    """Return the columns that are joint coordinates, with unit and positive direction where given."""
    listed = motion.values["coordinates"]
    if isinstance(listed, list) and all(isinstance(name, str) for name in listed):
        return {name: {} for name in listed}
    if not isinstance(listed, dict):
        mend = 'write ["COLUMN"], or { COLUMN = { unit = "deg", positive = "flexion" } }'
        raise motion.error("coordinates", f"must be a list of columns, not {listed!r}", mend)
    units = (*ANGLES, *TRANSLATIONS)
    kinds: dict[str, dict[str, str]] = {}
    for name, value in listed.items():
        table = _Table(motion.file, motion.path_to(f"coordinates.{name}"), value, ("unit", "positive"))
        kinds[name] = {word: table.text(word, '"deg"') for word in table.values}
        if kinds[name].get("unit", "deg") not in units:
            problem = f"there is no unit {kinds[name]['unit']!r}"
            raise table.error("unit", problem, suggestion(kinds[name]["unit"], units))
    return kinds


def _motion_of_several(
    table: _Table,
    bones: Mapping[str, Any],
    files: dict[str, Path],
    options: dict[str, Any],
) -> RigidMotion:
    if "bone" in table:
        mend = "leave out bone where transforms is a table of files by bone"
        raise table.error("bone", "stands beside a table of transforms", mend)
    inner = _Table(table.file, "motion.transforms", table.values["transforms"], ())
    motions: list[RigidMotion] = []
    seen: set[str] = set()
    for bone in inner.values:
        if bone not in bones:
            raise inner.error(bone, f"there is no bone {bone!r}", suggestion(bone, bones))
        motion, files[inner.path_to(bone)] = inner.read(bone, '"FILE.csv"', _reader_for(bone, options, seen))
        if motions and not np.array_equal(motion.times, motions[0].times):
            mend = "give all tables the same times"
            raise inner.error(bone, "its times differ from those of the first table", mend)
        motions.append(motion)
    if not motions:
        raise table.error("transforms", "is empty", 'write transforms = "FILE.csv"')
    transforms = {bone: table for motion in motions for bone, table in motion.transforms.items()}
    coordinates: dict[str, Coordinate] = {}
    for motion in motions:
        for name, coordinate in motion.coordinates.items():
            known = coordinates.setdefault(name, coordinate)
            if not np.array_equal(known.values, coordinate.values):
                mend = "give it the same values in all tables, or another name in one"
                raise table.error("coordinates", f"{name!r} differs from table to table", mend)
    missing = sorted(set(options["coordinates"] or ()) - seen)
    if missing:
        problem = f"no table has the column {missing[0]!r}"
        raise table.error("coordinates", problem, suggestion(missing[0], sorted(seen)))
    return RigidMotion(motions[0].times, transforms, motions[0].centre, coordinates)


def _reader_for(bone: str, options: dict[str, Any], seen: set[str]) -> Callable[[Path], RigidMotion]:
    """Return a reader of a bone's table, which takes those coordinates that it has, and notes its columns."""

    def read(path: Path) -> RigidMotion:
        columns, wanted = motion_columns(path), options["coordinates"]
        seen.update(columns)
        if wanted is not None:
            wanted = {name: kind for name, kind in wanted.items() if name in columns}
        return read_motion_table(path, bone, **{**options, "coordinates": wanted})

    return read


def _known_bone(table: _Table, bones: Mapping[str, Any]) -> str:
    bone = table.text("bone", '"NAME"')
    if bone not in bones:
        raise table.error("bone", f"there is no bone {bone!r}", suggestion(bone, bones))
    return bone


def _hinge(motion: _Table, bones: Mapping[str, Any]) -> RigidMotion:
    table = _Table(motion.file, "motion.hinge", motion.values["hinge"], _HINGE_KEYS)
    bone = _known_bone(table, bones)
    centre, axis = table.numbers("centre", "[0.0, 0.0, 0.0]"), table.numbers("axis", "[1.0, 0.0, 0.0]")
    if not np.linalg.norm(axis) > 0:
        raise table.error("axis", "has no length", "write axis = [1.0, 0.0, 0.0], or another direction")
    start, stop, step = table.numbers("angles", "[0, 90, 2]")
    if not (step > 0 and stop >= start):
        mend = "write [start, stop, step] with step > 0 and stop >= start; to turn the other way, negate axis"
        raise table.error("angles", f"[{start:g}, {stop:g}, {step:g}] does not ascend", mend)
    # A stop that is a whole number of steps away, up to rounding, is reached by the last step.
    count = (stop - start) / step
    if count > _MOST_FRAMES:
        raise table.error("angles", f"are {count:.3g} frames", "choose a larger step")
    whole = int(np.floor(count + 1e-9))
    angles = start + step * np.arange(whole + 1)
    if count - whole > 1e-9:
        angles = np.append(angles, stop)
    else:
        angles[-1] = stop
    coordinate = table.text("coordinate", '"knee_flexion"') if "coordinate" in table else None
    return hinge(bone, centre, axis, angles, coordinate=coordinate)
