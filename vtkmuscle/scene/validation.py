"""Validation of scene tables: each key by the schema, then keys together."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.taut_paths import PATH_PRESETS
from vtkmuscle.pipelines import DEFORMER_SETTINGS
from vtkmuscle.scene import schema
from vtkmuscle.scene.data import Faults, SceneError, words_of
from vtkmuscle.scene.writing import inline_toml

#: File names of a run besides the muscles' names.
_RESERVED = ("bones", "figures", "finished", "scene")


def _tables(kind: Any, key: str = "") -> Iterator[tuple[str, type[schema.SchemaTable]]]:
    """Yield keys and classes of the tables in a type of a field."""
    if isinstance(kind, type) and issubclass(kind, schema.SchemaTable):
        yield key, kind
        for name, field in kind.model_fields.items():
            yield from _tables(field.annotation, name)
    for part in get_args(kind):
        yield from _tables(part, key)


#: All tables by their key, for hints and examples; the file itself has none.
_TABLES = dict(_tables(schema.SceneTable))

#: Key, problem and remedy.
_Fault = tuple[str, str, str]


def _fault(fault: str, key: str, **values: object) -> _Fault:
    return key, *words_of(fault, **values)


def validated(values: Mapping[str, Any], file: Path | None) -> schema.SceneTable:
    """Return the checked tables of a scene file. SceneError with a fault for each key at fault."""
    try:
        table = schema.SceneTable.model_validate(values)
    except ValidationError as error:
        faults = _faults_in_words(error.errors(include_url=False))
    else:
        faults = _conflicts(table)
    Faults(SceneError(problem, key, remedy, file) for key, problem, remedy in faults).raise_any()
    return table


def _faults_in_words(errors: list[ErrorDetails]) -> Iterator[_Fault]:
    """Yield key, problem and remedy of pydantic's errors, unknown keys first."""
    for error in sorted(errors, key=lambda error: (error["type"] != "extra_forbidden", len(error["loc"]))):
        path = [part for part in error["loc"] if part not in ("[key]", schema.ALONE)]
        key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
        yield (key.removeprefix("."), *_problem_and_remedy(error, path))


def _problem_and_remedy(error: ErrorDetails, path: Sequence[int | str]) -> tuple[str, str]:
    *parents, name = [part for part in path if isinstance(part, str)]
    table = _TABLES[next(key for key in (*reversed(parents), "") if key in _TABLES)]
    field = table.model_fields.get(name)
    example = f"{name} = {inline_toml(field.examples[0])}" if field and field.examples else ""
    remedy = f"write {example}" if example else "see the format of a scene.toml"
    match error["type"]:
        case "value_error":
            problem, own = fault_of(error["ctx"]["error"])
            return problem, own or remedy
        case "missing":
            return "the key is missing", f"add {example}"
        case "extra_forbidden":
            keys = [key for key, kind in _TABLES.items() if name in kind.model_fields]
            homes = [f"in the table {key}" if key else "above the first [table]" for key in keys]
            if homes and not get_close_matches(name, table.model_fields, cutoff=0.8):
                return "there is no such key", f"write {name} {' or '.join(homes)}"
            return "there is no such key", suggestion(name, table.model_fields)
        case "literal_error":
            remedy = suggestion(str(error["input"]), re.findall("'(.*?)'", error["ctx"]["expected"]))
        case "too_short" | "too_long" if field and field.description:
            remedy += f": {field.description.partition('.')[0]}"
        case "model_type":
            return f"must be a table, not {quoted(error['input'])}", remedy
    problem = error["msg"].replace("Input should be", "must be").replace(" after validation", "")
    problem = problem.replace("String should have at least 1 character", "the text is empty")
    return problem + (f", not {quoted(error['input'])}" if "must be" in problem else ""), remedy


