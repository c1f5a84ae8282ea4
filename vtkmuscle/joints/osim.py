"""Bodies, joints and couplings in files of OpenSim 3 and 4."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.io.xml_elements import Element, read_xml
from vtkmuscle.joints.functions import FUNCTIONS, IDENTITY, function_in, function_of
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree

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


#: Parts of a model that affect neither body poses nor paths; only their contents are listed.
NOT_USED = ("ControllerSet", "ContactGeometrySet", "ProbeSet")
_MODEL_KEYS = (
    *("credits", "publications", "length_units", "force_units", "gravity", "assembly_accuracy", "defaults"),
    *("Ground", "BodySet", "JointSet", "ConstraintSet", "ForceSet", "MarkerSet", "ComponentSet"),
    *("ModelVisualPreferences", "components", "FrameGeometry", *NOT_USED),
)
_INERTIA = [f"inertia_{a}{b}" for a, b in ("xx", "yy", "zz", "xy", "xz", "yz")]
_BODY_KEYS = (
    *("mass", "mass_center", "inertia", *_INERTIA, "Joint", "VisibleObject", "WrapObjectSet"),
    *("FrameGeometry", "attached_geometry", "components", "frames"),
)
#: Accepted length units; a file may leave the unit empty.
_METRES = ("meters", "metres", "m", "")

#: Body and frame (4, 4) in the body, by the name of the frame.
Frames = dict[str, tuple[str, Floats]]
GROUND = "ground"


def of_kind(tag: str, elements: Sequence[Element]) -> Sequence[Element]:
    """Return elements with a tag.

    Elements with a different tag raise an InputError.
    """
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
    """Return frames with the PhysicalOffsetFrames among elements."""
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
    """Return the name in a child, or None.

    Several names raise an InputError.
    """
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
    """Return the coupling of a CoordinateCouplerConstraint.

    None if switched off.
    """
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


def last_part(path: str) -> str:
    """Return the last name of an OpenSim component path."""
    return path.strip().rpartition("/")[2]


def model_element(path: Path) -> Element:
    """Return the model in an OpenSim file.

    A model with lengths not in metres raises an InputError.
    """
    document = read_xml(path)
    if document.tag != "OpenSimDocument":
        problem = f"this is XML of {document.tag!r}, not a model of OpenSim"
        raise InputError(path, problem, "give an .osim file")
    model = document.need("Model")
    model.only(_MODEL_KEYS)
    units = model.word("length_units")
    if units not in _METRES:
        problem = f"there is no unit {units!r} here: lengths must be in metres"
        raise model.need("length_units").error(problem, "convert the model to meters")
    return model


def read_tree(path: Path) -> KinematicTree:
    """Return the bodies and joints of an OpenSim model.

    In metres, without muscles.

    Raises
    ------
    FileNotFoundError, ValueError
        As of :func:`vtkmuscle.opensim.read_osim`.
    """
    model = model_element(path)
    return tree_in(model, bodies_in(model)[1], [])[0]


def bodies_in(model: Element) -> tuple[list[tuple[str, Element]], Frames]:
    """Return bodies by name, and the frames on all bodies."""
    frames: Frames = {}
    bodies = [(body.name, body) for body in of_kind("Body", model.within("BodySet"))]
    for name, body in bodies:
        if name in frames:
            raise body.error("another body has this name")
        body.only(_BODY_KEYS)
        frames[name] = (name, np.eye(4))
    ground = model.find("Ground")
    if ground is not None:
        bodies.append((ground.name or GROUND, ground))
        frames[GROUND] = (GROUND, np.eye(4))
    for _, body in bodies:
        for holder in ("components", "frames"):
            frames = offset_frames(body.within(holder), frames)
    return bodies, frames


def tree_in(model: Element, frames: Frames, not_used: list[str]) -> tuple[KinematicTree, dict[str, str]]:
    """Return the tree of a model.

    The second result has the joint of each coordinate. The list of unused parts is extended.
    """
    joints = [joint_in(element, frames) for element in model.within("JointSet")]
    for body in model.within("BodySet"):
        joints += [joint_in(element, frames, body.name) for element in body.within("Joint")]
    couplings = [(element, coupling_in(element)) for element in model.within("ConstraintSet")]
    not_used += [f"switched off: {element}" for element, coupling in couplings if coupling is None]
    try:
        tree = KinematicTree(
            GROUND,
            [joint for joint, _ in joints],
            [coordinate for _, own in joints for coordinate in own],
            [coupling for _, coupling in couplings if coupling is not None],
        )
    except ValueError as error:
        raise model.placed(error) from error
    return tree, {coordinate.name: joint.name for joint, own in joints for coordinate in own}
