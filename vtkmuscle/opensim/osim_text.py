"""Models of OpenSim, made of a kinematic tree and muscles' paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.functions import (
    Constant,
    CoordinateFunction,
    CubicSpline,
    Multiplier,
    PiecewiseLinear,
    Polynomial,
    Wave,
)
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath
from vtkmuscle.opensim.tree import Joint, JointAxis, JointCoordinate, KinematicTree

#: The version of the format that is written: that of OpenSim 4.6.
VERSION = 40600
#: Kinds of muscles that are written.
MUSCLES = ("Millard2012EquilibriumMuscle", "Thelen2003Muscle", "DeGrooteFregly2016Muscle", "PathActuator")
#: Radius of gyration of a body whose mass is stated [m], a quarter of a bone's length: no bone tells it.
GYRATION = 0.1
#: Length of a cylinder [m], which to a path has no ends.
CYLINDER = 0.5
#: How much is seen of a muscle that does not move with the model.
OPACITY = 0.3
_AXES = [kind + number for kind in ("rotation", "translation") for number in "123"]


@dataclass(frozen=True, eq=False)
class MuscleOut:
    """A muscle to be written.

    Attributes
    ----------
    name : str
        Without spaces and slashes.
    path : PointPath or FunctionPath
        In metres.
    parameters : mapping of str to float
        Properties of the muscle in OpenSim, such as ``max_isometric_force`` [N], ``optimal_fiber_length``
        [m], ``tendon_slack_length`` [m] and ``pennation_angle_at_optimal`` [rad]; the others have OpenSim's
        values.
    kind : str
        One of :data:`MUSCLES`.
    """

    name: str
    path: PointPath | FunctionPath
    parameters: Mapping[str, float] = field(default_factory=dict)
    kind: str = "Millard2012EquilibriumMuscle"

    def __post_init__(self) -> None:
        _check_name("muscle", self.name)
        if self.kind not in MUSCLES:
            raise InputError("", f"there is no kind of muscle {self.kind!r}; allowed: {', '.join(MUSCLES)}")
        if isinstance(self.path, PointPath) and self.path.wraps:
            raise InputError("", f"muscle {self.name!r} winds round surfaces, which are not written")


def osim_of(
    tree: KinematicTree,
    muscles: Sequence[MuscleOut] = (),
    *,
    name: str = "model",
    masses: Mapping[str, float] | None = None,
    meshes: Mapping[str, Sequence[str]] | None = None,
) -> str:
    """Return a model of OpenSim as text.

    Parameters
    ----------
    tree : KinematicTree
        In metres. Its root is the ground, whatever its name.
    muscles : sequence of MuscleOut, optional
        On its bodies.
    name : str, optional
        Of the model.
    masses : mapping of str to float, optional
        Of the bodies [kg]; others have none. Moments of inertia are those of a radius of 0.1 m about each
        axis. Lengths, moment arms and inverse kinematics do not depend on them, dynamics does.
    meshes : mapping of str to sequence of str, optional
        Of the bodies: names of .stl files, without suffix, in the folder ``Geometry`` beside the model.

    Returns
    -------
    str
        The text of an .osim file.

    Raises
    ------
    ValueError
        If a name cannot be part of a path in OpenSim, or a muscle names what the tree has not.
    """
    for what, names in (
        ("body", tree.bodies),
        ("joint", [joint.name for joint in tree.joints]),
        ("coordinate", [one.name for one in tree.coordinates]),
    ):
        for one in names:
            _check_name(what, one)
    paths = ComponentPaths(
        {body: "/ground" if body == tree.root else f"/bodyset/{body}" for body in tree.bodies},
        _coordinate_paths(tree),
    )
    for body in masses or {}:
        paths.body(body)  # raises where there is none
    inside = _insides(muscles, meshes or {})
    bodies = "".join(
        f'<Body name="{body}">{_mass((masses or {}).get(body, 0.0))}{inside.get(body, "")}</Body>\n'
        for body in tree.bodies[1:]
    )
    joints = "".join(_joint(joint, tree, paths) for joint in tree.joints)
    couplings = "".join(
        f'<CoordinateCouplerConstraint name="{one.dependent}_follows">\n<isEnforced>true</isEnforced>\n'
        f"<coupled_coordinates_function>{_function(one.function)}</coupled_coordinates_function>\n"
        f"<independent_coordinate_names>{one.independent}</independent_coordinate_names>\n"
        f"<dependent_coordinate_name>{one.dependent}</dependent_coordinate_name>\n"
        f"<scale_factor>1</scale_factor></CoordinateCouplerConstraint>\n"
        for one in tree.couplings
    )
    forces = "".join(muscle_element(one, paths) for one in muscles)
    return f"""<?xml version="1.0" encoding="UTF-8" ?>
