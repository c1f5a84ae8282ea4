"""What can be set of the solver of one muscle."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Allowed values of the settings that are a choice.
CHOICES = {
    "prediction": ("blend", "inertial"),
    "solver": ("anderson", "gauss-seidel"),
    "projection_order": ("batched", "sequential"),
    "bone_push": ("off", "transform"),
    "contact_velocity": ("zero", "keep"),
}

#: Least and greatest allowed values of the others.
RANGES = {
    "iterations": (1, 1_000_000),
    "substeps": (1, 10_000),
    "dt": (0.0, math.inf),
    "velocity_kept": (0.0, 1.0),
    "stiffness": (0.0, 1.0),
    "shape_stiffness": (0.0, 1.0),
    "volume_stiffness": (0.0, 1.0),
    "guidance": (0.0, 1.0),
    "tolerance": (0.0, math.inf),
}


@dataclass(frozen=True)
class SolverParameters:
    """Settings of :class:`~vtkmuscle.core.pbd.solver.MuscleSolver`.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per (sub)step, at most, >= 1.
    substeps : int
        Parts that a step is cut into, bones moving along their screws, >= 1.
    dt : float
        Time of a step [s], > 0.
    velocity_kept : float
        Part of the velocity that is left after a (sub)step, in [0, 1].
    stiffness, shape_stiffness, volume_stiffness : float
        Of the distance, dihedral and volume constraints, in [0, 1]: per iteration, but per (sub)step with
        ``"gauss-seidel"`` and ``"batched"``.
    external_force : (3,) tuple
        Force per mass on each free point [mm / s^2].
    guidance : float
        Part of its way to where the taut fibres carry it that each iteration draws a point, in [0, 1]; 0
        leaves them to their rest shape.
    prediction : str
        Where the solve of a step starts: ``"inertial"`` or ``"blend"``.
    solver : str
        ``"gauss-seidel"`` or ``"anderson"``: the iteration as it is, or accelerated.
    tolerance : float
        With ``"anderson"``, where the taut fibres draw the points: stop where the converged shape is at most
        so far (root mean square) [mm]; 0 stops at a fixed point only.
    projection_order : str
        ``"batched"`` or ``"sequential"``: many edges at once and the volume last, or Algorithm 2 of Kohout
        and Cervenka 2021 with its constraints as printed.
    bone_push : str
        What a bone does to points it moved over: ``"transform"`` or ``"off"``.
    contact_velocity : str
        What velocity points have that met a bone: ``"zero"`` or ``"keep"``, that of their displacement.

    Raises
    ------
    ValueError
        If a setting is none of its choices, or out of its range.

    Examples
    --------
    >>> SolverParameters(solver="anderson", iterations=100).tolerance
    0.5
    """

    iterations: int = 30
    substeps: int = 1
    dt: float = 1.0
    velocity_kept: float = 0.99
    stiffness: float = 1.0
    shape_stiffness: float = 0.9
    volume_stiffness: float = 1.0
    external_force: tuple[float, ...] = (0.0, 0.0, 0.0)
    guidance: float = 0.02
    prediction: str = "blend"
    solver: str = "anderson"
    tolerance: float = 0.5
    projection_order: str = "batched"
    bone_push: str = "off"
    contact_velocity: str = "zero"

    def __post_init__(self) -> None:
        """Check each setting."""
        for name, choices in CHOICES.items():
            value = getattr(self, name)
            if value not in choices:
                allowed = " or ".join(map(repr, choices))
                raise ValueError(f"SolverParameters.{name} is {value!r}, but must be {allowed}")
        for name, (least, greatest) in RANGES.items():
            value = getattr(self, name)
            if not least <= value <= greatest or (name == "dt" and value == 0.0):
                sign = ">" if name == "dt" else ">="
                most = "" if math.isinf(greatest) else f" and <= {greatest}"
                raise ValueError(f"SolverParameters.{name} is {value!r}, but must be {sign} {least}{most}")
        if len(self.external_force) != 3:
            raise ValueError(
                f"SolverParameters.external_force is {self.external_force!r}, but must have three components"
            )
