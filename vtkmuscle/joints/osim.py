"""Bodies, joints, couplings and motions in files of OpenSim and SIMM."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from posixpath import join, normpath

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.io.csv_table import finite_number
from vtkmuscle.io.motion_table import MOST_FRAMES
from vtkmuscle.io.xml_elements import Element, decoded, last_part, of_kind, read_xml
from vtkmuscle.joints.functions import IDENTITY, OSIM, Polynomial, function_in, function_of
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree

_JOINTS, _ELEMENTS = OSIM["joints"], OSIM["elements"]
ENDS = ("parent", "child")
#: Names of a CustomJoint's axes, in the order of the transform.
AXES = tuple(kind + number for kind in ("rotation", "translation") for number in "123")
#: Parts of a model without effect here, and holders of further components.
NOT_USED, FURTHER = _ELEMENTS["not_used"], _ELEMENTS["further"]
#: Accepted length units; a file may leave the unit empty.
_METRES = ("meters", "metres", "m", "")
#: Body that never moves: that of all without a joint.
GROUND = "ground"
#: Kind of a frame that is fixed to another.
OFFSET = "PhysicalOffsetFrame"
JOINTSET = "/jointset"


class BodyFrames:
    """Bodies and their offset frames by component path, as OpenSim resolves the paths.

    Two bodies or joints may have frames of one name. A path that leads nowhere counts by its last name.
    """

    def __init__(self) -> None:
        self._bodies = {f"/{GROUND}": GROUND}
        self._offsets: dict[str, Element] = {}

    def add_body(self, path: str, body: Element) -> None:
        """Add a body and its offset frames."""
        self._bodies[path] = last_part(path)
        self.add_offsets(path, body)

    def add_offsets(self, path: str, owner: Element, tags: Sequence[str] = ("components", "frames")) -> None:
        """Add the offset frames inside a component."""
        for element in (each for tag in tags for each in owner.within(tag)):
            if element.tag == OFFSET:
                self._offsets[f"{path}/{element.name}"] = element
                self.add_offsets(f"{path}/{element.name}", element)

    def at(self, socket: Element, owner: str = "", *, depth: int = 0) -> tuple[str, Floats]:
        """Return the body and frame (4, 4) of a socket. Relative paths begin at the owner's path."""
        text = socket.text.strip()
        path = normpath(join("/", owner, text))
        if path not in self._bodies and path not in self._offsets:
            paths = [each for each in (*self._bodies, *self._offsets) if last_part(each) == last_part(path)]
            if len(paths) != 1:
                problem = "there is no body or frame" if not paths else f"{len(paths)} frames have the name"
                raise socket.error(f"{problem} {last_part(text)!r}", ", ".join(paths))
            path = paths[0]
        if path in self._bodies:
            return self._bodies[path], np.eye(4)
        if depth > len(self._offsets):
            raise socket.error("the frames are offsets of each other")
        element = self._offsets[path]
        body, frame = self.at(element.need("socket_parent"), path, depth=depth + 1)
        return body, frame @ frame_at(element.vector("translation"), element.vector("orientation"))


def point_on(element: Element, frames: BodyFrames) -> tuple[str, Floats]:
    """Return the body and body-fixed position (3,) of a point."""
    body, frame = frames.at(element.need("socket_parent_frame", "body"))
    return body, frame[:3, :3] @ element.need("location").numbers(3) + frame[:3, 3]


