"""Models of OpenSim: bodies, joints and muscles in files of versions 3 and 4."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.xml_elements import Element, last_part, of_kind, read_xml
from vtkmuscle.joints import osim
from vtkmuscle.joints.functions import OSIM, function_in
from vtkmuscle.joints.osim import MotionFile, read_motion_file
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath, Posed, powers

__all__ = ["MotionFile", "OsimModel", "checked_model", "read_motion_file", "read_osim"]
_FORCES = OSIM["forces"]


@dataclass(frozen=True, eq=False)
class OsimMuscle:
    """A muscle, or another actuator along a path, with its class in OpenSim."""

    name: str
    path: PointPath | FunctionPath
    parameters: Mapping[str, float] = field(default_factory=dict)
    kind: str = "Millard2012EquilibriumMuscle"


@dataclass(frozen=True, eq=False)
class OsimModel:
    """A model of OpenSim, in metres and radians.

    ``tree`` has bodies and joints, its root is the ground; ``muscles`` are all actuators along a path, by
    name, ``ligaments`` passive forces along a path; ``meshes`` are bodies with a file each; ``joint_of`` is
    the joint of each coordinate; ``not_used`` are parts of the file without effect here: forces without a
    path, controllers, contact geometry, probes, further components.
    """

    name: str
    tree: KinematicTree
    markers: tuple[str, ...]
    muscles: dict[str, OsimMuscle]
    meshes: tuple[tuple[str, str], ...]
    joint_of: dict[str, str] = field(default_factory=dict)
    not_used: tuple[str, ...] = ()
    ligaments: dict[str, OsimMuscle] = field(default_factory=dict)

    @property
    def paths(self) -> dict[str, OsimMuscle]:
        """Muscles and ligaments by name."""
        return self.muscles | self.ligaments

    def lengths(self, names: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the lengths (f,) of paths by name, for values (f,) of coordinates."""
        paths = {name: self.paths[name].path for name in names}
        points = [point for path in paths.values() for point in getattr(path, "points", ())]
        at = Posed.of(self.tree, values, {point.body for point in points})
        return {name: path.lengths_at(at) for name, path in paths.items()}

    def muscle(self, name: str) -> OsimMuscle:
        """Return a muscle by name; ValueError for an unknown name."""
        if name not in self.muscles:
            raise InputError("", f"the model has no muscle {name!r}; {suggestion(name, self.muscles)}")
        return self.muscles[name]


def read_osim(path: str | PathLike[str]) -> OsimModel:
    """Read a model of OpenSim 3 or 4, without OpenSim. All lengths are in metres.

    Parameters
    ----------
    path : path
        An .osim file. Supported: joints Weld, Pin, Slider, Universal, Ball, Gimbal, Planar, Free and
        Custom; constant, linear, polynomial, piecewise linear, sine and SimmSpline functions and
        multiples of a function; CoordinateCouplerConstraints of 1 coordinate; fixed, conditional and
        moving path points; paths as polynomials of coordinates.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the file is no model, or an unsupported part affects body poses; the message names part and line.

    References
    ----------
    Seth et al. 2018, *OpenSim: Simulating musculoskeletal dynamics and neuromuscular control to study human
    and animal movement*, doi:10.1371/journal.pcbi.1006223.
    """
    model = osim.model_element(Path(path))
    not_used: list[str] = []
    bodies, frames = osim.bodies_in(model)
    meshes = [mesh for name, body in bodies for mesh in _meshes(name, body, not_used)]
    tree, joint_of = osim.tree_in(model, frames, not_used)
    for name, _ in bodies:
        if name not in tree.bodies:
            raise model.error(f"the body {name!r} has no joint")
    paths = _paths(model, frames, tree, not_used)
    parts = ((tag, part) for tag in (*osim.NOT_USED, *osim.FURTHER) for part in model.within(tag))
    not_used += [f"{tag}: {part}" for tag, part in parts if part.tag != osim.OFFSET]
    markers = tuple(marker.name for marker in of_kind("Marker", model.within("MarkerSet")))
    ligaments = {name: each for name, each in paths.items() if each.kind in _FORCES["ligaments"]}
    muscles = {name: each for name, each in paths.items() if name not in ligaments}
    return OsimModel(model.name, tree, markers, muscles, tuple(meshes), joint_of, tuple(not_used), ligaments)


def own_name(model: Path) -> str:
    """Return the stem of names of a model's further files.

    A folder may have hip.osim and hip.xml: the names begin with ``hip`` and ``hip_xml``.
    """
    return model.stem if model.suffix.lower() != ".xml" else model.name.replace(".", "_")


