"""A muscle as it is given, and the solver that is made from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.mesh.segments import fibre_directions_at
from vtkmuscle.core.mesh.surface import check_volume, signed_volume
from vtkmuscle.core.mesh.topology import MeshTopology, mesh_topology
from vtkmuscle.core.morphing.superficial import directions_over_muscle, seen_fibres
from vtkmuscle.core.pbd.anisotropy import edge_stiffness, following_stiffness, harmonic_directions
from vtkmuscle.core.pbd.parameters import SolverParameters
from vtkmuscle.core.pbd.rest_shape import ShapeReport
from vtkmuscle.core.pbd.solver import MuscleSolver
from vtkmuscle.core.pbd.state import MuscleState
from vtkmuscle.core.taut.carrying import Passengers
from vtkmuscle.core.taut.guidance import Guidance
from vtkmuscle.core.paths.lines import bones_at_ends, evenly_spread, lines_on_surface
from vtkmuscle.core.taut.paths import POINTS, TautPaths
from vtkmuscle.core.paths.via_rings import ViaRing
from vtkmuscle.core.types import Floats, Ints

#: Points (n, 3) of polylines, one after the other [mm], and the first point of each, and n, (k + 1,).
Lines = tuple[Floats, Ints]


@dataclass(frozen=True, eq=False)
class FixedMuscle:
    """A muscle at rest, its fixed points and its fibres.

    Attributes
    ----------
    points : (n, 3) array
        Its surface [mm].
    triangles : (m, 3) int array
        Point ids, outward oriented, a closed surface.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    fibres : Lines or None
        Fibres within it.
    superficial : Lines or None
        Fibres that somebody has seen on the surface.
    rings : tuple of (int, ViaRing)
        Via rings that the fibres pass through, each with its bone.
    """

    points: Floats
    triangles: Ints
    fixed_to: Ints
    fibres: Lines | None = None
    superficial: Lines | None = None
    rings: tuple[tuple[int, ViaRing], ...] = ()

    def same_as(self, other: FixedMuscle | None) -> bool:
        """Return whether another muscle has the same content."""
        if other is None or [bone for bone, _ in self.rings] != [bone for bone, _ in other.rings]:
            return False
        mine, theirs = self._arrays(), other._arrays()
        return mine.keys() == theirs.keys() and all(
            np.array_equal(array, theirs[name]) for name, array in mine.items()
        )

    def _arrays(self) -> Mapping[str, NDArray[Any]]:
        arrays: dict[str, NDArray[Any]] = {
            "points": self.points,
            "triangles": self.triangles,
            "fixed_to": self.fixed_to,
        }
        several: list[tuple[str, tuple[NDArray[Any], ...]]] = [
            ("fibres", self.fibres or ()),
            ("superficial", self.superficial or ()),
            *((f"ring {number}", ring) for number, (_, ring) in enumerate(self.rings)),
        ]
        for name, parts in several:
            arrays.update({f"{name}, {number}": part for number, part in enumerate(parts)})
        return arrays


@dataclass(frozen=True, eq=False)
class Elasticity:
    """How a muscle's edges follow its fibres.

    Attributes
    ----------
    directions : (k, 3) array or None
        Unit direction of the fibres at each edge at rest; None for an isotropic muscle.
    stiffness : (k,) array or None
        Of each edge by that.
    guidance : Guidance or None
        The taut fibres that all of the muscle follows, where it follows some.
    """

    directions: Floats | None = None
    stiffness: Floats | None = None
    guidance: Guidance | None = None


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
    carried : (n, 3) array or None
        Where the taut fibres carry its points before edges, volume and bones are heeded [mm]; None where it
        follows none.
    fibre_points : (p, 3) array or None
        Where they carry the points of its fibres [mm]; None where these are lines that stand in for some.
    """

    points: Floats
    displacement: Floats
    velocities: Floats
    report: ShapeReport
    carried: Floats | None
    fibre_points: Floats | None


