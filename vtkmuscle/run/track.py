"""The frames of one muscle of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import cell_array
from vtkmuscle.data.paths import paths_of


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
        Of the paths per finished frame [mm]: musculotendon lengths. None of a muscle whose fibres have no
        paths, as it is on one bone.
    wrenches : list of dict of str to (k, 6) array
        Of the paths per finished frame, by bone, see :mod:`vtkmuscle.data.paths`.
    fibre_lengths : list of (k,) array
        Of the fibres per finished frame [mm].
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
    wrenches: list[dict[str, Floats]] = field(default_factory=list)
    fibre_lengths: list[Floats] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    failure: tuple[int, float, Exception] | None = None
    errors: Mapping[str, Estimate] = field(default_factory=dict)

    def keep(self, fibres: vtkPolyData, millimetres: float) -> None:
        """Keep the fibres of a frame, their lengths and those of their paths."""
        self.fibres.append(fibres)
        self.fibre_lengths.append(np.array(cell_array(fibres, "Length", "fibres")) * millimetres)
        paths = paths_of(fibres, "fibres")
        if paths is not None:
            self.lengths.append(paths.lengths * millimetres)
            self.wrenches.append(paths.wrenches)
