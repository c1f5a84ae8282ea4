"""What can be set of Algorithm 2."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameters:
    """Settings of Algorithm 2; the defaults are those of section 4 of the paper.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per step, >= 1; it differs between the paper's experiments.
    dt : float
        Time of a step [s], > 0.
    velocity_kept : float
        Part of the velocity that is left after a step, in [0, 1]: line 8.
    stiffness, shape_stiffness, volume_stiffness : float
        Of the distance, dihedral and volume constraints, per iteration, in [0, 1].
    anisotropy : bool
        Whether edges are the softer the more they run along the fibres: section 3.1.
    external_force : (3,) tuple
        Force per mass on each free point [mm / s^2]: line 7.
    bone_push : str
        What a bone does to points that it moved over: ``"transform"``, take them with it (section 3.2), or
        ``"off"``, nothing.
    contact_velocity : str
        What velocity points have that met a bone: ``"keep"``, that of their displacement, or ``"zero"``, as
        section 5 proposes.
    """

    iterations: int = 30
    dt: float = 1.0
    velocity_kept: float = 0.99
    stiffness: float = 1.0
    shape_stiffness: float = 0.9
    volume_stiffness: float = 1.0
    anisotropy: bool = True
    external_force: tuple[float, ...] = (0.0, 0.0, 0.0)
    bone_push: str = "transform"
    contact_velocity: str = "keep"
