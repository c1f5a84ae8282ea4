"""Time steps in the information of a pipeline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline


def announce_times(info: Any, steps: Sequence[float]) -> None:
    """Write time steps and their range into a port's information.

    Parameters
    ----------
    info : vtkInformation
        Of an output port, in RequestInformation.
    steps : sequence of float
        Ascending times.
    """
    info.Remove(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    for step in steps:
        info.Append(vtkStreamingDemandDrivenPipeline.TIME_STEPS(), float(step))
    info.Remove(vtkStreamingDemandDrivenPipeline.TIME_RANGE())
    if len(steps):
        info.Append(vtkStreamingDemandDrivenPipeline.TIME_RANGE(), float(min(steps)))
        info.Append(vtkStreamingDemandDrivenPipeline.TIME_RANGE(), float(max(steps)))


def times_of(info: Any) -> tuple[float, ...]:
    """Return the time steps that a port's information announces, () where there are none."""
    key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    if info is None or not info.Has(key):
        return ()
    times: tuple[float, ...] = info.Get(key)
    return times
