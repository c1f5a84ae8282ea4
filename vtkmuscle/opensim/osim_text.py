"""Models of OpenSim, made of a kinematic tree and muscles' paths, and muscles put into a model of a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.io.xml_elements import decoded, made, xml_text
from vtkmuscle.joints.functions import Polynomial, function_element
from vtkmuscle.joints.osim import AXES
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim.model import checked_model
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath

#: The version of the format that is written: that of OpenSim 4.6.
VERSION = 40600
#: Kinds of muscles that are written.
MUSCLES = ("Millard2012EquilibriumMuscle", "Thelen2003Muscle", "DeGrooteFregly2016Muscle", "PathActuator")
#: Radius of gyration of a body whose mass is given [m], a quarter of a bone's length.
GYRATION = 0.1
#: Length of a cylinder [m], which to a path has no ends.
CYLINDER = 0.5
#: Opacity of a muscle that does not move with the model.
OPACITY = 0.3
#: Paths in a model's tree of components, by kind ("body" or "coordinate") and name.
_Paths = dict[tuple[str, str], str]


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
        If a name cannot be part of a path in OpenSim, or a muscle names a body or coordinate that the tree
        does not have.
    """
    for what, names in (
        ("body", tree.bodies),
        ("joint", [joint.name for joint in tree.joints]),
        ("coordinate", [one.name for one in tree.coordinates]),
    ):
        for one in names:
            _check_name(what, one)
    owners: dict[str, str] = {}
    for joint in tree.joints:  # a coordinate is of the first joint that moves by it
        for axis in joint.axes:
            if axis.coordinate is not None:
                owners.setdefault(axis.coordinate, joint.name)
    paths = _component_paths(tree, owners)
    for body in masses or {}:
        _path("body", body, paths)  # raises where there is none
    bodies = {body: made("Body", name=body) for body in tree.bodies}
    bodies[tree.root] = made("Ground", name="ground")
    for body, inside in bodies.items():
        if body != tree.root:
            mass = (masses or {}).get(body, 0.0)
            inertia = [*[mass * GYRATION**2] * 3, 0.0, 0.0, 0.0]
            inside.extend([made("mass", mass), made("mass_center", [0, 0, 0]), made("inertia", inertia)])
        if shown := (meshes or {}).get(body):
            inside.append(made("attached_geometry", *map(_mesh, shown)))
    for on, cylinder in _cylinders(muscles):
        _objects_in(bodies[on]).append(cylinder)
    ground, *others = bodies.values()
    model = made(
        "Model",
        ground,
        made("gravity", [0.0, -9.80665, 0.0]),
        made("length_units", "meters"),
        made("force_units", "N"),
        _set("BodySet", others, name="bodyset"),
        _set("JointSet", [_joint(joint, tree, owners, paths) for joint in tree.joints], name="jointset"),
        _set("ConstraintSet", map(_coupler, tree.couplings), name="constraintset"),
        _set("ForceSet", [_muscle(one, paths) for one in muscles], name="forceset"),
        name=name,
    )
    return xml_text(made("OpenSimDocument", model, Version=str(VERSION)))


def enriched(model: Path, muscles: Sequence[MuscleOut], *, replace: Sequence[str] = ()) -> str:
    """Return the text of a model of OpenSim with further muscles, all else as it is in the file.

    Parameters
    ----------
    model : Path
        An .osim file of version 4.
    muscles : sequence of MuscleOut
        On its bodies, by its coordinates.
    replace : sequence of str, optional
        Muscles of the model that are taken out.

    Raises
    ------
    ValueError
        If the file is no such model, keeps a muscle of the same name, or lacks one that is to be taken out.
    """
    read = checked_model(model)
    for one in replace:
        read.muscle(one)  # raises where there is none
    names = {muscle.name for muscle in muscles}
    for one in sorted(names & (set(read.muscles) - set(replace))):
        raise InputError(
            model, f"the model has a muscle {one!r} already", "call the new one otherwise, or replace"
        )
    paths = _component_paths(read.tree, read.joint_of)
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    text = decoded(model)  # without its declaration, whose encoding may be wrong
    root = ElementTree.fromstring(text.partition("?>")[2] if text.startswith("<?xml") else text, parser)
    forces = root.find("Model/ForceSet/objects")
    if forces is None:
        raise InputError(model, "the model has no ForceSet", "save it again with OpenSim 4")
    for force in [force for force in forces if force.get("name") in replace]:
        forces.remove(force)
    forces.extend([_muscle(one, paths) for one in muscles])  # an iterator's errors would become TypeErrors
    for on, cylinder in _cylinders(muscles):
        body = root.find(
            "Model/Ground" if on == read.tree.root else f"Model/BodySet/objects/Body[@name='{on}']"
        )
        assert body is not None  # read_osim has found it
        _objects_in(body).append(cylinder)
    return xml_text(root, indented=False)


