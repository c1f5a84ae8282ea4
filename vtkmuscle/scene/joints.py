"""A scene's motion, and its joints as a kinematic tree."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.blending import screws
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES, Coordinate
from vtkmuscle.core.motion.rigid import SIX_DIGITS, RigidMotion, frame_at, hinge, inverses, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.io import motion_columns, read_motion_table
from vtkmuscle.io.motion_table import MOST_FRAMES
from vtkmuscle.joints import grid_of, steps_of
from vtkmuscle.joints.functions import IDENTITY, CoordinateFunction, CubicSpline, Polynomial
from vtkmuscle.joints.osim import GROUND, read_motion_file, read_tree
from vtkmuscle.joints.tree import HALF_STEP, Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.scene import schema
from vtkmuscle.scene.data import Faults, SceneData, SceneError, SceneFiles, scene_errors_at


def motion_from(scene: schema.SceneTable, files: SceneFiles, joints: "SceneJoints | None") -> RigidMotion:
    """Return a scene's motion; SceneError for unreadable or inconsistent tables."""
    table = scene.motion
    if joints is not None:
        return joints.motion(scene, files)
    if (turn := table.hinge) is not None:
        return hinge(turn.bone, turn.centre, turn.axis, steps_of(*turn.angles), coordinate=turn.coordinate)
    columns = None
    if table.coordinates is not None:
        columns = {name: kind.model_dump(exclude_unset=True) for name, kind in table.coordinates.items()}
    centres, transforms = table.centre or {}, table.transforms or {}
    if schema.ALONE in transforms:
        bone = str(table.bone)
        centre = centres.get(schema.ALONE, centres.get(bone))
        read = partial(read_motion_table, bone=bone, time=table.time, centre=centre, coordinates=columns)
        return files.read("motion.transforms", transforms[schema.ALONE], read)
    return _of_several(table, columns, files)


def _of_several(
    table: schema.Motion, columns: Mapping[str, Mapping[str, str]] | None, files: SceneFiles
) -> RigidMotion:
    """Return the motion of bones with a table each."""
    motions: list[RigidMotion] = []
    seen: set[str] = set()
    centres, scene, faults = table.centre or {}, files.paths[""], Faults()

    def read(path: Path, bone: str) -> RigidMotion:
        present = motion_columns(path)
        seen.update(present)
        own = columns and {name: kind for name, kind in columns.items() if name in present}
        centre = centres.get(schema.ALONE, centres.get(bone))
        return read_motion_table(path, bone, time=table.time, centre=centre, coordinates=own)

    for bone, text in (table.transforms or {}).items():
        with faults.gathered():
            key = f"motion.transforms.{bone}"
            motions.append(files.read(key, text, partial(read, bone=bone)))
            if not np.array_equal(motions[-1].times, motions[0].times):
                problem = "times differ from the first table"
                raise SceneError(problem, key, "use equal times in all tables", scene)
    faults.raise_any()
    coordinates: dict[str, Coordinate] = {}
    for motion in motions:
        for name, coordinate in motion.coordinates.items():
            if not np.array_equal(coordinates.setdefault(name, coordinate).values, coordinate.values):
                remedy = "use equal values in all tables, or separate names"
                raise SceneError(f"{name!r} differs from table to table", "motion.coordinates", remedy, scene)
    if missing := sorted(set(columns or ()) - seen):
        problem = f"no table has the column {missing[0]!r}"
        raise SceneError(problem, "motion.coordinates", suggestion(missing[0], sorted(seen)), scene)
    moving = {bone: poses for motion in motions for bone, poses in motion.transforms.items()}
    centre = {bone: motion.centre_of(bone) for motion in motions for bone in motion.transforms}
    return RigidMotion(motions[0].times, moving, centre if centres else None, coordinates)


