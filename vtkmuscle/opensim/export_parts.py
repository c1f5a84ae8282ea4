"""Parts of models of other programs beside the paths: muscles' properties and meshes."""

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

#: Force per physiological cross-section [N/cm^2], where none is given: Rajagopal et al. 2016,
#: doi:10.1109/TBME.2016.2586891.
SPECIFIC_TENSION = 60.0
#: Properties without which a muscle has no force.
NEEDED = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")


def opensim_properties(hill: Mapping[str, float], metres: float) -> dict[str, float]:
    """Return the properties of a muscle of OpenSim for Hill's parameters in a scene, in metres per its unit.

    Examples
    --------
    >>> from vtkmuscle.opensim.export_parts import opensim_properties
    >>> opensim_properties({"optimal_fibre_length": 110.0, "pcsa": 20.0, "specific_tension": 61.0}, 0.001)
    {'optimal_fiber_length': 0.11, 'max_isometric_force': 1220.0}
    """
    found: dict[str, float] = {}
    if "optimal_fibre_length" in hill:
        found["optimal_fiber_length"] = metres * hill["optimal_fibre_length"]
    if "tendon_slack_length" in hill:
        found["tendon_slack_length"] = metres * hill["tendon_slack_length"]
    if "pennation" in hill:
        found["pennation_angle_at_optimal"] = float(np.radians(hill["pennation"]))
    if "pcsa" in hill:
        found["max_isometric_force"] = hill["pcsa"] * hill["specific_tension"]
    elif "max_isometric_force" in hill:
        found["max_isometric_force"] = hill["max_isometric_force"]
    return found


def completed_properties(
    given: Mapping[str, float],
    architecture: Mapping[str, Any],
    name: str,
    *,
    length: float,
    share: float = 1.0,
    specific_tension: float = SPECIFIC_TENSION,
) -> dict[str, float]:
    """Return the properties of a muscle of OpenSim: those given, the others from its architecture.

    Fibres have the length and pennation that were measured at rest, which are optimal unless the length of
    the sarcomeres is known; the tendon is slack there, so that fibres and tendon make up the path, whose
    ``length`` at rest is in m. ``architecture`` is that of a run's report, ``share`` the length of a group of
    fibres in parts of that of all, the specific tension in N/cm^2. InputError if no length is left for a
    tendon.
    """
    area = architecture["pcsa_without_tendon_mm2"] / 100.0
    found = {**given, "max_isometric_force": given.get("max_isometric_force", specific_tension * area)}
    mean = architecture["fascicle_length_mm"]["mean"]
    fibre = share * mean / 1000.0
    ends = [architecture[f"fascicle_pennation_{end}_deg"]["mean"] for end in ("origin", "insertion")]
    pennation = float(np.radians(np.mean(ends)))
    if "optimal_fiber_length" in found:
        fibre = found["optimal_fiber_length"]
        pennation = found.get("pennation_angle_at_optimal", pennation)
    else:
        optimal = share * architecture.get("fascicle_length_normalised_mm", mean) / 1000.0
        found["optimal_fiber_length"] = optimal
        inward = min(fibre * np.sin(pennation) / optimal, 0.99)
        found.setdefault("pennation_angle_at_optimal", float(np.arcsin(inward)))
    if "tendon_slack_length" not in found:
        tendon = length - fibre * float(np.cos(pennation))
        if tendon <= 0.0:
            raise InputError(
                "",
                f"muscle {name!r} has a path of {1000 * length:.4g} mm at rest and fibres of "
                f"{1000 * fibre:.4g} mm, which leaves no tendon",
                "give hill.optimal_fibre_length or hill.tendon_slack_length, or export its geometry only",
            )
        found["tendon_slack_length"] = tendon
    return found


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
    """Write surfaces as .stl files in ``Geometry``, in metres and in frames of bodies; return names by body.

    Each surface has a body, and is given in the scene, of so many metres per unit, by the name of its file
    without suffix. The tree is in metres, at rest where the scene is, whose frame is that of a body at rest.
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
    """Return a surface, decimated where it has more than MOST_TRIANGLES triangles."""
    count = surface.GetNumberOfCells()
    if count <= MOST_TRIANGLES:
        return surface
    decimation = vtkQuadricDecimation()
    decimation.SetInputData(surface)
    decimation.SetTargetReduction(1.0 - MOST_TRIANGLES / count)
    decimation.Update()
    found: vtkPolyData = decimation.GetOutput()
    return found
