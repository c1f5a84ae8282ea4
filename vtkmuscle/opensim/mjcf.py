"""Models of MuJoCo (MJCF): a kinematic tree with spatial tendons over sites."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.frames import inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.functions import Constant, CoordinateFunction, Multiplier, Polynomial
from vtkmuscle.opensim.hill import NEEDED
from vtkmuscle.opensim.meshes import FOLDER
from vtkmuscle.opensim.muscle_paths import PointPath
from vtkmuscle.opensim.osim_text import CYLINDER, GYRATION, MuscleOut, along
from vtkmuscle.opensim.tree import Joint, JointAxis, KinematicTree

#: Highest power of a coupling in MuJoCo.
_HIGHEST = 4
#: Mass of what has none [kg].
LEAST_MASS = 0.001
#: What is seen, and neither touches nor weighs anything.
_PASSIVE = 'contype="0" conaffinity="0" mass="0" rgba="0.8 0.75 0.7 0.5"'


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
        Those that a muscle's tendon has [m], by its name: with them, and Hill's parameters, it gets a muscle.

    Returns
    -------
    str
        The text of an MJCF file.

    Raises
    ------
    ValueError
        If there is what MuJoCo has not: splines, paths that are functions, points that move or come and go.
    """
    joints = {joint.child: joint for joint in tree.joints}
    model = _Model({one.name for one in tree.coordinates})
    for muscle in muscles:
        _check(muscle)
    sites = _sites(muscles)
    shown = meshes or {}

    def body(name: str) -> str:
        inner = "".join(f'<geom type="mesh" mesh="{mesh}" {_PASSIVE}/>\n' for mesh in shown.get(name, ()))
        inner += "".join(text for on, text in sites if on == name)
        inner += "".join(body(child) for child, joint in joints.items() if joint.parent == name)
        joint = joints.get(name)
        if joint is None:
            return inner
        return _body(joint, inner, model, (masses or {}).get(name, LEAST_MASS))

    world = body(tree.root)
    tendons = "".join(
        f'<spatial name="{muscle.name}">\n' + "".join(_way(muscle)) + "</spatial>\n" for muscle in muscles
    )
    actuators = "".join(
        _actuator(muscle, lengths[muscle.name])
        for muscle in muscles
        if lengths is not None and set(NEEDED) <= set(muscle.parameters)
    )
    assets = "".join(
        f'<mesh name="{mesh}" file="{mesh}.stl"/>\n' for names in shown.values() for mesh in names
    )
    for one in tree.couplings:
        model.couple(one.dependent, one.independent, one.function)
    missing = sorted(model.coordinates - model.joints)
    if missing:
        raise InputError("", f"no joint is the coordinate {missing[0]!r} itself, as MuJoCo needs it")
    return f"""<mujoco model={quoteattr(name)}>
<compiler angle="radian" autolimits="true" meshdir="{FOLDER}"/>
<asset>
{assets}</asset>
<worldbody>
{world}</worldbody>
<tendon>
{tendons}</tendon>
<actuator>
{actuators}</actuator>
<equality>
{"".join(model.equalities)}</equality>
</mujoco>
"""


class _Model:
    """Joints and equalities that have been written."""

    def __init__(self, coordinates: set[str]) -> None:
        self.coordinates = coordinates
        self.joints: set[str] = set()
        self.equalities: list[str] = []

    def couple(self, dependent: str, independent: str, function: CoordinateFunction) -> None:
        coefficients = _polynomial(function, dependent)
        low_first = np.zeros(_HIGHEST + 1)
        low_first[: len(coefficients)] = coefficients[::-1]
        self.equalities.append(
            f'<joint joint1="{dependent}" joint2="{independent}" polycoef="{_numbers(low_first)}"/>\n'
        )


def _body(joint: Joint, inner: str, model: _Model, mass: float) -> str:
    """Return a child's body: a frame at the joint, which moves, with the child's own frame in it."""
    turn = Rotation.from_matrix(joint.parent_frame[:3, :3].copy()).as_quat()
    back = inverses(joint.child_frame[None])[0]
    own = Rotation.from_matrix(back[:3, :3].copy()).as_quat()
    parts = []
    shift = np.zeros(3)
    for kind, axes in (("slide", joint.translations), ("hinge", joint.rotations)):
        for number, axis in enumerate(axes, start=1):
            if axis.coordinate is None:
                far = float(axis.at({}, 1)[0])
                if kind == "slide":
                    shift = shift + far * axis.axis
                elif far:
                    raise InputError(
                        "", f"joint {joint.name!r} has a constant turn, which is not written for MuJoCo"
                    )
                continue
            parts.append(_axis(joint, kind, number, axis, model))
    place = joint.parent_frame[:3, 3] + joint.parent_frame[:3, :3] @ shift
    return (
        f'<body name="{joint.name}_frame" pos="{_numbers(place)}" quat="{_quaternion(turn)}">\n'
        f"{''.join(parts)}"
        f"{_inertial(LEAST_MASS)}"
        f'<body name="{joint.child}" pos="{_numbers(back[:3, 3])}" quat="{_quaternion(own)}">\n'
        f"{_inertial(mass)}{inner}</body>\n</body>\n"
    )


