"""Joints, couplings and paths of OpenSim's files, of the forms before and since version 4."""

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

#: Joints that are made of turns about, then slides along x, y and z of the joint's frame.
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
#: Names of the axes of a CustomJoint, in their order.
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


#: The body of each frame of a model, and the frame (4, 4) on it.
Frames = dict[str, tuple[str, Floats]]
GROUND = "ground"


def of_kind(tag: str, elements: Sequence[Element]) -> Sequence[Element]:
    """Return elements, which must all have a tag."""
    for element in elements:
        if element.tag != tag:
            raise element.error(f"is not understood: only {tag} may be here")
    return elements


def frame_of(element: Element, frames: Frames) -> tuple[str, Floats]:
    """Return the body, and the frame (4, 4) on it, that the path of OpenSim in an element ends with."""
    name = element.text.strip().rstrip("/").rpartition("/")[2]
    if name in frames:
        return frames[name]
    if name == GROUND:
        return name, np.eye(4)
    raise element.error(f"there is no body or frame {name!r}")


def point_on(element: Element, frames: Frames) -> tuple[str, Floats]:
    """Return the body of a point, and where it is on it (3,)."""
    body, frame = frame_of(element.need("socket_parent_frame", "body"), frames)
    return body, frame[:3, :3] @ element.need("location").numbers(3) + frame[:3, 3]


def offset_frames(elements: Sequence[Element], frames: Frames) -> Frames:
    """Return frames, and the PhysicalOffsetFrames among elements that hold nothing else."""
    found = dict(frames)
    for element in of_kind("PhysicalOffsetFrame", elements):
        element.only(_FRAME_KEYS)
        body, place = frame_of(element.need("socket_parent"), found)
        offset = frame_at(element.vector("translation"), element.vector("orientation"))
        found[element.name] = (body, place @ offset)
    return found


def joint_in(
    element: Element, frames: Frames, child: str | None = None
) -> tuple[Joint, list[JointCoordinate]]:
    """Return a joint and its coordinates; before version 4 joints stand in their bodies, the children.

    Raises
    ------
    InputError
        If there is something in it that is not understood; the message names it.
    """
    if element.tag not in JOINTS:
        raise element.error("this kind of joint is not understood", f"understood: {', '.join(JOINTS)}")
    element.only(_JOINT_KEYS)
    if element.flag("reverse"):
        raise element.error("joints with reverse = true are not understood", "exchange parent and child")
    holder = "coordinates" if element.find("coordinates") else "CoordinateSet"
    named = of_kind("Coordinate", element.within(holder))
    if element.tag == "CustomJoint":
        rotations, translations = _spatial_transform(element)
    else:
        turns, slides = _PLAIN[element.tag]
        if len(named) != len(turns + slides):
            raise element.error(f"has {len(named)} coordinates, but must have {len(turns + slides)}")
        letters = zip(turns + slides, named, strict=True)
        axes = [JointAxis(_AXES[letter], IDENTITY, one.name) for letter, one in letters]
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
    turned = {axis.coordinate for axis in rotations}
    coordinates = [_coordinate(one, "rad" if one.name in turned else "m") for one in named]
    joint = Joint(
        element.name, parent, child, rotations, translations, parent_frame, child_frame, element.tag
    )
    return joint, coordinates


def _coordinate(element: Element, unit: str) -> JointCoordinate:
    element.only(_COORDINATE_KEYS)
    if element.flag("prescribed"):
        raise element.error("coordinates that are prescribed by a function of time are not understood")
    rest = element.number("default_value" if element.find("default_value") else "initial_value", 0.0)
    limits = None
    if element.find("range") is not None:
        low, high = element.vector("range", 2)
        limits = float(low), float(high)
    return JointCoordinate(element.name, unit, rest, limits)


def _spatial_transform(element: Element) -> tuple[list[JointAxis], list[JointAxis]]:
    transform = element.need("SpatialTransform")
    transform.only(("TransformAxis", "objects", "groups"))
    holder = transform if transform.find("objects") is None else transform.need("objects")
    found = {axis.name: _transform_axis(axis) for axis in of_kind("TransformAxis", holder.children)}
    for name in found:
        if name not in AXES:
            raise transform.error(f"there is no axis {name!r}", f"the axes are {', '.join(AXES)}")
    rotations = [found[name] for name in AXES[:3] if name in found]
    translations = [found[name] for name in AXES[3:] if name in found]
    return rotations, translations


def _transform_axis(element: Element) -> JointAxis:
    element.only(("coordinates", "axis", "function", *FUNCTIONS))
    names = element.words("coordinates")
    if len(names) > 1:
        raise element.error(f"depends on {len(names)} coordinates; functions of one are understood")
    function = function_of(element)
    try:
        return JointAxis(element.need("axis").numbers(3), function, names[0] if names else None)
    except ValueError as error:
        raise element.placed(error) from error