def joint_in(element: Element, frames: BodyFrames, child: str = "") -> tuple[Joint, list[JointCoordinate]]:
    """Return a joint and its coordinates. ``child`` is the body around the joint before version 4."""
    if element.tag not in (supported := ("CustomJoint", *_JOINTS)):
        raise element.error("this kind of joint is not supported", f"supported: {', '.join(supported)}")
    element.only(_ELEMENTS["joint"])
    if element.flag("reverse"):
        raise element.error("joints with reverse = true are not supported", "exchange parent and child")
    holder = "coordinates" if element.find("coordinates") else "CoordinateSet"
    elements = of_kind("Coordinate", element.within(holder))
    if element.tag == "CustomJoint":
        rotations, translations = _spatial_transform(element)
    else:
        turns, slides = _JOINTS[element.tag]
        if len(elements) != len(turns + slides):
            raise element.error(f"has {len(elements)} coordinates, but must have {len(turns + slides)}")
        letters = zip(map("xyz".index, turns + slides), elements, strict=True)
        axes = [JointAxis(np.eye(3)[letter], IDENTITY, coordinate.name) for letter, coordinate in letters]
        rotations, translations = axes[: len(turns)], axes[len(turns) :]
    if not child:
        sockets = [element.need(f"socket_{end}_frame", f"socket_{end}_offset_frame") for end in ENDS]
        path = f"{JOINTSET}/{element.name}"
        (parent, parent_frame), (child, child_frame) = (frames.at(socket, path) for socket in sockets)
    else:
        parent, _ = frames.at(element.need("parent_body"))
        parent_frame = frame_at(element.vector("location_in_parent"), element.vector("orientation_in_parent"))
        child_frame = frame_at(element.vector("location"), element.vector("orientation"))
    angles = {axis.coordinate for axis in rotations}
    coordinates = [_coordinate(each, "rad" if each.name in angles else "m") for each in elements]
    ends = (parent, child, rotations, translations, parent_frame, child_frame)
    return Joint(element.name, *ends, element.tag), coordinates


def _coordinate(element: Element, unit: str) -> JointCoordinate:
    if element.flag("prescribed"):
        raise element.error("coordinates prescribed by a function of time are not supported")
    rest = element.number("default_value" if element.find("default_value") else "initial_value", 0.0)
    limits = element.find("range")
    span = None if limits is None else tuple(limits.numbers(2).tolist())
    return JointCoordinate(element.name, unit, rest, span, locked=element.flag("locked"))


def _spatial_transform(element: Element) -> tuple[list[JointAxis], list[JointAxis]]:
    transform = element.need("SpatialTransform")
    transform.only(("TransformAxis", "objects", "groups"))
    holder = transform if transform.find("objects") is None else transform.need("objects")
    axes: dict[str, JointAxis] = {}
    for axis in of_kind("TransformAxis", holder.children):
        axis.only(("coordinates", "axis", "function", *OSIM["functions"]))
        coordinate = _only_coordinate(axis, "coordinates")
        function = function_of(axis, missing=Polynomial(np.zeros(1)))
        try:
            axes[axis.name] = JointAxis(axis.need("axis").numbers(3), function, coordinate)
        except ValueError as error:
            raise axis.placed(error) from error
    if wrong := [name for name in axes if name not in AXES]:
        raise transform.error(f"there is no axis {wrong[0]!r}", f"the axes are {', '.join(AXES)}")
    rotations, translations = ([axes[name] for name in part if name in axes] for part in (AXES[:3], AXES[3:]))
    return rotations, translations


def _only_coordinate(element: Element, tag: str) -> str | None:
    """Return the only name in a child, or None."""
    names = element.word(tag).split()
    if len(names) > 1:
        raise element.error(f"depends on {len(names)} coordinates, but only functions of 1 are supported")
    return names[0] if names else None


def coupling_in(element: Element) -> Coupling | None:
    """Return the coupling of a CoordinateCouplerConstraint; None if switched off."""
    if not element.flag("isEnforced", default=True) or element.flag("isDisabled"):
        return None
    if element.tag != "CoordinateCouplerConstraint":
        raise element.error("this constraint is not supported", "use a CoordinateCouplerConstraint")
    element.only(_ELEMENTS["coupling"])
    independent = _only_coordinate(element, "independent_coordinate_names")
    if independent is None:
        raise element.error("depends on no coordinate", "name the independent coordinate")
    function = function_in(element.need("coupled_coordinates_function"))
    dependent = element.need("dependent_coordinate_name").text.strip()
    return Coupling(dependent, independent, function.rescaled(1.0, element.number("scale_factor", 1.0)))


