"""The joints of a scene as a kinematic tree, and the motion that coordinates give its bones."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from vtkmuscle.core.motion.rigid import RigidMotion, frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.opensim import read_motion_file, read_osim
from vtkmuscle.opensim.functions import (
    IDENTITY,
    Constant,
    CoordinateFunction,
    CubicSpline,
    PiecewiseLinear,
    Polynomial,
)
from vtkmuscle.opensim.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim.tree_motion import grid_of, motion_of_tree
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.faults import SceneError, errors_at
from vtkmuscle.scene.files import SceneFiles
from vtkmuscle.scene.joint_schema import Axis, Function, JointTable, OpenSimTable
from vtkmuscle.scene.motion import steps_of
from vtkmuscle.scene.schema import MOST_FRAMES, SceneTable

#: What all bones that hang on no joint are fixed to.
GROUND = "ground"
_DEGREE = pi / 180.0


@dataclass(frozen=True, eq=False)
class SceneJoints:
    """The joints of a scene.

    Attributes
    ----------
    tree : KinematicTree
        In the scene's unit of length; the bones are at rest where its coordinates are.
    bodies : dict of str to str
        The body of each bone.
    frame, fixed : str
        The body whose frame at rest is the scene's, and the one that stays where it is.
    """

    tree: KinematicTree
    bodies: dict[str, str]
    frame: str
    fixed: str

    def crossed(self, bones: Iterable[str]) -> tuple[str, ...]:
        """Return the free coordinates that move some bones against each other."""
        return self.tree.crossed([self.bodies[bone] for bone in bones])

    def motion(self, table: SceneTable, files: SceneFiles) -> RigidMotion:
        """Return the motion that a scene's file or grid of coordinates gives its bones.

        Raises
        ------
        SceneError
            If the file cannot be read, or names no coordinate.
        """
        times, values = coordinate_values(table, self.tree, files)
        key = "motion.file" if table.motion.file is not None else "motion.grid"
        _warn_of_ranges(values, self.tree, key, files)
        chosen = list(table.motion.coordinates) if table.motion.coordinates else None
        with errors_at("motion", files.paths[""], "correct it"):
            moved = motion_of_tree(
                self.tree,
                values,
                times=times,
                bodies=self.bodies,
                frame=self.frame,
                fixed=self.fixed,
                coordinates=chosen,
            )
        if not moved.transforms:
            raise SceneError(
                "no bone moves", key, "name coordinates of joints between bones", files.paths[""]
            )
        return moved


def joints_in(table: SceneTable, files: SceneFiles) -> SceneJoints:
    """Return the joints of a scene that has some.

    Raises
    ------
    SceneError
        If a file cannot be read, or the joints are no tree.
    """
    if table.opensim is not None:
        return _of_opensim(table.opensim, table, files)
    hung = {joint.child for joint in table.joints.values()}
    bodies = dict.fromkeys([*table.bones, *(joint.parent for joint in table.joints.values())])
    joints = [Joint(f"{GROUND}_{name}", GROUND, name, kind="weld") for name in bodies if name not in hung]
    coordinates: list[JointCoordinate] = []
    couplings: list[Coupling] = []
    factors = _factors(table.joints)
    for name, joint in table.joints.items():
        with errors_at(f"joints.{name}", files.paths[""], "correct it"):
            coordinates += _coordinates(joint, factors, table.units)
            couplings += _couplings(joint, factors)
            joints.append(_joint(name, joint, factors))
    with errors_at("joints", files.paths[""], "correct it"):
        tree = KinematicTree(GROUND, joints, coordinates, couplings)
    return SceneJoints(_at_rest(tree), {bone: bone for bone in table.bones}, GROUND, GROUND)


def coordinate_values(
    table: SceneTable, tree: KinematicTree, files: SceneFiles
) -> tuple[Floats, dict[str, Floats]]:
    """Return the times (f,) of a scene's motion, and the values (f,) of the coordinates that it gives.

    Raises
    ------
    SceneError
        If the file cannot be read, or names no coordinate.
    """
    motion = table.motion
    key = "motion.file" if motion.file is not None else "motion.grid"
    if motion.file is not None:
        found = files.read(key, motion.file, read_motion_file)
        rows = slice(None, None, motion.every)
        times = found.times[rows]
        given = files.read(key, motion.file, lambda _: found.values(tree))
        values = {name: column[rows] for name, column in given.items()}
    else:
        grid = {
            name: steps_of(*three) * (_DEGREE if tree.coordinate(name).is_angle else 1.0)
            for name, three in _known(motion.grid or {}, tree, files)
        }
        count = int(np.prod([len(one) for one in grid.values()]))
        if count > MOST_FRAMES:
            raise SceneError(f"the grid has {count} poses", key, "choose larger steps", files.paths[""])
        values = grid_of(grid)
        alone = next(iter(motion.grid or {})) if len(grid) == 1 else None
        times = np.arange(float(count)) if alone is None else steps_of(*(motion.grid or {})[alone])
    return times, values


def _known(
    grid: Mapping[str, list[float]], tree: KinematicTree, files: SceneFiles
) -> Iterator[tuple[str, list[float]]]:
    for name, three in grid.items():
        with errors_at(f"motion.grid.{name}", files.paths[""]):
            tree.coordinate(name)
        if name not in tree.free:
            problem = f"the coordinate {name!r} follows another one"
            raise SceneError(problem, f"motion.grid.{name}", "leave it out", files.paths[""])
        yield name, three


def _warn_of_ranges(values: Mapping[str, Floats], tree: KinematicTree, key: str, files: SceneFiles) -> None:
    """Warn where a motion goes beyond the range of a coordinate."""
    for name, column in values.items():
        one = tree.coordinate(name)
        if one.range is None or name not in tree.free:
            continue
        low, high = one.range
        factor = 1.0 / _DEGREE if one.is_angle else 1.0
        if column.min() < low - 1e-6 or column.max() > high + 1e-6:
            words = (
                f"{files.paths['']}: {key}: {name!r} goes from {factor * column.min():.4g} to "
                f"{factor * column.max():.4g}, but its range is {factor * low:.4g} to {factor * high:.4g}"
            )
            warnings.warn(words, stacklevel=4)


def _of_opensim(table: OpenSimTable, scene: SceneTable, files: SceneFiles) -> SceneJoints:
    model = files.read("opensim.model", table.model, read_osim)
    tree = model.tree
    where = files.paths[""]
    given = table.bodies or {}
    bodies = {bone: given.get(bone, bone) for bone in scene.bones}
    for bone in given:
        if bone not in scene.bones:
            raise SceneError(f"there is no bone {bone!r}", f"opensim.bodies.{bone}", "", where)
    with errors_at("opensim.rest", where):
        rest = {
            name: value * (_DEGREE if tree.coordinate(name).is_angle else 1.0)
            for name, value in (table.rest or {}).items()
        }
        tree = replace(
            tree, coordinates=[replace(one, rest=rest.get(one.name, one.rest)) for one in tree.coordinates]
        )
    for key, body in (
        *((f"bodies.{bone}", body) for bone, body in bodies.items()),
        ("frame", table.frame or tree.root),
        ("fixed", table.fixed or tree.root),
    ):
        if body not in tree.bodies:
            problem = f"the model has no body {body!r}"
            raise SceneError(problem, f"opensim.{key}", f"its bodies are {', '.join(tree.bodies)}", where)
    scale = 1000.0 / MILLIMETRES[scene.units]
    return SceneJoints(tree.scaled(scale), bodies, table.frame or tree.root, table.fixed or tree.root)


def _factors(joints: Mapping[str, JointTable]) -> dict[str, float]:
    """Return radians per degree for each coordinate that is an angle, 1 for one that slides alone."""
    factors: dict[str, float] = {}
    for joint in joints.values():
        turns = {axis.coordinate for axis in joint.rotations or []}
        slides = {axis.coordinate for axis in joint.translations or []} - turns
        factors |= {name: 1.0 if name in slides else _DEGREE for name in joint.coordinates or {}}
    return factors


def _coordinates(joint: JointTable, factors: Mapping[str, float], units: str) -> Iterator[JointCoordinate]:
    for name, one in (joint.coordinates or {}).items():
        factor = factors[name]
        limits = None if one.range is None else (factor * one.range[0], factor * one.range[1])
        unit = units if factor == 1.0 else "rad"
        yield JointCoordinate(name, unit, factor * one.rest, limits, one.positive or "")


def _couplings(joint: JointTable, factors: Mapping[str, float]) -> Iterator[Coupling]:
    for name, one in (joint.coordinates or {}).items():
        if one.follows is not None:
            yield Coupling(name, one.follows, _function(one, factors[one.follows], factors[name]))


def _joint(name: str, joint: JointTable, factors: Mapping[str, float]) -> Joint:
    frame = frame_at(joint.centre or (0.0, 0.0, 0.0))
    names = list(joint.coordinates or {})
    rotations: list[JointAxis] = []
    translations: list[JointAxis] = []
    if joint.type == "pin":
        rotations = [JointAxis(np.array(joint.axis), IDENTITY, names[0])]
    elif joint.type == "ball":
        axes = joint.axes or np.eye(3).tolist()
        rotations = [JointAxis(np.array(axis), IDENTITY, one) for axis, one in zip(axes, names, strict=True)]
    elif joint.type == "custom":
        rotations = [_axis(axis, factors, _DEGREE) for axis in joint.rotations or []]
        translations = [_axis(axis, factors, 1.0) for axis in joint.translations or []]
    return Joint(name, joint.parent, joint.child, rotations, translations, frame, frame, joint.type)


def _axis(axis: Axis, factors: Mapping[str, float], out: float) -> JointAxis:
    if axis.coordinate is None:
        return JointAxis(np.array(axis.axis), Constant(out * (axis.constant or 0.0)))
    return JointAxis(np.array(axis.axis), _function(axis, factors[axis.coordinate], out), axis.coordinate)


def _function(table: Function, factor: float, out: float) -> CoordinateFunction:
    """Return a function in a file's units as one of radians and lengths.

    ``factor`` is what the coordinate's unit in the file is in the tree, ``out`` the same of the result.
    """
    for knots, kind in ((table.spline, CubicSpline), (table.piecewise, PiecewiseLinear)):
        if knots is not None:
            return kind(np.array(knots.x) * factor, np.array(knots.y) * out)
    coefficients = np.array(table.polynomial or [1.0, 0.0])
    return Polynomial(coefficients * out / factor ** np.arange(len(coefficients))[::-1])


def _at_rest(tree: KinematicTree) -> KinematicTree:
    """Return a tree whose bodies' frames are all the scene's frame where its coordinates are at rest.

    The axes of a joint go through its centre there, so what it slides is counted from rest.
    """
    full = tree.completed({})
    joints = []
    for joint in tree.joints:
        moved = replace(joint, child_frame=np.eye(4)).transforms(full, 1)[0]
        shift = moved[:3, 3] - joint.parent_frame[:3, 3]
        parent, child = np.array(joint.parent_frame), np.array(moved)
        parent[:3, 3] -= shift
        child[:3, 3] -= shift
        joints.append(replace(joint, parent_frame=parent, child_frame=child))
    return replace(tree, joints=joints)
