"""What can be set of Algorithm 2."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameters:
    """Settings of Algorithm 2; the defaults are those of section 4 of the paper.

    PBDDeformer has them too, and takes what it says of them from here.

    Attributes
    ----------
    iterations : int
        Projections of all constraints per step, >= 1; it differs between the paper's experiments.
    dt : float
        Time of a step [s], > 0.
    velocity_kept : float
        Part of its velocity that a point keeps from step to step, in [0, 1] (line 8).
    stiffness : float
        Of edge lengths, per iteration, in [0, 1].
    shape_stiffness : float
        Of the angles between triangles, per iteration, in [0, 1].
    volume_stiffness : float
        Of the muscle's volume, per iteration, in [0, 1].
    anisotropy : bool
        Whether edges are the softer the more they run along the fibres (section 3.1).
    external_force : (3,) tuple
        Force per mass on all free points [mm/s^2] (line 7).
    bone_push : str
        What a bone does to points that it moved over: ``"transform"``, take them with it (section 3.2), or
        ``"off"``, nothing.
    contact_velocity : str
        Velocity of points that met a bone: ``"keep"``, that of their displacement, as the paper computes it,
        or ``"zero"``, as its section 5 proposes.
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