def _component_paths(tree: KinematicTree, joint_of: Mapping[str, str]) -> _Paths:
    """Return paths in a model, whose ground is the root, for the joint that each coordinate belongs to."""
    bodies = {("body", body): f"/bodyset/{body}" for body in tree.bodies} | {("body", tree.root): "/ground"}
    return bodies | {("coordinate", name): f"/jointset/{joint}/{name}" for name, joint in joint_of.items()}


def _path(what: str, name: str, paths: _Paths) -> str:
    if (what, name) not in paths:
        known = ", ".join(other for kind, other in paths if kind == what)
        problem = f"the model has no {what} {name!r}; it has {known}"
        raise InputError("", problem, "give the scene's the names of the model's, or leave --into out")
    return paths[what, name]


def _set(tag: str, objects: Iterable[Element], **attributes: str) -> Element:
    return made(tag, made("objects", *objects), made("groups"), **attributes)


def _objects_in(body: Element) -> Element:
    """Return the element for the cylinders of a body; made where it has none yet."""
    holder = body
    for tag in ("WrapObjectSet", "objects"):
        inner = holder.find(tag)
        holder = SubElement(holder, tag) if inner is None else inner
    return holder


def _mesh(name: str) -> Element:
    opacity = made("Appearance", made("opacity", OPACITY if name.endswith("_at_rest") else 1.0))
    return made("Mesh", made("mesh_file", f"{name}.stl"), opacity, name=f"{name}_mesh")


def _cylinders(muscles: Sequence[MuscleOut]) -> Iterator[tuple[str, Element]]:
    """Give the bodies and the elements of the cylinders that paths wind round."""
    for muscle in muscles:
        for number, one in enumerate(getattr(muscle.path, "cylinders", ()), start=1):
            parts = (
                made("active", "true"),
                made("xyz_body_rotation", _turn(one.frame)),
                made("translation", one.centre),
                made("quadrant", "all"),
                made("radius", one.radius),
                made("length", CYLINDER),
            )
            yield one.body, made("WrapCylinder", *parts, name=f"{muscle.name}-C{number}")


def _coupler(one: Coupling) -> Element:
    return made(
        "CoordinateCouplerConstraint",
        made("isEnforced", "true"),
        made("coupled_coordinates_function", function_element(one.function)),
        made("independent_coordinate_names", one.independent),
        made("dependent_coordinate_name", one.dependent),
        made("scale_factor", 1.0),
        name=f"{one.dependent}_follows",
    )


def _joint(joint: Joint, tree: KinematicTree, owners: Mapping[str, str], paths: _Paths) -> Element:
    foreign = sorted(
        axis.coordinate for axis in joint.axes if axis.coordinate and owners[axis.coordinate] != joint.name
    )
    if foreign:
        raise InputError(
            "",
            f"joint {joint.name!r} moves by {foreign[0]!r}, a coordinate of another joint, which OpenSim "
            "does not take; give it a coordinate of its own that follows the other",
        )
    ends = (("parent", joint.parent, joint.parent_frame), ("child", joint.child, joint.child_frame))
    frames = [
        made(
            "PhysicalOffsetFrame",
            made("socket_parent", _path("body", body, paths)),
            made("translation", frame[:3, 3]),
            made("orientation", _turn(frame)),
            name=f"{joint.name}_in_{side}",
        )
        for side, body, frame in ends
    ]
    own = [_coordinate(one) for one in tree.coordinates if owners.get(one.name) == joint.name]
    return made(
        "CustomJoint" if joint.axes else "WeldJoint",
        *(made(f"socket_{side}_frame", f"{joint.name}_in_{side}") for side, *_ in ends),
        made("coordinates", *own),
        made("frames", *frames),
        *([made("SpatialTransform", *_transform_axes(joint))] if joint.axes else []),
        name=joint.name,
    )