def _axis(joint: Joint, kind: str, number: int, axis: JointAxis, model: _Model) -> str:
    assert axis.coordinate is not None
    coefficients = _polynomial(axis.function, f"{joint.name}, {kind} {number}")
    itself = np.array_equal(coefficients, [1.0, 0.0]) and axis.coordinate not in model.joints
    name = axis.coordinate if itself else f"{joint.name}_{kind}{number}"
    model.joints.add(name)
    if not itself:
        model.couple(name, axis.coordinate, axis.function)
    return f'<joint name="{name}" type="{kind}" axis="{_numbers(axis.axis)}"/>\n'


def _polynomial(function: CoordinateFunction, what: str) -> Floats:
    factor = 1.0
    while isinstance(function, Multiplier):
        factor, function = factor * function.factor, function.function
    if isinstance(function, Constant):
        return np.array([factor * function.value])
    if isinstance(function, Polynomial) and len(function.coefficients) <= _HIGHEST + 1:
        return factor * function.coefficients
    kind = type(function).__name__
    raise InputError("", f"{what}: MuJoCo has polynomials up to power {_HIGHEST} only, not {kind}")


def _check(muscle: MuscleOut) -> None:
    path = muscle.path
    if not isinstance(path, PointPath):
        raise InputError(
            "", f"muscle {muscle.name!r} is a function of coordinates, which MuJoCo has not; give points"
        )
    for point in path.points:
        if point.moves or point.only_in is not None:
            raise InputError("", f"muscle {muscle.name!r}: MuJoCo has no points that move, or come and go")


def _sites(muscles: Sequence[MuscleOut]) -> list[tuple[str, str]]:
    """Return what paths go over and round: bodies, and elements on them."""
    found = []
    for muscle in muscles:
        assert isinstance(muscle.path, PointPath)
        for i, point in enumerate(muscle.path.points, start=1):
            place = _numbers(np.asarray(point.place, dtype=np.float64))
            found.append((point.body, f'<site name="{muscle.name}-P{i}" pos="{place}"/>\n'))
        for i, one in enumerate(muscle.path.cylinders, start=1):
            turn = _quaternion(Rotation.from_matrix(along(one.axis)).as_quat())
            text = (
                f'<geom name="{muscle.name}-C{i}" type="cylinder" pos="{_numbers(one.centre)}" quat="{turn}" '
                f'size="{float(one.radius)!r} {CYLINDER / 2.0!r}" group="3" {_PASSIVE}/>\n'
            )
            found.append((one.body, text))
    return found


def _way(muscle: MuscleOut) -> Iterator[str]:
    assert isinstance(muscle.path, PointPath)
    round_it = {one.after: i for i, one in enumerate(muscle.path.cylinders, start=1)}
    for i in range(len(muscle.path.points)):
        yield f'<site site="{muscle.name}-P{i + 1}"/>\n'
        if i in round_it:
            yield f'<geom geom="{muscle.name}-C{round_it[i]}"/>\n'


def _actuator(muscle: MuscleOut, lengths: Floats) -> str:
    """Return a muscle of MuJoCo: its lengths are in parts of the optimal one, along the tendon."""
    force, fibre, tendon = (muscle.parameters[name] for name in NEEDED)
    cosine = float(np.cos(muscle.parameters.get("pennation_angle_at_optimal", 0.0)))
    ends = np.array([lengths.min(), lengths.max()])
    return (
        f'<muscle name="{muscle.name}_muscle" tendon="{muscle.name}" force="{force * cosine!r}" '
        f'lengthrange="{_numbers(ends)}" range="{_numbers((ends - tendon) / (fibre * cosine))}"/>\n'
    )


def _inertial(mass: float) -> str:
    inertia = mass * GYRATION**2
    return f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>\n'


def _quaternion(xyzw: Floats) -> str:
    return _numbers(np.roll(xyzw, 1))


def _numbers(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)
