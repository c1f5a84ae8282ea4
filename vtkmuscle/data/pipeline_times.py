"""Pipeline time: announced steps, requests, inputs at a time. Provenance."""

import json
import threading
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vtkmodules.vtkCommonCore import vtkGarbageCollector, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from vtkmuscle import __version__
from vtkmuscle.data.arrays import field_strings, string_array

# Calls of a key find their signature in a twentieth of the time that those of the information take.
_STEPS = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
_RANGE = vtkStreamingDemandDrivenPipeline.TIME_RANGE()
_TIME = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()


def announce_times(info: Any, steps: Sequence[float]) -> None:
    """Write ascending time steps and their range into an output's information."""
    ends = [min(steps), max(steps)] if len(steps) else []
    for key, times in ((_STEPS, steps), (_RANGE, ends)):
        info.Remove(key)
        for time in times:
            info.Append(key, float(time))


def times_of(info: Any) -> tuple[float, ...]:
    """Return the announced time steps of a port, () without steps."""
    return tuple(info.Get(_STEPS)) if info is not None and _STEPS.Has(info) else ()


def time_asked(info: Any) -> float | None:
    """Return the requested time of a port, None without a request."""
    return float(_TIME.Get(info)) if _TIME.Has(info) else None


def requested_time(info: Any) -> float | None:
    """Return the requested time, else the last step; None without pipeline time."""
    return time_asked(info) if _TIME.Has(info) else (None, *times_of(info))[-1]


def request_time(info: Any, time: float | None) -> None:
    """Request a time at a port; None withdraws the request."""
    if time is None:
        _TIME.Remove(info)
    else:
        _TIME.Set(info, float(time))


def vtk_collector() -> type[vtkGarbageCollector] | None:
    """Return VTK's deferrable collector of reference cycles; None outside the main thread."""
    return vtkGarbageCollector if threading.current_thread() is threading.main_thread() else None


def input_at(algorithm: Any, port: int, time: float) -> Any:
    """Return an input's data at a time, computed if missing; RuntimeError on failure."""
    if (collector := vtk_collector()) is not None:
        collector.Collect()  # leftovers of the time before
    connection = algorithm.GetInputConnection(port, 0)
    producer, index = connection.GetProducer(), connection.GetIndex()
    request_time(producer.GetOutputInformation(index), time)
    done = producer.Update(index)
    data = producer.GetOutputDataObject(index)
    # VTK before 9.3 returns None here rather than a success flag.
    if (done is not None and not done) or not data.GetNumberOfElements(vtkDataObject.POINT):
        what = f"the {algorithm.input_ports[port].name} at time {time:g} could not be computed"
        raise RuntimeError(f"{type(algorithm).__name__}: {what}")
    return data


def state_of_inputs(algorithm: Any, ports: Iterable[int]) -> list[int]:
    """Return numbers that change with anything upstream, except the requested time."""
    state: list[int] = []
    for port in ports:
        connection = algorithm.GetInputConnection(port, 0)
        producer = connection.GetProducer()
        state += [producer.GetMTime(), connection.GetIndex(), producer.GetExecutive().GetPipelineMTime()]
    return state


#: Field array with a JSON object per filter, in order of execution.
PROVENANCE = "Provenance"


def provenance_of(data: Any) -> list[dict[str, Any]]:
    """Return the filters behind a data set, first to last.

    ``data`` is the output of a filter, or read from its file. Each dict has ``filter``, ``parameters`` (class
    names for objects) and ``vtkmuscle``, the version; there is none without provenance.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource, provenance_of
    >>> [step["filter"] for step in provenance_of(FibreTemplateSource(n_fibres=3).update().output)]
    ['FibreTemplateSource']
    """
    return [json.loads(entry) for entry in field_strings(data, PROVENANCE)]


def provenance_array(inputs: Iterable[Any], name: str, parameters: Mapping[str, Any]) -> vtkStringArray:
    """Return the provenance of a result: the entries of inputs (None: open port), then the filter's."""
    entries = [entry for data in inputs if data is not None for entry in field_strings(data, PROVENANCE)]
    step = {"filter": name, "parameters": dict(parameters), "vtkmuscle": __version__}
    own = json.dumps(step, default=lambda value: type(value).__name__)
    return string_array(PROVENANCE, dict.fromkeys([*entries, own]))
