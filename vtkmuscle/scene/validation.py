"""Validation of scene tables: each key by the schema, then keys together."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.taut_paths import RESOLUTIONS
from vtkmuscle.pipelines import DEFORMERS
from vtkmuscle.scene.faults import Faults, SceneError
from vtkmuscle.scene.joint_schema import JOINT_KINDS, Function, JointTable
from vtkmuscle.scene.schema import ALONE, ESTIMATE, Estimate, Motion, MuscleTable, SceneTable
from vtkmuscle.scene.schema_types import Settings
from vtkmuscle.scene.writing import inline_toml

#: File names of a run besides the muscles' names.
_RESERVED = ("bones", "figures", "finished", "scene")

#: Remedies for missing tables.
_TABLES = {
    "bones": "a table [bones.NAME]",
    "muscles": "a table [muscles.NAME]",
    "motion": "a table [motion] with bone and transforms, or with file or grid and [joints.NAME], or "
    "[motion.hinge]",
}

#: Key, problem and remedy.
_Fault = tuple[str, str, str]


def validated(values: Mapping[str, Any], file: Path | None) -> SceneTable:
    """Return the checked tables of a scene file.

    Raises
    ------
    SceneError
        With a fault for each unknown, missing, forbidden or conflicting key.
    """
    try:
        table = SceneTable.model_validate(values)
    except ValidationError as error:
        faults = faults_in_words(error.errors(include_url=False))
    else:
        faults = _conflicts(table)
    Faults(SceneError(problem, key, remedy, file) for key, problem, remedy in faults).raise_any()
    return table


def faults_in_words(errors: list[ErrorDetails], root: type[BaseModel] = SceneTable) -> Iterator[_Fault]:
    """Yield key, problem and remedy of pydantic's errors, unknown keys first.

    A missing key is omitted if an unknown key looks like its misspelling.
    """
    unknown = {error["loc"] for error in errors if error["type"] == "extra_forbidden"}
    for error in sorted(errors, key=lambda error: len(error["loc"]) if error["loc"] in unknown else 99):
        path = [part for part in error["loc"] if part not in ("[key]", ALONE)]
        table, name = _table_and_key(path, root)
        misspelt = (str(loc[-1]) for loc in unknown if list(loc[:-1]) == path[:-1])
        if error["type"] == "missing" and any(
            suggestion(word, table.model_fields).startswith(f"did you mean {name!r}") for word in misspelt
        ):
            continue
        yield (_dotted(path), *_problem_and_remedy(error, table, name))


def _problem_and_remedy(error: ErrorDetails, table: type[BaseModel], name: str) -> tuple[str, str]:
    kind, context = error["type"], error.get("ctx", {})
    field = table.model_fields.get(name)
    example = f"{name} = {inline_toml(field.examples[0])}" if field and field.examples else ""
    remedy = f"write {example}" if example else "see the format of a scene.toml"
    if kind == "value_error":
        problem, own = fault_of(context["error"])
        return problem, own or remedy
    if kind == "missing":
        return "the key is missing", f"add {_TABLES.get(name) or example}"
    if kind == "extra_forbidden":
        return "there is no such key", suggestion(name, table.model_fields)
    problem = error["msg"].replace("Input should be", "must be").replace(" after validation", "")
    if "must be" in problem:
        problem += f", not {quoted(error['input'])}"
    if kind == "literal_error":
        remedy = suggestion(str(error["input"]), re.findall("'(.*?)'", context["expected"]))
    elif kind == "model_type":
        problem = f"must be a table, not {quoted(error['input'])}"
    return problem, remedy


def _table_and_key(path: list[int | str], table: type[BaseModel]) -> tuple[type[BaseModel], str]:
    """Return the innermost model and key on a path."""
    name = str(path[0])
    field = table.model_fields.get(name)
    kinds = [] if field is None else list(_kinds(field.annotation))
    inner = next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)
    rest = path[2:] if dict in kinds or list in kinds else path[1:]  # without a table's name or number
    return (table, name) if inner is None or not rest else _table_and_key(rest, inner)


def _kinds(annotation: Any) -> Iterator[Any]:
    """Yield the plain types in an annotation."""
    yield get_origin(annotation) or annotation
    for part in get_args(annotation):
        yield from _kinds(part)


def _dotted(path: list[int | str]) -> str:
    """Return a dotted key with escaped control characters and short names."""
    key = ""
    for part in path:
        text = str(part) if str(part).isprintable() else ascii(part)[1:-1]
        key += f"[{part}]" if isinstance(part, int) else f".{text[:60]}"
    return key.removeprefix(".")


def _conflicts(scene: SceneTable) -> Iterator[_Fault]:
    """Yield the faults of keys that are valid alone, but not together."""
    for kind, names in (("bones", list(scene.bones)), ("muscles", list(scene.muscles))):
        if not names:
            yield kind, f"the scene has no {kind}", f"add a table [{kind}.NAME] with its surface"
        seen: dict[str, str] = {}
        for name in names:
            other = seen.setdefault(name.casefold(), name)
            if other != name:
                problem = f"{name!r} and {other!r} are the same file name on some systems"
                yield f"{kind}.{name}", problem, "rename one of them"
    yield from _of_joints(scene)
    yield from _of_motion(scene)
    if scene.deformer == "none" and scene.muscle_contact != "off":
        problem = f"deformer is 'none', so that no muscle has a surface, but this is {scene.muscle_contact!r}"
        yield "muscle_contact", problem, "leave it out, or use deformer 'paths'"
    if scene.quality not in (None, *RESOLUTIONS) and scene.deformer != "pbd":
        problem = f"{scene.quality!r} is a preset of deformer 'pbd', but deformer is {scene.deformer!r}"
        yield "quality", problem, "use 'preview', 'balanced' or 'accurate', or deformer 'pbd'"
    deformer = DEFORMERS[scene.deformer]
    allowed = {} if deformer is None else deformer.parameter_declarations
    for key, table in _solver_tables(scene):
        for setting in table.given():
            if setting not in allowed:
                problem = f"deformer {scene.deformer!r} has no such setting"
                yield f"{key}.{setting}", problem, suggestion(setting, allowed) if allowed else "leave it out"
    for name in scene.muscles:
        yield from _of_muscle(name, scene)


def _solver_tables(scene: SceneTable) -> Iterator[tuple[str, Settings]]:
    yield "solver", scene.solver
    for name, muscle in scene.muscles.items():
        yield f"muscles.{name}.solver", muscle.solver


def _unknown_bone(key: str, bone: str, bones: Collection[str]) -> Iterator[_Fault]:
    if bone not in bones:
        yield key, f"there is no bone {quoted(bone)}", suggestion(bone, bones)


def _of_muscle(name: str, scene: SceneTable) -> Iterator[_Fault]:
    key, muscle, folded = f"muscles.{name}", scene.muscles[name], name.casefold()
    taken = {muscle_name.casefold() for muscle_name in scene.muscles} - {folded}
    if folded in _RESERVED or folded.removesuffix("_fibres") in taken:
        problem = f"the results of a muscle called {name!r} would overwrite other results"
        yield key, problem, "give it another name"
    if scene.deformer == "none" and muscle.fibres is None:
        problem = "deformer is 'none', which moves paths alone, but this muscle has no fibres to begin with"
        yield f"{key}.fibres", problem, "add a table fibres, or use deformer 'paths'"
    if muscle.aponeuroses is not None and muscle.fibres is None:
        problem = "fibres end on aponeuroses, but this muscle has no fibres"
        yield f"{key}.aponeuroses", problem, "add a table fibres"
    if muscle.aponeuroses is not None and scene.deformer == "none":
        problem = "aponeuroses move with the muscle, which deformer 'none' does not deform"
        yield f"{key}.aponeuroses", problem, "leave them out, or use deformer 'paths'"
    yield from _of_attachments(f"{key}.attachments", muscle, scene)


def _of_attachments(key: str, muscle: MuscleTable, scene: SceneTable) -> Iterator[_Fault]:
    if isinstance(muscle.attachments, Estimate):
        for bone in muscle.attachments.bones:
            yield from _unknown_bone(key, bone, scene.bones)
        return
    for number, area in enumerate(muscle.attachments):
        yield from _unknown_bone(f"{key}[{number}].bone", area.bone, scene.bones)
        if area.role == VIA and area.closed is False:
            remedy = "leave closed out, or write closed = true"
            yield f"{key}[{number}].closed", "a via ring is closed", remedy
    roles = {area.role for area in muscle.attachments} - {VIA}
    default = FixedPointDetector.parameter_declarations["method"].default
    method = {"method": default, **scene.fixing.given(), **muscle.fixing.given()}["method"]
    alone = ROLES[:1] if method == "attachment" and not roles else ()  # a muscle without fibres needs one
    for role in alone if muscle.fibres is None else ROLES:
        if role not in roles:
            remedy = f'add {{ role = "{role}", bone = "...", landmarks = "..." }}'
            if not roles:
                remedy += f', or write attachments = "{ESTIMATE}" (from where it touches the bones)'
            if muscle.fibres is not None:
                remedy += ", or leave out fibres"
            yield key, f"there is no attachment with role {role!r}", remedy


#: Kinds of motion, and the keys of each.
_MOTIONS = {
    "hinge": (),
    "file": ("every", "coordinates"),
    "grid": ("coordinates",),
    "transforms": ("bone", "time", "centre", "coordinates"),
}


def _of_motion(scene: SceneTable) -> Iterator[_Fault]:
    motion = scene.motion
    jointed = bool(scene.joints) or scene.opensim is not None
    present = [name for name in Motion.model_fields if name in motion.model_fields_set]
    kind = next((name for name in _MOTIONS if name in present), None)
    if jointed and kind not in ("file", "grid"):
        remedy = 'add file = "FILE.mot", or grid = { COORDINATE = [0, 90, 5] }'
        yield "motion", "does not say how the joints move", remedy
        return
    if kind is None:
        remedy = 'add transforms = "FILE.csv", or a table [motion.hinge]; or joints, and file or grid'
        yield "motion.transforms", "the key is missing", remedy
        return
    for name in present:
        if name not in (kind, *_MOTIONS[kind]):
            yield f"motion.{name}", f"cannot be combined with motion.{kind}", "leave out one of them"
    if kind in ("file", "grid") and not jointed:
        remedy = "add tables [joints.NAME], or [opensim] with a model"
        yield f"motion.{kind}", "there are no joints that it could move", remedy
    if motion.hinge is not None:
        yield from _unknown_bone("motion.hinge.bone", motion.hinge.bone, scene.bones)
    elif motion.transforms is None:
        return
    elif ALONE not in motion.transforms:
        if motion.bone is not None:
            remedy = "leave out bone where transforms is a table of files by bone"
            yield "motion.bone", "cannot be combined with a table of transforms", remedy
        for bone in motion.transforms:
            yield from _unknown_bone(f"motion.transforms.{bone}", bone, scene.bones)
    elif motion.bone is None:
        yield "motion.bone", "the key is missing", 'add bone = "NAME"'
    else:
        yield from _unknown_bone("motion.bone", motion.bone, scene.bones)


#: Kinds of joints of each optional key.
_JOINT_KEYS = {
    "axis": ("pin",),
    "axes": ("ball",),
    "rotations": ("custom",),
    "translations": ("custom",),
    "coordinates": ("pin", "ball", "custom"),
}
#: Required keys of each kind of joint.
_NEEDED = {"pin": ("centre", "axis"), "ball": ("centre",), "weld": (), "custom": ("centre",)}
_FUNCTIONS = ("polynomial", "spline", "piecewise")


def _of_joints(scene: SceneTable) -> Iterator[_Fault]:
    if scene.joints and scene.opensim is not None:
        yield "opensim", "cannot be combined with [joints.NAME]", "leave out one of them"
    bodies = {
        "parent": {*scene.bones, *(joint.child for joint in scene.joints.values())},
        "child": {*scene.bones, *(joint.parent for joint in scene.joints.values())},
    }
    coordinates = [name for joint in scene.joints.values() for name in joint.coordinates or {}]
    for number, name in enumerate(coordinates):
        if name in coordinates[:number]:
            yield "joints", f"there are two coordinates {quoted(name)}", "rename one of them"
    for name, joint in scene.joints.items():
        key = f"joints.{name}"
        for end, allowed in bodies.items():
            if getattr(joint, end) not in allowed:
                yield from _unknown_bone(f"{key}.{end}", getattr(joint, end), scene.bones)
        yield from _of_kind(key, joint)
        yield from _of_functions(key, joint, coordinates)


def _of_kind(key: str, joint: JointTable) -> Iterator[_Fault]:
    kind = joint.type
    for name, kinds in _JOINT_KEYS.items():
        if kind not in kinds and getattr(joint, name) is not None:
            yield f"{key}.{name}", f"is no key of a joint of type {kind!r}", "leave it out, or change type"
    for name in _NEEDED[kind]:
        if getattr(joint, name) is None:
            yield f"{key}.{name}", "the key is missing", f"add {name} = [1.0, 0.0, 0.0]"
    wanted, count = JOINT_KINDS[kind], len(joint.coordinates or {})
    if wanted and count != wanted:
        names = ", ".join(f'"NAME_{number}"' for number in range(1, wanted + 1))
        remedy = f"write coordinates = [{names}]"
        yield f"{key}.coordinates", f"names {count}, but a {kind} has {wanted}", remedy
    if kind == "custom" and not (joint.rotations or joint.translations):
        remedy = 'add rotations = [{ axis = [1.0, 0.0, 0.0], coordinate = "NAME" }]'
        yield f"{key}.rotations", "a custom joint needs rotations or translations", remedy


def _of_functions(key: str, joint: JointTable, coordinates: list[str]) -> Iterator[_Fault]:
    for name, entry in (joint.coordinates or {}).items():
        where = f"{key}.coordinates.{name}"
        if len(_functions(entry)) != (entry.follows is not None):
            problem = f"needs exactly one of {', '.join(_FUNCTIONS)}, because it follows another coordinate"
            if entry.follows is None:
                problem = f"follows no other coordinate, but has one of {', '.join(_FUNCTIONS)}"
            yield where, problem, 'write follows = "NAME" and one function, or neither'
        independent = [coordinate for coordinate in coordinates if coordinate != name]
        if entry.follows is not None and entry.follows not in independent:
            problem = f"there is no other coordinate {quoted(entry.follows)}"
            yield f"{where}.follows", problem, suggestion(entry.follows, independent)
    for kind in ("rotations", "translations"):
        for number, axis in enumerate(getattr(joint, kind) or []):
            where, functions = f"{key}.{kind}[{number}]", _functions(axis)
            if axis.coordinate is None:
                if functions:
                    yield f"{where}.coordinate", "the key is missing", "name the coordinate of the function"
                continue
            if axis.coordinate not in coordinates:
                problem = f"there is no coordinate {quoted(axis.coordinate)}"
                yield f"{where}.coordinate", problem, suggestion(axis.coordinate, coordinates)
            if len(functions) > 1 or axis.constant is not None:
                yield where, "has more than one function", "leave all but one out"


def _functions(table: Function) -> list[str]:
    return [name for name in _FUNCTIONS if getattr(table, name) is not None]
