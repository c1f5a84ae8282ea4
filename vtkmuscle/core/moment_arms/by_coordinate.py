"""What is known of the moment arms by one coordinate."""

from __future__ import annotations

from dataclasses import dataclass

from vtkmuscle.core.types import Floats, Ints


@dataclass(frozen=True, eq=False, repr=False)
class JointArms:
    """Moment arms of the paths of a muscle by one coordinate: the levers of their pulls.

    Attributes
    ----------
    coordinate, unit, positive : str
        Its name, the unit of its values, and what its positive direction is.
    frames : (m,) int array
        Numbers of the frames in which they are known, counted in the motion that was given.
    values : (m,) array
        Of the coordinate in these frames, in its unit.
    arms : (m, k) array
        Per path; positive where its pull drives the coordinate up. In the unit of the lengths by an angle,
        per millimetre by a translation.
    slopes : (m, k) array
        -dl/dq of the paths' lengths, by differences between the frames that differ in this coordinate alone;
        NaN where there are none. They are the arms, but for what a parabola between frames misses and what
        is not right with the paths: that they are not at rest, or jump.
    quartic : (m, k) array or None
        Of a polynomial of degree 4 fitted to each path's lengths; None where other coordinates change too,
        or there are too few values.
    quartic_residuals : (k,) array or None
        Root mean square of what it leaves of the lengths.
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
        """Of all paths, (m,)."""
        mean: Floats = self.arms.mean(axis=1)
        return mean

    @property
    def mean_slope(self) -> Floats:
        """Of all paths, (m,); NaN where it is not known."""
        mean: Floats = self.slopes.mean(axis=1)
        return mean
