"""Models of OpenSim: bodies, joints, couplings, markers, muscles' paths and names of meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.xml_elements import Element, read_xml
from vtkmuscle.opensim.elements import (
    GROUND,
    Frames,
    OsimMuscle,
    coupling_in,
    joint_in,
    muscle_in,
    of_kind,
    offset_frames,
    point_on,
)
from vtkmuscle.opensim.tree import KinematicTree

#: Parts of a model that do not decide where bodies are and muscles run; their contents are listed only.
_NOT_USED = ("ControllerSet", "ContactGeometrySet", "ProbeSet")
_MODEL_KEYS = (
    *("credits", "publications", "length_units", "force_units", "gravity", "assembly_accuracy", "defaults"),
    *("Ground", "BodySet", "JointSet", "ConstraintSet", "ForceSet", "MarkerSet", "ComponentSet"),
    *("ModelVisualPreferences", "components", "FrameGeometry", *_NOT_USED),
)
_INERTIA = [f"inertia_{a}{b}" for a, b in ("xx", "yy", "zz", "xy", "xz", "yz")]
_BODY_KEYS = (
    *("mass", "mass_center", "inertia", *_INERTIA, "Joint", "VisibleObject", "WrapObjectSet"),
    *("FrameGeometry", "attached_geometry", "components", "frames"),
)
#: Names of the unit of length, of which a file may give none.
_METRES = ("meters", "metres", "m", "")


@dataclass(frozen=True, eq=False)
class Marker:
    """A marker on a body: its name, the body's, and where on it (3,)."""

    name: str
    body: str
    place: Floats


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """A mesh of a body: its file's name, its scale (3,), and its frame on the body (4, 4)."""

    body: str
    file: str
    scale: Floats
    frame: Floats


@dataclass(frozen=True, eq=False)
class OsimModel:
    """A model of OpenSim as far as it is understood: lengths in metres, angles in radians.

    Attributes
    ----------
    name : str
        Name of the model.
    tree : KinematicTree
        Its bodies and joints; the root is the ground.
    markers : tuple of Marker
        Points on bodies.
    muscles : dict of str to OsimMuscle
        Muscles and other actuators along a path, by name.
    meshes : tuple of BodyMesh
        Names of files.
    joint_of : dict of str to str
        The joint of each coordinate.
    not_used : tuple of str
        Parts of the file that do not decide where bodies are and muscles run: forces without a path,
        controllers, contact geometry and probes.
    """

    name: str
    tree: KinematicTree
    markers: tuple[Marker, ...]
    muscles: dict[str, OsimMuscle]
    meshes: tuple[BodyMesh, ...]
    joint_of: dict[str, str] = field(default_factory=dict)
    not_used: tuple[str, ...] = ()

    def muscle(self, name: str) -> OsimMuscle:
        """Return a muscle by its name; ValueError if there is none."""
        if name not in self.muscles:
            raise InputError("", f"the model has no muscle {name!r}; {suggestion(name, self.muscles)}")
        return self.muscles[name]


def read_osim(path: str | PathLike[str]) -> OsimModel:
    """Read a model of OpenSim, of version 3 or 4, without OpenSim.

    Parameters
    ----------
    path : path
        An .osim file. Joints of the types Weld, Pin, Slider, Universal, Ball, Gimbal, Planar, Free and Custom
        are understood; functions that are constant, linear, polynomial, piecewise linear, sines, SimmSplines
        and multiples of these; CoordinateCouplerConstraints of one coordinate; path points that are fixed,
        conditional or moving, and paths that are polynomials of coordinates.

    Returns
    -------
    OsimModel
        With all lengths in metres.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no model, or a part that decides where bodies are is not understood; the message names the
        part and its line.

    References
    ----------
    Seth et al. 2018, *OpenSim: Simulating musculoskeletal dynamics and neuromuscular control to study human
    and animal movement*, doi:10.1371/journal.pcbi.1006223.
    """
    path = Path(path)
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
    return _model_in(model)


def checked_model(path: Path) -> OsimModel:
    """Return a model of OpenSim that muscles can be put into; ValueError if it is not of version 4."""
    version = read_xml(path).attributes.get("Version", "0")
    if not version.isdecimal() or int(version) < 40000:
        raise InputError(path, f"the model is of version {version}", "save it again with OpenSim 4")
    return read_osim(path)


def _model_in(model: Element) -> OsimModel:
    not_used: list[str] = []
    bodies, frames = _bodies(model)
    meshes = [mesh for name, body in bodies for mesh in _meshes(name, body, not_used)]
    tree, joint_of = _tree(model, frames, not_used)
    for name, (body, _) in frames.items():
        if name == body and name not in tree.bodies:
            raise model.error(f"the body {name!r} hangs on no joint")
    muscles = _muscles(model, frames, tree, not_used)
    not_used += [f"{tag}: {one}" for tag in _NOT_USED for one in model.within(tag)]
    for tag in ("ComponentSet", "components"):
        for one in model.within(tag):
            raise one.error("further components are not understood", "remove it")
    return OsimModel(
        model.name, tree, _markers(model, frames), muscles, tuple(meshes), joint_of, tuple(not_used)
    )


def _bodies(model: Element) -> tuple[list[tuple[str, Element]], Frames]:
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


def _meshes(name: str, body: Element, not_used: list[str]) -> Iterator[BodyMesh]:
    for one in body.within("attached_geometry"):
        if one.tag == "Mesh":
            scale = one.vector("scale_factors", default=[1, 1, 1])
            yield BodyMesh(name, one.word("mesh_file"), scale, np.eye(4))
        else:
            not_used.append(f"geometry of {name!r}: {one}")
    visible = body.find("VisibleObject")
    if visible is not None:
        scale = visible.vector("scale_factors", default=[1, 1, 1])
        for one in visible.within("GeometrySet"):
            own = one.vector("scale_factors", default=[1, 1, 1])
            turn = one.vector("transform", 6)
            yield BodyMesh(name, one.word("geometry_file"), scale * own, frame_at(turn[3:], turn[:3]))


def _tree(model: Element, frames: Frames, not_used: list[str]) -> tuple[KinematicTree, dict[str, str]]:
    """Return the tree, and the joint of each coordinate."""
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


def _markers(model: Element, frames: Frames) -> tuple[Marker, ...]:
    markers = of_kind("Marker", model.within("MarkerSet"))
    for one in markers:
        one.only(("socket_parent_frame", "body", "location", "fixed", "VisibleObject", "display"))
    return tuple(Marker(one.name, *point_on(one, frames)) for one in markers)


def _muscles(
    model: Element, frames: Frames, tree: KinematicTree, not_used: list[str]
) -> dict[str, OsimMuscle]:
    known = {one.name for one in tree.coordinates}
    found: dict[str, OsimMuscle] = {}
    for one in model.within("ForceSet"):
        muscle = muscle_in(one, frames)
        if muscle is None:
            not_used.append(f"ForceSet: {one}")
            continue
        if one.name in found:
            raise one.error("there is another muscle of this name")
        for name in sorted(muscle.path.named - known):
            raise one.error(f"there is no coordinate {name!r}", suggestion(name, sorted(known)))
        found[one.name] = muscle
    return found