@dataclass(frozen=True, eq=False)
class SceneJoints:
    """A scene's kinematic tree and bodies of bones. ``frame`` has the scene's frame, ``fixed`` rests."""

    tree: KinematicTree
    bodies: dict[str, str]
    frame: str
    fixed: str

    def crossed(self, bones: Iterable[str]) -> tuple[str, ...]:
        """Return the free coordinates that move bones relative to each other."""
        return self.tree.crossed([self.bodies[bone] for bone in bones])

    def coordinates(self) -> dict[str, tuple[str, ...]]:
        """Return the free coordinates by joint."""
        return {joint.name: self.tree.crossed([joint.parent, joint.child]) for joint in self.tree.joints}

    def motion(self, table: schema.SceneTable, files: SceneFiles) -> RigidMotion:
        """Return the bones' motion by the scene's file or grid of coordinates."""
        times, values = coordinate_values(table, self.tree, files)
        key = _key(table)
        _warn_of_ranges(values, self.tree, key, files)
        with scene_errors_at("motion", files.paths[""], "correct it"):
            moved = self.motion_of(times, values, list(table.motion.coordinates or ()) or None)
        if not moved.transforms:
            raise SceneError("no bone moves", key, "name coordinates between bones", files.paths[""])
        return moved

    def motion_of(
        self, times: Floats, values: Mapping[str, Floats], coordinates: Sequence[str] | None = None
    ) -> RigidMotion:
        """Return the motion of bones for coordinate values (f,) at times (f,).

        Moment arms are defined for `coordinates`; by default for all coordinates with values that move a bone
        relative to another bone or the fixed body. Angles of the motion are in degrees.
        """
        tree, full = self.tree, self.tree.completed(values)
        if coordinates is None:
            crossed = tree.crossed([*self.bodies.values(), self.fixed])
            coordinates = [name for name in crossed if name in values]
        rest = tree.poses({})
        placed = rest[self.frame][0]
        back = inverses(placed[None])[0]

        def moved(at: Mapping[str, ArrayLike]) -> dict[str, Floats]:
            """Return the motion of each bone from rest, (f, 4, 4)."""
            now = tree.poses(at)
            to = back @ (rest[self.fixed] @ inverses(now[self.fixed]))
            return {
                bone: to @ now[body] @ inverses(rest[body]) @ placed for bone, body in self.bodies.items()
            }

        def coordinate(name: str) -> Coordinate:
            """Return a coordinate with each bone's twist per radian or millimetre."""
            kind, twists = tree.coordinate(name), None
            if name in tree.free:
                own = {free: full[free] for free in tree.free}
                low, high = (moved({**own, name: own[name] + step}) for step in (-HALF_STEP, HALF_STEP))
                step = 2.0 * HALF_STEP * (1.0 if kind.is_angle else MILLIMETRES[kind.unit])
                twists = {bone: screws(high[bone] @ inverses(low[bone])) / step for bone in self.bodies}
            own_values, unit = (np.degrees(full[name]), "deg") if kind.is_angle else (full[name], kind.unit)
            return Coordinate(own_values, unit, kind.positive, twists)

        negligible = 1e-12 * max(1.0, float(np.abs(placed[:3, 3]).max()))
        poses = moved(full).items()
        moving = {bone: table for bone, table in poses if np.abs(table - np.eye(4)).max() > negligible}
        joints = {joint.child: joint for joint in tree.joints}
        centres = {
            bone: (back @ rest[body][0] @ joints[body].child_frame)[:3, 3]
            for bone, body in self.bodies.items()
            if bone in moving and body in joints
        }
        return RigidMotion(times, moving, centres, {name: coordinate(name) for name in coordinates})


def joints_of(table: schema.SceneTable, files: SceneFiles) -> SceneJoints | None:
    """Return a scene's joints, None without joints. SceneError if the joints form no tree."""
    if table.opensim is not None:
        return _of_opensim(table.opensim, table, files)
    if not table.joints:
        return None
    hung = {joint.child for joint in table.joints.values()}
    bodies = dict.fromkeys([*table.bones, *(joint.parent for joint in table.joints.values())])
    joints = [Joint(f"{GROUND}_{name}", GROUND, name, kind="weld") for name in bodies if name not in hung]
    coordinates: list[JointCoordinate] = []
    couplings: list[Coupling] = []
    factors = _factors(table.joints)
    for name, joint in table.joints.items():
        with scene_errors_at(f"joints.{name}", files.paths[""], "correct it"):
            for own, entry in (joint.coordinates or {}).items():
                unit = table.units if factors[own] == 1.0 else "rad"
                limits = None if entry.range is None else (entry.range[0], entry.range[1])
                coordinate = JointCoordinate(own, unit, entry.rest, limits, entry.positive or "")
                coordinates.append(coordinate.scaled(factors[own]))
                if entry.follows is not None:
                    function = _function(entry).rescaled(factors[entry.follows], factors[own])
                    couplings.append(Coupling(own, entry.follows, function))
            joints.append(_joint(name, joint, factors))
    with scene_errors_at("joints", files.paths[""], "correct it"):
        tree = KinematicTree(GROUND, joints, coordinates, couplings)
    return SceneJoints(_at_rest(tree), {bone: bone for bone in table.bones}, GROUND, GROUND)


