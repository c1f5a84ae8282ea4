"""Trees of the Multimod Application Framework (MAF 2) and of ALBA: surfaces, landmarks and their poses.

A tree (.msf) is XML, ``<MSF Version="2.0">`` or ``"2.2"``: a ``<Root>`` with ``<Node>`` in ``<Children>``,
each with a ``Name`` and a ``Type`` such as ``mafVMESurface`` or ``albaVMELandmarkCloud``. By files and
sources of both (https://github.com/FusionBox2/MAF2, https://github.com/IOR-BIC/ALBA):

* ``<DataVector>`` names a VTK file for each time, beside the tree: ``<VItem>`` with ``<URL>``,
  ``<DataType>``, ``<TimeStamp>`` and ``<Crypting>``; a ``.zvtk`` is such a file in a ZIP archive of its own.
* ``<MatrixVector>`` has the pose in the frame of the parent for each time: ``<Matrix TimeStamp="0">`` with 16
  numbers, row by row. Computed nodes have one ``<Transform>`` instead.
* The landmarks of a cloud are nodes in it, their positions the last columns of their poses; the matrix of an
  invisible landmark is zero.
* In older trees a cloud can be closed (the tag ``MFL_VME_LANDMARK_CLOUD_STATE`` is 1): its landmarks are the
  points of its VTK file. Which tags name them is not known: they are numbered.

``.nms`` is read as the same format. Encrypted files, and files that share one archive (``SingleFileMode``),
are refused. A pose holds until the next; before the first the first holds.
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

#: What a component of an axis may be, and a place: scales are of units.
_LARGEST, _FARTHEST = 1e4, 1e9

_CLOSED = "MFL_VME_LANDMARK_CLOUD_STATE"


@dataclass(frozen=True, eq=False)
class MsfFile:
    """A file of a node: its time [s], its path, and its kind of VTK data."""

    time: float
    path: Path
    kind: str


@dataclass(frozen=True, eq=False)
class MsfNode:
    """A node of a tree.

    Attributes
    ----------
    name, kind : str
        The kind is the node's type without ``mafVME``, ``albaVME`` or ``mflVME``, such as ``"Surface"``.
    times : (t,) array
        Of the poses [s]; empty for a node that stays in its parent's frame.
    poses : (t, 4, 4) array
        In the frame of the parent, lengths in the unit of the tree.
    files : tuple of MsfFile
        By time.
    children : tuple of MsfNode
        In the order of the file.
    closed : bool
        Whether it is a cloud of landmarks that are the points of its file.
    """

    name: str
    kind: str
    times: Floats
    poses: Floats
    files: tuple[MsfFile, ...]
    children: tuple[MsfNode, ...]
    closed: bool = False

    def pose(self, time: float | None = None) -> Floats:
        """Return the pose (4, 4) in the frame of the parent at a time, by default the first."""
        if not len(self.times):
            return np.eye(4)
        last = 0 if time is None else int(np.searchsorted(self.times, time, side="right")) - 1
        found: Floats = self.poses[max(last, 0)]
        return found

    def file(self, time: float | None = None) -> MsfFile | None:
        """Return the file at a time, by default the first; None where there is none."""
        if not self.files:
            return None
        before = [file for file in self.files if time is not None and file.time <= time]
        return before[-1] if before else self.files[0]

    def walk(
        self, time: float | None = None, frame: Floats | None = None
    ) -> Iterator[tuple[MsfNode, Floats]]:
        """Give this node and all below it, each with its pose (4, 4) in the frame of the tree."""
        here = self.pose(time) if frame is None else frame @ self.pose(time)
        yield self, here
        for child in self.children:
            yield from child.walk(time, here)


def read_msf(path: str | PathLike[str]) -> MsfNode:
    """Return the root of a tree in a .msf or .nms file; the files that it names are not opened.

    Raises
    ------
    FileNotFoundError, InputError
        If there is no such file, it is no tree of version 2, has a document type, names a file outside its
        folder, or has an invalid pose; the message names the line.
    """
    path = Path(path)
    tree = read_xml(path)
    version = tree.attributes.get("Version", "")
    if tree.tag != "MSF" or not version.startswith("2"):
        problem = f"is {tree.tag} {quoted(version)}, not a tree (MSF) of version 2"
        raise tree.error(problem, "save it with a newer version of its program")
    return _node(tree.need("Root"), path.parent)


def surfaces_of(root: MsfNode, time: float | None = None) -> dict[str, vtkPolyData]:
    """Return the surfaces and polylines of a tree at a time, by default the first, in the tree's frame.

    Repeated names get a number. Other data, such as volumes, and clouds are left out.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file does not exist or cannot be read.
    """
    found: dict[str, vtkPolyData] = {}
    for node, pose in root.walk(time):
        file = node.file(time)
        if file is not None and file.kind == "vtkPolyData" and node.kind != "LandmarkCloud":
            data = _polydata(file.path)
            found[_unused(node.name, found)] = with_points(data, apply_transform(pose, points_of(data)))
    return found


def landmarks_of(root: MsfNode, time: float | None = None) -> dict[str, dict[str, Floats]]:
    """Return the visible landmarks (3,) at a time, by cloud and by name, in the tree's frame."""
    found: dict[str, dict[str, Floats]] = {}
    for cloud, pose in root.walk(time):
        if cloud.kind != "LandmarkCloud":
            continue
        points: dict[str, Floats] = {}
        file = cloud.file(time)
        if cloud.closed and file is not None:
            places = apply_transform(pose, points_of(_polydata(file.path)))
            points = {str(number): place for number, place in enumerate(places)}
        for node in cloud.children:
            if node.kind == "Landmark" and node.pose(time)[:3, :3].any():
                points[_unused(node.name, points)] = (pose @ node.pose(time))[:3, 3]
        found[_unused(cloud.name, found)] = points
    return found


