"""Muscle properties and meshes in models of other programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.fitted_paths import rms
from vtkmuscle.opensim.muscle_paths import FunctionPath
from vtkmuscle.opensim.osim_text import MuscleOut

#: Default force per physiological cross-section [N/cm^2]: Rajagopal et al. 2016,
#: doi:10.1109/TBME.2016.2586891.
SPECIFIC_TENSION = 60.0
#: Properties that a muscle with force requires.
NEEDED = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")


def opensim_properties(hill: Mapping[str, float], metres: float) -> dict[str, float]:
    """Return OpenSim properties for a scene's Hill parameters, ``metres`` per unit of length."""
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
    length: float,
    share: float = 1.0,
    specific_tension: float = SPECIFIC_TENSION,
) -> dict[str, float]:
    """Return OpenSim properties of a muscle, ``fixed`` properties completed from its architecture.

    Fibre length and pennation at rest are taken as optimal, unless the sarcomere length is in the
    architecture. The tendon is slack at rest: fibres and tendon make up the path, ``length`` [m] at rest; if
    no length remains, an InputError is raised. ``share`` is the group's mean fibre length relative to all
    fibres; ``specific_tension`` is in N/cm^2.
    """
    force = specific_tension * (architecture["pcsa_without_tendon_mm2"] / 100.0)
    properties = {"max_isometric_force": force, **fixed}
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
            problem = f"muscle {name!r} has a path of {1000 * length:.4g} mm and fibres of "
            remedy = "give hill.optimal_fibre_length or hill.tendon_slack_length, or export geometry only"
            raise InputError("", f"{problem}{1000 * fibre:.4g} mm at rest, so no tendon", remedy)
        properties["tendon_slack_length"] = tendon
    return properties


#: Folder next to a model where OpenSim looks for meshes.
FOLDER = "Geometry"


@dataclass(frozen=True, eq=False)
class ExportedMuscle:
    """A group of fibres as written, with errors.

    ``muscle`` is the name in the scene, ``out`` the muscle as written [m], fitted to the mean of ``fibres``.
    ``group_error`` is the RMS of the fibres' length changes against the mean [mm]; ``errors`` (f,) in the
    poses of the run are of ``"length"`` [mm], and of moment arms by coordinate [mm, 1 for a translation].
    """

    muscle: str
    out: MuscleOut
    fibres: tuple[int, ...]
    group_error: float
    errors: dict[str, Floats]

    def __str__(self) -> str:
        path = self.out.path
        if isinstance(path, FunctionPath):
            what = f"a polynomial of {', '.join(path.names)}, order {path.order}"
        else:
            what = f"{len(path.points)} points and {len(path.cylinders)} cylinders"
        sizes = [f"{of} {rms(off):.2g} (max {np.abs(off).max():.2g})" for of, off in self.errors.items()]
        listed = ", ".join([*sizes, f"group {self.group_error:.2g}"])
        return f"{len(self.fibres)} fibres as {what}; errors in mm: {listed}"
