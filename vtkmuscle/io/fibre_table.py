"""What was measured of fibres, as a table and in short."""

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


def fibre_columns(fibres: vtkPolyData) -> dict[str, NDArray[np.float64]]:
    """Return every cell array of numbers, one per fibre, by its name, in alphabetical order.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics`.

    Returns
    -------
    dict of str to (n_fibres,) array
        Columns.
    """
    data = fibres.GetCellData()
    arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
    columns = {
        array.GetName(): np.array(vtk_to_numpy(array), dtype=np.float64)
        for array in arrays
        if array is not None and array.GetNumberOfComponents() == 1
    }
    return dict(sorted(columns.items()))


def fibre_summary(fibres: vtkPolyData) -> dict[str, dict[str, float]]:
    """Return mean, standard deviation (of the population), least and largest of each measure.

    Parameters
    ----------
    fibres : vtkPolyData
        As of :func:`fibre_columns`.

    Returns
    -------
    dict
        Per cell array ``mean``, ``sd``, ``min`` and ``max``, in its unit.

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
    """Return what was measured of a muscle as a whole.

    Parameters
    ----------
    fibres : vtkPolyData
        From :class:`~vtkmuscle.filters.FibreMetrics` with ``architecture``, ``sections`` or both.

    Returns
    -------
    dict
        ``MuscleVolume``, ``PCSA`` and ``PCSALine`` as they are, ``LineOfAction`` as three numbers,
        ``CentroidPathLength`` from end to end of the centroid path, and of ``SectionArea``, ``SectionFibres``
        and ``SectionDensity`` the ``mean``, ``sd`` (of the population), ``min`` and ``max`` over the
        sections; those of them that were measured.

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
    found: dict[str, float | list[float] | dict[str, float]] = {}
    for name in ("MuscleVolume", "PCSA", "PCSALine"):
        values = field_array(fibres, name)
        if values is not None:
            found[name] = float(values[0])
    direction, path = field_array(fibres, "LineOfAction"), field_array(fibres, "CentroidPath")
    if direction is not None:
        found["LineOfAction"] = [float(component) for component in np.ravel(direction)]
    if path is not None:
        steps = np.linalg.norm(np.diff(np.asarray(path).reshape(-1, 3), axis=0), axis=1)
        found["CentroidPathLength"] = float(steps.sum())
    for name in ("SectionArea", "SectionFibres", "SectionDensity"):
        values = field_array(fibres, name)
        if values is not None:
            found[name] = spread(np.asarray(values, dtype=np.float64))
    return found


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
        raise InputError(
            "write_fibre_table", "the fibres have no cell arrays", "run FibreMetrics on them first"
        )
    rows = zip(*(map("%.10g".__mod__, column) for column in columns.values()), strict=True)
    write_rows(Path(path), [list(columns), *rows])
    return Path(path)
