"""Meshes that go along with an exported model: bones, and muscles as they are at rest."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from vtkmuscle.core.motion.rigid import apply_transform, inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.io.writing import replacing
from vtkmuscle.opensim.tree import KinematicTree

#: The folder beside a model in which OpenSim looks for its meshes.
FOLDER = "Geometry"
#: Triangles of a mesh, at most: MuJoCo reads 200 000, and to be looked at fewer do.
MOST_TRIANGLES = 100_000
#: A triangle of a binary .stl.
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def write_meshes(
    folder: Path,
    surfaces: Mapping[str, tuple[str, vtkPolyData]],
    tree: KinematicTree,
    frame: str,
    metres: float,
) -> dict[str, list[str]]:
    """Write surfaces as .stl files in the frames of bodies, in metres.

    Parameters
    ----------
    folder : Path
        That of the model; the files are in its ``Geometry``.
    surfaces : mapping of str to (str, vtkPolyData)
        By the file's name without suffix: its body, and itself in the scene.
    tree : KinematicTree
        In metres, at rest where the scene is.
    frame : str
        The body whose frame at rest is the scene's.
    metres : float
        Of the scene's unit.

    Returns
    -------
    dict of str to list of str
        The names of each body's meshes, without suffix.
    """
    rest = tree.poses({})
    found: dict[str, list[str]] = {}
    for name, (body, surface) in surfaces.items():
        placed = (inverses(rest[body]) @ rest[frame])[0]
        shown = _with_fewer_triangles(surface)
        points = apply_transform(placed, metres * points_of(shown))
        corners: Floats = points[triangles_of(shown, name)]
        records = np.zeros(len(corners), dtype=_TRIANGLE)
        records["corners"] = corners
        records["normal"] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with replacing(folder / FOLDER / f"{name}.stl") as partial:
            head = b"vtkmuscle, metres".ljust(80) + np.uint32(len(records)).tobytes()
            partial.write_bytes(head + records.tobytes())
        found.setdefault(body, []).append(name)
    return found


def _with_fewer_triangles(surface: vtkPolyData) -> vtkPolyData:
    """Return a surface, or one like it of at most so many triangles."""
    count = surface.GetNumberOfCells()
    if count <= MOST_TRIANGLES:
        return surface
    decimation = vtkQuadricDecimation()
    decimation.SetInputData(surface)
    decimation.SetTargetReduction(1.0 - MOST_TRIANGLES / count)
    decimation.Update()
    found: vtkPolyData = decimation.GetOutput()
    return found
