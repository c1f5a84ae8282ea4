"""Muscles put into a model of OpenSim that there is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.xml_elements import read_xml
from vtkmuscle.opensim.model import OsimModel, read_osim
from vtkmuscle.opensim.osim_text import ComponentPaths, MuscleOut, cylinder_elements, muscle_element


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


def enriched(model: Path, muscles: Sequence[MuscleOut], *, replace: Sequence[str] = ()) -> str:
    """Return the text of a model of OpenSim with further muscles, all else as it is in the file.

    Parameters
    ----------
    model : Path
        An .osim file of version 4.
    muscles : sequence of MuscleOut
        On its bodies, by its coordinates.
    replace : sequence of str, optional
        Muscles of the model that are taken out.

    Raises
    ------
    ValueError
        If the file is no such model, has a muscle of that name that is not taken out, or no muscle that is
        to be taken out.
    """
    read = checked_model(model)
    for one in replace:
        read.muscle(one)  # raises where there is none
    names = {muscle.name for muscle in muscles}
    for one in sorted(names & (set(read.muscles) - set(replace))):
        raise InputError(
            model, f"the model has a muscle {one!r} already", "call the new one otherwise, or replace"
        )
    paths = ComponentPaths(
        {body: "/ground" if body == read.tree.root else f"/bodyset/{body}" for body in read.tree.bodies},
        {name: f"/jointset/{joint}/{name}" for name, joint in read.joint_of.items()},
    )
    root = ElementTree.fromstring(
        _as_utf8(model), ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    )
    forces = root.find("Model/ForceSet/objects")
    if forces is None:
        raise InputError(model, "the model has no ForceSet", "save it again with OpenSim 4")
    for force in [force for force in forces if force.get("name") in replace]:
        forces.remove(force)
    _add(forces, "".join(muscle_element(one, paths) for one in muscles))
    for body, cylinders in cylinder_elements(muscles).items():
        path = "Model/Ground" if body == read.tree.root else f"Model/BodySet/objects/Body[@name='{body}']"
        holder = root.find(path)
        assert holder is not None
        for tag in ("WrapObjectSet", "objects"):
            inner = holder.find(tag)
            holder = ElementTree.SubElement(holder, tag) if inner is None else inner
        _add(holder, cylinders)
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add(holder: ElementTree.Element, text: str) -> None:
    holder.extend(ElementTree.fromstring(f"<objects>{text}</objects>"))


def _as_utf8(path: Path) -> str:
    """Return a file's text without what it says of its encoding, which is not always so."""
    data = path.read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.partition("?>")[2] if text.startswith("<?xml") else text
