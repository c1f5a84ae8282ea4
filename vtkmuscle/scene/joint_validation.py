"""What the keys of a scene's joints say of each other, and of its bones and its motion."""

from __future__ import annotations

from collections.abc import Iterator

from vtkmuscle.core.words import shown, suggestion
from vtkmuscle.scene.joint_schema import JOINT_KINDS, Function, JointTable
from vtkmuscle.scene.schema import SceneTable

#: Where a fault is, what it is, and its remedy.
Fault = tuple[str, str, str]
_FUNCTIONS = ("polynomial", "spline", "piecewise")
#: Keys that a kind of joint has beside those that all have.
_KEYS = {"pin": ("axis",), "ball": ("axes",), "weld": (), "custom": ("rotations", "translations")}


def joint_faults(scene: SceneTable) -> Iterator[Fault]:
    """Give what cannot be of a scene's joints and of the motion by them."""
    jointed = bool(scene.joints) or scene.opensim is not None
    if scene.joints and scene.opensim is not None:
        yield "opensim", "cannot be combined with [joints.NAME]", "leave out one of them"
    yield from _of_motion(scene, jointed=jointed)
    children = {joint.child for joint in scene.joints.values()}
    parents = {joint.parent for joint in scene.joints.values()}
    known = [name for joint in scene.joints.values() for name in joint.coordinates or {}]
    for number, name in enumerate(known):
        if name in known[:number]:
            yield "joints", f"there are two coordinates {shown(name)}", "rename one of them"
    for name, joint in scene.joints.items():
        key = f"joints.{name}"
        for what, body, others in (("parent", joint.parent, children), ("child", joint.child, parents)):
            if body not in scene.bones and body not in others:
                yield f"{key}.{what}", f"there is no bone {shown(body)}", suggestion(body, scene.bones)
        yield from _of_kind(key, joint)
        yield from _of_functions(key, joint, known)


def _of_motion(scene: SceneTable, *, jointed: bool) -> Iterator[Fault]:
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


def _of_kind(key: str, joint: JointTable) -> Iterator[Fault]:
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


def _of_functions(key: str, joint: JointTable, known: list[str]) -> Iterator[Fault]:
    for name, one in (joint.coordinates or {}).items():
        where, given = f"{key}.coordinates.{name}", _given(one)
        if len(given) != (one.follows is not None):
            problem = (
                "follows another coordinate by one of" if one.follows else "follows no other, but has one of"
            )
            remedy = 'write follows = "NAME" and one function, or neither'
            yield where, f"{problem} {', '.join(_FUNCTIONS)}", remedy
        if one.follows is not None and (one.follows not in known or one.follows == name):
            problem = f"there is no other coordinate {shown(one.follows)}"
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
                problem = f"there is no coordinate {shown(axis.coordinate)}"
                yield f"{where}.coordinate", problem, suggestion(axis.coordinate, known)
            if len(given) > 1 or axis.constant is not None:
                yield where, "has more than one function", "leave all but one out"


def _given(table: Function) -> list[str]:
    return [name for name in _FUNCTIONS if getattr(table, name) is not None]
