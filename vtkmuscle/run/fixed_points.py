"""Muscles of which no point is free."""

from __future__ import annotations

import warnings

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.data.arrays import point_array


def warn_of_fixed_points(name: str, muscle: vtkPolyData) -> None:
    """Warn where no point of a muscle is free to move.

    Parameters
    ----------
    name : str
        Of the muscle.
    muscle : vtkPolyData
        With the point array ``FixedTo``.
    """
    fixed = point_array(muscle, "FixedTo", f"muscles.{name}") >= 0
    if fixed.all():
        warnings.warn(
            f"muscles.{name}: all {len(fixed)} points are fixed to bones: none is free, and nothing is "
            "deformed; check fixing (method, tolerance) and the areas",
            stacklevel=2,
        )
