"""Lengths of paths that wind round surfaces, by OpenSim."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.io.writing import write_text
from vtkmuscle.io.xml_elements import xml_text
from vtkmuscle.joints.osim import FURTHER, NOT_USED, OFFSET
from vtkmuscle.opensim.model import OsimModel
from vtkmuscle.opensim.osim_text import model_tree

#: Lengths of muscles (f,) for values of coordinates (f,).
Lengths = Callable[[Sequence[str], Mapping[str, Floats]], dict[str, Floats]]


def opensim_lengths(path: Path, model: OsimModel, names: Sequence[str]) -> Lengths | None:
    """Return the function that gets lengths of paths from OpenSim, None without OpenSim.

    All further forces and parts, maybe of plugins, are removed beforehand. Coupled coordinates are set here:
    OpenSim's search for consistent coordinates would take a hundred times as long.
    """
    try:
        import opensim  # noqa: PLC0415 -- an extra
    except ImportError:
        return None
    opensim.Logger.removeFileSink()  # no log in the working folder
    opensim.Logger.setLevelString("error")
    root = model_tree(path)
    for tag in ("ForceSet/objects", *(f"{tag}/objects" for tag in (*NOT_USED, FURTHER[0])), FURTHER[1]):
        kept = names if tag.startswith("ForceSet") else ()
        if (holder := root.find(f"Model/{tag}")) is not None:
            holder[:] = [each for each in holder if each.tag == OFFSET or each.get("name") in kept]
    with TemporaryDirectory() as folder:
        write_text(Path(folder) / path.name, xml_text(root, indented=False))
        try:
            theirs = opensim.Model(str(Path(folder) / path.name))
            state = theirs.initSystem()
        except RuntimeError as error:
            problem = f"OpenSim does not read the model: {error}"
            raise InputError(path, problem, "correct the model") from error
    coordinates = theirs.updCoordinateSet()
    geometries = map(opensim.AbstractGeometryPath.safeDownCast, theirs.getComponentsList())
    paths = {each.getOwner().getName(): each for each in geometries if each is not None}
    for coordinate in model.tree.coordinates:
        coordinates.get(coordinate.name).setLocked(state, False)

    def lengths(muscles: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        columns = [(coordinates.get(name), column) for name, column in model.tree.completed(values).items()]
        table = np.empty((len(columns[0][1]), len(muscles)))
        for row in range(len(table)):
            for coordinate, column in columns:
                coordinate.setValue(state, float(column[row]), False)
            theirs.realizePosition(state)
            table[row] = [paths[name].getLength(state) for name in muscles]
        return dict(zip(muscles, table.T, strict=True))

    return lengths