def _coordinate(one: JointCoordinate) -> Element:
    limits = [] if one.range is None else [made("range", one.range)]
    return made("Coordinate", made("default_value", one.rest), *limits, name=one.name)


def _transform_axes(joint: Joint) -> Iterator[Element]:
    """Give the elements of three turns and three slides, of which those that the joint lacks stay at 0."""
    still = Polynomial(np.array([0.0]))
    axes: list[JointAxis] = []
    for given in (joint.rotations, joint.translations):
        axes += given
        axes += [JointAxis(axis, still) for axis in _further([one.axis for one in given])]
    for name, axis in zip(AXES, axes, strict=True):
        function = function_element(axis.function, name="function")
        coordinates = made("coordinates", axis.coordinate or "")
        yield made("TransformAxis", coordinates, made("axis", axis.axis), function, name=name)


def _further(given: list[Floats]) -> list[Floats]:
    """Return axes that complete the given ones to three, no two of them parallel, as OpenSim wants."""
    found: list[Floats] = []
    while len(given) + len(found) < 3:
        known = np.array([*given, *found]).reshape(-1, 3)
        axis = max(np.eye(3), key=lambda one: -np.abs(known @ one).max(initial=0.0))
        found.append(np.array(axis))
    return found


def _turn(frame: Floats) -> Floats:
    angles: Floats = Rotation.from_matrix(frame[:3, :3].copy()).as_euler("XYZ")
    return angles


def _muscle(muscle: MuscleOut, paths: _Paths) -> Element:
    path = muscle.path
    if isinstance(path, FunctionPath):
        written = _function_path(path, paths)
    else:
        written = _point_path(muscle.name, path, paths)
    given = (made(name, value) for name, value in muscle.parameters.items())
    return made(muscle.kind, written, *given, name=muscle.name)


def _function_path(path: FunctionPath, paths: _Paths) -> Element:
    polynomial = made(
        "MultivariatePolynomialFunction",
        made("coefficients", path.coefficients),
        made("dimension", str(len(path.names))),
        made("order", str(path.order)),
    )
    names = made("coordinate_paths", " ".join(_path("coordinate", name, paths) for name in path.names))
    return made("FunctionBasedPath", names, made("length_function", polynomial), name="path")


def _point_path(muscle: str, path: PointPath, paths: _Paths) -> Element:
    points = [_point(f"{muscle}-P{i}", one, paths) for i, one in enumerate(path.points, start=1)]
    wraps = [
        made(
            "PathWrap",
            made("wrap_object", f"{muscle}-C{i}"),
            made("method", "hybrid"),
            made("range", f"{one.after + 1} {one.after + 2}"),
            name=f"{muscle}-W{i}",
        )
        for i, one in enumerate(path.cylinders, start=1)
    ]
    return made("GeometryPath", _set("PathPointSet", points), _set("PathWrapSet", wraps), name="path")


def _point(name: str, point: PathPoint, paths: _Paths) -> Element:
    parts = [made("socket_parent_frame", _path("body", point.body, paths))]
    place = np.asarray(point.place, dtype=np.float64)
    if point.moves:
        named = next(one for one in point.coordinates if one is not None)
        for axis, function, own, at in zip("xyz", point.functions, point.coordinates, place, strict=True):
            parts.append(made(f"socket_{axis}_coordinate", _path("coordinate", own or named, paths)))
            parts.append(made(f"{axis}_location", function_element(function or Polynomial(at[None]))))
        return made("MovingPathPoint", *parts, name=name)
    parts.append(made("location", place))
    if point.only_in is None:
        return made("PathPoint", *parts, name=name)
    coordinate, *limits = point.only_in
    parts += [made("socket_coordinate", _path("coordinate", coordinate, paths)), made("range", limits)]
    return made("ConditionalPathPoint", *parts, name=name)


def _check_name(what: str, name: str) -> None:
    if not name or set(name) & set(" \t\n/\\*+<>&\"'"):
        raise InputError(
            "", f"a {what} of OpenSim cannot be called {name!r}: use letters, digits, _ - and . only"
        )
