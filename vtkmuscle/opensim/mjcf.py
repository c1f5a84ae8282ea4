"""Text of MuJoCo models (MJCF): a kinematic tree with spatial tendons."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.io.xml_elements import made, xml_text
from vtkmuscle.io.xml_elements import numbers_text as _numbers
from vtkmuscle.joints.functions import CoordinateFunction, Polynomial
from vtkmuscle.joints.tree import Joint, JointAxis, KinematicTree
from vtkmuscle.opensim.export_parts import FOLDER, NEEDED
from vtkmuscle.opensim.muscle_paths import PointPath
from vtkmuscle.opensim.osim_text import CYLINDER, GYRATION, MuscleOut

#: Highest power of a coupling in MuJoCo.
_HIGHEST = 4
#: Default mass of a body [kg]: MuJoCo refuses none, and a gram moves no other body.
LEAST_MASS = 0.001
#: Attributes of visible geometry without contact and mass.
_PASSIVE = {"contype": "0", "conaffinity": "0", "mass": "0", "rgba": "0.8 0.75 0.7 0.5"}


def mjcf_of(
    tree: KinematicTree,
    muscles: Sequence[MuscleOut] = (),
    *,
    name: str = "model",
    masses: Mapping[str, float] | None = None,
    meshes: Mapping[str, Sequence[str]] | None = None,
    lengths: Mapping[str, Floats] | None = None,
) -> str:
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
                mass = (masses or {}).get(joint.child, LEAST_MASS)
                yield _body(joint, inside(joint.child), joints, mass)

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