class MuscleModel:
    """Makes the solver of a muscle, anew as far as the bones or the settings have changed.

    Parameters
    ----------
    muscle : FixedMuscle
        The muscle; it stays the same.

    Raises
    ------
    ValueError
        By its methods, if the surface is open or encloses no volume, or if no fibre has a length.
    """

    def __init__(self, muscle: FixedMuscle) -> None:
        self.muscle = muscle
        self._solver: MuscleSolver | None = None
        self._made_from: tuple[object, ...] = ()
        self._elasticity = Elasticity()
        self._elasticity_made_from: tuple[object, ...] = ()
        self._passengers: tuple[Guidance, Passengers] | None = None
        self._shape: tuple[MuscleState, MuscleShape] | None = None

    def solver(
        self,
        parameters: SolverParameters,
        anisotropy: str,
        obstacles: tuple[Obstacle, ...],
        resolution: int = POINTS - 1,
    ) -> MuscleSolver:
        """Return the solver.

        Parameters
        ----------
        parameters : SolverParameters
            Its settings.
        anisotropy : str
            ``"taut"``, ``"stiffness"`` or ``"off"``: what edges have of the fibres.
        obstacles : tuple of Obstacle
            Bones that the muscle is kept out of, and taut fibres away from.
        resolution : int, optional
            Segments of a taut fibre.
        """
        if self._solver is None:  # before fibres, of which a muscle without extent cannot have any either
            check_volume(self.muscle.points, signed_volume(self.muscle.points, self.muscle.triangles))
        elasticity = self._elasticity_of(anisotropy, obstacles, resolution)
        made_from = parameters, obstacles, elasticity
        if self._solver is None or made_from != self._made_from:
            if self._solver is None:
                given = self.muscle.points, self.muscle.triangles, self.muscle.fixed_to
                make: Callable[..., MuscleSolver] = partial(MuscleSolver, *given)
            else:
                make = self._solver.adjusted
            self._solver = make(
                parameters,
                edge_stiffness=elasticity.stiffness,
                guidance=elasticity.guidance,
                obstacles=obstacles,
            )
            self._made_from = made_from
        return self._solver

    def shape(self, state: MuscleState) -> MuscleShape:
        """Return the muscle in a state of the last solver; the same state is looked at once."""
        if self._shape is None or self._shape[0] is not state:
            assert self._solver is not None
            carried = None if state.guided is None else state.guided.carried.surface
            shape = MuscleShape(
                self._solver.points(state),
                state.positions - self._solver.rest,
                state.velocities,
                self._solver.report(state, self._elasticity.directions),
                carried,
                self._fibre_points(state),
            )
            self._shape = state, shape
        return self._shape[1]

    def _fibre_points(self, state: MuscleState) -> Floats | None:
        """Return where the taut fibres carry the points of the muscle's own, (p, 3)."""
        guidance, fibres = self._elasticity.guidance, self.muscle.fibres
        if guidance is None or state.guided is None or fibres is None:
            return None
        if self._passengers is None or self._passengers[0] is not guidance:
            self._passengers = guidance, guidance.fibres(*fibres)
        return state.guided.carried.points(self._passengers[1])

    def _elasticity_of(self, anisotropy: str, obstacles: tuple[Obstacle, ...], resolution: int) -> Elasticity:
        made_from = (anisotropy, obstacles, resolution) if anisotropy == "taut" else (anisotropy, (), 0)
        if made_from != self._elasticity_made_from:
            self._elasticity = elasticity_of(self.muscle, *made_from)
            self._elasticity_made_from = made_from
        return self._elasticity


def elasticity_of(
    muscle: FixedMuscle, anisotropy: str, obstacles: tuple[Obstacle, ...], resolution: int
) -> Elasticity:
    """Return how the edges of a muscle follow its fibres, or the lines that stand in for them.

    Parameters
    ----------
    muscle : FixedMuscle
        The muscle.
    anisotropy : str
        ``"taut"``: it follows its fibres, pulled taut round the bones; ``"stiffness"``: its edges are less
        stiff along them (Kohout and Cervenka 2021, section 3.1); ``"off"``: they are isotropic.
    obstacles : tuple of Obstacle
        Bones that taut fibres keep away from.
    resolution : int
        Segments of a taut fibre.
    """
    if anisotropy == "off":
        return Elasticity()
    points, fixed_to = muscle.points, muscle.fixed_to
    topology = mesh_topology(len(points), muscle.triangles)
    edges = topology.edges
    seen = None
    if muscle.superficial is not None:
        on_surface = seen_fibres(*muscle.superficial, points)
        seen = directions_over_muscle(points, topology, fixed_to, on_surface)
    if anisotropy == "taut":
        paths = _taut_paths(muscle, topology, obstacles, resolution)
        if paths is None:
            return Elasticity()
        guidance = Guidance(paths, points, topology, fixed_to)
        along = guidance.directions if seen is None else seen
        return Elasticity(along, following_stiffness(points, edges, along), guidance)
    directions: Floats | None
    if seen is not None:
        directions = seen
    elif muscle.fibres is not None:
        directions = fibre_directions_at(points[edges].mean(axis=1), *muscle.fibres)
    else:
        directions = harmonic_directions(points, topology, fixed_to)
    if directions is None:
        return Elasticity()
    return Elasticity(directions, edge_stiffness(points, edges, directions))


def _taut_paths(
    muscle: FixedMuscle, topology: MeshTopology, obstacles: tuple[Obstacle, ...], resolution: int
) -> TautPaths | None:
    """Return a muscle's fibres, or lines over its surface where it has none, as taut strings.

    None where the muscle is not fixed to two bones: all of it goes with the one.
    """
    points, fixed_to = muscle.points, muscle.fixed_to
    if len(np.unique(fixed_to[fixed_to >= 0])) < 2:
        return None
    lines = muscle.fibres
    if lines is None:
        lines = lines_on_surface(points, topology, fixed_to)
        if lines is None:
            return None
    fibres = evenly_spread(*lines, resolution + 1)
    return TautPaths(
        fibres,
        *bones_at_ends(fibres, points, fixed_to),
        points,
        topology.triangles,
        {bone.bone: (bone.points, bone.triangles, bone.axes) for bone in obstacles},
        rings=muscle.rings,
    )
