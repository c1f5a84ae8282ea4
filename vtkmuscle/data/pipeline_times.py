"""Pipeline time: announced, asked for, and the inputs at a time. Provenance of data."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vtkmodules.vtkCommonCore import vtkGarbageCollector, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from vtkmuscle._version import __version__
from vtkmuscle.data.arrays import field_strings, string_array

_STEPS = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
_RANGE = vtkStreamingDemandDrivenPipeline.TIME_RANGE()
_TIME = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()


def announce_times(info: Any, steps: Sequence[float]) -> None:
    """Write ascending time steps and their range into an output's information, in RequestInformation."""
    ends = [min(steps), max(steps)] if len(steps) else []
    for key, times in ((_STEPS, steps), (_RANGE, ends)):
        info.Remove(key)
        for time in times:
            info.Append(key, float(time))


def times_of(info: Any) -> tuple[float, ...]:
    """Return the time steps that a port's information announces, () where there are none."""
    return tuple(info.Get(_STEPS)) if info is not None and info.Has(_STEPS) else ()


def time_asked(info: Any) -> float | None:
    """Return the time that is asked for in a port's information, None where none is."""
    return float(info.Get(_TIME)) if info.Has(_TIME) else None


def requested_time(info: Any) -> float | None:
    """Return the time asked for, else the last time step; None where the pipeline has no time."""
    steps = times_of(info)
    return steps[-1] if steps and not info.Has(_TIME) else time_asked(info)


def request_time(info: Any, time: float | None) -> None:
    """Ask for a time in a port's information; None takes the request back."""
    if time is None:
        info.Remove(_TIME)
    else:
        info.Set(_TIME, float(time))


def vtk_collector() -> type[vtkGarbageCollector] | None:
    """Return VTK's collector of reference cycles, which can be deferred; None out of the main thread.

    It looks through the whole pipeline each time that Python lets go of an object of it, which takes half of
    the time beside the kernels (``benchmarks/bench_step.py --stages``). Once in an update will do.
    """
    return vtkGarbageCollector if threading.current_thread() is threading.main_thread() else None


def input_at(algorithm: Any, port: int, time: float | None) -> Any:
    """Return the data on an algorithm's input port (of one connection) at a time; None where that failed.

    Data that is there already is not computed again.
    """
    if (collector := vtk_collector()) is not None:
        collector.Collect()  # what is left of the time before
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
        The output of a filter, or data read from a file of it.

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
    return [json.loads(entry) for entry in field_strings(data, PROVENANCE)]


def provenance_entry(name: str, parameters: Mapping[str, Any]) -> str:
    """Return the entry that a filter with these parameters adds to its output."""
    step = {"filter": name, "parameters": dict(parameters), "vtkmuscle": __version__}
    return json.dumps(step, default=lambda value: type(value).__name__)


def joined_provenance(earlier: Iterable[vtkStringArray], entry: str) -> vtkStringArray:
    """Return the array of which filters made a result: those of its inputs' arrays, then this one."""
    entries = [array.GetValue(i) for array in earlier for i in range(array.GetNumberOfValues())]
    return string_array(PROVENANCE, dict.fromkeys([*entries, entry]))
