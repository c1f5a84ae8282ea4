"""What goes along with paths into other programs: Hill's parameters, meshes, and slides in metres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import TRANSLATIONS
from vtkmuscle.core.motion.rigid import apply_transform, inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.io.writing import replacing
from vtkmuscle.opensim.functions import Multiplier, stretched
from vtkmuscle.opensim.tree import Coupling, JointAxis, JointCoordinate, KinematicTree

#: Force per physiological cross-section [N/cm^2], where none is stated: Rajagopal et al. 2016,
#: doi:10.1109/TBME.2016.2586891.
SPECIFIC_TENSION = 60.0
#: What a muscle cannot do without.
NEEDED = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")


def opensim_properties(hill: Mapping[str, float], metres: float) -> dict[str, float]:
    """Return the properties of a muscle of OpenSim.

    Parameters
    ----------
    hill : mapping of str to float
        Hill's parameters by the names of :class:`~vtkmuscle.scene.joint_schema.Hill`.
    metres : float
        Of the scene's unit of length.

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
    """Return the properties of a muscle of OpenSim, those that are not given from its architecture.

    Fibres have the length and pennation that were measured at rest, which are optimal unless the length of
    the sarcomeres is known; the tendon is slack there, so that fibres and tendon make up the path.

    Parameters
    ----------
    given : mapping of str to float
        Properties in OpenSim, which stay.
    architecture : mapping
        Of a run's report: fascicles and cross-section at rest.
    name : str
        Of the muscle.
    length : float
        Of its path at rest [m].
    share : float, optional
        Length of the group of fibres, in parts of that of all.
    specific_tension : float, optional
        Force per cross-section [N/cm^2].

    Raises
    ------
    InputError
        If no length is left for a tendon.
    """
    found = dict(given)
    fibre = share * architecture["fascicle_length_mm"]["mean"] / 1000.0
    optimal = share * architecture.get("fascicle_length_normalised_mm", 1000.0 * fibre / share) / 1000.0
    ends = [architecture[f"fascicle_pennation_{end}_deg"]["mean"] for end in ("origin", "insertion")]
    pennation = np.radians(np.mean(ends))
    found.setdefault(
        "max_isometric_force", specific_tension * architecture["pcsa_without_tendon_mm2"] / 100.0
    )
    if "optimal_fiber_length" in found:
        fibre = found["optimal_fiber_length"]
        pennation = found.get("pennation_angle_at_optimal", pennation)
    else:
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


def slides_in_metres(tree: KinematicTree) -> tuple[KinematicTree, dict[str, float]]:
    """Return a tree that moves as it did, with its sliding coordinates in metres.

    Parameters
    ----------
    tree : KinematicTree
        With slides in any unit.

    Returns
    -------
    tree : KinematicTree
        The same poses for values times the factors.
    factors : dict of str to float
        Of each coordinate what its unit is, in metres; 1 for angles.

    Examples
    --------
    >>> from vtkmuscle.opensim.functions import IDENTITY
    >>> from vtkmuscle.opensim.export_parts import slides_in_metres
    >>> from vtkmuscle.opensim.tree import Joint, JointAxis, JointCoordinate, KinematicTree
    >>> slide = Joint("draw", "box", "drawer", translations=[JointAxis((1, 0, 0), IDENTITY, "out")])
    >>> tree = KinematicTree("box", [slide], [JointCoordinate("out", "mm", range=(0.0, 300.0))])
    >>> metres, factors = slides_in_metres(tree)
    >>> metres.coordinates[0].range, factors
    ((0.0, 0.3), {'out': 0.001})
    """
    factors = {one.name: 1.0 if one.is_angle else TRANSLATIONS[one.unit] / 1000.0 for one in tree.coordinates}

    def of_metres(axis: JointAxis) -> JointAxis:
        if axis.coordinate is None:
            return axis
        return replace(axis, function=stretched(axis.function, factors[axis.coordinate]))

    joints = [
        replace(
            joint,
            rotations=[of_metres(axis) for axis in joint.rotations],
            translations=[of_metres(axis) for axis in joint.translations],
        )
        for joint in tree.joints
    ]
    couplings = [
        Coupling(
            one.dependent,
            one.independent,
            Multiplier(stretched(one.function, factors[one.independent]), factors[one.dependent]),
        )
        for one in tree.couplings
    ]
    coordinates = [_in_metres(one, factors[one.name]) for one in tree.coordinates]
    return replace(tree, joints=joints, coordinates=coordinates, couplings=couplings), factors


def _in_metres(one: JointCoordinate, factor: float) -> JointCoordinate:
    if one.is_angle:
        return one
    limits = None if one.range is None else (factor * one.range[0], factor * one.range[1])
    return replace(one, unit="m", rest=factor * one.rest, range=limits)