def pin_joint_of(scene: SceneData) -> tuple[SceneJoints, dict[str, Floats]] | None:
    """Return a motion of one bone about a fixed axis as a pin joint, with coordinate values (f,) [rad].

    None for any other motion, to six digits of the bones' coordinates, or where no bone stays at rest.
    """
    motion, bones = scene.motion, scene.bones
    still = [bone for bone in bones if bone not in motion.transforms]
    if len(motion.transforms) != 1 or len(motion.coordinates) != 1 or not still or len(motion.times) < 2:
        return None
    ((bone, poses),), ((name, coordinate),) = motion.transforms.items(), motion.coordinates.items()
    if coordinate.unit not in ANGLES or np.ptp(coordinate.values) == 0.0:
        return None
    angles = coordinate.values * (ANGLES["deg"] if coordinate.unit == "deg" else 1.0)
    steps, changes = screws(poses[1:] @ inverses(poses[:-1])), np.diff(angles)
    twist = steps.T @ changes / (changes @ changes)
    turning = float(np.linalg.norm(twist[3:]))
    if turning == 0.0:
        return None
    axis, centre = twist[3:] / turning, np.cross(twist[3:], twist[:3]) / turning**2
    rest = float(angles[0] - screws(poses[:1])[0, 3:] @ axis)
    turned = np.array([rotation_about(centre, axis, np.degrees(angle - rest)) for angle in angles])
    size = np.abs([each.GetBounds() for each in bones.values()]).max()
    if (np.abs(turned - poses).max(axis=(0, 1)) > SIX_DIGITS * np.array([1.0, 1.0, 1.0, size])).any():
        return None
    parent, frame = still[0], frame_at(centre)
    joints = [Joint(f"{GROUND}_{parent}", GROUND, parent, kind="weld")]
    joints += [Joint(f"{parent}_{each}", parent, each, kind="weld") for each in still[1:]]
    turn = JointAxis(axis, IDENTITY, name)
    joints.append(Joint(f"{bone}_hinge", parent, bone, [turn], (), frame, frame, "pin"))
    own = JointCoordinate(name, "rad", rest, positive=coordinate.positive)
    bodies = {each: each for each in (*still, bone)}
    return SceneJoints(_at_rest(KinematicTree(GROUND, joints, [own])), bodies, GROUND, GROUND), {name: angles}


def coordinate_values(
    table: schema.SceneTable, tree: KinematicTree, files: SceneFiles
) -> tuple[Floats, dict[str, Floats]]:
    """Return times (f,) and coordinate values (f,) of a scene's motion."""
    motion, key = table.motion, _key(table)
    if motion.file is not None:
        table_of_file = files.read(key, motion.file, read_motion_file)
        rows = slice(None, None, motion.every)
        columns = files.read(key, motion.file, lambda _: table_of_file.values(tree))
        return table_of_file.times[rows], {name: column[rows] for name, column in columns.items()}
    where = files.paths[""]
    grid = {name: steps_of(*steps) for name, steps in (motion.grid or {}).items()}
    for name in grid:
        with scene_errors_at(f"{key}.{name}", where):
            tree.coordinate(name)
        if name not in tree.free:
            raise SceneError(f"{name!r} follows another coordinate", f"{key}.{name}", "remove the key", where)
    count = int(np.prod([len(column) for column in grid.values()]))
    if count > MOST_FRAMES:
        raise SceneError(f"the grid has {count} poses", key, "choose larger steps", where)
    values = grid_of({name: column * _unit(tree, name) for name, column in grid.items()})
    return (next(iter(grid.values())) if len(grid) == 1 else np.arange(float(count))), values


def _key(table: schema.SceneTable) -> str:
    return "motion.file" if table.motion.file is not None else "motion.grid"


