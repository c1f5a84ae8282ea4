"""Coarser triangles for a closed surface."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import checked_surface, surface_from


def decimated(points: Floats, triangles: Ints, count: int) -> tuple[Floats, Ints]:
    """Return a closed surface, points (n, 3) and triangles (m, 3), with about so many triangles.

    Garland, Heckbert 1997, *Surface simplification using quadric error metrics*, doi:10.1145/258734.258849.

    Raises
    ------
    ValueError
        If the coarser surface is not closed, or its triangles face different sides.
    """
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    decimation = vtkQuadricDecimation()
    decimation.SetInputData(surface_from((points - middle) / size, triangles))
    decimation.SetTargetReduction(1.0 - count / len(triangles))
    decimation.Update()
    coarse, faces = checked_surface(decimation.GetOutput(), "the coarser surface")
    report = survey(coarse, faces)
    if not (report.closed and report.manifold and report.oriented):
        raise InputError("", f"its {len(triangles)} triangles cannot be decimated to {count}")
    return coarse * size + middle, faces
