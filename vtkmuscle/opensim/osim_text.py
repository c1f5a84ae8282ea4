"""Text of new and of extended OpenSim models."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
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
from vtkmuscle.opensim.model import OsimMuscle, checked_model
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath

#: Format version of OpenSim 4.6, written in files.
VERSION = 40600
#: Muscle classes that can be written.
MUSCLES = ("Millard2012EquilibriumMuscle", "Thelen2003Muscle", "DeGrooteFregly2016Muscle", "PathActuator")
#: Radius of gyration of a body with mass [m], about a quarter of a bone's length.
GYRATION = 0.1
#: Drawn length of a cylinder [m]; paths ignore the length.
CYLINDER = 0.5
#: Component paths in a model, by kind ("body" or "coordinate") and name.
_Paths = dict[tuple[str, str], str]


@dataclass(frozen=True, eq=False)
class MuscleOut(OsimMuscle):
    """A muscle to be written, with a path in metres.

    ``name`` has no spaces and slashes, ``kind`` is in :data:`MUSCLES`. ``parameters`` are OpenSim properties
    such as ``max_isometric_force`` [N], ``optimal_fiber_length`` [m], ``tendon_slack_length`` [m] and
    ``pennation_angle_at_optimal`` [rad]; by default OpenSim's values.
    """

    def __post_init__(self) -> None:
        _check_name("muscle", self.name)
        if self.kind not in MUSCLES:
            raise InputError("", f"there is no kind of muscle {self.kind!r}; allowed: {', '.join(MUSCLES)}")
        if isinstance(self.path, PointPath) and self.path.wraps:
            raise InputError("", f"muscle {self.name!r} has a wrapped path, which cannot be written")


def osim_of(
    tree: KinematicTree, muscles: Sequence[MuscleOut] = (), *, name: str = "model",
    masses: Mapping[str, float] | None = None, meshes: Mapping[str, Sequence[str]] | None = None,
) -> str:  # fmt: skip
    """Return a model as the text of an .osim file.

    Parameters
    ----------
    tree : KinematicTree
        In metres. The root becomes the ground.
    muscles : sequence of MuscleOut, optional
        Muscles on the bodies.
    name : str, optional
        Name of the model.
    masses : mapping of str to float, optional
        Masses of bodies [kg], by default 0. Moments of inertia assume a radius of gyration of 0.1 m about
        each axis. Masses affect dynamics only, not lengths, moment arms and inverse kinematics.
    meshes : mapping of str to sequence of str, optional
        By body: names of .stl files, without suffix, in the folder ``Geometry`` next to the model.

    Raises
    ------
    ValueError
        If a name cannot be part of a component path, or a muscle uses an unknown body or coordinate.
    """
    for body in tree.bodies:
        _check_name("body", body)
    for what, each in (("joint", tree.joints), ("coordinate", tree.coordinates)):
        for part in each:
            _check_name(what, part.name)
    # The first joint that a coordinate moves owns the coordinate.
    moved = [(axis.coordinate, joint.name) for joint in tree.joints for axis in joint.axes if axis.coordinate]
    owners = dict(reversed(moved))
    paths = _component_paths(tree, owners)
    for body in masses or {}:
        _path("body", body, paths)  # raises for an unknown body
    bodies = {body: made("Body", name=body) for body in tree.bodies}
    bodies[tree.root] = made("Ground", name="ground")
    for body, inside in bodies.items():
        if body != tree.root:
            mass = (masses or {}).get(body, 0.0)
            inertia = [*[mass * GYRATION**2] * 3, 0.0, 0.0, 0.0]
            inside.extend([made("mass", mass), made("mass_center", [0, 0, 0]), made("inertia", inertia)])
        if files := (meshes or {}).get(body):
            inside.append(made("attached_geometry", *map(_mesh, files)))
    for body, cylinder in _cylinders(muscles):
        _objects_in(bodies[body]).append(cylinder)
    ground, *moving = bodies.values()
    sets = {"BodySet": moving, "JointSet": [_joint(joint, tree, owners, paths) for joint in tree.joints]}
    sets["ConstraintSet"] = [_coupler(coupling) for coupling in tree.couplings]
    sets["ForceSet"] = [_muscle(muscle, paths) for muscle in muscles]
    parts = [_set(tag, objects, name=tag.lower()) for tag, objects in sets.items()]
    units = {"gravity": [0.0, -9.80665, 0.0], "length_units": "meters", "force_units": "N"}
    model = _component("Model", ground, *parts, name=name, **units)
    return xml_text(made("OpenSimDocument", model, Version=str(VERSION)))


def enriched(model: Path, muscles: Sequence[MuscleOut], *, replace: Sequence[str] = ()) -> str:
    """Return the text of a model with further muscles. The rest stays unchanged.

    Parameters
    ----------
    model : Path
        An .osim file of version 4.
    muscles : sequence of MuscleOut
        On the model's bodies, by its coordinates.
    replace : sequence of str, optional
        Muscles of the model to remove.

    Raises
    ------
    ValueError
        If the file is no such model, contains a muscle of the same name, or lacks a muscle to remove.
    """
    read = checked_model(model)
    for name in replace:
        read.muscle(name)  # raises for an unknown muscle
    for name in sorted({muscle.name for muscle in muscles} & (set(read.muscles) - set(replace))):
        problem = f"the model has a muscle {name!r} already"
        raise InputError(model, problem, "rename the new muscle, or replace the model's")
    paths = _component_paths(read.tree, read.joint_of)
    root = model_tree(model)
    forces = root.find("Model/ForceSet/objects")
    if forces is None:
        raise InputError(model, "the model has no ForceSet", "save it again with OpenSim 4")
    for force in [force for force in forces if force.get("name") in replace]:
        forces.remove(force)
    forces.extend([_muscle(muscle, paths) for muscle in muscles])  # a generator's errors become TypeErrors
    for name, cylinder in _cylinders(muscles):
        where = "Ground" if name == read.tree.root else f"BodySet/objects/Body[@name='{name}']"
        body = root.find(f"Model/{where}")
        assert body is not None  # read_osim has read the body
        _objects_in(body).append(cylinder)
    return xml_text(root, indented=False)


def model_tree(model: Path) -> Element:
    """Return the outermost element of a model's file, with comments."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    text = decoded(model)  # parsed without its declaration: the encoding there may be wrong
    return ElementTree.fromstring(text.partition("?>")[2] if text.startswith("<?xml") else text, parser)