def _unit(tree: KinematicTree, coordinate: str) -> float:
    """Return the scene's unit of a coordinate in the tree's unit."""
    return ANGLES["deg"] if tree.coordinate(coordinate).is_angle else 1.0


def _warn_of_ranges(values: Mapping[str, Floats], tree: KinematicTree, key: str, files: SceneFiles) -> None:
    """Warn about a motion beyond a coordinate's range."""
    for name, column in values.items():
        limits = tree.coordinate(name).range
        if limits is None or name not in tree.free:
            continue
        (low, high), unit = limits, _unit(tree, name)
        if column.min() < low - 1e-6 or column.max() > high + 1e-6:
            words = f"{files.paths['']}: {key}: {name!r} goes from {column.min() / unit:.4g} to "
            words += f"{column.max() / unit:.4g}, but its range is {low / unit:.4g} to {high / unit:.4g}"
            warnings.warn(words, stacklevel=4)


def _of_opensim(table: schema.OpenSimTable, scene: schema.SceneTable, files: SceneFiles) -> SceneJoints:
    tree = files.read("opensim.model", table.model, read_tree)
    where = files.paths[""]
    body_names = table.bodies or {}
    bodies = {bone: body_names.get(bone, bone) for bone in scene.bones}
    frame, fixed = table.frame or tree.root, table.fixed or tree.root
    for bone in sorted(body_names.keys() - scene.bones.keys()):
        remedy = suggestion(bone, scene.bones)
        raise SceneError(f"there is no bone {bone!r}", f"opensim.bodies.{bone}", remedy, where)
    with scene_errors_at("opensim.rest", where):
        rest = {name: value * _unit(tree, name) for name, value in (table.rest or {}).items()}
    coordinates = [replace(old, rest=rest.get(old.name, old.rest)) for old in tree.coordinates]
    named = {f"bodies.{bone}": body for bone, body in bodies.items()} | {"frame": frame, "fixed": fixed}
    for key, body in named.items():
        if body not in tree.bodies:
            problem = f"the model has no body {body!r}"
            raise SceneError(problem, f"opensim.{key}", f"bodies: {', '.join(tree.bodies)}", where)
    tree = replace(tree, coordinates=coordinates).scaled(1000.0 / MILLIMETRES[scene.units])
    return SceneJoints(tree, bodies, frame, fixed)


def _factors(joints: Mapping[str, schema.JointTable]) -> dict[str, float]:
    """Return radians per degree for angles, 1 for pure translations."""
    factors: dict[str, float] = {}
    for joint in joints.values():
        turns = {axis.coordinate for axis in joint.rotations or []}
        slides = {axis.coordinate for axis in joint.translations or []} - turns
        factors |= {name: 1.0 if name in slides else ANGLES["deg"] for name in joint.coordinates or {}}
    return factors


def _joint(name: str, joint: schema.JointTable, factors: Mapping[str, float]) -> Joint:
    frame = frame_at(joint.centre or (0.0, 0.0, 0.0))
    names = list(joint.coordinates or {})
    rotations: list[JointAxis] = []
    if joint.type in ("pin", "ball"):
        axes = [joint.axis] if joint.type == "pin" else joint.axes or np.eye(3)
        rotations = [JointAxis(np.array(axis), IDENTITY, own) for axis, own in zip(axes, names, strict=True)]
    rotations += [_axis(axis, factors, ANGLES["deg"]) for axis in joint.rotations or []]
    translations = [_axis(axis, factors, 1.0) for axis in joint.translations or []]
    return Joint(name, joint.parent, joint.child, rotations, translations, frame, frame, joint.type)


def _axis(axis: schema.Axis, factors: Mapping[str, float], result: float) -> JointAxis:
    function = _function(axis).rescaled(factors[axis.coordinate], result)
    return JointAxis(np.array(axis.axis), function, axis.coordinate)


def _function(table: schema.Function) -> CoordinateFunction:
    """Return a function of a scene, in the scene's units."""
    if table.spline is not None:
        return CubicSpline(np.array(table.spline.x), np.array(table.spline.y))
    return Polynomial(np.array(table.polynomial or [1.0, 0.0]))


def _at_rest(tree: KinematicTree) -> KinematicTree:
    """Return a tree whose body frames equal the scene's frame at rest."""
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
