"""Models of MuJoCo (MJCF): text of a tree with spatial tendons, and models read by the package mujoco."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy.polynomial import Polynomial as Powers
from scipy.spatial.transform import Rotation

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.core.motion.rigid import frame_at, inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.io.xml_elements import made, xml_text
from vtkmuscle.io.xml_elements import numbers_text as _numbers
from vtkmuscle.joints.functions import CoordinateFunction, Polynomial
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim.export_parts import FOLDER, NEEDED
from vtkmuscle.opensim.model import OsimModel, OsimMuscle
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath
from vtkmuscle.opensim.osim_text import CYLINDER, GYRATION, MuscleOut
from vtkmuscle.run.table import optional_package

#: Highest power of a coupling in MuJoCo.
_HIGHEST = 4
#: Default mass of a body [kg]: MuJoCo refuses none, and a gram moves no other body.
LEAST_MASS = 0.001
#: Attributes of visible geometry without contact and mass.
_PASSIVE = {"contype": "0", "conaffinity": "0", "mass": "0", "rgba": "0.8 0.75 0.7 0.5"}


def mjcf_of(
    tree: KinematicTree, muscles: Sequence[MuscleOut] = (), *, name: str = "model",
    masses: Mapping[str, float] | None = None, meshes: Mapping[str, Sequence[str]] | None = None,
    lengths: Mapping[str, Floats] | None = None,
) -> str:  # fmt: skip
    """Return a model as the text of an MJCF file.

    A rotation or translation equal to its coordinate becomes a joint of the coordinate's name. A polynomial
    up to the fourth power becomes a separate joint, e.g. ``JOINT_hinge2`` for a second rotation, coupled by
    an equality.

    Parameters
    ----------
    tree, muscles, name, meshes
        As of :func:`osim_of`; paths go over fixed points and round cylinders.
    masses : mapping of str to float, optional
        Masses of bodies [kg], by default 0.001 kg: MuJoCo moves no body without mass.
    lengths : mapping of str to array, optional
        Tendon lengths in the poses of a run [m], by muscle. A tendon with lengths and Hill parameters
        gets a muscle.

    Raises
    ------
    ValueError
        For features that MuJoCo lacks: splines, paths as functions, moving and conditional points.
    """
    paths: dict[str, PointPath] = {}
    for muscle in muscles:
        path = muscle.path
        if not isinstance(path, PointPath):
            raise InputError("", f"muscle {muscle.name!r} is a function of coordinates: MuJoCo needs points")
        if any(point.moves or point.only_in is not None for point in path.points):
            raise InputError("", f"muscle {muscle.name!r}: MuJoCo has no moving or conditional points")
        paths[muscle.name] = path
    ranges = {each.name: each.range for each in tree.coordinates if each.range}
    joints = _Joints(set(), [], {name: span for name, span in ranges.items() if span[0] < span[1]})
    sites = [site for muscle, path in paths.items() for site in _sites(muscle, path)]

    def inside(name: str) -> Iterator[Element]:
        """Yield a body's meshes, sites and child bodies."""
        for mesh in (meshes or {}).get(name, ()):
            yield made("geom", type="mesh", mesh=mesh, **_PASSIVE)
        yield from (element for body, element in sites if body == name)
        for joint in tree.joints:
            if joint.parent == name:
                yield _body(joint, inside(joint.child), joints, (masses or {}).get(joint.child, LEAST_MASS))

    world = list(inside(tree.root))
    for coupling in tree.couplings:
        joints.couple(coupling.dependent, coupling.independent, coupling.function)
    for missing in sorted({coordinate.name for coordinate in tree.coordinates} - joints.names):
        raise InputError("", f"no joint equals the coordinate {missing!r}, as MuJoCo requires")
    files = [mesh for names in (meshes or {}).values() for mesh in names]
    actuated = [muscle for muscle in muscles if lengths and set(NEEDED) <= set(muscle.parameters)]
    parts = {
        "asset": [made("mesh", name=mesh, file=f"{mesh}.stl") for mesh in files],
        "worldbody": world,
        "tendon": [made("spatial", *_tendon(*item), name=item[0]) for item in paths.items()],
        "actuator": [_actuator(muscle, (lengths or {})[muscle.name]) for muscle in actuated],
        "equality": joints.equalities,
    }
    compiler = made("compiler", angle="radian", autolimits="true", meshdir=FOLDER)
    inside_of = [made(tag, *elements) for tag, elements in parts.items()]
    return xml_text(made("mujoco", compiler, *inside_of, model=name))


class _Joints(NamedTuple):
    """Names of the joints written so far, equalities between joints, and ranges of coordinates."""

    names: set[str]
    equalities: list[Element]
    ranges: Mapping[str, tuple[float, float]]

    def couple(self, dependent: str, independent: str, function: CoordinateFunction) -> None:
        high_first = _polynomial(function, dependent)
        numbers = _numbers(np.pad(high_first[::-1], (0, _HIGHEST + 1 - len(high_first))))
        self.equalities.append(made("joint", joint1=dependent, joint2=independent, polycoef=numbers))


def _body(joint: Joint, inner: Iterable[Element], joints: _Joints, mass: float) -> Element:
    """Return a child's body inside a moving frame at the joint."""
    back = inverses(joint.child_frame[None])[0]
    parts = []
    shift = np.zeros(3)
    for kind, axes in (("slide", joint.translations), ("hinge", joint.rotations)):
        for number, axis in enumerate(axes, start=1):
            if axis.coordinate is not None:
                parts.append(_axis(joint, f"{kind}{number}", axis, axis.coordinate, joints))
            elif kind == "slide":
                shift = shift + axis.at({}, 1)[0] * axis.axis
            elif axis.at({}, 1)[0]:
                raise InputError("", f"joint {joint.name!r}: constant rotations are not supported for MuJoCo")
    position = joint.parent_frame[:3, 3] + joint.parent_frame[:3, :3] @ shift
    turn, own = (_quaternion(frame[:3, :3]) for frame in (joint.parent_frame, back))
    child = made("body", _inertial(mass), *inner, name=joint.child, pos=_numbers(back[:3, 3]), quat=own)
    name = f"{joint.name}_frame"
    return made("body", *parts, _inertial(LEAST_MASS), child, name=name, pos=_numbers(position), quat=turn)