<OpenSimDocument Version="{VERSION}">
<Model name={quoteattr(name)}>
<Ground name="ground">{inside.get(tree.root, "")}</Ground>
<gravity>0 -9.80665 0</gravity>
<length_units>meters</length_units>
<force_units>N</force_units>
<BodySet name="bodyset"><objects>
{bodies}</objects><groups/></BodySet>
<JointSet name="jointset"><objects>
{joints}</objects><groups/></JointSet>
<ConstraintSet name="constraintset"><objects>
{couplings}</objects><groups/></ConstraintSet>
<ForceSet name="forceset"><objects>
{forces}</objects><groups/></ForceSet>
</Model>
</OpenSimDocument>
"""


@dataclass(frozen=True)
class ComponentPaths:
    """Where bodies and coordinates are in the model's tree of components."""

    bodies: Mapping[str, str]
    coordinates: Mapping[str, str]

    def body(self, name: str) -> str:
        """Return the path of a body; InputError where there is none."""
        if name not in self.bodies:
            raise InputError("", f"there is no body {name!r}; there are {', '.join(self.bodies)}")
        return self.bodies[name]

    def coordinate(self, name: str) -> str:
        """Return the path of a coordinate; InputError where there is none."""
        if name not in self.coordinates:
            raise InputError("", f"there is no coordinate {name!r}; there are {', '.join(self.coordinates)}")
        return self.coordinates[name]


def _mass(mass: float) -> str:
    inertia = f"{mass * GYRATION**2!r} " * 3 + "0 0 0"
    return f"<mass>{mass!r}</mass><mass_center>0 0 0</mass_center><inertia>{inertia}</inertia>"


