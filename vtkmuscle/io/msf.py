"""Trees (.msf) of the Multimod Application Framework and ALBA.

A tree (.msf) is XML, ``<MSF Version="2.0">`` or ``"2.2"``: a ``<Root>`` with ``<Node>`` in ``<Children>``. A
node has a ``Name`` and a ``Type`` such as ``mafVMESurface`` or ``albaVMELandmarkCloud``. Derived from files
and sources of both programs (https://github.com/FusionBox2/MAF2, https://github.com/IOR-BIC/ALBA):

* ``<DataVector>`` names a VTK file for each time, in the tree's folder: ``<VItem>`` with ``<URL>``,
``<DataType>``, ``<TimeStamp>`` and ``<Crypting>``; a ``.zvtk`` is a VTK file in a ZIP archive.
* ``<MatrixVector>`` has the pose in the parent's frame for each time: ``<Matrix TimeStamp="0">`` with 16
numbers, row by row. Computed nodes have 1 ``<Transform>`` instead.
* The landmarks of a cloud are child nodes; positions are the last columns of their poses. The matrix of an
invisible landmark is zero.
* In older trees a cloud can be closed (the tag ``MFL_VME_LANDMARK_CLOUD_STATE`` is 1): its landmarks are the
points of its VTK file, numbered here, because the tags with their names are undocumented.

``.nms`` files have the same format. Encrypted files, and files in a shared archive (``SingleFileMode``), are
refused. A pose holds until the next pose, and the first pose also before.
"""

from __future__ import annotations

import re
import tempfile
import zipfile
from collections.abc import Container, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import MOST_BYTES, InputError, check_is_file
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io.csv_table import number_in
from vtkmuscle.io.surfaces import read_polydata
from vtkmuscle.io.xml_elements import Element, read_xml

#: Suffixes of trees.
TREE_SUFFIXES = (".msf", ".nms")

#: Largest component of an axis, a scale of units, and largest coordinate of a position.
_LARGEST, _FARTHEST = 1e4, 1e9

_CLOSED = "MFL_VME_LANDMARK_CLOUD_STATE"


@dataclass(frozen=True, eq=False)
class MsfFile:
    """A node's file: time [s], path, kind of VTK data."""

    time: float
    path: Path
    kind: str


@dataclass(frozen=True, eq=False)
class MsfNode:
    """A node of a tree.

    Attributes
    ----------
    name, kind : str
        Name, and type without ``mafVME``, ``albaVME`` or ``mflVME``, such as ``"Surface"``.
    times : (t,) array
        Times of poses [s]; empty for a node fixed to its parent.
    poses : (t, 4, 4) array
        In the parent's frame, in the tree's unit of length.
    files : tuple of MsfFile
        By time.
    children : tuple of MsfNode
        In the order of the file.
    closed : bool
        Whether the node is a closed cloud, with its landmarks in a file.
    """

    name: str
    kind: str
    times: Floats
    poses: Floats
    files: tuple[MsfFile, ...]
    children: tuple[MsfNode, ...]
    closed: bool = False

    def pose(self, time: float | None = None) -> Floats:
        """Return the pose (4, 4) in the parent's frame.

        The default is the first time.
        """
        if not len(self.times):
            return np.eye(4)
        last = 0 if time is None else int(np.searchsorted(self.times, time, side="right")) - 1
        pose: Floats = self.poses[max(last, 0)]
        return pose

    def file(self, time: float | None = None) -> MsfFile | None:
        """Return the file at a time, or None.

        The default is the first time.
        """
        if not self.files:
            return None
        before = [file for file in self.files if time is not None and file.time <= time]
        return before[-1] if before else self.files[0]

    def walk(
        self, time: float | None = None, frame: Floats | None = None
    ) -> Iterator[tuple[MsfNode, Floats]]:
        """Yield all nodes with poses (4, 4) in the tree's frame."""
        here = self.pose(time) if frame is None else frame @ self.pose(time)
        yield self, here
        for child in self.children:
            yield from child.walk(time, here)


def read_msf(path: str | PathLike[str]) -> MsfNode:
    """Return the root of a .msf or .nms tree.

    Files named in the tree are not opened.

    Raises
    ------
    FileNotFoundError, InputError
        If the file does not exist, is no tree of version 2, has a document type, an invalid pose, or the
        name of a file outside its folder; the message names the line.
    """
    path = Path(path)
    tree = read_xml(path)
    version = tree.attributes.get("Version", "")
    if tree.tag != "MSF" or not version.startswith("2"):
        problem = f"is {tree.tag} {quoted(version)}, not a tree (MSF) of version 2"
        raise tree.error(problem, "save it with a newer version of its program")
    return _node(tree.need("Root"), path.parent)


def surfaces_of(root: MsfNode, time: float | None = None) -> dict[str, vtkPolyData]:
    """Return surfaces and polylines in the tree's frame.

    The default is the first time. Repeated names get a number. Clouds, volumes and other data are omitted.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file does not exist or cannot be read.
    """
    surfaces: dict[str, vtkPolyData] = {}
    for node, pose in root.walk(time):
        file = node.file(time)
        if file is not None and file.kind == "vtkPolyData" and node.kind != "LandmarkCloud":
            data = _polydata(file.path)
            surfaces[_unused(node.name, surfaces)] = with_points(data, apply_transform(pose, points_of(data)))
    return surfaces


