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
from vtkmuscle.joints.motion_file import MotionFile, read_motion_file
from vtkmuscle.joints.osim import NOT_USED, Frames, bodies_in, model_element, of_kind, point_on, tree_in
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim.muscle_elements import OsimMuscle, muscle_in

__all__ = ["BodyMesh", "Marker", "MotionFile", "OsimModel", "checked_model", "read_motion_file", "read_osim"]


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
    return _model_in(model_element(Path(path)))


def checked_model(path: Path) -> OsimModel:
    """Return a model of OpenSim that muscles can be put into; ValueError if it is not of version 4."""
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
            raise model.error(f"the body {name!r} hangs on no joint")
    muscles = _muscles(model, frames, tree, not_used)
    not_used += [f"{tag}: {one}" for tag in NOT_USED for one in model.within(tag)]
    for tag in ("ComponentSet", "components"):
        for one in model.within(tag):
            raise one.error("further components are not understood", "remove it")
    return OsimModel(
        model.name, tree, _markers(model, frames), muscles, tuple(meshes), joint_of, tuple(not_used)
    )


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