def _conflicts(scene: schema.SceneTable) -> Iterator[_Fault]:
    """Yield the faults of keys that are valid alone, but not together."""
    for kind, names in (("bones", list(scene.bones)), ("muscles", list(scene.muscles))):
        if not names:
            yield _fault("empty", kind, kind=kind)
    yield from _of_joints(scene)
    yield from _of_motion(scene)
    if scene.deformer == "none" and scene.muscle_contact != "off":
        yield _fault("contact_without_deformer", "muscle_contact", contact=scene.muscle_contact)
    if scene.quality not in (None, *PATH_PRESETS) and scene.deformer != "pbd":
        yield _fault("quality_of_pbd", "quality", quality=scene.quality, deformer=scene.deformer)
    allowed = DEFORMER_SETTINGS[scene.deformer]
    solvers = {f"muscles.{name}.solver": muscle.solver for name, muscle in scene.muscles.items()}
    for key, table in ({"solver": scene.solver} | solvers).items():
        for setting in table.settings():
            if setting not in allowed:
                remedy = suggestion(setting, allowed) if allowed else "remove it"
                yield _fault("no_setting", f"{key}.{setting}", deformer=scene.deformer, remedy=remedy)
    for name in scene.muscles:
        yield from _of_muscle(name, scene)


def _unknown_bone(key: str, bone: str, bones: Collection[str]) -> Iterator[_Fault]:
    if bone not in bones:
        yield _fault("no_bone", key, bone=quoted(bone), remedy=suggestion(bone, bones))


def _of_muscle(name: str, scene: schema.SceneTable) -> Iterator[_Fault]:
    key, muscle, folded = f"muscles.{name}", scene.muscles[name], name.casefold()
    taken = {other.casefold() for other in scene.muscles if other != name}
    if folded in _RESERVED or folded.removesuffix("_fibres") in taken:
        yield _fault("taken_name", key, name=name)
    if scene.deformer == "none" and muscle.fibres is None:
        yield _fault("paths_without_fibres", f"{key}.fibres")
    if muscle.aponeuroses is not None and muscle.fibres is None:
        yield _fault("aponeuroses_without_fibres", f"{key}.aponeuroses")
    if muscle.aponeuroses is not None and scene.deformer == "none":
        yield _fault("aponeuroses_without_deformer", f"{key}.aponeuroses")
    yield from _of_attachments(f"{key}.attachments", muscle, scene)


def _of_attachments(key: str, muscle: schema.MuscleTable, scene: schema.SceneTable) -> Iterator[_Fault]:
    if isinstance(muscle.attachments, schema.Estimate):
        for bone in muscle.attachments.bones:
            yield from _unknown_bone(key, bone, scene.bones)
        return
    for number, area in enumerate(muscle.attachments):
        yield from _unknown_bone(f"{key}[{number}].bone", area.bone, scene.bones)
    roles = {area.role for area in muscle.attachments} - {VIA}
    default = FixedPointDetector.parameter_declarations["method"].default
    method = {"method": default, **scene.fixing.settings(), **muscle.fixing.settings()}["method"]
    alone = ROLES[:1] if method == "attachment" and not roles else ()  # a muscle without fibres needs one
    for role in alone if muscle.fibres is None else ROLES:
        if role not in roles:
            more = "" if roles else ', or write attachments = "estimate" (from contact with the bones)'
            more += "" if muscle.fibres is None else ", or leave out fibres"
            yield _fault("no_role", key, role=role, more=more)


def _of_motion(scene: schema.SceneTable) -> Iterator[_Fault]:
    motion = scene.motion
    jointed = bool(scene.joints) or scene.opensim is not None
    present = [name for name in schema.Motion.model_fields if name in motion.model_fields_set]
    kind = next((name for name in schema.MOTION_KINDS if name in present), None)
    if jointed and kind not in ("file", "grid"):
        yield _fault("joints_without_motion", "motion")
        return
    if kind is None:
        remedy = 'add transforms = "FILE.csv", or a table [motion.hinge]; or joints, and file or grid'
        yield _fault("missing", "motion.transforms", remedy=remedy)
        return
    for name in sorted(set(present) - {kind, *schema.MOTION_KINDS[kind]}):
        yield _fault("combined", f"motion.{name}", other=f"motion.{kind}")
    if kind in ("file", "grid") and not jointed:
        yield _fault("no_joints", f"motion.{kind}")
    if motion.hinge is not None:
        yield from _unknown_bone("motion.hinge.bone", motion.hinge.bone, scene.bones)
    elif motion.transforms is None:
        return
    elif schema.ALONE not in motion.transforms:
        if motion.bone is not None:
            yield _fault("bone_and_bones", "motion.bone")
        for bone in motion.transforms:
            yield from _unknown_bone(f"motion.transforms.{bone}", bone, scene.bones)
    elif motion.bone is None:
        yield _fault("missing", "motion.bone", remedy='add bone = "NAME"')
    else:
        yield from _unknown_bone("motion.bone", motion.bone, scene.bones)


