"""Landmark clouds of NMSBuilder's trees of data (.nms, .msf)."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import shown
from vtkmuscle.io.xml_elements import Element, read_xml

_CLOUD, _LANDMARK = "VMELandmarkCloud", "VMELandmark"


def read_landmark_clouds(path: str | PathLike[str]) -> dict[str, Floats]:
    """Read the landmark clouds of a tree that NMSBuilder has written, in the frame of its root.

    Parameters
    ----------
    path : path
        A .nms or .msf file: XML of nested nodes, each with a matrix that leads to the frame of the node
        around it.

    Returns
    -------
    dict of str to (k, 3) array
        The landmarks of each cloud, by its name, in the order and the unit of the file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no such file, two clouds have one name, or a cloud has no landmarks.
    """
    path = Path(path)
    outermost = read_xml(path)
    if outermost.tag != "MSF":
        raise InputError(
            path, f"this is XML of {shown(outermost.tag)}, not of MSF", "give a .nms or .msf file"
        )
    found: dict[str, Floats] = {}
    _collect(outermost.need("Root"), np.eye(4), found)
    return found


def _collect(node: Element, frame: Floats, found: dict[str, Floats]) -> None:
    """Add the clouds in a node to those found, with the matrices of all nodes around them."""
    frame = frame @ _matrix(node)
    inner = node.find("Children")
    children = [] if inner is None else inner.children
    if node.attributes.get("Type", "").endswith(_CLOUD):
        name = node.attributes.get("Name", "")
        places = [
            (frame @ _matrix(one))[:3, 3]
            for one in children
            if one.attributes.get("Type", "").endswith(_LANDMARK)
        ]
        if not places:
            raise node.error(f"the cloud {shown(name)} has no landmarks")
        if name in found:
            raise node.error(f"there are two clouds of the name {shown(name)}")
        found[name] = np.array(places)
        return
    for child in children:
        _collect(child, frame, found)


def _matrix(node: Element) -> Floats:
    """Return a node's matrix (4, 4), the identity where it has none."""
    holder = node.find("MatrixVector")
    matrices = [] if holder is None else holder.children
    if len(matrices) > 1:
        raise node.error(f"has {len(matrices)} matrices, of different times, but must have one")
    return matrices[0].numbers(16).reshape(4, 4) if matrices else np.eye(4)
