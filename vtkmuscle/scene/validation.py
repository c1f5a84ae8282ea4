"""Check the tables of a scene: each key by the schema, then what keys say of each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

import tomli_w
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.scene.faults import Faults, SceneError
from vtkmuscle.scene.joint_schema import JOINT_KINDS, Function, JointTable
from vtkmuscle.scene.schema import ALONE, ESTIMATE, Estimate, Motion, MuscleTable, SceneTable
from vtkmuscle.scene.schema_types import Settings

#: Names that the run writes itself, beside those of the muscles.
_RESERVED = ("bones", "figures", "finished", "scene")

#: What is missing where a key that is a table is missing.
_TABLES = {
    "bones": "a table [bones.NAME]",
    "muscles": "a table [muscles.NAME]",
    "motion": "a table [motion] with bone and transforms, or with file or grid and [joints.NAME], or "
    "[motion.hinge]",
}
_KINDS = {
    "string_type": "a text",
    "string_too_short": "a text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "list_type": "a list",
}

#: Where a fault is, what it is, and its remedy.
_Fault = tuple[str, str, str]


def validated(values: Mapping[str, Any], file: Path | None) -> SceneTable:
    """Return the tables of a scene's file, checked.

    Raises
    ------
    SceneError
        With a fault for each key that is unknown, missing or not allowed, or does not agree with others.
    """
    try:
        table = SceneTable.model_validate(values)
    except ValidationError as error:
        found = faults_in_words(error.errors(include_url=False))
    else:
        found = _disagreements(table)
    Faults(SceneError(problem, key, remedy, file) for key, problem, remedy in found).raise_any()
    return table


def faults_in_words(errors: list[ErrorDetails], root: type[BaseModel] = SceneTable) -> Iterator[_Fault]:
    """Give key, problem and remedy of what a schema has found: unknown keys first, which may be meant.

    Parameters
    ----------
    errors : list of ErrorDetails
        As pydantic gives them.
    root : type, optional
        The model of the whole file.
    """
    unknown = {error["loc"] for error in errors if error["type"] == "extra_forbidden"}
    for error in sorted(errors, key=lambda one: len(one["loc"]) if one["loc"] in unknown else 99):
        *path, name = error["loc"] if error["loc"][-1] != "[key]" else error["loc"][:-1]
        known = _model_at(tuple(path), root)
        if error["type"] == "missing" and any(
            suggestion(str(loc[-1]), known.model_fields).startswith(f"did you mean {name!r}")
            for loc in unknown
            if list(loc[:-1]) == path
        ):
            continue
        yield (_key((*path, name)), *_fault(error, str(name), known))


def _fault(error: ErrorDetails, name: str, known: type[BaseModel]) -> tuple[str, str]:
    """Return what is wrong with a key of a table, and what to do about it."""
    kind, value = error["type"], error["input"]
    field = known.model_fields.get(name)
    example = "" if field is None or not field.examples else tomli_w.dumps({name: field.examples[0]})
    example = " ".join(example.split()).replace("[ ", "[").replace(", ]", "]")
    if kind == "fault":
        context = error["ctx"]
        return context["problem"], context["remedy"] or f"write {example}"
    if kind == "missing":
        return "the key is missing", f"add {_TABLES.get(name) or example}"
    if kind == "extra_forbidden":
        gone = known.gone.get(name, "") if issubclass(known, Settings) else ""
        what = f"there is no setting {name!r}" if issubclass(known, Settings) else "there is no such key"
        return what + (" any more" if gone else ""), gone or suggestion(name, known.model_fields)
    if kind in _KINDS:
        remedy = f"write {example}"
        if kind == "bool_type" and field is not None and field.description:
            first = field.description.partition(". ")[0]
            remedy = first[0].lower() + first[1:].rstrip(".")
        return f"must be {_KINDS[kind]}, not {quoted(value)}", remedy
    if kind not in ("dict_type", "model_type", "model_attributes_type"):
        allowed = error["msg"].replace("Input should be", "it must be").replace("List should", "it must")
        return f"{quoted(value)} is not allowed", allowed
    return f"must be a table, not {quoted(value)}", "see the format of a scene.toml"


def _model_at(path: tuple[int | str, ...], root: type[BaseModel]) -> type[BaseModel]:
    """Return the model of the table at a place."""
    model = root
    parts = iter(path)
    for part in parts:
        kinds = list(_kinds(model.model_fields[str(part)].annotation))
        model = next((one for one in kinds if isinstance(one, type) and issubclass(one, BaseModel)), model)
        if dict in kinds or list in kinds:
            next(parts, None)  # the name of a table, or its number
    return model


def _kinds(annotation: Any) -> Iterator[Any]:
    """Give the plain types in an annotation."""
    yield get_origin(annotation) or annotation
    for part in get_args(annotation):
        yield from _kinds(part)


def _key(path: tuple[int | str, ...]) -> str:
    """Return a dotted key, without what a terminal would take for more than text."""
    key = ""
    for part in path:
        text = str(part) if str(part).isprintable() else ascii(part)[1:-1]
        key += f"[{part}]" if isinstance(part, int) else f".{text[:60]}"
    return key.removeprefix(".")


def _disagreements(scene: SceneTable) -> Iterator[_Fault]:
    """Give what keys say of each other that cannot be."""
    for kind, names in (("bones", list(scene.bones)), ("muscles", list(scene.muscles))):
        if not names:
            yield kind, f"the scene has no {kind}", f"add a table [{kind}.NAME] with its surface"
        seen: dict[str, str] = {}
        for name in names:
            other = seen.setdefault(name.casefold(), name)
            if other != name:
                problem = f"{name!r} and {other!r} are the same file name on some systems"
                yield f"{kind}.{name}", problem, "rename one of them"
    yield from joint_faults(scene)
    yield from _of_motion(scene.motion, list(scene.bones), jointed=bool(scene.joints or scene.opensim))
    if scene.model == "paths" and scene.muscle_contact != "off":
        problem = f"model is 'paths', in which no muscle has a surface, but this is {scene.muscle_contact!r}"
        yield "muscle_contact", problem, "leave it out, or use model 'volume'"
    known = {name.casefold() for name in scene.muscles}
    for name, muscle in scene.muscles.items():
        plain = name.casefold().removesuffix("_fibres")
        if name.casefold() in _RESERVED or (plain != name.casefold() and plain in known):
            problem = f"the results of a muscle called {name!r} would overwrite other results"
            yield f"muscles.{name}", problem, "give it another name"
        if scene.model == "paths" and muscle.fibres is None:
            problem = "model is 'paths', which moves fibres, but this muscle has none"
            yield f"muscles.{name}.fibres", problem, "add a table fibres, or use model 'volume'"
        if muscle.aponeuroses is not None:
            yield from _of_aponeuroses(f"muscles.{name}.aponeuroses", muscle, scene)
        yield from _of_attachments(f"muscles.{name}.attachments", muscle, scene)


def _of_motion(motion: Motion, bones: list[str], *, jointed: bool) -> Iterator[_Fault]:
    if jointed or motion.file is not None or motion.grid is not None:
        return
    named = [name for name in Motion.model_fields if name in motion.model_fields_set]
    given = [name for name in named if getattr(motion, name) is not None and name != "hinge"]
    if motion.hinge is not None:
        if given:
            remedy = "leave out one of them; a hinge has its keys in [motion.hinge]"
            yield f"motion.{given[0]}", "cannot be combined with motion.hinge", remedy
        moving = {"motion.hinge.bone": motion.hinge.bone}
    elif motion.transforms is None:
        remedy = 'add transforms = "FILE.csv", or a table [motion.hinge]; or joints, and file or grid'
        yield "motion.transforms", "the key is missing", remedy
        return
    elif ALONE not in motion.transforms:
        if motion.bone is not None:
            remedy = "leave out bone where transforms is a table of files by bone"
            yield "motion.bone", "cannot be combined with a table of transforms", remedy
        if not motion.transforms:
            yield "motion.transforms", "is empty", 'write transforms = "FILE.csv"'
        moving = {f"motion.transforms.{bone}": bone for bone in motion.transforms}
    elif motion.bone is None:
        yield "motion.bone", "the key is missing", 'add bone = "NAME"'
        return
    else:
        moving = {"motion.bone": motion.bone}
    for key, bone in moving.items():
        if bone not in bones:
            yield key, f"there is no bone {quoted(bone)}", suggestion(bone, bones)


def _of_aponeuroses(key: str, muscle: MuscleTable, scene: SceneTable) -> Iterator[_Fault]:
    if muscle.fibres is None:
        yield key, "fibres end on aponeuroses, but this muscle has none", "add a table fibres"
    if scene.model == "paths":
        problem = "aponeuroses move with the muscle, which model 'paths' does not deform"
        yield key, problem, "leave them out, or use model 'volume'"


def _of_attachments(key: str, muscle: MuscleTable, scene: SceneTable) -> Iterator[_Fault]:
    if isinstance(muscle.attachments, Estimate):
        for bone in muscle.attachments.bones:
            if bone not in scene.bones:
                yield key, f"there is no bone {quoted(bone)}", suggestion(bone, scene.bones)
        return
    for number, area in enumerate(muscle.attachments):
        if area.bone not in scene.bones:
            problem = f"there is no bone {quoted(area.bone)}"
            yield f"{key}[{number}].bone", problem, suggestion(area.bone, scene.bones)
        if area.role == VIA and area.closed is False:
            remedy = "leave closed out, or write closed = true"
            yield f"{key}[{number}].closed", "a via ring is closed", remedy
    roles = {area.role for area in muscle.attachments} - {VIA}
    default = FixedPointDetector.parameter_declarations["method"].default
    method = {"method": default, **scene.fixing.given(), **muscle.fixing.given()}["method"]
    alone = ROLES[:1] if not roles and method == "attachment" else ()
    for role in alone if muscle.fibres is None else ROLES:
        if role not in roles:
            remedy = f'add {{ role = "{role}", bone = "...", landmarks = "..." }}'
            if not roles:
                remedy += f', or write attachments = "{ESTIMATE}" (from where it touches the bones)'
            if muscle.fibres is not None:
                remedy += ", or leave out fibres"
            yield key, f"there is no attachment with role {role!r}", remedy


_FUNCTIONS = ("polynomial", "spline", "piecewise")
#: Keys that a kind of joint has beside those that all have.
_KEYS = {"pin": ("axis",), "ball": ("axes",), "weld": (), "custom": ("rotations", "translations")}


def joint_faults(scene: SceneTable) -> Iterator[_Fault]:
    """Give what cannot be of a scene's joints and of the motion by them."""
    jointed = bool(scene.joints) or scene.opensim is not None
    if scene.joints and scene.opensim is not None:
        yield "opensim", "cannot be combined with [joints.NAME]", "leave out one of them"
    yield from _of_joint_motion(scene, jointed=jointed)
    children = {joint.child for joint in scene.joints.values()}
    parents = {joint.parent for joint in scene.joints.values()}
    known = [name for joint in scene.joints.values() for name in joint.coordinates or {}]
    for number, name in enumerate(known):
        if name in known[:number]:
            yield "joints", f"there are two coordinates {quoted(name)}", "rename one of them"
    for name, joint in scene.joints.items():
        key = f"joints.{name}"
        for what, body, others in (("parent", joint.parent, children), ("child", joint.child, parents)):
            if body not in scene.bones and body not in others:
                yield f"{key}.{what}", f"there is no bone {quoted(body)}", suggestion(body, scene.bones)
        yield from _of_kind(key, joint)
        yield from _of_functions(key, joint, known)