def _of_joints(scene: schema.SceneTable) -> Iterator[_Fault]:
    if scene.joints and scene.opensim is not None:
        yield _fault("combined", "opensim", other="[joints.NAME]")
    joints = scene.joints.values()
    bodies = {"parent": {*scene.bones, *(joint.child for joint in joints)}}
    bodies["child"] = {*scene.bones, *(joint.parent for joint in joints)}
    coordinates = [name for joint in joints for name in joint.coordinates or {}]
    for number, name in enumerate(coordinates):
        if name in coordinates[:number]:
            yield _fault("two_coordinates", "joints", name=quoted(name))
    for name, joint in scene.joints.items():
        key = f"joints.{name}"
        for end, allowed in bodies.items():
            if getattr(joint, end) not in allowed:
                yield from _unknown_bone(f"{key}.{end}", getattr(joint, end), scene.bones)
        yield from _of_kind(key, joint)
        yield from _of_functions(key, joint, coordinates)


def _of_kind(key: str, joint: schema.JointTable) -> Iterator[_Fault]:
    kind, keys = joint.type, schema.JOINT_KINDS[joint.type]
    for name in ("centre", "axis", "axes", "coordinates", "rotations", "translations"):
        missing = getattr(joint, name) is None
        if missing and name in keys["needed"]:
            yield _fault("missing", f"{key}.{name}", remedy=f"add {name} = [1.0, 0.0, 0.0]")
        elif not missing and name not in (*keys["needed"], *keys["optional"]):
            yield _fault("not_of_joint", f"{key}.{name}", kind=kind)
    count = len(joint.coordinates or {})
    if (wanted := keys.get("coordinates")) and count != wanted:
        names = ", ".join(f'"NAME_{number}"' for number in range(1, wanted + 1))
        sizes = {"count": count, "kind": kind, "wanted": wanted, "names": names}
        yield _fault("coordinates_of_joint", f"{key}.coordinates", **sizes)
    if kind == "custom" and not (joint.rotations or joint.translations):
        yield _fault("empty_joint", f"{key}.rotations")


def _of_functions(key: str, joint: schema.JointTable, coordinates: list[str]) -> Iterator[_Fault]:
    for name, entry in (joint.coordinates or {}).items():
        where = f"{key}.coordinates.{name}"
        if len(_functions(entry)) != (entry.follows is not None):
            yield _fault("follows_nothing" if entry.follows is None else "follows_by_nothing", where)
        independent = [coordinate for coordinate in coordinates if coordinate != name]
        if entry.follows is not None and entry.follows not in independent:
            words = {"name": quoted(entry.follows), "remedy": suggestion(entry.follows, independent)}
            yield _fault("no_other_coordinate", f"{where}.follows", **words)
    for kind in ("rotations", "translations"):
        for number, axis in enumerate(getattr(joint, kind) or []):
            where = f"{key}.{kind}[{number}]"
            if axis.coordinate not in coordinates:
                words = {"name": quoted(axis.coordinate), "remedy": suggestion(axis.coordinate, coordinates)}
                yield _fault("no_coordinate", f"{where}.coordinate", **words)
            if len(_functions(axis)) > 1:
                yield _fault("two_functions", where)


def _functions(table: schema.Function) -> set[str]:
    return table.model_fields_set & schema.Function.model_fields.keys()
