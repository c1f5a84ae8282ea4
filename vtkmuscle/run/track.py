"""The frames of one muscle of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.types import Floats


@dataclass(eq=False)
class MuscleTrack:
    """The finished frames of one muscle.

    Attributes
    ----------
    rest : vtkPolyData or None
        At rest, with the point array ``FixedTo``.
    rest_fibres : vtkPolyData or None
        Fibres at rest.
    points : list of (n, 3) array
        Points per finished frame.
    fibres : list of vtkPolyData
        Fibres per finished frame, empty for a muscle without fibres.
    lengths : list of (k,) array
        Fibre lengths per finished frame [mm].
    report : dict
        What is known of the muscle, JSON-able.
    failure : (int, float, Exception) or None
        Frame and time that could not be computed, and why; the frames before are there.
    errors : dict of str to Estimate
        Quantities with the parts of their errors.
    """

    rest: vtkPolyData | None = None
    rest_fibres: vtkPolyData | None = None
    points: list[Floats] = field(default_factory=list)
    fibres: list[vtkPolyData] = field(default_factory=list)
    lengths: list[Floats] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    failure: tuple[int, float, Exception] | None = None
    errors: Mapping[str, Estimate] = field(default_factory=dict)
