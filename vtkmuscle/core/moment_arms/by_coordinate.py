"""Results for the moment arms by a coordinate."""

from __future__ import annotations

from dataclasses import dataclass

from vtkmuscle.core.types import Floats, Ints


@dataclass(frozen=True, eq=False, repr=False)
class JointArms:
    """Moment arms of a muscle's paths by a coordinate.

    Attributes
    ----------
    coordinate, unit, positive : str
        Name of the coordinate, its unit, and its positive direction.
    frames : (m,) int array
        Frames with moment arms, counted in the whole motion.
    values : (m,) array
        Coordinate values in the frames, in their unit.
    arms : (m, k) array
        Levers of the paths; positive if a pull increases the coordinate. In the unit of lengths for an angle,
        without unit for a translation.
    slopes : (m, k) array
        -dl/dq of the paths' lengths, by differences between frames that differ in this coordinate alone; NaN
        without such frames. Slopes differ from arms by the error of a parabola between frames, and by errors
        of paths: jumps, or paths not at rest.
    quartic : (m, k) array or None
        Moment arms by a polynomial of degree 4 fitted to each path's lengths; None if other coordinates
        change, or for too few values.
    quartic_residuals : (k,) array or None
        Root mean square residuals of the polynomials.
    """

    coordinate: str
    unit: str
    positive: str
    frames: Ints
    values: Floats
    arms: Floats
    slopes: Floats
    quartic: Floats | None
    quartic_residuals: Floats | None

    def __repr__(self) -> str:
        low, high = (f"{value:g}" for value in (self.values.min(), self.values.max()))
        arms, paths = self.arms, self.arms.shape[1]
        spread = f"{arms.mean():.1f} ({arms.min():.1f} to {arms.max():.1f}), {paths} paths"
        return f"JointArms by {self.coordinate}, {low} to {high} {self.unit}: {spread}"

    @property
    def mean(self) -> Floats:
        """Mean moment arm of all paths, (m,)."""
        mean: Floats = self.arms.mean(axis=1)
        return mean

    @property
    def mean_slope(self) -> Floats:
        """Mean slope of all paths, (m,); NaN if unknown."""
        mean: Floats = self.slopes.mean(axis=1)
        return mean
