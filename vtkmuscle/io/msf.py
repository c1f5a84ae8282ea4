"""Landmarks in trees (.msf, .nms) of the Multimod Application Framework and ALBA, at their first time.

A tree is XML, ``<MSF Version="2.0">`` or ``"2.2"``: a ``<Root>`` with ``<Node>`` in ``<Children>``. A node
has a ``Name`` and a ``Type`` such as ``mafVMESurface`` or ``albaVMELandmarkCloud``. Derived from files and
sources of both programs (https://github.com/FusionBox2/MAF2, https://github.com/IOR-BIC/ALBA):

* ``<MatrixVector>`` has the pose in the parent's frame for each time: ``<Matrix TimeStamp="0">`` with 16
numbers, row by row. Computed nodes have 1 ``<Transform>`` instead.
* The landmarks of a cloud are child nodes; positions are the last columns of their poses. The matrix of an
invisible landmark is zero.
"""

from collections.abc import Container
from itertools import chain, count
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.io.csv_table import finite_number
from vtkmuscle.io.xml_elements import Element, read_xml

#: Largest number of a pose: far more than a length in micrometres, or a scale of units.
_LARGEST = 1e9

Clouds = dict[str, dict[str, Floats]]


def read_msf(path: str | PathLike[str]) -> Clouds:
    """Read visible landmarks (3,) of a tree by cloud and name. In the tree's frame and unit.

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
    clouds: Clouds = {}
    _add_landmarks(tree.need("Root"), np.eye(4), clouds, {})
    return clouds


def _add_landmarks(element: Element, frame: Floats, clouds: Clouds, cloud: dict[str, Floats]) -> None:
    """Add the landmarks of a node and its children; ``frame`` and ``cloud`` are its parent's."""
    kind, name = element.attributes.get("Type", ""), element.attributes.get("Name", "")
    own = _pose(element, kind)
    if kind.endswith("VMELandmark") and own[:3, :3].any():
        cloud[_unused(name, cloud)] = (frame @ own)[:3, 3]
    cloud = {}
    if kind.endswith("VMELandmarkCloud"):
        clouds[_unused(name, clouds)] = cloud
    for child in _children(element, "Children", "Node"):
        _add_landmarks(child, frame @ own, clouds, cloud)


def _pose(element: Element, kind: str) -> Floats:
    """Return the pose (4, 4) of a node at its first time, in the parent's frame."""
    matrices = _children(element, "MatrixVector", "Matrix")
    if not matrices and (single := element.find("Transform")) is not None:
        matrices = [single]
    times = [(each.attributes.get("TimeStamp", "0"), "TimeStamp", each.path, str(each)) for each in matrices]
    poses = [(finite_number(*time), _matrix(each, kind)) for time, each in zip(times, matrices, strict=True)]
    return min(poses, key=lambda pose: pose[0], default=(0.0, np.eye(4)))[1]


def _children(element: Element, holder: str, tag: str) -> list[Element]:
    return [child for child in element.within(holder) if child.tag == tag]


def _matrix(element: Element, kind: str) -> Floats:
    pose = element.numbers(16).reshape(4, 4)
    large = np.abs(pose).max() > _LARGEST
    singular = not large and abs(np.linalg.det(pose[:3, :3])) < 1e-12
    if (pose[3] != (0.0, 0.0, 0.0, 1.0)).any() or large or (singular and not kind.endswith("Landmark")):
        problem = "is no pose: the last row must be 0 0 0 1, the axes independent, and all numbers at most "
        problem += f"{_LARGEST:g}"
        raise element.error(problem, "correct it")
    return pose


def _unused(name: str, taken: Container[str]) -> str:
    """Return a free name, with a number if necessary."""
    numbered = (f"{name} ({number})" for number in count(2))
    return next(free for free in chain([name], numbered) if free not in taken)
