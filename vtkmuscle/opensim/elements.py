"""Joints, couplings and muscle paths in files of OpenSim.

Forms of versions 3 and 4 are supported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.io.xml_elements import Element
from vtkmuscle.opensim.functions import FUNCTIONS, IDENTITY, function_in, function_of
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath, powers
from vtkmuscle.opensim.tree import Coupling, Joint, JointAxis, JointCoordinate

#: Axes of each joint type in the joint frame: letters of its rotations, then of its translations.
_PLAIN = {
    "WeldJoint": ("", ""),
    "PinJoint": ("z", ""),
    "SliderJoint": ("", "x"),
    "UniversalJoint": ("xy", ""),
    "BallJoint": ("xyz", ""),
    "GimbalJoint": ("xyz", ""),
    "PlanarJoint": ("z", "xy"),
    "FreeJoint": ("xyz", "xyz"),
}
_AXES = dict(zip("xyz", np.eye(3), strict=True))
JOINTS = ("CustomJoint", *_PLAIN)
#: Names of a CustomJoint's axes, in the order of the transform.
AXES = tuple(kind + number for kind in ("rotation", "translation") for number in "123")

_JOINT_KEYS = (
    *("socket_parent_frame", "socket_child_frame", "socket_parent_offset_frame", "socket_child_offset_frame"),
    *("coordinates", "CoordinateSet", "frames", "SpatialTransform", "reverse", "components"),
    *("parent_body", "location_in_parent", "orientation_in_parent", "location", "orientation"),
)
_COORDINATE_KEYS = (
    *("motion_type", "default_value", "default_speed_value", "initial_value", "initial_speed_value", "range"),
    *("clamped", "locked", "prescribed", "prescribed_function", "is_free_to_satisfy_constraints"),
)
_FRAME_KEYS = (
    *("FrameGeometry", "attached_geometry", "WrapObjectSet", "socket_parent", "translation", "orientation"),
    *("components",),
)


#: Body and frame (4, 4) in the body, by the name of the frame.
Frames = dict[str, tuple[str, Floats]]
GROUND = "ground"


def of_kind(tag: str, elements: Sequence[Element]) -> Sequence[Element]:
    """Return elements; raise an InputError unless all have the tag."""
    for element in elements:
        if element.tag != tag:
            raise element.error(f"is not supported: only {tag} may be here")
    return elements


def frame_of(element: Element, frames: Frames) -> tuple[str, Floats]:
    """Return the body and frame (4, 4) at an element's path."""
    name = last_part(element.text.strip().rstrip("/"))
    if name in frames:
        return frames[name]
    if name == GROUND:
        return name, np.eye(4)
    raise element.error(f"there is no body or frame {name!r}")


def point_on(element: Element, frames: Frames) -> tuple[str, Floats]:
    """Return the body and body-fixed position (3,) of a point."""
    body, frame = frame_of(element.need("socket_parent_frame", "body"), frames)
    return body, frame[:3, :3] @ element.need("location").numbers(3) + frame[:3, 3]


def offset_frames(elements: Sequence[Element], frames: Frames) -> Frames:
    """Return frames, extended by the PhysicalOffsetFrames among elements."""
    extended = dict(frames)
    for element in of_kind("PhysicalOffsetFrame", elements):
        element.only(_FRAME_KEYS)
        body, frame = frame_of(element.need("socket_parent"), extended)
        offset = frame_at(element.vector("translation"), element.vector("orientation"))
        extended[element.name] = (body, frame @ offset)
    return extended


