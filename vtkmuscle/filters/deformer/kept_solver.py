"""The solver of a muscle, kept for as long as what it is made from stays the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.mesh.topology import MeshTopology, mesh_topology
from vtkmuscle.core.morphing.superficial import directions_over_muscle, seen_fibres
from vtkmuscle.core.pbd.anisotropy import (
    edge_stiffness,
    fibre_directions_at,
    following_stiffness,
    harmonic_directions,
)
from vtkmuscle.core.pbd.solver import MuscleSolver, MuscleState, SolverParameters
from vtkmuscle.core.taut.carrying import Passengers
from vtkmuscle.core.taut.guidance import Guidance
from vtkmuscle.core.taut.lines import bones_at_ends, evenly_spread, lines_on_surface
from vtkmuscle.core.taut.paths import POINTS, TautPaths
from vtkmuscle.core.taut.via_rings import ViaRing
from vtkmuscle.data.arrays import Polylines

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FixedMuscle:
    """What the solver is made from, to tell whether it is still the same."""

    points: Floats
    triangles: Ints
    fixed_to: Ints
    fibres: Polylines | None
    superficial: Polylines | None = None
    rings: tuple[tuple[int, ViaRing], ...] = ()

    def same_as(self, other: FixedMuscle | None) -> bool:
        """Return whether another muscle has the same content."""
        if other is None:
            return False
        pairs = [
            (self.points, other.points),
            (self.triangles, other.triangles),
            (self.fixed_to, other.fixed_to),
        ]
        for mine, yours in ((self.fibres, other.fibres), (self.superficial, other.superficial)):
            if (mine is None) != (yours is None):
                return False
            if mine is not None and yours is not None:
                pairs += [(mine.points, yours.points), (mine.offsets, yours.offsets)]
        if [bone for bone, _ in self.rings] != [bone for bone, _ in other.rings]:
            return False
        for (_, ring), (_, others) in zip(self.rings, other.rings, strict=True):
            pairs += list(zip(ring, others, strict=True))
        return all(np.array_equal(mine, yours) for mine, yours in pairs)


@dataclass(frozen=True, eq=False)
class Elasticity:
    """Direction of the fibres at edges, how stiff they are by it, and the taut fibres that all follow."""

    directions: Floats | None
    stiffness: Floats | None
    guidance: Guidance | None


class KeptSolver:
    """Makes the solver of a muscle, anew as far as the muscle, the bones or the parameters have changed.

    Parameters
    ----------
    where : str
        Named in errors, e.g. ``"PBDDeformer: muscle"``.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._muscle: FixedMuscle | None = None
        self._solver: MuscleSolver | None = None
        self._made_from: tuple[Any, ...] = ()
        self._elasticity: tuple[tuple[str, tuple[Obstacle, ...]], Elasticity] | None = None
        self._passengers: tuple[Guidance, Passengers] | None = None

    def take(self, muscle: FixedMuscle) -> bool:
        """Work with this muscle from now on; return whether it is another than before."""
        if muscle.same_as(self._muscle):
            return False
        self._muscle, self._solver, self._elasticity = muscle, None, None
        return True

    def elasticity(self, anisotropy: str, obstacles: tuple[Obstacle, ...]) -> Elasticity:
        """Return the elasticity of the edges; it depends on the muscle, its fibres and the bones at rest.

        Parameters
        ----------
        anisotropy : str
            ``"taut"``, ``"stiffness"`` or ``"off"``.
        obstacles : tuple of Obstacle
            Bones that taut fibres keep away from.
        """
        assert self._muscle is not None
        made_from = anisotropy, obstacles if anisotropy == "taut" else ()
        kept = self._elasticity
        if kept is None or kept[0] != made_from:
            try:
                kept = self._elasticity = made_from, _elasticity(self._muscle, *made_from)
            except ValueError as error:
                raise ValueError(f"{self._where}: {error}") from error
        return kept[1]

    def carried(
        self, state: MuscleState, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]
    ) -> tuple[Floats, Floats | None] | None:
        """Return where the taut fibres carry the surface (n, 3), and the points of the fibres (p, 3).

        None where a state follows no fibres; no points where the fibres are lines that stand in for some.
        """
        guidance = self.elasticity(settings["anisotropy"], obstacles).guidance
        assert self._muscle is not None
        if guidance is None or state.guided is None:
            return None
        carried, fibres = state.guided.carried, self._muscle.fibres
        if fibres is None:
            return carried.surface, None
        if self._passengers is None or self._passengers[0] is not guidance:
            self._passengers = guidance, guidance.fibres(fibres.points, fibres.offsets)
        return carried.surface, carried.points(self._passengers[1])

    def solver(self, settings: Mapping[str, Any], obstacles: tuple[Obstacle, ...]) -> MuscleSolver:
        """Return the solver.

        Parameters
        ----------
        settings : mapping
            Of PBDDeformer; those of the solver are taken from them.
        obstacles : tuple of Obstacle
            Bones that the muscle is kept out of.

        Raises
        ------
        ValueError
            If the surface is open or encloses no volume.
        """
        muscle = self._muscle
        assert muscle is not None
        parameters = SolverParameters(
            **{name: settings[name] for name in SolverParameters.__dataclass_fields__}
        )
        elasticity = self.elasticity(settings["anisotropy"], obstacles)
        made_from = (parameters, obstacles, elasticity)
        if self._solver is not None and made_from == self._made_from:
            return self._solver
        if self._solver is None:
            try:
                self._solver = MuscleSolver(
                    muscle.points,
                    muscle.triangles,
                    muscle.fixed_to,
                    parameters,
                    edge_stiffness=elasticity.stiffness,
                    guidance=elasticity.guidance,
                    obstacles=obstacles,
                )
            except ValueError as error:
                raise ValueError(f"{self._where}: {error}") from error
        else:
            self._solver = self._solver.adjusted(
                parameters,
                edge_stiffness=elasticity.stiffness,
                guidance=elasticity.guidance,
                obstacles=obstacles,
            )
        self._made_from = made_from
        return self._solver


