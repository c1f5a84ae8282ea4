"""What a step of the solver starts from and leads to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.taut.guidance import Guided

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MuscleState:
    """A muscle at one time.

    Attributes
    ----------
    positions : (n, 3) array
        Relative to the solver's ``centre`` [mm].
    velocities : (n, 3) array
        [mm / s]; 0 at points that collided, unless ``contact_velocity`` is ``"keep"``.
    transforms : (b, 4, 4) array
        Of the bones, rest to now.
    colliding : int
        Points that met a bone in the step that led here.
    iterations : int
        Done in that step.
    residual : float
        Root mean square over the points of what the last iteration moved them by [mm].
    distance : float or None
        Estimated root mean square distance to the converged shape [mm], where the solver knows it.
    milliseconds : mapping of str to float
        Time of each of :data:`~vtkmuscle.core.pbd.stages.STAGES` in that step [ms].
    guided : Guided or None
        The taut strings and what they say of the muscle, where it follows some.
    """

    positions: Floats
    velocities: Floats
    transforms: Floats
    colliding: int = 0
    iterations: int = 0
    residual: float = 0.0
    distance: float | None = None
    milliseconds: Mapping[str, float] = field(default_factory=dict)
    guided: Guided | None = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        own = self.positions.nbytes + self.velocities.nbytes + self.transforms.nbytes
        return own + (0 if self.guided is None else self.guided.nbytes)