def checked_model(path: Path) -> OsimModel:
    """Return a model for further muscles; ValueError before version 4."""
    model, version = read_osim(path), read_xml(path).attributes.get("Version", "0")
    if not version.isdecimal() or int(version) < 40000:
        raise InputError(path, f"the model is of version {version}", "save it again with OpenSim 4")
    return model


def _meshes(name: str, body: Element, not_used: list[str]) -> Iterator[tuple[str, str]]:
    for mesh in body.within("attached_geometry"):
        if mesh.tag == "Mesh":
            yield name, mesh.word("mesh_file")
        else:
            not_used.append(f"geometry of {name!r}: {mesh}")
    visible = body.find("VisibleObject")
    for mesh in visible.within("GeometrySet") if visible is not None else ():
        yield name, mesh.word("geometry_file")


def _paths(
    model: Element, frames: osim.BodyFrames, tree: KinematicTree, not_used: list[str]
) -> dict[str, OsimMuscle]:
    """Return the forces along a path by name."""
    coordinates = {coordinate.name for coordinate in tree.coordinates}
    muscles: dict[str, OsimMuscle] = {}
    for force in model.within("ForceSet"):
        muscle = _muscle(force, frames)
        if muscle is None:
            not_used.append(f"ForceSet: {force}")
            continue
        if force.name in muscles:
            raise force.error("another muscle has this name")
        for name in sorted(muscle.path.named - coordinates):
            raise force.error(f"there is no coordinate {name!r}", suggestion(name, sorted(coordinates)))
        muscles[force.name] = muscle
    return muscles


def _muscle(element: Element, frames: osim.BodyFrames) -> OsimMuscle | None:
    """Return the muscle of a force element; None without a path."""
    inside = (element.find("path") or element).children
    geometry = next((child for child in inside if child.tag.endswith("Path")), None)
    if geometry is None:
        return None
    path: PointPath | FunctionPath = PointPath((), (geometry.tag,))
    if geometry.tag == "GeometryPath":
        path = _point_path(geometry, frames)
    elif geometry.tag == "FunctionBasedPath":
        path = _function_path(geometry)
    there = (name for name in _FORCES["properties"] if element.find(name) is not None)
    return OsimMuscle(element.name, path, {name: element.number(name, 0.0) for name in there}, element.tag)


def _point_path(element: Element, frames: osim.BodyFrames) -> PointPath:
    element.only(("PathPointSet", "PathWrapSet", "Appearance", "default_color", "VisibleObject", "display"))
    points = [_point(point, frames) for point in element.need("PathPointSet").objects()]
    if len(points) < 2:
        raise element.error(f"has {len(points)} points, but a path needs two or more")
    wraps = element.within("PathWrapSet")
    return PointPath(points, [wrap.word("wrap_object") or wrap.name for wrap in wraps])


def _point(element: Element, frames: osim.BodyFrames) -> PathPoint:
    if element.tag not in (supported := _FORCES["points"]):
        raise element.error("this kind of path point is not supported", f"supported: {', '.join(supported)}")
    if element.tag == "PathPoint":
        return PathPoint(*osim.point_on(element, frames))
    if element.tag == "ConditionalPathPoint":
        low, high = element.need("range").numbers(2)
        name = last_part(element.need("coordinate", "socket_coordinate").text)
        return PathPoint(*osim.point_on(element, frames), only_in=(name, float(low), float(high)))
    body, frame = frames.at(element.need("socket_parent_frame", "body"))
    if not np.array_equal(frame, np.eye(4)):
        raise element.error("points that move on an offset frame are not supported", "give its body")
    functions = [function_in(element.need(f"{axis}_location")) for axis in "xyz"]
    paths = [element.word(f"{axis}_coordinate", f"socket_{axis}_coordinate") for axis in "xyz"]
    return PathPoint(body, np.zeros(3), functions, [last_part(path) or None for path in paths])


def _function_path(element: Element) -> PointPath | FunctionPath:
    names = [last_part(path) for path in element.word("coordinate_paths").split()]
    bare = [child for child in element.children if child.name == "length_function"]
    functions = element.within("length_function") or bare
    if [each.tag for each in functions] != ["MultivariatePolynomialFunction"]:
        return PointPath((), [each.tag for each in functions] or ["nothing"])
    (function,) = functions
    function.only(("coefficients", "dimension", "order"))
    dimension, order = function.number("dimension", 0.0), function.number("order", 0.0)
    if dimension != len(names) or order != int(order) or not 0 <= order <= 20:
        raise function.error(f"has dimension {dimension:g} and order {order:g} for {len(names)} coordinates")
    coefficients = function.need("coefficients").numbers()
    expected = len(powers(len(names), int(order)))
    if len(coefficients) != expected:
        raise function.error(f"has {len(coefficients)} coefficients, but needs {expected}")
    return FunctionPath(tuple(names), int(order), coefficients)