def _of_joint_motion(scene: SceneTable, *, jointed: bool) -> Iterator[_Fault]:
    motion = scene.motion
    named = [key for key in ("file", "grid") if getattr(motion, key) is not None]
    if len(named) == 2:
        yield "motion.grid", "cannot be combined with motion.file", "leave out one of them"
    if named and not jointed:
        remedy = "add tables [joints.NAME], or [opensim] with a model"
        yield f"motion.{named[0]}", "there are no joints that it could move", remedy
    if jointed and not named:
        remedy = 'add file = "FILE.mot", or grid = { COORDINATE = [0, 90, 5] }'
        yield "motion", "does not say how the joints move", remedy
    if motion.every != 1 and motion.file is None:
        yield "motion.every", "is for a file, but there is none", "leave it out"
    for key in ("bone", "transforms", "time", "centre", "hinge"):
        if named and getattr(motion, key) is not None:
            yield f"motion.{key}", f"cannot be combined with motion.{named[0]}", "leave out one of them"


def _of_kind(key: str, joint: JointTable) -> Iterator[_Fault]:
    kind = joint.type
    for other in {one for keys in _KEYS.values() for one in keys} - set(_KEYS[kind]):
        if getattr(joint, other) is not None:
            yield f"{key}.{other}", f"is no key of a joint of type {kind!r}", "leave it out, or change type"
    if kind == "weld":
        if joint.coordinates:
            yield f"{key}.coordinates", "a weld has no coordinates", "leave it out"
        return
    if joint.centre is None:
        yield f"{key}.centre", "the key is missing", "add centre = [0.0, 0.0, 0.0]"
    if kind == "pin" and joint.axis is None:
        yield f"{key}.axis", "the key is missing", "add axis = [1.0, 0.0, 0.0]"
    wanted, given = JOINT_KINDS[kind], len(joint.coordinates or {})
    if wanted is not None and given != wanted:
        names = ", ".join(f'"NAME_{number}"' for number in range(1, wanted + 1))
        yield (
            f"{key}.coordinates",
            f"names {given}, but a {kind} has {wanted}",
            f"write coordinates = [{names}]",
        )
    if kind == "custom":
        if not (joint.rotations or joint.translations):
            remedy = 'add rotations = [{ axis = [1.0, 0.0, 0.0], coordinate = "NAME" }]'
            yield f"{key}.rotations", "a custom joint needs rotations or translations", remedy
        for what in ("rotations", "translations"):
            if len(getattr(joint, what) or []) > 3:
                yield f"{key}.{what}", "are more than three", "leave some out"