def model_element(path: Path) -> Element:
    """Return the model in an OpenSim file, if in metres."""
    document = read_xml(path)
    if document.tag != "OpenSimDocument":
        raise InputError(path, f"this is XML of {document.tag!r}, not a model of OpenSim")
    model = document.need("Model")
    model.only((*_ELEMENTS["model"], *FURTHER, *NOT_USED))
    units = model.word("length_units")
    if units not in _METRES:
        raise model.need("length_units").error(f"there is no unit {units!r} here", "convert it to meters")
    return model


def read_tree(path: Path) -> KinematicTree:
    """Return the bodies and joints of an OpenSim model, in metres. Raises as ``read_osim``."""
    model = model_element(path)
    return tree_in(model, bodies_in(model)[1], [])[0]


def bodies_in(model: Element) -> tuple[list[tuple[str, Element]], BodyFrames]:
    """Return bodies by name, and the frames of the model."""
    frames = BodyFrames()
    bodies: dict[str, Element] = {}
    for body in of_kind("Body", model.within("BodySet")):
        if body.name in bodies:
            raise body.error("another body has this name")
        bodies[body.name] = body
        frames.add_body(f"/{GROUND}" if body.name == GROUND else f"/bodyset/{body.name}", body)
    if (ground := model.find("Ground")) is not None:
        bodies[GROUND] = ground
        frames.add_body(f"/{GROUND}", ground)
    for joint in model.within("JointSet"):
        frames.add_offsets(f"{JOINTSET}/{joint.name}", joint)
    frames.add_offsets("", model, FURTHER)
    return list(bodies.items()), frames


def tree_in(model: Element, frames: BodyFrames, not_used: list[str]) -> tuple[KinematicTree, dict[str, str]]:
    """Return the tree of a model, and the joint of each coordinate. The list of unused parts is extended."""
    joints = [joint_in(element, frames) for element in model.within("JointSet")]
    for body in model.within("BodySet"):
        joints += [joint_in(element, frames, body.name) for element in body.within("Joint")]
    couplings = [(element, coupling_in(element)) for element in model.within("ConstraintSet")]
    not_used += [f"switched off: {element}" for element, coupling in couplings if coupling is None]
    coordinates = [coordinate for _, own in joints for coordinate in own]
    followed = [coupling for _, coupling in couplings if coupling is not None]
    try:
        tree = KinematicTree(GROUND, [joint for joint, _ in joints], coordinates, followed)
    except ValueError as error:
        raise model.placed(error) from error
    return tree, {coordinate.name: joint.name for joint, own in joints for coordinate in own}


@dataclass(frozen=True, eq=False)
class MotionFile:
    """The table of a .mot or .sto file.

    ``times`` (f,) [s] ascend; ``labels`` of the further columns, in ``table`` (f, k), may repeat; ``degrees``
    tells whether angles are in degrees, None if unspecified.
    """

    path: Path
    times: Floats
    labels: tuple[str, ...]
    table: Floats
    degrees: bool | None

    def values(self, tree: KinematicTree) -> dict[str, Floats]:
        """Return the values (f,) of a tree's coordinates.

        Angles are in radians, translations as in the file. The label of a column is the coordinate's name,
        or its path (``/jointset/knee_r/knee_angle_r/value``); further columns are ignored. ValueError if no
        column is a coordinate, two columns are the same coordinate, or the unit of angles is unknown.
        """
        kinds = {coordinate.name: coordinate for coordinate in tree.coordinates}
        result: dict[str, Floats] = {}
        for label, column in zip(self.labels, self.table.T, strict=True):
            parts = label.split("/")
            name = parts[-2] if len(parts) > 2 and parts[-1] == "value" else parts[-1]
            if name not in kinds or (len(parts) > 1 and parts[-1] not in ("value", name)):
                continue
            if name in result:
                raise InputError(self.path, f"two columns are the coordinate {name!r}", "remove one")
            if kinds[name].is_angle and self.degrees is None:
                remedy = "add a line inDegrees=yes, or inDegrees=no"
                raise InputError(self.path, "the header lacks the unit of angles", remedy)
            result[name] = np.radians(column) if kinds[name].is_angle and self.degrees else column
        if not result:
            problem = f"no column is a coordinate; the columns are {', '.join(self.labels[:8])}"
            raise InputError(self.path, problem, f"the coordinates are {', '.join(kinds) or 'none'}")
        return result


