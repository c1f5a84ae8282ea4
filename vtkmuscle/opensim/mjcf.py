"""Models of MuJoCo (MJCF): a kinematic tree with spatial tendons over sites."""

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
#: Mass of a body for which none is given [kg].
LEAST_MASS = 0.001
#: Attributes of geometry that is seen, and neither touches nor weighs anything.
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
    """Return a model of MuJoCo as text.

    A turn or slide that is its coordinate itself is a joint of the coordinate's name. Where it is a
    polynomial of a coordinate up to the fourth power, it is a joint of its own, ``JOINT_hinge2`` for a
    second turn, that an equality couples.

    Parameters
    ----------
    tree : KinematicTree
        In metres.
    muscles : sequence of MuscleOut, optional
        With paths over points that are fixed to bodies, and round cylinders.
    name : str, optional
        Of the model.
    masses : mapping of str to float, optional
        Of the bodies [kg]; the others have 0.001 kg, for MuJoCo moves nothing without mass.
    meshes : mapping of str to sequence of str, optional
        Of the bodies: names of .stl files, without suffix, in the folder ``Geometry`` beside the model.
    lengths : mapping of str to array, optional
        Of tendons in the poses of a run [m], by muscle: with them, and Hill's parameters, a tendon gets a
        muscle.

    Returns
    -------
    str
        The text of an MJCF file.

    Raises
    ------
    ValueError
        For what MuJoCo does not have: splines, paths that are functions, points that move or come and go.
    """
    paths = {muscle.name: _path_of(muscle) for muscle in muscles}
    joints = _Joints(set(), [])
    sites = [site for muscle, path in paths.items() for site in _sites(muscle, path)]

    def inside(name: str) -> Iterator[Element]:
        """Give the elements in a body: its meshes and sites, and the bodies that hang on it."""
        for mesh in (meshes or {}).get(name, ()):
            yield made("geom", type="mesh", mesh=mesh, **_PASSIVE)
        yield from (element for on, element in sites if on == name)
        for joint in tree.joints:
            if joint.parent == name:
                mass = (masses or {}).get(joint.child, LEAST_MASS)
                yield _body(joint, inside(joint.child), joints, mass)

    world = list(inside(tree.root))
    for one in tree.couplings:
        joints.couple(one.dependent, one.independent, one.function)
    missing = sorted({one.name for one in tree.coordinates} - joints.names)
    if missing:
        raise InputError("", f"no joint is the coordinate {missing[0]!r} itself, as MuJoCo needs it")
    files = [mesh for of_body in (meshes or {}).values() for mesh in of_body]
    pulled = [one for one in muscles if lengths is not None and set(NEEDED) <= set(one.parameters)]
    return xml_text(
        made(
            "mujoco",
            made("compiler", angle="radian", autolimits="true", meshdir=FOLDER),
            made("asset", *(made("mesh", name=mesh, file=f"{mesh}.stl") for mesh in files)),
            made("worldbody", *world),
            made("tendon", *(made("spatial", *_tendon(*one), name=one[0]) for one in paths.items())),
            made("actuator", *(_actuator(one, (lengths or {})[one.name]) for one in pulled)),
            made("equality", *joints.equalities),
            model=name,
        )
    )


class _Joints(NamedTuple):
    """Names of the joints that have been written, and equalities between them."""

    names: set[str]
    equalities: list[Element]

    def couple(self, dependent: str, independent: str, function: CoordinateFunction) -> None:
        low_first = np.zeros(_HIGHEST + 1)
        coefficients = _polynomial(function, dependent)[::-1]
        low_first[: len(coefficients)] = coefficients
        numbers = _numbers(low_first)
        self.equalities.append(made("joint", joint1=dependent, joint2=independent, polycoef=numbers))


def _body(joint: Joint, inner: Iterable[Element], joints: _Joints, mass: float) -> Element:
    """Return a child's body: a frame at the joint, which moves, with the child's own frame in it."""
    back = inverses(joint.child_frame[None])[0]
    parts = []
    shift = np.zeros(3)
    for kind, axes in (("slide", joint.translations), ("hinge", joint.rotations)):
        for number, axis in enumerate(axes, start=1):
            if axis.coordinate is not None:
                parts.append(_axis(joint, f"{kind}{number}", axis, axis.coordinate, joints))
                continue
            far = float(axis.at({}, 1)[0])
            if kind == "slide":
                shift = shift + far * axis.axis
            elif far:
                raise InputError(
                    "", f"joint {joint.name!r} has a constant turn, which is not written for MuJoCo"
                )
    place = joint.parent_frame[:3, 3] + joint.parent_frame[:3, :3] @ shift
    turn, own = (_quaternion(frame[:3, :3]) for frame in (joint.parent_frame, back))
    child = made("body", _inertial(mass), *inner, name=joint.child, pos=_numbers(back[:3, 3]), quat=own)
    name = f"{joint.name}_frame"
    return made("body", *parts, _inertial(LEAST_MASS), child, name=name, pos=_numbers(place), quat=turn)


def _axis(joint: Joint, label: str, axis: JointAxis, coordinate: str, joints: _Joints) -> Element:
    coefficients = _polynomial(axis.function, f"{joint.name}, {label}")
    itself = np.array_equal(coefficients, [1.0, 0.0]) and coordinate not in joints.names
    name = coordinate if itself else f"{joint.name}_{label}"
    joints.names.add(name)
    if not itself:
        joints.couple(name, coordinate, axis.function)
    return made("joint", name=name, type=label[:-1], axis=_numbers(axis.axis))


def _polynomial(function: CoordinateFunction, what: str) -> Floats:
    if isinstance(function, Polynomial) and len(function.coefficients) <= _HIGHEST + 1:
        return function.coefficients
    kind = type(function).__name__
    raise InputError("", f"{what}: MuJoCo has polynomials up to power {_HIGHEST} only, not {kind}")


def _path_of(muscle: MuscleOut) -> PointPath:
    path = muscle.path
    if not isinstance(path, PointPath):
        raise InputError(
            "", f"muscle {muscle.name!r} is a function of coordinates, which MuJoCo has not; give points"
        )
    if any(point.moves or point.only_in is not None for point in path.points):
        raise InputError("", f"muscle {muscle.name!r}: MuJoCo has no points that move, or come and go")
    return path


def _sites(muscle: str, path: PointPath) -> Iterator[tuple[str, Element]]:
    """Give the points and cylinders of a path: bodies, and elements on them."""
    for i, point in enumerate(path.points, start=1):
        yield point.body, made("site", name=f"{muscle}-P{i}", pos=_numbers(point.place))
    for i, one in enumerate(path.cylinders, start=1):
        turn, size = _quaternion(one.frame), _numbers([one.radius, CYLINDER / 2.0])
        where = {"pos": _numbers(one.centre), "quat": turn, "size": size, "group": "3"}
        yield one.body, made("geom", name=f"{muscle}-C{i}", type="cylinder", **where, **_PASSIVE)


def _tendon(muscle: str, path: PointPath) -> Iterator[Element]:
    """Give the points and cylinders of a path in the order in which it goes over them."""
    round_it = {one.after: i for i, one in enumerate(path.cylinders, start=1)}
    for i in range(len(path.points)):
        yield made("site", site=f"{muscle}-P{i + 1}")
        if i in round_it:
            yield made("geom", geom=f"{muscle}-C{round_it[i]}")


def _actuator(muscle: MuscleOut, lengths: Floats) -> Element:
    """Return a muscle of MuJoCo: its lengths are in parts of the optimal one, along the tendon."""
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
