"""Muscles and their paths in OpenSim's files, of the forms before and since version 4."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vtkmuscle.io.xml_elements import Element
from vtkmuscle.joints.functions import function_in
from vtkmuscle.joints.osim import Frames, frame_of, point_on
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath, powers

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
