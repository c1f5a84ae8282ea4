"""What a run wrote, read back for one time: bones, muscles and fibres in a pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import blocks_of, multiblock_from, set_cell_array, set_field_array
from vtkmuscle.io.temporal import SERIES_SUFFIXES, TimeSeries, read_series
from vtkmuscle.run.claim import read_report


@dataclass(frozen=True)
class Pose:
    """A frame of a run's results.

    Attributes
    ----------
    time : float
        Pipeline time.
    bones : vtkMultiBlockDataSet
        Where they are; one block where they were written as one file.
    muscles : list of vtkPolyData
        Deformed.
    fibres : list of vtkPolyData
        Of the muscles that have some.
    """

    time: float
    bones: vtkMultiBlockDataSet
    muscles: list[vtkPolyData]
    fibres: list[vtkPolyData]


def read_pose(folder: Path, time: float | None = None) -> Pose:
    """Read the frame of a run's results that is nearest to a time, by default the last.

    Raises
    ------
    InputError
        If the run ends before that time, or begins after it.
    FileNotFoundError
        If it is not the folder of a run, or one that finished no frame.
    """
    report = read_report(folder)
    if report is None:
        what = "it is no report of a run" if (folder / "report.json").exists() else "there is no such file"
        raise FileNotFoundError(f"{folder / 'report.json'}: {what}; give the folder of a run's results")
    names = report["muscles"]
    bones = series_of(folder, "bones")
    muscles = {name: series_of(folder, name) for name in names}
    fibres = [found for name in names if (found := series_of(folder, f"{name}_fibres"))]
    missing = [name for name, series in {"bones": bones, **muscles}.items() if series is None]
    if bones is None or missing:
        raise FileNotFoundError(
            f"{folder}: no frame was written of {', '.join(missing)}; run the scene again"
        )
    if time is not None and not bones.times[0] <= time <= bones.times[-1]:
        there = f"from {bones.times[0]:g} to {bones.times[-1]:g}"
        raise InputError(str(folder), f"it has no time {time:g}", f"give one {there}")
    at = bones.times[-1] if time is None else min(bones.times, key=lambda t: abs(t - time))
    moved = bones.at(at)
    return Pose(
        at,
        moved if isinstance(moved, vtkMultiBlockDataSet) else multiblock_from({"bones": moved}),
        [series.at(at) for series in muscles.values() if series is not None],
        [series.at(at) for series in fibres],
    )


def series_of(folder: Path, name: str) -> TimeSeries | None:
    """Return a series that a run wrote to its folder, in either format; None where there is none."""
    for suffix in SERIES_SUFFIXES:
        if (folder / f"{name}{suffix}").is_file():
            return read_series(folder / f"{name}{suffix}")
    return None


def merged(data: Any) -> vtkPolyData:
    """Return the blocks of a data set as one, with the cell array ``Bone``: the number of the block."""
    if isinstance(data, vtkPolyData):
        return data
    append = vtkAppendPolyData()
    blocks = blocks_of(data)
    for number, (_, block) in enumerate(blocks):
        numbered = vtkPolyData()
        numbered.ShallowCopy(block)
        set_cell_array(numbered, "Bone", np.full(block.GetNumberOfCells(), number, dtype=np.int32))
        append.AddInputData(numbered)
    append.SetOutputPointsPrecision(vtkAppendPolyData.DOUBLE_PRECISION)
    append.Update()
    merged: vtkPolyData = append.GetOutput()
    for name in ("Scene", "Units", "Version"):
        merged.GetFieldData().AddArray(blocks[0][1].GetFieldData().GetAbstractArray(name))
    set_field_array(merged, "BoneNames", ", ".join(name for name, _ in blocks))
    return merged