def _component_paths(tree: KinematicTree, joint_of: Mapping[str, str]) -> _Paths:
    """Return component paths of bodies and coordinates."""
    bodies = {("body", body): f"/bodyset/{body}" for body in tree.bodies} | {("body", tree.root): "/ground"}
    return bodies | {("coordinate", name): f"/jointset/{joint}/{name}" for name, joint in joint_of.items()}


def _path(what: str, name: str, paths: _Paths) -> str:
    if (what, name) not in paths:
        names = ", ".join(each for kind, each in paths if kind == what)
        remedy = f"use the model's names in the scene, or omit --into; the model has {names}"
        raise InputError("", f"the model has no {what} {name!r}", remedy)
    return paths[what, name]


def _set(tag: str, objects: Iterable[Element], **attributes: str) -> Element:
    return made(tag, made("objects", *objects), made("groups"), **attributes)


def _component(tag: str, *parts: Element, name: str, **properties: Any) -> Element:
    """Return a component with parts, and with properties: elements, texts or numbers."""
    return made(tag, *parts, *(made(key, value) for key, value in properties.items()), name=name)


def _objects_in(body: Element) -> Element:
    """Return the element for a body's cylinders, made if missing."""
    for tag in ("WrapObjectSet", "objects"):
        inner = body.find(tag)
        body = SubElement(body, tag) if inner is None else inner
    return body


def _mesh(name: str) -> Element:
    # A muscle mesh stays at rest while the model moves.
    opacity = made("opacity", 0.3 if name.endswith("_at_rest") else 1.0)
    return _component("Mesh", name=f"{name}_mesh", mesh_file=f"{name}.stl", Appearance=opacity)


def _cylinders(muscles: Sequence[MuscleOut]) -> Iterator[tuple[str, Element]]:
    """Yield the body and the element of each cylinder."""
    for muscle in muscles:
        for number, cylinder in enumerate(getattr(muscle.path, "cylinders", ()), start=1):
            turn, size = _angles(cylinder.frame), {"radius": cylinder.radius, "length": CYLINDER}
            position = {"xyz_body_rotation": turn, "translation": cylinder.centre, "quadrant": "all"}
            name = f"{muscle.name}-C{number}"
            yield cylinder.body, _component("WrapCylinder", active="true", **position, **size, name=name)


def _coupler(coupling: Coupling) -> Element:
    names = {"independent_coordinate_names": coupling.independent, "isEnforced": "true"}
    names |= {"dependent_coordinate_name": coupling.dependent, "name": f"{coupling.dependent}_follows"}
    function = made("coupled_coordinates_function", function_element(coupling.function))
    return _component("CoordinateCouplerConstraint", function, **names, scale_factor=1.0)


