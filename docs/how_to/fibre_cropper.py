"""The filter of the page "Add a filter"; tests/filters/test_guide_filter.py runs it through the contract."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.data.arrays import Polylines
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class FibreCropper(Filter):
    """Cut a part from both ends of every fibre.

    Parameters
    ----------
    fibres
        Polylines.
    part
        Fraction of the length to cut at each end.

    Attributes
    ----------
    output
        The polylines with new ends, as many points each as before.

    Raises
    ------
    ValueError
        If there are no fibres, or a point is not finite.

    Limitations
    -----------
    Arrays keep their values, though the points move.

    Examples
    --------
    >>> from fibre_cropper import FibreCropper
    >>> from vtkmuscle.filters import FibreMetrics, FibreTemplateSource
    >>> fibres = FibreTemplateSource(n_fibres=3).update().output
    >>> whole, belly = (FibreMetrics().apply(f)["Length"] for f in (fibres, FibreCropper()(fibres)))
    >>> bool(abs(belly / whole - 0.5).max() < 1e-9)
    True
    """

    part = Parameter(float, default=0.25, minimum=0.0, maximum=0.45)

    fibres = ports.Lines()
    output = OutputPort(vtkPolyData)

    def execute(self, fibres: Polylines) -> vtkPolyData:
        """Return the cut fibres."""
        return fibres.moved(np.vstack([self._cut(fibres.line(i)) for i in range(len(fibres))]))

    def _cut(self, line: np.ndarray) -> np.ndarray:
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        wanted = np.linspace(self.part * along[-1], (1.0 - self.part) * along[-1], len(line))
        return np.column_stack([np.interp(wanted, along, line[:, axis]) for axis in range(3)])
