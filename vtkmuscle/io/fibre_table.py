"""Measures of fibres as tables and summaries."""

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array
from vtkmuscle.io.csv_table import write_rows

#: Field arrays with a value per muscle.
_WHOLE = ("MuscleVolume", "PCSA", "PCSALine")


def fibre_columns(fibres: vtkPolyData) -> dict[str, Floats]:
    """Return the scalar cell arrays (n_fibres,) by name, sorted."""
    arrays = map(fibres.GetCellData().GetArray, range(fibres.GetCellData().GetNumberOfArrays()))
    scalars = {each.GetName(): each for each in arrays if each and each.GetNumberOfComponents() == 1}
    return {name: np.array(vtk_to_numpy(scalars[name]), dtype=np.float64) for name in sorted(scalars)}


def muscle_summary(fibres: vtkPolyData) -> dict[str, Any]:
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
    whole = {name: values for name in _WHOLE if (values := field_array(fibres, name)) is not None}
    summary: dict[str, Any] = {name: float(values[0]) for name, values in whole.items()}
    if (line := field_array(fibres, "LineOfAction")) is not None:
        summary["LineOfAction"] = line.ravel().tolist()
    if (path := field_array(fibres, "CentroidPath")) is not None:
        steps = np.diff(path.reshape(-1, 3), axis=0)
        summary["CentroidPathLength"] = float(np.linalg.norm(steps, axis=1).sum())
    return summary


def spread(values: Floats) -> dict[str, float]:
    """Return ``mean``, ``sd`` (of the population), ``min`` and ``max`` of values."""
    measures = {"mean": values.mean(), "sd": values.std(), "min": values.min(), "max": values.max()}
    return {name: float(value) for name, value in measures.items()}


def write_fibre_table(fibres: vtkPolyData, path: str | PathLike[str]) -> Path:
    """Write the measures of fibres as CSV: a row per fibre, a column per array.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics`.
    path : path
        Replaced if existing.

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
