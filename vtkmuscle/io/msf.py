"""Trees (.msf, .nms) of the Multimod Application Framework and ALBA, at their first time.

A tree is XML, ``<MSF Version="2.0">`` or ``"2.2"``: a ``<Root>`` with ``<Node>`` in ``<Children>``. A node
has a ``Name`` and a ``Type`` such as ``mafVMESurface`` or ``albaVMELandmarkCloud``. Derived from files and
sources of both programs (https://github.com/FusionBox2/MAF2, https://github.com/IOR-BIC/ALBA):

* ``<MatrixVector>`` has the pose in the parent's frame for each time: ``<Matrix TimeStamp="0">`` with 16
numbers, row by row. Computed nodes have 1 ``<Transform>`` instead.
* The landmarks of a cloud are child nodes; positions are the last columns of their poses. The matrix of an
invisible landmark is zero.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.io.csv_table import number_in
from vtkmuscle.io.xml_elements import Element, read_xml

#: Largest component of an axis, a scale of units, and largest coordinate of a position.
_LARGEST, _FARTHEST = 1e4, 1e9


@dataclass(frozen=True, eq=False)
class MsfNode:
    """A node of a tree at its first time.

    ``kind`` is the type without ``mafVME``, ``albaVME`` or ``mflVME``, such as ``"Surface"``; ``pose`` (4, 4)
    is in the parent's frame, in the tree's unit of length.
    """

    name: str
    kind: str
    pose: Floats
    children: tuple[MsfNode, ...]

    def walk(self, frame: Floats | None = None) -> Iterator[tuple[MsfNode, Floats]]:
        """Yield all nodes with poses (4, 4) in the tree's frame."""
        here = self.pose if frame is None else frame @ self.pose
        yield self, here
        for child in self.children:
            yield from child.walk(here)


def read_msf(path: str | PathLike[str]) -> MsfNode:
    """Return the root of a .msf or .nms tree; its surfaces are files by themselves.

    Raises
    ------
    FileNotFoundError, InputError
        If the file does not exist, is no tree of version 2, or has a document type or an invalid pose; the
        message names the line.
    """
    tree = read_xml(Path(path))
    version = tree.attributes.get("Version", "")
    if tree.tag != "MSF" or not version.startswith("2"):
        problem = f"is {tree.tag} {quoted(version)}, not a tree (MSF) of version 2"
        raise tree.error(problem, "save it with a newer version of its program")
    return _node(tree.need("Root"))


def landmarks_of(root: MsfNode) -> dict[str, dict[str, Floats]]:
    """Return visible landmarks (3,) by cloud and name, in the tree's frame."""
    clouds: dict[str, dict[str, Floats]] = {}
    for cloud, pose in root.walk():
        if cloud.kind == "LandmarkCloud":
            points: dict[str, Floats] = {}
            for node in cloud.children:
                if node.kind == "Landmark" and node.pose[:3, :3].any():
                    points[_unused(node.name, points)] = (pose @ node.pose)[:3, 3]
            clouds[_unused(cloud.name, clouds)] = points
    return clouds


def _node(element: Element) -> MsfNode:
    kind = re.sub(r"^(maf|alba|mfl)VME", "", element.attributes.get("Type", ""))
    poses = [(_time(matrix), _pose(matrix, kind)) for matrix in _children(element, "MatrixVector", "Matrix")]
    if not poses and (single := element.find("Transform")) is not None:
        poses = [(0.0, _pose(single, kind))]
    return MsfNode(
        element.attributes.get("Name", ""),
        kind,
        min(poses, key=lambda item: item[0], default=(0.0, np.eye(4)))[1],
        tuple(map(_node, _children(element, "Children", "Node"))),
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
        problem += f"{_LARGEST:g}, and the position no farther than {_FARTHEST:g}"
        raise element.error(problem, "correct it")
    return pose


def _unused(name: str, taken: Container[str]) -> str:
    """Return a free name, with a number if necessary."""
    number, candidate = 1, name
    while candidate in taken:
        number += 1
        candidate = f"{name} ({number})"
    return candidate
