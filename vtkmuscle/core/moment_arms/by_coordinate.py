"""What is known of the moment arms by one coordinate."""

from __future__ import annotations

from dataclasses import dataclass

from vtkmuscle.core.types import Floats, Ints

#: Half width of the band about the mean, in standard errors: 95 per cent of a normal distribution.
BAND = 1.96


@dataclass(frozen=True, eq=False)
class JointArms:
    """Moment arms of the fibres of a muscle by one coordinate, -dl/dq.

    Attributes
    ----------
    coordinate, unit, positive : str
        Its name, the unit of its values, and what its positive direction is.
    frames : (m,) int array
        Numbers of the frames in which they are determined, counted in the motion that was given.
    values : (m,) array
        Of the coordinate in these frames, in its unit.
    arms, errors : (m, k) arrays
        Per fibre, and the standard error; positive where the fibre's pull drives the coordinate up. In the
        unit of the lengths by an angle, per millimetre by a translation.
    mean, mean_error : (m,) arrays
        Of the mean length of the fibres.
    quartic : (m, k) array or None
        Of a polynomial of degree 4 fitted to each fibre's lengths; None where other coordinates change too,
        or there are too few values.
    quartic_residuals : (k,) array or None
        Root mean square of what it leaves of the lengths.
    window : int
        How many different values a window of the regression holds.
    """

    coordinate: str
    unit: str
    positive: str
    frames: Ints
    values: Floats
    arms: Floats
    errors: Floats
    mean: Floats
    mean_error: Floats
    quartic: Floats | None
    quartic_residuals: Floats | None
    window: int
