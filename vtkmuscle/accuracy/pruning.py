"""What is lost where fibres are carried by few vertices instead of all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import polylines_of, with_points
from vtkmuscle.filters.fibre_transport import FibreTransport


def lengths_lost(
    fibres: vtkPolyData, muscle: vtkPolyData, shapes: Sequence[Floats], weight_tolerance: float
) -> Floats:
    """Return by how much fibres are longer by all weights than by those that are kept, (f, k).

    Parameters
    ----------
    fibres, muscle : vtkPolyData
        At rest.
    shapes : sequence of (n, 3) array
        Points of the muscle in f frames.
    weight_tolerance : float
        By which weights are left out, see :class:`~vtkmuscle.filters.FibreTransport`.
    """
    lengths = {}
    for tolerance in (weight_tolerance, 0.0):
        carry = FibreTransport(method="mean-value", weight_tolerance=tolerance)
        frames = [polylines_of(carry(fibres, muscle, with_points(muscle, now)), "fibres") for now in shapes]
        lengths[tolerance] = np.array([polyline_lengths(one.points, one.offsets) for one in frames])
    return np.asarray(lengths[0.0] - lengths[weight_tolerance])