def _node(element: Element, folder: Path) -> MsfNode:
    kind = re.sub(r"^(maf|alba|mfl)VME", "", element.attributes.get("Type", ""))
    timed = [(_time(one), _pose(one, kind)) for one in _children(element, "MatrixVector", "Matrix")]
    if not timed and (single := element.find("Transform")) is not None:
        timed = [(0.0, _pose(single, kind))]
    timed.sort(key=lambda pair: pair[0])
    vector = element.find("DataVector")
    if vector is not None and vector.attributes.get("SingleFileMode", "").lower() in ("true", "1"):
        raise vector.error("all its files are in one archive", "save the tree with files of their own")
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
        problem = "is no pose: its last row must be 0 0 0 1, its axes must not lie in a plane, nor be longer "
        problem += f"than {_LARGEST:g}, and its position must not be farther than {_FARTHEST:g}"
        raise element.error(problem, "correct it")
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
        raise item.error(problem, "put it there, and name it without its folder")
    return MsfFile(time, path, item.word("DataType"))


def _tag(element: Element, name: str) -> str:
    """Return the value of a node's tag, "" where it has none of that name."""
    for array in _children(element, "Attributes", "Item"):
        for tag in array.children:
            if tag.tag == "TItem" and tag.attributes.get("Name") == name:
                value = tag.find("TItem")
                return "" if value is None else value.word("TC")
    return ""


def _unused(name: str, taken: Container[str]) -> str:
    """Return a name that is not taken, with a number if need be."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} ({number})"
    return free


def _polydata(path: Path) -> vtkPolyData:
    if path.suffix.lower() != ".zvtk":
        return read_polydata(path)
    check_is_file(path)
    try:
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            members = archive.infolist()
            if len(members) != 1 or members[0].file_size > MOST_BYTES:
                problem = f"the archive holds {len(members)} files, or too large a one, and not one .vtk file"
                raise InputError(path, problem, "save the tree again")
            unzipped = Path(folder) / "data.vtk"
            unzipped.write_bytes(archive.read(members[0]))
            return read_polydata(unzipped)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(path, f"the archive cannot be read: {error}", "save the tree again") from error