def joint_in(
    element: Element, frames: Frames, child: str | None = None
) -> tuple[Joint, list[JointCoordinate]]:
    """Return a joint and its coordinates.

    Before version 4 the child body contains the joint; ``child`` is the body's name.

    Raises
    ------
    InputError
        For an unsupported element; the message names the element.
    """
    if element.tag not in JOINTS:
        raise element.error("this kind of joint is not supported", f"supported: {', '.join(JOINTS)}")
    element.only(_JOINT_KEYS)
    if element.flag("reverse"):
        raise element.error("joints with reverse = true are not supported", "exchange parent and child")
    holder = "coordinates" if element.find("coordinates") else "CoordinateSet"
    elements = of_kind("Coordinate", element.within(holder))
    if element.tag == "CustomJoint":
        rotations, translations = _spatial_transform(element)
    else:
        turns, slides = _PLAIN[element.tag]
        if len(elements) != len(turns + slides):
            raise element.error(f"has {len(elements)} coordinates, but must have {len(turns + slides)}")
        letters = zip(turns + slides, elements, strict=True)
        axes = [JointAxis(_AXES[letter], IDENTITY, coordinate.name) for letter, coordinate in letters]
        rotations, translations = axes[: len(turns)], axes[len(turns) :]
    if child is None:
        own = offset_frames(element.within("frames"), frames)
        parent, parent_frame = frame_of(
            element.need("socket_parent_frame", "socket_parent_offset_frame"), own
        )
        child, child_frame = frame_of(element.need("socket_child_frame", "socket_child_offset_frame"), own)
    else:
        parent, _ = frame_of(element.need("parent_body"), frames)
        parent_frame = frame_at(element.vector("location_in_parent"), element.vector("orientation_in_parent"))
        child_frame = frame_at(element.vector("location"), element.vector("orientation"))
    angles = {axis.coordinate for axis in rotations}
    coordinates = [_coordinate(each, "rad" if each.name in angles else "m") for each in elements]
    ends = (parent, child, rotations, translations, parent_frame, child_frame)
    return Joint(element.name, *ends, element.tag), coordinates


def _coordinate(element: Element, unit: str) -> JointCoordinate:
    element.only(_COORDINATE_KEYS)
    if element.flag("prescribed"):
        raise element.error("coordinates prescribed by a function of time are not supported")
    rest = element.number("default_value" if element.find("default_value") else "initial_value", 0.0)
    limits = element.find("range")
    span = None if limits is None else tuple(limits.numbers(2).tolist())
    return JointCoordinate(element.name, unit, rest, span)


def _spatial_transform(element: Element) -> tuple[list[JointAxis], list[JointAxis]]:
    transform = element.need("SpatialTransform")
    transform.only(("TransformAxis", "objects", "groups"))
    holder = transform if transform.find("objects") is None else transform.need("objects")
    axes = {axis.name: _transform_axis(axis) for axis in of_kind("TransformAxis", holder.children)}
    for name in axes:
        if name not in AXES:
            raise transform.error(f"there is no axis {name!r}", f"the axes are {', '.join(AXES)}")
    rotations, translations = ([axes[name] for name in part if name in axes] for part in (AXES[:3], AXES[3:]))
    return rotations, translations


def _only_coordinate(element: Element, tag: str) -> str | None:
    """Return the name in a child, or None; raise an InputError for several."""
    names = element.words(tag)
    if len(names) > 1:
        raise element.error(f"depends on {len(names)} coordinates, but only functions of 1 are supported")
    return names[0] if names else None


def _transform_axis(element: Element) -> JointAxis:
    element.only(("coordinates", "axis", "function", *FUNCTIONS))
    function, coordinate = function_of(element), _only_coordinate(element, "coordinates")
    try:
        return JointAxis(element.need("axis").numbers(3), function, coordinate)
    except ValueError as error:
        raise element.placed(error) from error


def coupling_in(element: Element) -> Coupling | None:
    """Return the coupling of a CoordinateCouplerConstraint; None if switched off."""
    if not element.flag("isEnforced", default=True) or element.flag("isDisabled"):
        return None
    if element.tag != "CoordinateCouplerConstraint":
        remedy = "supported: CoordinateCouplerConstraint; or switch it off"
        raise element.error("this constraint is not supported", remedy)
    keys = ("isEnforced", "isDisabled", "coupled_coordinates_function", "independent_coordinate_names")
    element.only((*keys, "dependent_coordinate_name", "scale_factor"))
    independent = _only_coordinate(element, "independent_coordinate_names")
    if independent is None:
        raise element.error("depends on no coordinate", "name the independent coordinate")
    function = function_in(element.need("coupled_coordinates_function"))
    dependent = element.need("dependent_coordinate_name").text.strip()
    return Coupling(dependent, independent, function.rescaled(1.0, element.number("scale_factor", 1.0)))


