"""Hill's parameters of a muscle as OpenSim takes them: given, or of its architecture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vtkmuscle.core.errors import InputError

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
        Hill's parameters by the names of :class:`~vtkmuscle.scene.hill.Hill`.
    metres : float
        Of the scene's unit of length.

    Examples
    --------
    >>> from vtkmuscle.opensim.hill import opensim_properties
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
