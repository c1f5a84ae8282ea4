"""Bodies, joints and couplings of OpenSim's files, of the forms before and since version 4."""

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


#: Parts of a model that do not decide where bodies are and muscles run; their contents are listed only.
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
#: Names of the unit of length, of which a file may give none.
_METRES = ("meters", "metres", "m", "")

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


def model_element(path: Path) -> Element:
    """Return the model in a file of OpenSim; raise an InputError where it is none, or not in metres."""
    document = read_xml(path)
    if document.tag != "OpenSimDocument":
        raise InputError(
            path, f"this is XML of {document.tag!r}, not a model of OpenSim", "give an .osim file"
        )
    model = document.need("Model")
    model.only(_MODEL_KEYS)
    units = model.word("length_units")
    if units not in _METRES:
        problem = f"there is no unit {units!r} here: lengths must be in metres"
        raise model.need("length_units").error(problem, "convert the model to meters")
    return model


def read_tree(path: Path) -> KinematicTree:
    """Return the bodies and joints of a model of OpenSim, lengths in metres, without its muscles.

    Raises
    ------
    FileNotFoundError, ValueError
        As of :func:`vtkmuscle.opensim.read_osim`.
    """
    model = model_element(path)
    _, frames = bodies_in(model)
    tree, _ = tree_in(model, frames, [])
    return tree


def bodies_in(model: Element) -> tuple[list[tuple[str, Element]], Frames]:
    """Return bodies by name, and the frames of all that is on them."""
    frames: Frames = {}
    bodies = [(body.name, body) for body in of_kind("Body", model.within("BodySet"))]
    for name, body in bodies:
        if name in frames:
            raise body.error("there is another body of this name")
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
    """Return the tree of a model, and the joint of each coordinate; names of what is left out are added."""
    found = [joint_in(one, frames) for one in model.within("JointSet")]
    for body in model.within("BodySet"):
        found += [joint_in(one, frames, body.name) for one in body.within("Joint")]
    couplings = []
    for one in model.within("ConstraintSet"):
        coupling = coupling_in(one)
        if coupling is None:
            not_used.append(f"switched off: {one}")
        else:
            couplings.append(coupling)
    coordinates = [coordinate for _, own in found for coordinate in own]
    try:
        tree = KinematicTree(GROUND, [joint for joint, _ in found], coordinates, couplings)
    except ValueError as error:
        raise model.placed(error) from error
    return tree, {coordinate.name: joint.name for joint, own in found for coordinate in own}
