"""Muscles and paths in files of OpenSim 3 and 4."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vtkmuscle.io.xml_elements import Element
from vtkmuscle.joints.functions import function_in
from vtkmuscle.joints.osim import Frames, frame_of, last_part, point_on
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath, powers

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