def _joint(joint: Joint, tree: KinematicTree, owners: Mapping[str, str], paths: _Paths) -> Element:
    foreign = {axis.coordinate for axis in joint.axes if owners.get(axis.coordinate or "", "") != joint.name}
    for name in sorted(filter(None, foreign)):
        problem = f"joint {joint.name!r} uses {name!r}, a coordinate of another joint, which OpenSim refuses"
        raise InputError("", problem, f"give the joint its own coordinate that follows {name!r}")
    ends = (("parent", joint.parent, joint.parent_frame), ("child", joint.child, joint.child_frame))
    parts = []
    for side, body, frame in ends:
        at = {"translation": frame[:3, 3], "orientation": _angles(frame)}
        on, name = _path("body", body, paths), f"{joint.name}_in_{side}"
        parts.append(_component("PhysicalOffsetFrame", name=name, socket_parent=on, **at))
    own = [_coordinate(each) for each in tree.coordinates if owners.get(each.name) == joint.name]
    sockets = [made(f"socket_{side}_frame", f"{joint.name}_in_{side}") for side, *_ in ends]
    transform = [made("SpatialTransform", *_transform_axes(joint))] if joint.axes else []
    inside = *sockets, made("coordinates", *own), made("frames", *parts), *transform
    return made("CustomJoint" if joint.axes else "WeldJoint", *inside, name=joint.name)


def _coordinate(coordinate: JointCoordinate) -> Element:
    rest, limits = coordinate.rest, {}
    if coordinate.range is not None:
        limits = {"range": coordinate.range, "clamped": "true"}
        rest = float(np.clip(rest, *coordinate.range))
    return _component("Coordinate", name=coordinate.name, default_value=rest, **limits)


def _transform_axes(joint: Joint) -> Iterator[Element]:
    """Yield 3 rotations and 3 translations, 0 if missing."""
    zero = Polynomial(np.array([0.0]))
    axes: list[JointAxis] = []
    for part in (joint.rotations, joint.translations):
        axes += [*part, *(JointAxis(axis, zero) for axis in _further([each.axis for each in part]))]
    for name, axis in zip(AXES, axes, strict=True):
        function, moved = function_element(axis.function, name="function"), axis.coordinate or ""
        yield _component("TransformAxis", function, name=name, coordinates=moved, axis=axis.axis)


def _further(axes: list[Floats]) -> list[Floats]:
    """Return unit vectors that complete axes to 3, without parallel pairs."""
    complete = list(axes)
    while len(complete) < 3:
        complete.append(np.eye(3)[np.abs(complete or np.zeros((1, 3))).max(axis=0).argmin()])
    return complete[len(axes) :]


def _angles(frame: Floats) -> Floats:
    return np.asarray(Rotation.from_matrix(frame[:3, :3].copy()).as_euler("XYZ"))


def _muscle(muscle: MuscleOut, paths: _Paths) -> Element:
    name, path = muscle.name, muscle.path
    if isinstance(path, PointPath):
        points = [_point(f"{name}-P{i}", point, paths) for i, point in enumerate(path.points, start=1)]
        wraps = []
        for i, cylinder in enumerate(path.cylinders, start=1):
            span = {"method": "hybrid", "range": f"{cylinder.after + 1} {cylinder.after + 2}"}
            wraps.append(_component("PathWrap", name=f"{name}-W{i}", wrap_object=f"{name}-C{i}", **span))
        geometry = made("GeometryPath", _set("PathPointSet", points), _set("PathWrapSet", wraps), name="path")
    else:
        sizes = made("dimension", str(len(path.names))), made("order", str(path.order))
        polynomial = made("MultivariatePolynomialFunction", made("coefficients", path.coefficients), *sizes)
        names = " ".join(_path("coordinate", each, paths) for each in path.names)
        function = {"coordinate_paths": names, "length_function": polynomial}
        geometry = _component("FunctionBasedPath", name="path", **function)
    return _component(muscle.kind, geometry, name=name, **muscle.parameters)


def _point(name: str, point: PathPoint, paths: _Paths) -> Element:
    kind, position = "PathPoint", np.asarray(point.position, dtype=np.float64)
    properties: dict[str, Any] = {"socket_parent_frame": _path("body", point.body, paths)}
    if point.moves:
        kind, first = "MovingPathPoint", next(filter(None, point.coordinates))
        for axis, function, own, at in zip("xyz", point.functions, point.coordinates, position, strict=True):
            properties[f"socket_{axis}_coordinate"] = _path("coordinate", own or first, paths)
            properties[f"{axis}_location"] = function_element(function or Polynomial(at[None]))
    else:
        properties["location"] = position
    if point.only_in is not None and not point.moves:
        kind, (coordinate, *limits) = "ConditionalPathPoint", point.only_in
        properties |= {"socket_coordinate": _path("coordinate", coordinate, paths), "range": limits}
    return _component(kind, name=name, **properties)


def _check_name(what: str, name: str) -> None:
    if not name or set(name) & set(" \t\n/\\*+<>&\"'"):
        raise InputError("", f"{name!r} is no name for a {what} in OpenSim", "use letters, digits, _ - and .")