def _elasticity(muscle: FixedMuscle, anisotropy: str, obstacles: tuple[Obstacle, ...]) -> Elasticity:
    points, fixed_to, fibres = muscle.points, muscle.fixed_to, muscle.fibres
    if anisotropy == "off":
        return Elasticity(None, None, None)
    topology = mesh_topology(len(points), muscle.triangles)
    edges = topology.edges
    seen = _seen_directions(muscle, topology)
    if anisotropy == "taut":
        paths = taut_paths(muscle, topology, obstacles)
        if paths is None:
            return Elasticity(None, None, None)
        guidance = Guidance(paths, points, topology, fixed_to)
        along = guidance.directions if seen is None else seen
        return Elasticity(along, following_stiffness(points, edges, along), guidance)
    directions: Floats | None
    if seen is not None:
        directions = seen
    elif fibres is not None:
        directions = fibre_directions_at(points[edges].mean(axis=1), fibres.points, fibres.offsets)
    else:
        directions = harmonic_directions(points, topology, fixed_to)
    if directions is None:
        return Elasticity(None, None, None)
    return Elasticity(directions, edge_stiffness(points, edges, directions), None)


def taut_paths(
    muscle: FixedMuscle, topology: MeshTopology, obstacles: tuple[Obstacle, ...]
) -> TautPaths | None:
    """Return a muscle's fibres, or lines over its surface where it has none, as taut strings.

    Parameters
    ----------
    muscle : FixedMuscle
        With points that are fixed to bones.
    topology : MeshTopology
        Of its surface.
    obstacles : tuple of Obstacle
        Bones that the strings keep away from.

    Returns
    -------
    TautPaths or None
        None where the muscle is not fixed to two bones: all of it goes with the one.
    """
    points, fixed_to = muscle.points, muscle.fixed_to
    if len(np.unique(fixed_to[fixed_to >= 0])) < 2:
        return None
    lines: tuple[Floats, Ints] | None
    if muscle.fibres is not None:
        lines = muscle.fibres.points, muscle.fibres.offsets
    else:
        lines = lines_on_surface(points, topology, fixed_to)
        if lines is None:
            return None
    fibres = evenly_spread(*lines, POINTS)
    return TautPaths(
        fibres,
        *bones_at_ends(fibres, points, fixed_to),
        points,
        topology.triangles,
        {bone.bone: (bone.points, bone.triangles, bone.axes) for bone in obstacles},
        rings=muscle.rings,
    )


def _seen_directions(muscle: FixedMuscle, topology: MeshTopology) -> Floats | None:
    """Return the direction of the fibres at each edge by superficial fibres, None where there are none."""
    if muscle.superficial is None:
        return None
    seen = seen_fibres(muscle.superficial.points, muscle.superficial.offsets, muscle.points)
    return directions_over_muscle(muscle.points, topology, muscle.fixed_to, seen)