def landmarks_of(root: MsfNode, time: float | None = None) -> dict[str, dict[str, Floats]]:
    """Return visible landmarks (3,) by cloud and name.

    Positions are in the tree's frame, at the first time by default.
    """
    clouds: dict[str, dict[str, Floats]] = {}
    for cloud, pose in root.walk(time):
        if cloud.kind != "LandmarkCloud":
            continue
        points: dict[str, Floats] = {}
        file = cloud.file(time)
        if cloud.closed and file is not None:
            positions = apply_transform(pose, points_of(_polydata(file.path)))
            points = {str(number): position for number, position in enumerate(positions)}
        for node in cloud.children:
            if node.kind == "Landmark" and node.pose(time)[:3, :3].any():
                points[_unused(node.name, points)] = (pose @ node.pose(time))[:3, 3]
        clouds[_unused(cloud.name, clouds)] = points
    return clouds


def _node(element: Element, folder: Path) -> MsfNode:
    kind = re.sub(r"^(maf|alba|mfl)VME", "", element.attributes.get("Type", ""))
    timed = [(_time(matrix), _pose(matrix, kind)) for matrix in _children(element, "MatrixVector", "Matrix")]
    if not timed and (single := element.find("Transform")) is not None:
        timed = [(0.0, _pose(single, kind))]
    timed.sort(key=lambda pair: pair[0])
    vector = element.find("DataVector")
    if vector is not None and vector.attributes.get("SingleFileMode", "").lower() in ("true", "1"):
        raise vector.error("all its files are in an archive", "save the tree with separate files")
    files = [_file(item, folder) for item in _children(element, "DataVector", "VItem")]
    children = _children(element, "Children", "Node")
    return MsfNode(
        name=element.attributes.get("Name", ""),
        kind=kind,
        times=np.array([time for time, _ in timed]),
        poses=np.reshape([pose for _, pose in timed], (-1, 4, 4)),
        files=tuple(sorted(files, key=lambda file: file.time)),
        children=tuple(_node(child, folder) for child in children),
        closed=_tag(element, _CLOSED) == "1",
    )


def _children(element: Element, holder: str, tag: str) -> list[Element]:
    return [child for child in element.within(holder) if child.tag == tag]


def _time(element: Element) -> float:
    text = element.attributes.get("TimeStamp", "0")
    time = number_in(text)
    if not np.isfinite(time):
        raise element.error(f"its TimeStamp is {quoted(text)}, but must be a finite number", "correct it")
    return time


def _pose(element: Element, kind: str) -> Floats:
    pose = element.numbers(16).reshape(4, 4)
    large = np.abs(pose[:3, :3]).max() > _LARGEST or np.abs(pose).max() > _FARTHEST
    singular = not large and abs(np.linalg.det(pose[:3, :3])) < 1e-12
    if (pose[3] != (0.0, 0.0, 0.0, 1.0)).any() or large or (singular and kind != "Landmark"):
        problem = "is no pose: the last row must be 0 0 0 1, the axes independent and no longer than "
        raise element.error(
            f"{problem}{_LARGEST:g}, and the position no farther than {_FARTHEST:g}", "correct it"
        )
    return pose


def _file(item: Element, folder: Path) -> MsfFile:
    if item.word("Crypting").lower() in ("true", "1"):
        raise item.error("its file is encrypted", "save the tree without encryption")
    name, time = item.word("URL"), float(item.number("TimeStamp", 0.0))
    windows = PureWindowsPath(name)
    outside = windows.drive or windows.root or ".." in {*PurePosixPath(name).parts, *windows.parts}
    path = folder / name
    if not name or outside or "\0" in name or not path.resolve().is_relative_to(folder.resolve()):
        problem = f"its file {quoted(name)} lies outside the folder of the tree"
        raise item.error(problem, "move the file to the folder, and name the file without a folder")
    return MsfFile(time, path, item.word("DataType"))


def _tag(element: Element, name: str) -> str:
    """Return the value of a node's tag, or ""."""
    for array in _children(element, "Attributes", "Item"):
        for tag in array.children:
            if tag.tag == "TItem" and tag.attributes.get("Name") == name:
                value = tag.find("TItem")
                return "" if value is None else value.word("TC")
    return ""


def _unused(name: str, taken: Container[str]) -> str:
    """Return a free name, with a number if necessary."""
    number, candidate = 1, name
    while candidate in taken:
        number += 1
        candidate = f"{name} ({number})"
    return candidate


def _polydata(path: Path) -> vtkPolyData:
    if path.suffix.lower() != ".zvtk":
        return read_polydata(path)
    check_is_file(path)
    try:
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            members = archive.infolist()
            if len(members) != 1 or members[0].file_size > MOST_BYTES:
                problem = (
                    f"the archive has {len(members)} files, or is too large; it must contain 1 .vtk file"
                )
                raise InputError(path, problem, "save the tree again")
            unzipped = Path(folder) / "data.vtk"
            unzipped.write_bytes(archive.read(members[0]))
            return read_polydata(unzipped)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(path, f"the archive cannot be read: {error}", "save the tree again") from error
