"""Times of a pipeline: announced, asked for, those that lead to one, and what is upstream at them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from vtkmuscle._version import __version__


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


_TIME = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()


def requested_time(info: Any) -> float | None:
    """Return the time that is asked for in a port's information: the last time step where none is.

    None where the pipeline has no time.
    """
    if info.Has(_TIME):
        return float(info.Get(_TIME))
    steps = times_of(info)
    return steps[-1] if steps else None


def request_time(info: Any, time: float | None) -> None:
    """Ask for a time in a port's information."""
    info.Set(_TIME, time)


def path_to(time: float | None, steps: Sequence[float]) -> list[float | None]:
    """Return the times whose frames lead to the one at a time, in order, that one last.

    Parameters
    ----------
    time : float or None
        None where there are no steps.
    steps : sequence of float
        All time steps, ascending; where there are none, the path is the time itself.
    """
    return [time] if time is None else [*[step for step in steps if step < time], time]


def input_at(algorithm: Any, port: int, time: float | None) -> Any:
    """Return what an input port has at a time; what is there already is not computed again.

    Parameters
    ----------
    algorithm : vtkAlgorithm
        Whose input it is.
    port : int
        Of one connection.
    time : float or None
        Pipeline time.

    Returns
    -------
    vtkDataObject or None
        None where it could not be computed.
    """
    connection = algorithm.GetInputConnection(port, 0)
    producer, index = connection.GetProducer(), connection.GetIndex()
    request_time(producer.GetOutputInformation(index), time)
    done = producer.Update(index)
    data = producer.GetOutputDataObject(index)
    # VTK before 9.3 returns None here rather than a success flag.
    failed = done is not None and not done
    return None if failed or not data.GetNumberOfElements(vtkDataObject.POINT) else data


def state_of_inputs(algorithm: Any, ports: Iterable[int]) -> list[int]:
    """Return numbers that change with anything upstream of some input ports, but not with the time asked for.

    They are the pipelines' modification times; a data set's own would change with each time. Two producers
    behind one source share it, so theirs are among them as well.
    """
    state: list[int] = []
    for port in ports:
        connection = algorithm.GetInputConnection(port, 0)
        producer = connection.GetProducer()
        state += [producer.GetMTime(), connection.GetIndex(), producer.GetExecutive().GetPipelineMTime()]
    return state


#: Name of the field array: one JSON object per filter, in the order in which they ran.
PROVENANCE = "Provenance"


def provenance_of(data: Any) -> list[dict[str, Any]]:
    """Return which filters made a data set, the first one first.

    Parameters
    ----------
    data : vtkDataObject
        What a filter gave, or what was read from a file of it.

    Returns
    -------
    list of dict
        Each with ``filter``, ``parameters`` (objects by the name of their class) and ``vtkmuscle``, the
        version; empty where nothing is known.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource, provenance_of
    >>> [step["filter"] for step in provenance_of(FibreTemplateSource(n_fibres=3).update().output)]
    ['FibreTemplateSource']
    """
    return [json.loads(entry) for entry in _entries(data)]


def provenance_entry(name: str, parameters: Mapping[str, Any]) -> str:
    """Return what a filter with these parameters adds to what it makes."""
    step = {"filter": name, "parameters": dict(parameters), "vtkmuscle": __version__}
    return json.dumps(step, default=lambda value: type(value).__name__)


def add_provenance(result: Any, inputs: Sequence[Any], entry: str) -> None:
    """Write into the field data of a result which filters made it: those of all inputs, then this one."""
    entries: dict[str, None] = {}
    for data in inputs:
        entries.update(dict.fromkeys([] if data is None else _entries(data)))
    entries[entry] = None
    array = vtkStringArray()
    array.SetName(PROVENANCE)
    for each in entries:
        array.InsertNextValue(each)
    result.GetFieldData().AddArray(array)


def _entries(data: Any) -> list[str]:
    array = data.GetFieldData().GetAbstractArray(PROVENANCE)
    if not isinstance(array, vtkStringArray):
        return []
    return [array.GetValue(i) for i in range(array.GetNumberOfValues())]