#: Muscle properties that are read.
PARAMETERS = (
    "max_isometric_force",
    "optimal_fiber_length",
    "tendon_slack_length",
    "pennation_angle_at_optimal",
    "max_contraction_velocity",
)


@dataclass(frozen=True, eq=False)
class OsimMuscle:
    """A muscle, or another actuator along a path.

    Attributes
    ----------
    name : str
        Name in the model.
    kind : str
        Class in OpenSim.
    path : PointPath or FunctionPath
        In metres.
    parameters : dict of str to float
        Properties in the file, of :data:`PARAMETERS`.
    """

    name: str
    kind: str
    path: PointPath | FunctionPath
    parameters: dict[str, float] = field(default_factory=dict)


def muscle_in(element: Element, frames: Frames) -> OsimMuscle | None:
    """Return the muscle of a force element; None without a path."""
    geometry = (element.find("path") or element).find("GeometryPath", "FunctionBasedPath")
    if geometry is None:
        return None
    path = _function_path(geometry) if geometry.tag == "FunctionBasedPath" else _point_path(geometry, frames)
    parameters = {name: element.number(name, 0.0) for name in PARAMETERS if element.find(name) is not None}
    return OsimMuscle(element.name, element.tag, path, parameters)


def _point_path(element: Element, frames: Frames) -> PointPath:
    element.only(("PathPointSet", "PathWrapSet", "Appearance", "default_color", "VisibleObject", "display"))
    points = [_point(point, frames) for point in element.need("PathPointSet").objects()]
    if len(points) < 2:
        raise element.error(f"has {len(points)} points, but a path needs two or more")
    wraps = element.within("PathWrapSet")
    return PointPath(points, [wrap.word("wrap_object") or wrap.name for wrap in wraps])


#: Child elements by kind of path point, besides the shared children.
_POINTS: dict[str, tuple[str, ...]] = {
    "PathPoint": (),
    "ConditionalPathPoint": ("range", "coordinate", "socket_coordinate"),
    "MovingPathPoint": tuple(
        name for a in "xyz" for name in (f"{a}_location", f"{a}_coordinate", f"socket_{a}_coordinate")
    ),
}


def _point(element: Element, frames: Frames) -> PathPoint:
    if element.tag not in _POINTS:
        raise element.error("this kind of path point is not supported", f"supported: {', '.join(_POINTS)}")
    shared = ("socket_parent_frame", "body", "location", "VisibleObject", "display")
    element.only((*shared, *_POINTS[element.tag]))
    if element.tag == "PathPoint":
        return PathPoint(*point_on(element, frames))
    if element.tag == "ConditionalPathPoint":
        low, high = element.need("range").numbers(2)
        name = last_part(element.need("coordinate", "socket_coordinate").text)
        return PathPoint(*point_on(element, frames), only_in=(name, float(low), float(high)))
    body, frame = frame_of(element.need("socket_parent_frame", "body"), frames)
    if not np.array_equal(frame, np.eye(4)):
        raise element.error("points that move on an offset frame are not supported", "give its body")
    functions = [function_in(element.need(f"{axis}_location")) for axis in "xyz"]
    paths = [element.word(f"{axis}_coordinate", f"socket_{axis}_coordinate") for axis in "xyz"]
    return PathPoint(body, np.zeros(3), functions, [last_part(path) or None for path in paths])


def last_part(path: str) -> str:
    """Return the last name of an OpenSim component path."""
    return path.strip().rpartition("/")[2]


def _function_path(element: Element) -> FunctionPath:
    names = [last_part(path) for path in element.words("coordinate_paths")]
    bare = [child for child in element.children if child.name == "length_function"]
    functions = element.within("length_function") or bare
    if [each.tag for each in functions] != ["MultivariatePolynomialFunction"]:
        remedy = "supported: MultivariatePolynomialFunction"
        raise element.error("its length function is not supported", remedy)
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
