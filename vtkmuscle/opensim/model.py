"""Models of OpenSim: bodies, joints, couplings, markers, muscles' paths and names of meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.xml_elements import Element, read_xml
from vtkmuscle.opensim.elements import Frames, OsimMuscle, coupling_in, joint_in, muscle_in, offset_frames
from vtkmuscle.opensim.tree import Coupling, Joint, JointCoordinate, KinematicTree

#: Parts of a model that say nothing of where bodies are and muscles run; what is in them is named.
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
#: Metres per unit of length that a model may name.
_METRES = {"meters": 1.0, "metres": 1.0, "m": 1.0, "": 1.0, "millimeters": 1e-3, "mm": 1e-3}


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
    """What is understood of a model: lengths in metres, angles in radians.

    Attributes
    ----------
    name : str
        Of the model.
    tree : KinematicTree
        Its bodies and joints; the root is the ground.
    markers : tuple of Marker
        Points on bodies.
    muscles : dict of str to OsimMuscle
        All that acts along a path, by name.
    meshes : tuple of BodyMesh
        Names of files.
    joint_of : dict of str to str
        The joint of each coordinate.
    not_used : tuple of str
        Parts of the file that say nothing of where bodies are and muscles run: forces without a path,
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
        """Return a muscle by its name.

        Raises
        ------
        ValueError
            If there is none of that name.
        """
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
        If it is no model, or there is something that decides where bodies are and is not understood; the
        message names it and its line.

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
        raise model.need("length_units").error(f"there is no unit {units!r}", "give meters")
    if _METRES[units] != 1.0:
        raise model.error("lengths other than metres are not understood", "convert the model to metres")
    return _Reader(model).read()


def checked_model(path: Path) -> OsimModel:
    """Return a model of OpenSim that muscles can be put into.

    Raises
    ------
    ValueError
        If the file is no model, or not of version 4.
    """
    version = read_xml(path).attributes.get("Version", "0")
    if not version.isdecimal() or int(version) < 40000:
        raise InputError(path, f"the model is of version {version}", "save it again with OpenSim 4")
    return read_osim(path)


class _Reader:
    """Goes through a model once."""

    def __init__(self, model: Element) -> None:
        self.model = model
        self.frames = Frames()
        self.joints: list[tuple[Element, Joint]] = []
        self.coordinates: list[JointCoordinate] = []
        self.meshes: list[BodyMesh] = []
        self.not_used: list[str] = []
        self.joint_of: dict[str, str] = {}

    def read(self) -> OsimModel:
        self._bodies()
        self._joints()
        tree = self._tree()
        muscles = self._muscles(tree)
        for tag in _NOT_USED:
            self.not_used += [f"{tag}: {one}" for one in self.model.within(tag)]
        for tag in ("ComponentSet", "components"):
            for one in self.model.within(tag):
                raise one.error("further components are not understood", "remove it")
        return OsimModel(
            self.model.name,
            tree,
            tuple(self._markers()),
            muscles,
            tuple(self.meshes),
            self.joint_of,
            tuple(self.not_used),
        )

    def _bodies(self) -> None:
        ground = self.model.find("Ground")
        found = self.model.within("BodySet")
        for body in found:
            if body.tag != "Body":
                raise body.error("is not understood among bodies")
            if body.name in self.frames.on_bodies:
                raise body.error("there is another body of this name")
            body.only(_BODY_KEYS)
            self.frames.on_bodies[body.name] = (body.name, np.eye(4))
        if ground is not None:
            self.frames.on_bodies[self.frames.ground] = (self.frames.ground, np.eye(4))
        for body in [*found, *([] if ground is None else [ground])]:
            name = body.name or self.frames.ground
            for holder in ("components", "frames"):
                self.frames.on_bodies.update(offset_frames(body.within(holder), self.frames))
            self._meshes_of(body, name)

    def _meshes_of(self, body: Element, name: str) -> None:
        for one in body.within("attached_geometry"):
            if one.tag != "Mesh":
                self.not_used.append(f"geometry of {name!r}: {one}")
                continue
            file = one.word("mesh_file")
            self.meshes.append(
                BodyMesh(name, file, one.vector("scale_factors", default=[1, 1, 1]), np.eye(4))
            )
        visible = body.find("VisibleObject")
        if visible is None:
            return
        scale = visible.vector("scale_factors", default=[1, 1, 1])
        for one in visible.within("GeometrySet"):
            own = one.vector("scale_factors", default=[1, 1, 1])
            turn = one.vector("transform", 6)
            frame = frame_at(turn[3:], turn[:3])
            self.meshes.append(BodyMesh(name, one.word("geometry_file"), scale * own, frame))

    def _joints(self) -> None:
        found: list[tuple[Element, str | None]] = [(one, None) for one in self.model.within("JointSet")]
        for body in self.model.within("BodySet"):
            found += [(one, body.name) for one in body.within("Joint")]
        for element, child in found:
            joint, coordinates = joint_in(element, self.frames, child)
            self.joints.append((element, joint))
            self.coordinates += coordinates
            self.joint_of.update({one.name: joint.name for one in coordinates})

    def _tree(self) -> KinematicTree:
        couplings: list[Coupling] = []
        for one in self.model.within("ConstraintSet"):
            coupling = coupling_in(one)
            if coupling is None:
                self.not_used.append(f"switched off: {one}")
            else:
                couplings.append(coupling)
        try:
            tree = KinematicTree(
                self.frames.ground, [joint for _, joint in self.joints], self.coordinates, couplings
            )
        except ValueError as error:
            raise self.model.placed(error) from error
        loose = [name for name, (body, _) in self.frames.on_bodies.items() if body == name]
        for name in loose:
            if name not in tree.bodies:
                raise self.model.error(f"the body {name!r} hangs on no joint")
        return tree

    def _markers(self) -> list[Marker]:
        markers = []
        for one in self.model.within("MarkerSet"):
            if one.tag != "Marker":
                raise one.error("is not understood among markers")
            one.only(("socket_parent_frame", "body", "location", "fixed", "VisibleObject", "display"))
            asked = one.need("socket_parent_frame", "body")
            body, frame = self.frames.find(asked.text, asked)
            place = frame[:3, :3] @ one.need("location").numbers(3) + frame[:3, 3]
            markers.append(Marker(one.name, body, place))
        return markers

    def _muscles(self, tree: KinematicTree) -> dict[str, OsimMuscle]:
        known = {one.name for one in tree.coordinates}
        found: dict[str, OsimMuscle] = {}
        for one in self.model.within("ForceSet"):
            muscle = muscle_in(one, self.frames)
            if muscle is None:
                self.not_used.append(f"ForceSet: {one}")
                continue
            if one.name in found:
                raise one.error("there is another muscle of this name")
            points = getattr(muscle.path, "points", ())
            names = {name for point in points for name in point.coordinates if name is not None}
            names |= {point.only_in[0] for point in points if point.only_in is not None}
            names |= set(getattr(muscle.path, "names", ()))
            for name in sorted(names - known):
                raise one.error(f"there is no coordinate {name!r}", suggestion(name, sorted(known)))
            found[one.name] = muscle
        return found
