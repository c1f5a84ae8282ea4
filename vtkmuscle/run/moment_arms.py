"""The moment arms of a run: a table of all muscles, fibres and coordinates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.run.table import Table

#: Columns of the table: a row per muscle, coordinate, fibre and value of the coordinate. A path has the
#: number of its fibre. ``slope_mm`` is -dl/dq by differences; ``moment_arm_err_mm`` all that is known of the
#: error, with 95 % confidence: the one error that tables, figures and the page of a run have.
COLUMNS = (
    "muscle",
    "coordinate",
    "unit",
    "fibre",
    "value",
    "moment_arm_mm",
    "slope_mm",
    "quartic_mm",
    "moment_arm_err_mm",
)
#: Columns of its summary: a row per muscle, coordinate and value.
SUMMARY = (
    "muscle",
    "coordinate",
    "unit",
    "value",
    "mean_mm",
    "slope_mean_mm",
    "min_mm",
    "max_mm",
    "quartic_mean_mm",
    "mean_err_mm",
)


class MomentArmTable(Mapping[str, Mapping[str, JointArms]]):
    """Moment arms of muscles by coordinates: ``table["iliacus"]["hip_flexion_r"].mean``.

    Parameters
    ----------
    arms : mapping of str to mapping of str to JointArms
        Per muscle, per coordinate.
    refused : mapping of str to str, optional
        Coordinates by which there are none, and why.
    errors : mapping of str to mapping of str to Estimate, optional
        Per muscle ``moment_arm_NAME`` of the paths' mean and ``each_moment_arm_NAME``, by coordinates.

    Attributes
    ----------
    refused : dict of str to str
        As given.
    """

    def __init__(
        self,
        arms: Mapping[str, Mapping[str, JointArms]],
        refused: Mapping[str, str] | None = None,
        errors: Mapping[str, Mapping[str, Estimate]] | None = None,
    ) -> None:
        self._errors = dict(errors or {})
        self._arms = {muscle: dict(found) for muscle, found in arms.items()}
        self.refused = dict(refused or {})

    def __getitem__(self, muscle: str) -> Mapping[str, JointArms]:
        if muscle not in self._arms:
            known = ", ".join(self._arms) or "none"
            raise KeyError(f"there are no moment arms of {muscle!r}; there are those of: {known}")
        return self._arms[muscle]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arms)

    def __len__(self) -> int:
        return len(self._arms)

    def __repr__(self) -> str:
        lines = ["MomentArmTable [mm], mean (least to largest of all fibres and values):"]
        for muscle, found in self._arms.items():
            for name, one in found.items():
                low, high = one.values.min(), one.values.max()
                lines.append(
                    f"  {muscle} by {name}, {low:g} to {high:g} {one.unit}: {one.arms.mean():.1f} "
                    f"({one.arms.min():.1f} to {one.arms.max():.1f}), {one.arms.shape[1]} paths"
                )
        return "\n".join(lines if len(lines) > 1 else ["MomentArmTable: empty"])

    def table(self) -> Table:
        """Return the whole table, with the columns :data:`COLUMNS`; NaN where no quartic is."""
        return Table(COLUMNS, self._rows())

    def summary(self) -> Table:
        """Return per muscle, coordinate and value the mean of the paths, its error and their range."""
        return Table(SUMMARY, self._summary())

    def report(self, muscle: str) -> dict[str, Any]:
        """Return in short what is known of a muscle's moment arms, JSON-able."""
        return {
            name: {
                "unit": found.unit,
                "positive": found.positive,
                "values": [float(found.values.min()), float(found.values.max())],
                "mean_mm": float(found.arms.mean()),
                "min_mm": float(found.arms.min()),
                "max_mm": float(found.arms.max()),
                "slope_difference_mm": _root_mean_square(found.arms - found.slopes),
                "quartic_residual_mean_mm": (
                    None if found.quartic_residuals is None else float(found.quartic_residuals.mean())
                ),
            }
            for name, found in self._arms.get(muscle, {}).items()
        }

    def _rows(self) -> Iterator[tuple[Any, ...]]:
        for muscle, found in self._arms.items():
            for name, one in found.items():
                total = self._totals(muscle, f"each_moment_arm_{name}", one.arms)
                for fibre in range(one.arms.shape[1]):
                    for i, value in enumerate(one.values):
                        quartic = None if one.quartic is None else float(one.quartic[i, fibre])
                        arm, slope = float(one.arms[i, fibre]), float(one.slopes[i, fibre])
                        error = float(total[i, fibre])
                        yield muscle, name, one.unit, fibre, float(value), arm, slope, quartic, error

    def _summary(self) -> Iterator[tuple[Any, ...]]:
        for muscle, found in self._arms.items():
            for name, one in found.items():
                total = self._totals(muscle, f"moment_arm_{name}", one.mean)
                for i, value in enumerate(one.values):
                    mean, slope = float(one.mean[i]), float(one.mean_slope[i])
                    low, high = float(one.arms[i].min()), float(one.arms[i].max())
                    quartic = None if one.quartic is None else float(one.quartic[i].mean())
                    row = muscle, name, one.unit, float(value), mean, slope, low, high, quartic
                    yield *row, float(total[i])

    def _totals(self, muscle: str, quantity: str, like: Floats) -> Floats:
        """Return the errors of a quantity, NaN where they are not known, or those of other frames."""
        known = self._errors.get(muscle, {}).get(quantity)
        if known is None or known.total.shape != like.shape:
            return np.full(like.shape, np.nan)
        return known.total


def _root_mean_square(values: Floats) -> float | None:
    """Return that of the values that are known, None where none is."""
    known = values[~np.isnan(values)]
    return float(np.sqrt((known**2).mean())) if len(known) else None