def _axis(joint: Joint, label: str, axis: JointAxis, coordinate: str, joints: _Joints) -> Element:
    coefficients = _polynomial(axis.function, f"{joint.name}, {label}")
    itself = np.array_equal(coefficients, [1.0, 0.0]) and coordinate not in joints.names
    name = coordinate if itself else f"{joint.name}_{label}"
    joints.names.add(name)
    if not itself:
        joints.couple(name, coordinate, axis.function)
    limits = {"range": _numbers(joints.ranges[name])} if name in joints.ranges else {}
    return made("joint", name=name, type=label[:-1], axis=_numbers(axis.axis), **limits)


def _polynomial(function: CoordinateFunction, what: str) -> Floats:
    if isinstance(function, Polynomial) and len(function.coefficients) <= _HIGHEST + 1:
        return function.coefficients
    kind = type(function).__name__
    raise InputError("", f"{what}: MuJoCo supports polynomials up to power {_HIGHEST}, not {kind}")


def _sites(muscle: str, path: PointPath) -> Iterator[tuple[str, Element]]:
    """Yield the body and the element of each point and cylinder."""
    for i, point in enumerate(path.points, start=1):
        yield point.body, made("site", name=f"{muscle}-P{i}", pos=_numbers(point.position))
    for i, cylinder in enumerate(path.cylinders, start=1):
        turn, size = _quaternion(cylinder.frame), _numbers([cylinder.radius, CYLINDER / 2.0])
        where = {"pos": _numbers(cylinder.centre), "quat": turn, "size": size, "group": "3"}
        yield cylinder.body, made("geom", name=f"{muscle}-C{i}", type="cylinder", **where, **_PASSIVE)


def _tendon(muscle: str, path: PointPath) -> Iterator[Element]:
    """Yield a path's points and cylinders in path order."""
    cylinders = {cylinder.after: i for i, cylinder in enumerate(path.cylinders, start=1)}
    for i in range(len(path.points)):
        yield made("site", site=f"{muscle}-P{i + 1}")
        if i in cylinders:
            yield made("geom", geom=f"{muscle}-C{cylinders[i]}")


def _actuator(muscle: MuscleOut, lengths: Floats) -> Element:
    """Return a MuJoCo muscle with lengths in optimal fibre lengths."""
    force, fibre, tendon = (muscle.parameters[name] for name in NEEDED)
    cosine = float(np.cos(muscle.parameters.get("pennation_angle_at_optimal", 0.0)))
    ends = np.array([lengths.min(), lengths.max()])
    ranges = {"lengthrange": _numbers(ends), "range": _numbers((ends - tendon) / (fibre * cosine))}
    names = {"name": f"{muscle.name}_muscle", "tendon": muscle.name}
    return made("muscle", **names, force=_numbers(force * cosine), **ranges)


def _inertial(mass: float) -> Element:
    return made("inertial", pos="0 0 0", mass=_numbers(mass), diaginertia=_numbers([mass * GYRATION**2] * 3))


def _quaternion(turn: Floats) -> str:
    return _numbers(np.roll(Rotation.from_matrix(turn.copy()).as_quat(), 1))


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
    check_is_file(path)
    mujoco = optional_package("mujoco", "a model of MuJoCo", file=path)
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


def _equalities(mujoco: Any, model: Any) -> Iterator[tuple[int, int, Floats]]:
    """Yield the joints of each active equality, the second -1 if it is of one joint, and the polynomial."""
    for number in np.flatnonzero(model.eq_active0):
        if model.eq_type[number] == mujoco.mjtEq.mjEQ_JOINT:
            yield int(model.eq_obj1id[number]), int(model.eq_obj2id[number]), model.eq_data[number, :5]


def _coordinates(mujoco: Any, model: Any) -> Iterator[JointCoordinate]:
    hinge, slide = _axes_of(mujoco)
    held = {first: float(powers[0]) for first, second, powers in _equalities(mujoco, model) if second < 0}
    for number in range(model.njnt):
        joint, limits = model.joint(number), None
        if joint.type[0] in (hinge, slide) and joint.limited[0]:
            limits = float(joint.range[0]), float(joint.range[1])
        rest = float(joint.qpos0[0]) + held.get(number, 0.0) if joint.type[0] in (hinge, slide) else 0.0
        own = _name("joint", joint), "m" if joint.type[0] == slide else "rad", rest, limits
        yield JointCoordinate(*own, locked=number in held)


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
    for *ids, powers in _equalities(mujoco, model):
        if min(ids) >= 0:
            first, second = map(model.joint, ids)
            moved = Powers(powers)(Powers([-second.qpos0[0], 1.0])) + first.qpos0[0]
            yield Coupling(_name("joint", first), _name("joint", second), Polynomial(moved.coef[::-1]))


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
    if not (model.actuator_gaintype[number] == mujoco.mjtGain.mjGAIN_MUSCLE and most > least):
        return {}
    optimal = float((longest - shortest) / (most - least))
    lengths = {"optimal_fiber_length": optimal, "tendon_slack_length": float(shortest - least * optimal)}
    return lengths | ({"max_isometric_force": float(force)} if force > 0.0 else {})