def _of_functions(key: str, joint: JointTable, known: list[str]) -> Iterator[_Fault]:
    for name, one in (joint.coordinates or {}).items():
        where, given = f"{key}.coordinates.{name}", _given(one)
        if len(given) != (one.follows is not None):
            problem = (
                "follows another coordinate by one of" if one.follows else "follows no other, but has one of"
            )
            remedy = 'write follows = "NAME" and one function, or neither'
            yield where, f"{problem} {', '.join(_FUNCTIONS)}", remedy
        if one.follows is not None and (one.follows not in known or one.follows == name):
            problem = f"there is no other coordinate {quoted(one.follows)}"
            yield (
                f"{where}.follows",
                problem,
                suggestion(one.follows, [other for other in known if other != name]),
            )
    for what in ("rotations", "translations"):
        for number, axis in enumerate(getattr(joint, what) or []):
            where, given = f"{key}.{what}[{number}]", _given(axis)
            if axis.coordinate is None:
                if given:
                    yield f"{where}.coordinate", "the key is missing", "name what it is a function of"
                continue
            if axis.coordinate not in known:
                problem = f"there is no coordinate {quoted(axis.coordinate)}"
                yield f"{where}.coordinate", problem, suggestion(axis.coordinate, known)
            if len(given) > 1 or axis.constant is not None:
                yield where, "has more than one function", "leave all but one out"


def _given(table: Function) -> list[str]:
    return [name for name in _FUNCTIONS if getattr(table, name) is not None]
