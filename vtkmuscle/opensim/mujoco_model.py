"""Models of MuJoCo, read and evaluated by the package mujoco."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial as Powers
from scipy.spatial.transform import Rotation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.joints.functions import Polynomial
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim.model import OsimModel, OsimMuscle
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath


@dataclass(frozen=True, eq=False, kw_only=True)
class MujocoModel(OsimModel):
    """A model of MuJoCo, in metres and radians, with lengths by MuJoCo.

    Muscles are actuators of spatial tendons, ligaments are spatial tendons without an actuator. Free and ball
    joints are coordinates without a range, and stay at rest. ``not_used`` are further actuators and tendons.
    """

    compiled: Any  # mujoco.MjModel
    tendons: Mapping[str, int]  # numbers of the tendons of muscles and ligaments

    def lengths(self, names: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the lengths (f,) of paths by name, for values (f,) of coordinates."""
        import mujoco  # noqa: PLC0415 -- an extra

        model, full = self.compiled, self.tree.completed(values)
        moving = [number for number in range(model.njnt) if model.jnt_type[number] in _axes_of(mujoco)]
        addresses = model.jnt_qposadr[moving]
        poses = np.column_stack([full[_name("joint", model.joint(number))] for number in moving])
        data, table = mujoco.MjData(model), np.empty((len(poses), len(names)))
        for pose, row in zip(poses, table, strict=True):
            data.qpos[addresses] = pose
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_tendon(model, data)
            row[:] = data.ten_length[[self.tendons[name] for name in names]]
        return dict(zip(names, table.T, strict=True))


def read_mjcf(path: str | PathLike[str]) -> MujocoModel:
    """Read a model of MuJoCo, with the package mujoco.

    Optimal fibre and slack tendon lengths of a muscle follow from its ranges, where the file states them.

    Parameters
    ----------
    path : path
        An .xml file in MuJoCo's format, MJCF.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If MuJoCo does not read the model, or is not installed; if two parts of the model have one name.

    References
    ----------
    Todorov, Erez, Tassa 2012, *MuJoCo: A physics engine for model-based control*,
    doi:10.1109/IROS.2012.6386109.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    try:
        import mujoco  # noqa: PLC0415 -- an extra
    except ImportError as error:
        problem, remedy = "a model of MuJoCo needs the package mujoco", "pip install 'vtkmuscle[mujoco]'"
        raise InputError(path, problem, remedy) from error
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        stated = [bool(actuator.lengthrange[1] > actuator.lengthrange[0]) for actuator in spec.actuators]
        for actuator, has_range in zip(spec.actuators, stated, strict=True):
            if not has_range:
                actuator.lengthrange = 0.0, 1.0  # else MuJoCo simulates the model for a range
        model = spec.compile()
    except ValueError as error:
        raise InputError(path, f"MuJoCo does not read the model: {error}", "correct the model") from error
    paths = dict(_paths(mujoco, model))
    muscles, tendons, not_used = {}, {}, []
    for number in range(model.nu):
        name, tendon = _name("actuator", model.actuator(number)), int(model.actuator_trnid[number, 0])
        if model.actuator_trntype[number] == mujoco.mjtTrn.mjTRN_TENDON and tendon in paths:
            hill = _hill(mujoco, model, number) if stated[number] else {}
            muscles[name] = OsimMuscle(name, paths[tendon], hill, "muscle")
            tendons[name] = tendon
        else:
            not_used.append(f"actuator {name}")
    ligaments = {}
    for tendon in sorted(set(range(model.ntendon)) - set(tendons.values())):
        name = _name("tendon", model.tendon(tendon))
        if tendon in paths:
            ligaments[name], tendons[name] = OsimMuscle(name, paths[tendon], {}, "tendon"), tendon
        else:
            not_used.append(f"tendon {name}")
    coordinates = list(_coordinates(mujoco, model))
    tree = KinematicTree("world", list(_joints(mujoco, model)), coordinates, list(_couplings(mujoco, model)))
    parts: dict[str, Any] = {"not_used": tuple(not_used), "ligaments": ligaments}
    return MujocoModel(spec.modelname, tree, (), muscles, (), **parts, compiled=model, tendons=tendons)


def _name(kind: str, part: Any) -> str:
    """Return a part's name, or its kind and number."""
    return part.name or f"{kind} {part.id}"