def read_motion_file(path: str | PathLike[str]) -> MotionFile:
    r"""Read a .mot or .sto file of OpenSim or SIMM, or a .csv of time and further columns.

    The header may have the lines of either program; labels follow ``endheader``, rows follow the labels. A
    warning reports a wrong count of rows. As in OpenSim, a file without a version has angles in degrees; so
    has a .csv, which begins with its labels.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist or is no such table, a number is not finite, or times do not ascend; the
        message names the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> from vtkmuscle.opensim import read_motion_file
    >>> file = Path(mkdtemp()) / "knee.mot"
    >>> _ = file.write_text("knee\ninDegrees=yes\nendheader\ntime knee_angle\n0 10\n0.1 20\n")
    >>> read_motion_file(file).table.tolist()
    [[10.0], [20.0]]
    """
    path = Path(path)
    lines = decoded(path).splitlines()
    header, start = ({}, 0) if path.suffix.lower() == ".csv" else _header(lines, path)
    labels = _labels(lines, start, path)
    shown = list(map(quoted, labels))
    rows: list[list[float]] = []
    for number, line in enumerate(lines[start + 1 :], start=start + 2):
        where, cells = f"line {number}", line.replace(",", " ").split()
        if not cells:
            continue
        if len(cells) != len(labels):
            raise InputError(path, f"{where} has {len(cells)} numbers, but there are {len(labels)} labels")
        if len(rows) == MOST_FRAMES:
            raise InputError(path, f"the table has more than {MOST_FRAMES} rows", "leave some out")
        row = [finite_number(cell, label, path, where) for cell, label in zip(cells, shown, strict=True)]
        if rows and row[0] <= rows[-1][0]:
            raise InputError(path, f"{where}: time {row[0]:g} comes after {rows[-1][0]:g}", "sort the rows")
        rows.append(row)
    if not rows:
        raise InputError(path, "the table has no rows", "export it again")
    for key in ("nrows", "datarows"):
        if header.get(key, str(len(rows))) != str(len(rows)):
            words = f"the header says {key}={header[key]}, but the file has {len(rows)} rows; all were read"
            warnings.warn(f"{path}: {words}", stacklevel=2)
    table = np.array(rows)
    return MotionFile(path, table[:, 0], tuple(labels[1:]), table[:, 1:], _in_degrees(header, path))


def _header(lines: list[str], path: Path) -> tuple[dict[str, str], int]:
    """Return header values by key, and the number of lines."""
    header: dict[str, str] = {}
    for number, line in enumerate(lines):
        plain = line.strip()
        if plain.lower() == "endheader":
            return header, number + 1
        key, _, value = plain.partition("=" if "=" in plain else " ")
        header[key.strip().lower()] = value.strip()
    raise InputError(path, "there is no line 'endheader'", "export it again, as .mot, .sto or .csv")


def _labels(lines: list[str], start: int, path: Path) -> list[str]:
    line = lines[start].strip().replace(",", "\t") if start < len(lines) else ""
    labels = [label.strip() for label in (line.split("\t") if "\t" in line else line.split())]
    where = f"line {start + 1}"
    if len(labels) < 2 or labels[0].lower() != "time":
        problem = f"{where}: the labels begin with {quoted(line[:40])}, but must be time and further labels"
        raise InputError(path, problem, "put the time first, and commas or tabs between the columns")
    return labels


def _in_degrees(header: dict[str, str], path: Path) -> bool | None:
    kind = header.get("datatype", "double")
    if kind.lower() != "double":
        raise InputError(path, f"the file holds {quoted(kind)}, but numbers are read", "export joint angles")
    word = header.get("indegrees")
    if word is None:
        return None if "version" in header else True
    if word.lower() not in ("yes", "no", "true", "false"):
        raise InputError(path, f"inDegrees is {quoted(word)}, but must be yes or no")
    return word.lower() in ("yes", "true")
