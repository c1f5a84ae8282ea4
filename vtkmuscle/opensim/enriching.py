"""Muscles put into a model of OpenSim that there is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.parsers import expat

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.xml_elements import read_xml
from vtkmuscle.opensim.model import read_osim
from vtkmuscle.opensim.osim_text import ComponentPaths, MuscleOut, muscle_element


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
    read = read_osim(model)
    document = read_xml(model)
    version = document.attributes.get("Version", "0")
    if not version.isdecimal() or int(version) < 40000:
        raise InputError(model, f"the model is of version {version}", "save it again with OpenSim 4")
    names = {muscle.name for muscle in muscles}
    for one in replace:
        read.muscle(one)  # raises where there is none
    for one in sorted(names & (set(read.muscles) - set(replace))):
        raise InputError(
            model, f"the model has a muscle {one!r} already", "call the new one otherwise, or replace"
        )
    paths = ComponentPaths(
        {body: "/ground" if body == read.tree.root else f"/bodyset/{body}" for body in read.tree.bodies},
        {name: f"/jointset/{joint}/{name}" for name, joint in read.joint_of.items()},
    )
    text = _as_utf8(model)
    forces = "".join(muscle_element(one, paths) for one in muscles)
    return _with_forces(text, forces, set(replace), model)


def _as_utf8(path: Path) -> bytes:
    data = path.read_bytes()
    try:
        return data.decode("utf-8-sig").encode()
    except UnicodeDecodeError:
        return data.decode("latin-1").encode()


def _with_forces(text: bytes, forces: str, replace: set[str], path: Path) -> str:
    """Return a model's text with forces at the end of its set of them, and some taken out."""
    parser = expat.ParserCreate("utf-8")
    stack: list[str] = []
    cuts: list[tuple[int, int]] = []
    found: dict[str, int] = {}
    begun: dict[int, int] = {}
    place = ["OpenSimDocument", "Model", "ForceSet", "objects"]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if stack == place and attributes.get("name") in replace:
            begun[len(stack)] = parser.CurrentByteIndex
        stack.append(tag)
        if stack == place:
            found["empty"] = parser.CurrentByteIndex

    def end(tag: str) -> None:
        if stack == place:
            found["end"] = parser.CurrentByteIndex
        stack.pop()
        if len(stack) in begun:
            closing = text.index(b">", parser.CurrentByteIndex) + 1
            cuts.append((begun.pop(len(stack)), closing))

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(text, True)
    if "end" not in found:
        raise InputError(path, "the model has no ForceSet", "save it again with OpenSim 4")
    if found["end"] == found["empty"]:  # <objects/>
        closing = text.index(b">", found["empty"]) + 1
        pieces = [text[: found["empty"]], b"<objects>\n", forces.encode(), b"</objects>", text[closing:]]
        return b"".join(pieces).decode()
    kept, at = [], 0
    for first, last in cuts:
        kept.append(text[at:first])
        at = last
    kept += [text[at : found["end"]], forces.encode(), text[found["end"] :]]
    return b"".join(kept).decode()
