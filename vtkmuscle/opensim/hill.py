"""Hill's parameters of a muscle as OpenSim takes them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def opensim_properties(hill: Mapping[str, float], metres: float) -> dict[str, float]:
    """Return the properties of a muscle of OpenSim.

    Parameters
    ----------
    hill : mapping of str to float
        Hill's parameters by the names of :class:`Hill`.
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
