"""The muscle that is solved, and how it is in a state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.pbd.rest_shape import ShapeReport
from vtkmuscle.core.pbd.solver import MuscleSolver, MuscleState
from vtkmuscle.filters.deformer.kept_solver import FixedMuscle, KeptSolver

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MuscleShape:
    """A muscle in a state.

    Attributes
    ----------
    points, displacement : (n, 3) arrays
        Where it is, and how far from rest [mm].
    velocities : (n, 3) array
        [mm / s].
    report : ShapeReport
        How it keeps its shape.
    """

    points: Floats
    displacement: Floats
    velocities: Floats
    report: ShapeReport


class SolvedMuscle:
    """A muscle, its solver, and how it is in a state.

    Parameters
    ----------
    where : str
        Named in errors, e.g. ``"PBDDeformer: muscle"``.
    """

    def __init__(self, where: str) -> None:
        self._kept = KeptSolver(where)
        self._muscle: FixedMuscle | None = None
        self._shape: tuple[MuscleState, MuscleShape] | None = None

    def take(self, muscle: FixedMuscle) -> bool:
        """Work with this muscle from now on; return whether it is another than before."""
        if not self._kept.take(muscle):
            return False
        self._muscle, self._shape = muscle, None
        return True

    @property
    def free(self) -> Bools:
        """Free points of the muscle, (n,)."""
        assert self._muscle is not None
        return self._muscle.fixed_to < 0

    def solver(self, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]) -> MuscleSolver:
        """Return the solver; see :meth:`KeptSolver.solver`."""
        return self._kept.solver(settings, obstacles)

    def carried(
        self, state: MuscleState, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]
    ) -> tuple[Floats, Floats | None] | None:
        """Return where the fibres carry the muscle; see :meth:`KeptSolver.carried`."""
        return self._kept.carried(state, settings, obstacles)

    def shape(
        self, state: MuscleState, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]
    ) -> MuscleShape:
        """Return the muscle in a state of the solver; it is looked at once."""
        if self._shape is None or self._shape[0] is not state:
            solver = self.solver(settings, obstacles)
            directions = self._kept.elasticity(settings["anisotropy"], obstacles).directions
            shape = MuscleShape(
                solver.points(state),
                state.positions - solver.rest,
                state.velocities,
                solver.report(state, directions),
            )
            self._shape = state, shape
        return self._shape[1]
