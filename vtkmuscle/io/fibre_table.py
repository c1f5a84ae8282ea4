"""Measures of fibres, as a table and as a summary."""

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

#: Field arrays of a muscle with one value, and with a value per section.
_WHOLE = ("MuscleVolume", "PCSA", "PCSALine")
_SECTIONS = ("SectionArea", "SectionFibres", "SectionDensity")


def fibre_columns(fibres: vtkPolyData) -> dict[str, NDArray[np.float64]]:
    """Return every cell array of numbers (n_fibres,), by its name, in alphabetical order."""
    data = fibres.GetCellData()
    arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
    columns = {
        array.GetName(): np.array(vtk_to_numpy(array), dtype=np.float64)
        for array in arrays
        if array is not None and array.GetNumberOfComponents() == 1
    }
    return dict(sorted(columns.items()))


def fibre_summary(fibres: vtkPolyData) -> dict[str, dict[str, float]]:
    """Return ``mean``, ``sd`` (of the population), ``min`` and ``max`` of each cell array, in its unit.

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


def muscle_summary(fibres: vtkPolyData) -> dict[str, float | list[float] | dict[str, float]]:
    """Return the measures of a muscle as a whole.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics` with ``architecture``, ``sections`` or both.

    Returns
    -------
    dict
        The measured ones of ``MuscleVolume``, ``PCSA``, ``PCSALine``, ``LineOfAction`` (three numbers),
        ``CentroidPathLength``, and ``SectionArea``, ``SectionFibres`` and ``SectionDensity``, each with
        ``mean``, ``sd`` (of the population), ``min`` and ``max`` over the sections.

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
        name: np.asarray(field_array(fibres, name), dtype=np.float64)
        for name in (*_WHOLE, *_SECTIONS, "LineOfAction", "CentroidPath")
        if field_array(fibres, name) is not None
    }
    found: dict[str, float | list[float] | dict[str, float]] = {
        name: float(arrays[name][0]) for name in _WHOLE if name in arrays
    }
    if "LineOfAction" in arrays:
        found["LineOfAction"] = arrays["LineOfAction"].ravel().tolist()
    if "CentroidPath" in arrays:
        steps = np.diff(arrays["CentroidPath"].reshape(-1, 3), axis=0)
        found["CentroidPathLength"] = float(np.linalg.norm(steps, axis=1).sum())
    return found | {name: spread(arrays[name]) for name in _SECTIONS if name in arrays}


def spread(values: NDArray[np.float64]) -> dict[str, float]:
    """Return ``mean``, ``sd`` (of the population), ``min`` and ``max`` of values."""
    return {
        "mean": float(values.mean()),
        "sd": float(values.std()),
        "min": float(values.min()),
        "max": float(values.max()),
    }


def write_fibre_table(fibres: vtkPolyData, path: str | PathLike[str]) -> Path:
    """Write the measures of fibres as comma-separated values, a row per fibre and a column per cell array.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics`.
    path : path
        A file, replaced where it exists.

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
        raise InputError("write_fibre_table", problem, "run FibreMetrics on them first")
    rows = zip(*(map("%.10g".__mod__, column) for column in columns.values()), strict=True)
    write_rows(Path(path), [list(columns), *rows])
    return Path(path)