def _axes_of(mujoco: Any) -> tuple[int, int]:
    """Return the kinds of joints with a coordinate: hinges and slides."""
    return int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


def _coordinates(mujoco: Any, model: Any) -> Iterator[JointCoordinate]:
    hinge, slide = _axes_of(mujoco)
    for number in range(model.njnt):
        joint, limits = model.joint(number), None
        if joint.type[0] in (hinge, slide) and joint.limited[0]:
            limits = float(joint.range[0]), float(joint.range[1])
        rest = float(joint.qpos0[0]) if joint.type[0] in (hinge, slide) else 0.0
        yield JointCoordinate(_name("joint", joint), "m" if joint.type[0] == slide else "rad", rest, limits)


def _joints(mujoco: Any, model: Any) -> Iterator[Joint]:
    """Yield a joint for each joint and each fixed body; bodies of several joints are chains of bodies."""
    hinge, slide = _axes_of(mujoco)
    for number in range(1, model.nbody):
        body = model.body(number)
        parent, name = _name("body", model.body(body.parentid[0])), _name("body", body)
        offset = frame_at(body.pos)
        offset[:3, :3] = Rotation.from_quat(body.quat, scalar_first=True).as_matrix()
        joints = [model.joint(body.jntadr[0] + i) for i in range(body.jntnum[0])]
        if not joints:
            yield Joint(f"{name} fixed", parent, name, parent_frame=offset)
        for i, joint in enumerate(joints, start=1):
            child, anchor = name if i == len(joints) else f"{name} {i}", frame_at(joint.pos)
            kind, label = joint.type[0], _name("joint", joint)
            amount = Polynomial(np.array([1.0, -joint.qpos0[0]] if kind in (hinge, slide) else [0.0]))
            axes = [JointAxis(joint.axis, amount, label)]
            turns, slides = ([], axes) if kind == slide else (axes, [])
            yield Joint(label, parent, child, turns, slides, offset @ anchor, anchor)
            parent, offset = child, np.eye(4)


def _couplings(mujoco: Any, model: Any) -> Iterator[Coupling]:
    """Yield the active equalities of two joints; both joints count from rest."""
    for number in np.flatnonzero(model.eq_active0):
        ids = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        if model.eq_type[number] == mujoco.mjtEq.mjEQ_JOINT and min(ids) >= 0:
            (first, at), (second, independent_at) = (
                (_name("joint", joint), float(joint.qpos0[0])) for joint in map(model.joint, ids)
            )
            powers = Powers(model.eq_data[number, :5])(Powers([-independent_at, 1.0])) + at
            yield Coupling(first, second, Polynomial(np.array(powers.coef[::-1], dtype=np.float64)))


def _paths(mujoco: Any, model: Any) -> Iterator[tuple[int, PointPath]]:
    """Yield the spatial tendons' paths by number."""
    kinds = mujoco.mjtWrap
    rounds = {int(kinds.mjWRAP_SPHERE), int(kinds.mjWRAP_CYLINDER)}
    for number in range(model.ntendon):
        points, wraps = [], []
        for at in range(model.tendon_adr[number], model.tendon_adr[number] + model.tendon_num[number]):
            kind, part = model.wrap_type[at], int(model.wrap_objid[at])
            if kind == kinds.mjWRAP_SITE:
                site = model.site(part)
                points.append(PathPoint(_name("body", model.body(site.bodyid[0])), site.pos))
            elif kind in rounds:
                wraps.append(_name("geom", model.geom(part)))
        if points:
            yield number, PointPath(points, wraps)


def _hill(mujoco: Any, model: Any, number: int) -> dict[str, float]:
    """Return the properties of a muscle from its ranges of lengths; none for another actuator."""
    shortest, longest = model.actuator_lengthrange[number]
    least, most, force = model.actuator_gainprm[number, :3]
    muscle = model.actuator_gaintype[number] == mujoco.mjtGain.mjGAIN_MUSCLE
    if not (muscle and most > least):
        return {}
    optimal = float((longest - shortest) / (most - least))
    lengths = {"optimal_fiber_length": optimal, "tendon_slack_length": float(shortest - least * optimal)}
    return lengths | ({"max_isometric_force": float(force)} if force > 0.0 else {})
