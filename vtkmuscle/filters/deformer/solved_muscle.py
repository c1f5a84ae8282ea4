"""The muscle that is solved in place of the one that is given: itself, or one of fewer triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.pbd.resolution import ReducedMuscle
from vtkmuscle.core.pbd.rest_shape import ShapeReport
from vtkmuscle.core.pbd.solver import MuscleSolver, MuscleState
from vtkmuscle.filters.deformer.kept_solver import FixedMuscle, KeptSolver, decimation

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MuscleShape:
    """The full muscle in a state.

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
    """A muscle, the solver of it or of a reduced one, and the way back from that.

    Parameters
    ----------
    where : str
        Named in errors, e.g. ``"PBDDeformer: muscle"``.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._kept = KeptSolver(where)
        self._full: FixedMuscle | None = None
        self._reduced: ReducedMuscle | None = None
        self._max_triangles: int | None = None
        self._shape: tuple[MuscleState, MuscleShape] | None = None

    def take(self, full: FixedMuscle, max_triangles: int | None) -> bool:
        """Work with this muscle from now on; return whether it or what is solved for it is another.

        Parameters
        ----------
        full : FixedMuscle
            As given.
        max_triangles : int or None
            Most triangles of what is solved, None for the muscle itself.

        Raises
        ------
        ValueError
            If it cannot be reduced so far.
        ModuleNotFoundError
            If it is to be reduced, and fast-simplification is not installed.
        """
        if max_triangles == self._max_triangles and full.same_as(self._full):
            return False
        self._full, self._shape = None, None
        self._reduced = reduced = None
        if max_triangles is not None and len(full.triangles) > max_triangles:
            with decimation(f"PBDDeformer.max_triangles is {max_triangles}", "set it to None"):
                reduced = ReducedMuscle(full.points, full.triangles, full.fixed_to, max_triangles)
        if reduced is None:
            self._kept.take(full)
        else:
            its_fibres = full.fibres, full.superficial
            self._kept.take(
                FixedMuscle(reduced.points, reduced.triangles, reduced.fixed_to, *its_fibres, full.rings)
            )
        self._full, self._reduced, self._max_triangles = full, reduced, max_triangles
        return True

    @property
    def free(self) -> Bools:
        """Free points of the full muscle, (n,)."""
        assert self._full is not None
        return self._full.fixed_to < 0

    def solver(self, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]) -> MuscleSolver:
        """Return the solver; see :meth:`KeptSolver.solver`."""
        return self._kept.solver(settings, obstacles)

    def carried(
        self, state: MuscleState, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]
    ) -> tuple[Floats, Floats | None] | None:
        """Return where the fibres carry the full muscle; see :meth:`KeptSolver.carried`."""
        if self._reduced is not None:
            return None
        return self._kept.carried(state, settings, obstacles)

    def shape(
        self, state: MuscleState, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]
    ) -> MuscleShape:
        """Return the full muscle in a state of the solver; it is looked at once."""
        if self._shape is None or self._shape[0] is not state:
            self._shape = state, self._shape_of(state, settings, obstacles)
        return self._shape[1]

    def _shape_of(
        self, state: MuscleState, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]
    ) -> MuscleShape:
        solver, full = self.solver(settings, obstacles), self._full
        assert full is not None
        report = solver.report(state, self._kept.elasticity(settings["anisotropy"], obstacles).directions)
        points = solver.points(state)
        if self._reduced is None:
            return MuscleShape(points, state.positions - solver.rest, state.velocities, report)
        points = self._reduced.carry(points, state.transforms, obstacles)
        return MuscleShape(
            points,
            points - full.points,
            self._reduced.carry_vectors(state.velocities),
            replace(self._reduced.report(points), along=report.along, across=report.across),
        )
