"""Measures of fibres as tables and summaries."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import field_array
from vtkmuscle.io.csv_table import write_rows

#: Field arrays with a value per muscle.
_WHOLE = ("MuscleVolume", "PCSA", "PCSALine")


def fibre_columns(fibres: vtkPolyData) -> dict[str, NDArray[np.float64]]:
    """Return the scalar cell arrays (n_fibres,) by name, sorted."""
    data = fibres.GetCellData()
    arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
    columns = {
        array.GetName(): np.array(vtk_to_numpy(array), dtype=np.float64)
        for array in arrays
        if array is not None and array.GetNumberOfComponents() == 1
    }
    return dict(sorted(columns.items()))


def fibre_summary(fibres: vtkPolyData) -> dict[str, dict[str, float]]:
    """Return ``mean``, ``sd``, ``min`` and ``max`` of each cell array.

    ``sd`` is the standard deviation of the population; units are the array's.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics`.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource
    >>> from vtkmuscle.filters import FibreMetrics
    >>> from vtkmuscle.io import fibre_summary
    >>> fibre = vtkLineSource(point1=(0, 0, 0), point2=(3, 4, 0)).update().output
    >>> fibre_summary(FibreMetrics()(fibre))["Length"]
    {'mean': 5.0, 'sd': 0.0, 'min': 5.0, 'max': 5.0}
    """
    return {
        name: spread(values)
        for name, values in fibre_columns(fibres).items()
        if name != "FibreId" and len(values)
    }


def muscle_summary(fibres: vtkPolyData) -> dict[str, float | list[float]]:
    """Return the measures of a muscle as a whole.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics` with ``architecture``.

    Returns
    -------
    dict
        The available measures of ``MuscleVolume``, ``PCSA``, ``PCSALine``, ``LineOfAction`` (3 numbers) and
        ``CentroidPathLength``.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreMetrics
    >>> from vtkmuscle.io import muscle_summary
    >>> from vtkmuscle.phantoms import fibre_block
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = fibre_block("parallel")
    >>> muscle, attachments = phantom.muscles["block"], phantom.attachments["block"]
    >>> fibres = decompose(muscle, attachments, n_fibres=20).update().output
    >>> summary = muscle_summary(FibreMetrics(architecture=True)(fibres, muscle))
    >>> round(summary["MuscleVolume"]), round(summary["PCSA"])
    (96000, 800)
    """
    arrays = {
        name: np.asarray(values, dtype=np.float64)
        for name in (*_WHOLE, "LineOfAction", "CentroidPath")
        if (values := field_array(fibres, name)) is not None
    }
    summary: dict[str, float | list[float]] = {
        name: float(arrays[name][0]) for name in _WHOLE if name in arrays
    }
    if "LineOfAction" in arrays:
        summary["LineOfAction"] = arrays["LineOfAction"].ravel().tolist()
    if "CentroidPath" in arrays:
        steps = np.diff(arrays["CentroidPath"].reshape(-1, 3), axis=0)
        summary["CentroidPathLength"] = float(np.linalg.norm(steps, axis=1).sum())
    return summary


def spread(values: NDArray[np.float64]) -> dict[str, float]:
    """Return ``mean``, ``sd`` (of the population), ``min`` and ``max`` of values."""
    measures = {"mean": values.mean(), "sd": values.std(), "min": values.min(), "max": values.max()}
    return {name: float(value) for name, value in measures.items()}


def write_fibre_table(fibres: vtkPolyData, path: str | PathLike[str]) -> Path:
    """Write the measures of fibres as CSV, a row per fibre.

    Columns are the cell arrays.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics`.
    path : path
        Replaced if existing.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If the fibres have no cell arrays.
    """
    columns = fibre_columns(fibres)
    if not columns:
        problem = "the fibres have no cell arrays"
        raise InputError("write_fibre_table", problem, "run FibreMetrics on the fibres first")
    rows = zip(*(map("%.10g".__mod__, column) for column in columns.values()), strict=True)
    write_rows(Path(path), [list(columns), *rows])
    return Path(path)
