"""What can be set of the solver of one muscle."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SolverParameters:
    """Settings of :class:`~vtkmuscle.core.pbd.solver.MuscleSolver`.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per (sub)step, >= 1.
    substeps : int
        Parts that a step is cut into, bones moving along their screws, >= 1.
    dt : float
        Time of a step [s], > 0.
    velocity_kept : float
        Part of the velocity that is left after a (sub)step, in [0, 1].
    stiffness, shape_stiffness, volume_stiffness : float
        Of the distance, dihedral and volume constraints, in [0, 1]: per (sub)step with ``"gauss-seidel"``,
        per iteration with ``"anderson"``.
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
        Stop at this estimated distance to the converged shape [mm], except with ``"gauss-seidel"``; 0 never
        stops.
    projection_order : str
        ``"batched"`` or ``"sequential"``: many edges at once and the volume last, or P21's order.
    dtype : str
        ``"float64"`` or ``"float32"``: the numbers that the iteration computes with. The latter only with
        ``"gauss-seidel"`` and ``"batched"``: acceleration lives on differences that single precision loses.
    threads : int
        Threads that a large muscle is solved on, 0 for as many as there are processors. The result does not
        depend on it.
    bone_push : str
        What a bone does to points it moved over: ``"transform"`` or ``"off"``.
    contact_velocity : str
        What velocity points have that met a bone: ``"zero"`` or ``"keep"``, that of their displacement.
    """

    iterations: int = 10
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
    tolerance: float = 0.0
    projection_order: str = "batched"
    dtype: str = "float64"
    threads: int = 0
    bone_push: str = "off"
    contact_velocity: str = "zero"

    def __post_init__(self) -> None:
        """Refuse what does not go together.

        Raises
        ------
        ValueError
            For single precision with acceleration, or in sequential order.
        """
        if self.dtype == "float32" and (self.solver, self.projection_order) != ("gauss-seidel", "batched"):
            raise ValueError(
                f"dtype is 'float32', but solver is {self.solver!r} and projection_order is "
                f"{self.projection_order!r}; single precision is for solver 'gauss-seidel' with "
                "projection_order 'batched', all else needs dtype 'float64'"
            )
