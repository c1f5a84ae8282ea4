"""Models of OpenSim: bodies, joints, couplings, markers, muscle paths and mesh names."""

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

#: Parts of a model that affect neither body poses nor paths; only their contents are listed.
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
#: Accepted length units; a file may leave the unit empty.
_METRES = ("meters", "metres", "m", "")


@dataclass(frozen=True, eq=False)
class Marker:
    """A marker with its position (3,) on a body [m]."""

    name: str
    body: str
    position: Floats


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """A mesh file with its scale (3,) and frame (4, 4) on a body."""

    body: str
    file: str
    scale: Floats
    frame: Floats


@dataclass(frozen=True, eq=False)
class OsimModel:
    """A model of OpenSim, in metres and radians.

    Attributes
    ----------
    name : str
        Name of the model.
    tree : KinematicTree
        Bodies and joints; the root is the ground.
    markers : tuple of Marker
        Points on bodies.
    muscles : dict of str to OsimMuscle
        Muscles and other actuators along a path, by name.
    meshes : tuple of BodyMesh
        Names of mesh files.
    joint_of : dict of str to str
        Joint of each coordinate.
    not_used : tuple of str
        Parts of the file without effect here: forces without a path, controllers, contact geometry, probes.
    """

    name: str
    tree: KinematicTree
    markers: tuple[Marker, ...]
    muscles: dict[str, OsimMuscle]
    meshes: tuple[BodyMesh, ...]
    joint_of: dict[str, str] = field(default_factory=dict)
    not_used: tuple[str, ...] = ()

    def muscle(self, name: str) -> OsimMuscle:
        """Return a muscle by name; ValueError for an unknown name."""
        if name not in self.muscles:
            raise InputError("", f"the model has no muscle {name!r}; {suggestion(name, self.muscles)}")
        return self.muscles[name]


def read_osim(path: str | PathLike[str]) -> OsimModel:
    """Read a model of OpenSim 3 or 4, without OpenSim.

    Parameters
    ----------
    path : path
        An .osim file. Supported: joints Weld, Pin, Slider, Universal, Ball, Gimbal, Planar, Free and
        Custom; constant, linear, polynomial, piecewise linear, sine and SimmSpline functions and
        multiples of a function; CoordinateCouplerConstraints of 1 coordinate; fixed, conditional and
        moving path points; paths as polynomials of coordinates.

    Returns
    -------
    OsimModel
        All lengths in metres.

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
    path = Path(path)
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
    return _model_in(model)


def checked_model(path: Path) -> OsimModel:
    """Return a model for further muscles; ValueError before version 4."""
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
            raise model.error(f"the body {name!r} has no joint")
    muscles = _muscles(model, frames, tree, not_used)
    not_used += [f"{tag}: {part}" for tag in _NOT_USED for part in model.within(tag)]
    for component in [*model.within("ComponentSet"), *model.within("components")]:
        raise component.error("further components are not supported", "remove it")
    markers = _markers(model, frames)
    return OsimModel(model.name, tree, markers, muscles, tuple(meshes), joint_of, tuple(not_used))


def _bodies(model: Element) -> tuple[list[tuple[str, Element]], Frames]:
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


def _meshes(name: str, body: Element, not_used: list[str]) -> Iterator[BodyMesh]:
    for mesh in body.within("attached_geometry"):
        if mesh.tag == "Mesh":
            scale = mesh.vector("scale_factors", default=[1, 1, 1])
            yield BodyMesh(name, mesh.word("mesh_file"), scale, np.eye(4))
        else:
            not_used.append(f"geometry of {name!r}: {mesh}")
    visible = body.find("VisibleObject")
    if visible is not None:
        scale = visible.vector("scale_factors", default=[1, 1, 1])
        for mesh in visible.within("GeometrySet"):
            own = mesh.vector("scale_factors", default=[1, 1, 1])
            transform = mesh.vector("transform", 6)
            frame = frame_at(transform[3:], transform[:3])
            yield BodyMesh(name, mesh.word("geometry_file"), scale * own, frame)


def _tree(model: Element, frames: Frames, not_used: list[str]) -> tuple[KinematicTree, dict[str, str]]:
    """Return the tree, and the joint of each coordinate."""
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


def _markers(model: Element, frames: Frames) -> tuple[Marker, ...]:
    markers = of_kind("Marker", model.within("MarkerSet"))
    for marker in markers:
        marker.only(("socket_parent_frame", "body", "location", "fixed", "VisibleObject", "display"))
    return tuple(Marker(marker.name, *point_on(marker, frames)) for marker in markers)


def _muscles(
    model: Element, frames: Frames, tree: KinematicTree, not_used: list[str]
) -> dict[str, OsimMuscle]:
    coordinates = {coordinate.name for coordinate in tree.coordinates}
    muscles: dict[str, OsimMuscle] = {}
    for force in model.within("ForceSet"):
        muscle = muscle_in(force, frames)
        if muscle is None:
            not_used.append(f"ForceSet: {force}")
            continue
        if force.name in muscles:
            raise force.error("another muscle has this name")
        for name in sorted(muscle.path.named - coordinates):
            raise force.error(f"there is no coordinate {name!r}", suggestion(name, sorted(coordinates)))
        muscles[force.name] = muscle
    return muscles