def _insides(muscles: Sequence[MuscleOut], meshes: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return what is in the elements of bodies: meshes, and cylinders that paths wind round."""
    found: dict[str, str] = {}
    for body, names in meshes.items():
        found[body] = "<attached_geometry>\n" + "".join(map(_mesh, names)) + "</attached_geometry>\n"
    for body, cylinders in cylinder_elements(muscles).items():
        inside = f'<WrapObjectSet name="wrapobjectset"><objects>\n{cylinders}</objects></WrapObjectSet>\n'
        found[body] = found.get(body, "") + inside
    return found


def _mesh(name: str) -> str:
    opacity = OPACITY if name.endswith("_at_rest") else 1.0
    return (
        f'<Mesh name="{name}_mesh"><mesh_file>{name}.stl</mesh_file>'
        f"<Appearance><opacity>{opacity}</opacity></Appearance></Mesh>\n"
    )


def cylinder_elements(muscles: Sequence[MuscleOut]) -> dict[str, str]:
    """Return the elements of the cylinders that paths wind round, by body."""
    found: dict[str, str] = {}
    for muscle in muscles:
        for number, one in enumerate(getattr(muscle.path, "cylinders", ()), start=1):
            text = (
                f'<WrapCylinder name="{muscle.name}-C{number}"><active>true</active>'
                f"<xyz_body_rotation>{_numbers(_turn(along(one.axis)))}</xyz_body_rotation>"
                f"<translation>{_numbers(one.centre)}</translation><quadrant>all</quadrant>"
                f"<radius>{float(one.radius)!r}</radius><length>{CYLINDER!r}</length></WrapCylinder>\n"
            )
            found[one.body] = found.get(one.body, "") + text
    return found


def along(axis: Floats) -> Floats:
    """Return a frame (3, 3) whose z axis is a direction."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _owners(tree: KinematicTree) -> dict[str, str]:
    """Return the joint that each coordinate belongs to: the first that turns or slides by it."""
    owners: dict[str, str] = {}
    for joint in tree.joints:
        for axis in joint.axes:
            if axis.coordinate is not None:
                owners.setdefault(axis.coordinate, joint.name)
    return owners


def _coordinate_paths(tree: KinematicTree) -> dict[str, str]:
    return {name: f"/jointset/{joint}/{name}" for name, joint in _owners(tree).items()}


def _joint(joint: Joint, tree: KinematicTree, paths: ComponentPaths) -> str:
    owners = _owners(tree)
    mine = [one for one in tree.coordinates if owners.get(one.name) == joint.name]
    used = {axis.coordinate for axis in joint.axes if axis.coordinate is not None}
    foreign = sorted(used - {one.name for one in mine})
    if foreign:
        raise InputError(
            "",
            f"joint {joint.name!r} moves by {foreign[0]!r}, a coordinate of another joint, which OpenSim "
            "does not take; give it a coordinate of its own that follows the other",
        )
    stiff = not used and not joint.axes
    kind = "WeldJoint" if stiff else "CustomJoint"
    frames = "".join(
        f'<PhysicalOffsetFrame name="{joint.name}_{side}"><socket_parent>{paths.body(body)}</socket_parent>'
        f"<translation>{_numbers(frame[:3, 3])}</translation>"
        f"<orientation>{_numbers(_turn(frame))}</orientation></PhysicalOffsetFrame>\n"
        for side, body, frame in (
            ("in_parent", joint.parent, joint.parent_frame),
            ("in_child", joint.child, joint.child_frame),
        )
    )
    coordinates = "".join(_coordinate(one) for one in mine)
    transform = "" if stiff else f"<SpatialTransform>\n{_axes(joint)}</SpatialTransform>\n"
    return f"""<{kind} name="{joint.name}">
<socket_parent_frame>{joint.name}_in_parent</socket_parent_frame>
<socket_child_frame>{joint.name}_in_child</socket_child_frame>
<coordinates>{coordinates}</coordinates>
<frames>
{frames}</frames>
{transform}</{kind}>
"""


def _coordinate(one: JointCoordinate) -> str:
    limits = "" if one.range is None else f"<range>{_numbers(np.array(one.range))}</range>"
    return f'<Coordinate name="{one.name}"><default_value>{one.rest!r}</default_value>{limits}</Coordinate>\n'


def _axes(joint: Joint) -> str:
    axes: list[JointAxis] = []
    for given in (joint.rotations, joint.translations):
        axes += given
        axes += [JointAxis(axis, Constant(0.0)) for axis in _further([one.axis for one in given])]
    return "".join(
        f'<TransformAxis name="{name}"><coordinates>{axis.coordinate or ""}</coordinates>'
        f"<axis>{_numbers(axis.axis)}</axis>{_function(axis.function, name='function')}</TransformAxis>\n"
        for name, axis in zip(_AXES, axes, strict=True)
    )


def _further(given: list[Floats]) -> list[Floats]:
    """Return directions that make three of some, no two of them alike, as OpenSim wants them."""
    found: list[Floats] = []
    while len(given) + len(found) < 3:
        known = np.array([*given, *found]).reshape(-1, 3)
        axis = max(np.eye(3), key=lambda one: -np.abs(known @ one).max(initial=0.0))
        found.append(np.array(axis))
    return found


def _turn(frame: Floats) -> Floats:
    angles: Floats = Rotation.from_matrix(frame[:3, :3].copy()).as_euler("XYZ")
    return angles


def muscle_element(muscle: MuscleOut, paths: ComponentPaths) -> str:
    """Return the element of a muscle."""
    path = muscle.path
    written = (
        _function_path(path, paths) if isinstance(path, FunctionPath) else _point_path(muscle, path, paths)
    )
    given = "".join(f"<{name}>{float(value)!r}</{name}>\n" for name, value in muscle.parameters.items())
    return f'<{muscle.kind} name="{muscle.name}">\n{written}{given}</{muscle.kind}>\n'


def _function_path(path: FunctionPath, paths: ComponentPaths) -> str:
    names = " ".join(paths.coordinate(name) for name in path.names)
    return f"""<FunctionBasedPath name="path">
<coordinate_paths>{names}</coordinate_paths>
<length_function><MultivariatePolynomialFunction>
<coefficients>{_numbers(path.coefficients)}</coefficients>
<dimension>{len(path.names)}</dimension><order>{path.order}</order>
</MultivariatePolynomialFunction></length_function>
</FunctionBasedPath>
"""


def _point_path(muscle: MuscleOut, path: PointPath, paths: ComponentPaths) -> str:
    points = "".join(_point(f"{muscle.name}-P{i}", one, paths) for i, one in enumerate(path.points, start=1))
    wraps = "".join(
        f'<PathWrap name="{muscle.name}-W{i}"><wrap_object>{muscle.name}-C{i}</wrap_object>'
        f"<method>hybrid</method><range>{one.after + 1} {one.after + 2}</range></PathWrap>\n"
        for i, one in enumerate(path.cylinders, start=1)
    )
    return f"""<GeometryPath name="path"><PathPointSet><objects>
{points}</objects><groups/></PathPointSet>
<PathWrapSet><objects>
{wraps}</objects><groups/></PathWrapSet></GeometryPath>
"""


def _point(name: str, point: PathPoint, paths: ComponentPaths) -> str:
    body = f"<socket_parent_frame>{paths.body(point.body)}</socket_parent_frame>"
    place = np.asarray(point.place, dtype=np.float64)
    if point.moves:
        parts = []
        for axis, function, coordinate, at in zip(
            "xyz", point.functions, point.coordinates, place, strict=True
        ):
            named = coordinate or next(one for one in point.coordinates if one is not None)
            parts.append(
                f"<socket_{axis}_coordinate>{paths.coordinate(named)}</socket_{axis}_coordinate>\n"
                f"<{axis}_location>{_function(function or Constant(float(at)))}</{axis}_location>\n"
            )
        return f'<MovingPathPoint name="{name}">{body}\n{"".join(parts)}</MovingPathPoint>\n'
    location = f"<location>{_numbers(place)}</location>"
    if point.only_in is None:
        return f'<PathPoint name="{name}">{body}{location}</PathPoint>\n'
    coordinate, low, high = point.only_in
    return (
        f'<ConditionalPathPoint name="{name}">{body}{location}'
        f"<socket_coordinate>{paths.coordinate(coordinate)}</socket_coordinate>"
        f"<range>{low!r} {high!r}</range></ConditionalPathPoint>\n"
    )


def _function(function: CoordinateFunction, *, name: str = "") -> str:
    label = f' name="{name}"' if name else ""
    if isinstance(function, Multiplier):
        inner = _function(function.function)
        return (
            f"<MultiplierFunction{label}><function>{inner}</function><scale>{function.factor!r}</scale>"
            "</MultiplierFunction>"
        )
    if isinstance(function, Constant):
        return f"<Constant{label}><value>{function.value!r}</value></Constant>"
    if isinstance(function, Polynomial):
        kind = "LinearFunction" if len(function.coefficients) == 2 else "PolynomialFunction"
        return f"<{kind}{label}><coefficients>{_numbers(function.coefficients)}</coefficients></{kind}>"
    if isinstance(function, Wave):
        parts = "".join(
            f"<{one}>{getattr(function, one)!r}</{one}>" for one in ("amplitude", "omega", "phase")
        )
        return f"<Sine{label}>{parts}<offset>{function.offset!r}</offset></Sine>"
    if isinstance(function, CubicSpline | PiecewiseLinear):
        kind = "SimmSpline" if isinstance(function, CubicSpline) else "PiecewiseLinearFunction"
        return f"<{kind}{label}><x>{_numbers(function.x)}</x><y>{_numbers(function.y)}</y></{kind}>"
    raise InputError("", f"OpenSim has no function like {type(function).__name__}")


def _numbers(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)


def _check_name(what: str, name: str) -> None:
    if not name or set(name) & set(" \t\n/\\*+<>&\"'") or escape(name) != name:
        raise InputError(
            "", f"a {what} of OpenSim cannot be called {name!r}: use letters, digits, _ - and . only"
        )
