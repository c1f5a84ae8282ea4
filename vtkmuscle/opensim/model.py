"""Models of OpenSim."""

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
from vtkmuscle.joints.motion_file import MotionFile, read_motion_file
from vtkmuscle.joints.osim import NOT_USED, Frames, bodies_in, model_element, of_kind, point_on, tree_in
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim.muscle_elements import OsimMuscle, muscle_in

__all__ = ["BodyMesh", "Marker", "MotionFile", "OsimModel", "checked_model", "read_motion_file", "read_osim"]


@dataclass(frozen=True, eq=False)
class Marker:
    """A marker with its position (3,) on a body [m]."""

    name: str
    body: str
    position: Floats


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """A mesh file on a body: scale (3,), frame (4, 4)."""

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
    return _model_in(model_element(Path(path)))


def checked_model(path: Path) -> OsimModel:
    """Return a model for further muscles; ValueError before version 4."""
    version = read_xml(path).attributes.get("Version", "0")
    if not version.isdecimal() or int(version) < 40000:
        raise InputError(path, f"the model is of version {version}", "save it again with OpenSim 4")
    return read_osim(path)


def _model_in(model: Element) -> OsimModel:
    not_used: list[str] = []
    bodies, frames = bodies_in(model)
    meshes = [mesh for name, body in bodies for mesh in _meshes(name, body, not_used)]
    tree, joint_of = tree_in(model, frames, not_used)
    for name, (body, _) in frames.items():
        if name == body and name not in tree.bodies:
            raise model.error(f"the body {name!r} has no joint")
    muscles = _muscles(model, frames, tree, not_used)
    not_used += [f"{tag}: {part}" for tag in NOT_USED for part in model.within(tag)]
    for component in [*model.within("ComponentSet"), *model.within("components")]:
        raise component.error("further components are not supported", "remove it")
    markers = _markers(model, frames)
    return OsimModel(model.name, tree, markers, muscles, tuple(meshes), joint_of, tuple(not_used))


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
