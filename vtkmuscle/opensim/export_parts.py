"""Muscle properties and meshes in models of other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import apply_transform, inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.io.writing import replacing
from vtkmuscle.joints.tree import KinematicTree

#: Default force per physiological cross-section [N/cm^2]: Rajagopal et al. 2016,
#: doi:10.1109/TBME.2016.2586891.
SPECIFIC_TENSION = 60.0
#: Properties that a muscle with force requires.
NEEDED = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")


def opensim_properties(hill: Mapping[str, float], metres: float) -> dict[str, float]:
    """Return OpenSim properties for a scene's Hill parameters.

    ``metres`` is the scene's unit of length.

    Examples
    --------
    >>> from vtkmuscle.opensim.export_parts import opensim_properties
    >>> opensim_properties({"optimal_fibre_length": 110.0, "pcsa": 20.0, "specific_tension": 61.0}, 0.001)
    {'optimal_fiber_length': 0.11, 'max_isometric_force': 1220.0}
    """
    units = {
        "optimal_fibre_length": ("optimal_fiber_length", metres),
        "tendon_slack_length": ("tendon_slack_length", metres),
        "pennation": ("pennation_angle_at_optimal", np.pi / 180.0),
        "max_isometric_force": ("max_isometric_force", 1.0),
        "pcsa": ("max_isometric_force", hill["specific_tension"] if "pcsa" in hill else 0.0),
    }
    return {name: unit * hill[key] for key, (name, unit) in units.items() if key in hill}


def completed_properties(
    fixed: Mapping[str, float],
    architecture: Mapping[str, Any],
    name: str,
    *,
    length: float,
    share: float = 1.0,
    specific_tension: float = SPECIFIC_TENSION,
) -> dict[str, float]:
    """Return OpenSim properties of a muscle, completed from its architecture.

    Fibre length and pennation at rest are taken as optimal, unless the sarcomere length is in the
    architecture. The tendon is slack at rest: fibres and tendon make up the path.

    Parameters
    ----------
    fixed : mapping of str to float
        Properties that stay as they are.
    architecture : mapping of str to object
        From the report of a run.
    name : str
        The muscle, for errors.
    length : float
        Path length at rest [m].
    share : float
        Mean fibre length of the group relative to all fibres.
    specific_tension : float
        [N/cm^2].

    Raises
    ------
    InputError
        If no length remains for a tendon.
    """
    area = architecture["pcsa_without_tendon_mm2"] / 100.0
    properties = {**fixed, "max_isometric_force": fixed.get("max_isometric_force", specific_tension * area)}
    mean = architecture["fascicle_length_mm"]["mean"]
    fibre = share * mean / 1000.0
    ends = [architecture[f"fascicle_pennation_{end}_deg"]["mean"] for end in ("origin", "insertion")]
    pennation = float(np.radians(np.mean(ends)))
    if "optimal_fiber_length" in properties:
        fibre = properties["optimal_fiber_length"]
        pennation = properties.get("pennation_angle_at_optimal", pennation)
    else:
        optimal = share * architecture.get("fascicle_length_normalised_mm", mean) / 1000.0
        properties["optimal_fiber_length"] = optimal
        inward = min(fibre * np.sin(pennation) / optimal, 0.99)
        properties.setdefault("pennation_angle_at_optimal", float(np.arcsin(inward)))
    if "tendon_slack_length" not in properties:
        tendon = length - fibre * float(np.cos(pennation))
        if tendon <= 0.0:
            sizes = f"a path of {1000 * length:.4g} mm and fibres of {1000 * fibre:.4g} mm at rest"
            remedy = "give hill.optimal_fibre_length or hill.tendon_slack_length, or export geometry only"
            raise InputError("", f"muscle {name!r} has {sizes}, which leaves no tendon", remedy)
        properties["tendon_slack_length"] = tendon
    return properties


#: Folder next to a model where OpenSim looks for meshes.
FOLDER = "Geometry"
#: Triangles per mesh, at most; MuJoCo reads up to 200 000.
MOST_TRIANGLES = 100_000
#: Record of a triangle in a binary .stl file.
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def write_meshes(
    folder: Path,
    surfaces: Mapping[str, tuple[str, vtkPolyData]],
    tree: KinematicTree,
    frame: str,
    metres: float,
) -> dict[str, list[str]]:
    """Write surfaces in ``Geometry``; return file names by body.

    Files are in metres and in the frames of bodies.

    Parameters
    ----------
    folder : Path
        Folder of the model.
    surfaces : mapping of str to (str, vtkPolyData)
        By file name without suffix: body, and surface in the scene.
    tree : KinematicTree
        In metres, at rest as the scene.
    frame : str
        Body whose frame at rest is the scene's frame.
    metres : float
        Metres per unit of the scene.
    """
    rest = tree.poses({})
    names: dict[str, list[str]] = {}
    for name, (body, surface) in surfaces.items():
        placed = (inverses(rest[body]) @ rest[frame])[0]
        reduced = _with_fewer_triangles(surface)
        points = apply_transform(placed, metres * points_of(reduced))
        corners: Floats = points[triangles_of(reduced, name)]
        records = np.zeros(len(corners), dtype=_TRIANGLE)
        records["corners"] = corners
        records["normal"] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with replacing(folder / FOLDER / f"{name}.stl") as partial:
            head = b"vtkmuscle, metres".ljust(80) + np.uint32(len(records)).tobytes()
            partial.write_bytes(head + records.tobytes())
        names.setdefault(body, []).append(name)
    return names


def _with_fewer_triangles(surface: vtkPolyData) -> vtkPolyData:
    count = surface.GetNumberOfCells()
    if count <= MOST_TRIANGLES:
        return surface
    decimation = vtkQuadricDecimation()
    decimation.SetInputData(surface)
    decimation.SetTargetReduction(1.0 - MOST_TRIANGLES / count)
    decimation.Update()
    reduced: vtkPolyData = decimation.GetOutput()
    return reduced