def coupling_in(element: Element) -> Coupling | None:
    """Return the coupling of a CoordinateCouplerConstraint; None where it is switched off."""
    if not element.flag("isEnforced", default=True) or element.flag("isDisabled"):
        return None
    if element.tag != "CoordinateCouplerConstraint":
        raise element.error(
            "this constraint is not understood", "understood: CoordinateCouplerConstraint; or switch it off"
        )
    keys = ("isEnforced", "isDisabled", "coupled_coordinates_function", "independent_coordinate_names")
    element.only((*keys, "dependent_coordinate_name", "scale_factor"))
    names = element.words("independent_coordinate_names")
    if len(names) != 1:
        raise element.error(f"depends on {len(names)} coordinates; functions of one are understood")
    function = function_in(element.need("coupled_coordinates_function"))
    dependent = element.need("dependent_coordinate_name").text.strip()
    return Coupling(dependent, names[0], function.rescaled(1.0, element.number("scale_factor", 1.0)))


#: Numbers of a muscle that are kept where they are given.
PARAMETERS = (
    "max_isometric_force",
    "optimal_fiber_length",
    "tendon_slack_length",
    "pennation_angle_at_optimal",
    "max_contraction_velocity",
)


@dataclass(frozen=True, eq=False)
class OsimMuscle:
    """A muscle, or another actuator along a path: its class in OpenSim, and the parameters that it gives."""

    name: str
    kind: str
    path: PointPath | FunctionPath
    parameters: dict[str, float] = field(default_factory=dict)


def muscle_in(element: Element, frames: Frames) -> OsimMuscle | None:
    """Return the muscle of a force; None where it has no path."""
    geometry = (element.find("path") or element).find("GeometryPath", "FunctionBasedPath")
    if geometry is None:
        return None
    path = _function_path(geometry) if geometry.tag == "FunctionBasedPath" else _point_path(geometry, frames)
    given = {name: element.number(name, 0.0) for name in PARAMETERS if element.find(name) is not None}
    return OsimMuscle(element.name, element.tag, path, given)


def _point_path(element: Element, frames: Frames) -> PointPath:
    element.only(("PathPointSet", "PathWrapSet", "Appearance", "default_color", "VisibleObject", "display"))
    points = [_point(one, frames) for one in element.need("PathPointSet").objects()]
    if len(points) < 2:
        raise element.error(f"has {len(points)} points, but a path needs two or more")
    return PointPath(points, [one.word("wrap_object") or one.name for one in element.within("PathWrapSet")])


_POINT_KEYS = ("socket_parent_frame", "body", "location", "VisibleObject", "display")
_CONDITIONAL = ("range", "coordinate", "socket_coordinate")
_MOVING = [f"{axis}_{what}" for axis in "xyz" for what in ("location", "coordinate")]
_MOVING += [f"socket_{axis}_coordinate" for axis in "xyz"]


def _point(element: Element, frames: Frames) -> PathPoint:
    if element.tag == "PathPoint":
        element.only(_POINT_KEYS)
        return PathPoint(*point_on(element, frames))
    if element.tag == "ConditionalPathPoint":
        element.only((*_POINT_KEYS, *_CONDITIONAL))
        low, high = element.need("range").numbers(2)
        name = last_part(element.need("coordinate", "socket_coordinate").text)
        return PathPoint(*point_on(element, frames), only_in=(name, float(low), float(high)))
    if element.tag == "MovingPathPoint":
        element.only((*_POINT_KEYS, *_MOVING))
        body, frame = frame_of(element.need("socket_parent_frame", "body"), frames)
        if not np.array_equal(frame, np.eye(4)):
            raise element.error("points that move on an offset frame are not understood", "give its body")
        functions = [function_in(element.need(f"{axis}_location")) for axis in "xyz"]
        named = [element.word(f"{axis}_coordinate", f"socket_{axis}_coordinate") for axis in "xyz"]
        return PathPoint(body, np.zeros(3), functions, [last_part(one) or None for one in named])
    raise element.error(
        "this kind of path point is not understood",
        "understood: PathPoint, ConditionalPathPoint, MovingPathPoint",
    )


def last_part(path: str) -> str:
    """Return the name that a path of OpenSim ends with."""
    return path.strip().rpartition("/")[2]


def _function_path(element: Element) -> FunctionPath:
    names = [last_part(path) for path in element.words("coordinate_paths")]
    bare = [child for child in element.children if child.name == "length_function"]
    candidates = element.within("length_function") or bare
    if len(candidates) != 1 or candidates[0].tag != "MultivariatePolynomialFunction":
        raise element.error(
            "its length function is not understood", "understood: MultivariatePolynomialFunction"
        )
    function = candidates[0]
    function.only(("coefficients", "dimension", "order"))
    dimension, order = function.number("dimension", 0.0), function.number("order", 0.0)
    if dimension != len(names) or order != int(order) or not 0 <= order <= 20:
        raise function.error(f"has dimension {dimension:g} and order {order:g} for {len(names)} coordinates")
    coefficients = function.need("coefficients").numbers()
    expected = len(powers(len(names), int(order)))
    if len(coefficients) != expected:
        raise function.error(f"has {len(coefficients)} coefficients, but needs {expected}")
    return FunctionPath(tuple(names), int(order), coefficients)
