"""Running any algorithm: bring it up to date at a time, on data, and raise what a filter upstream raised.

Python has the signal of Ctrl-C: pressed while a filter executes, it comes out of ``update()``. VTK itself
prints and drops it in Python code of its other callbacks, and ends the process in an observer of an event.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from vtkmodules.vtkCommonCore import vtkOutputWindow

from vtkmuscle.data.arrays import shallow_copy
from vtkmuscle.data.pipeline_times import request_time, time_asked, times_of, vtk_collector
from vtkmuscle.filters.base.ports import source_of

#: Whether this thread is within :func:`update`, which raises what a filter's executive would print.
_within = threading.local()


def show_error(_executive: Any, _event: str, message: str) -> None:
    """Show what a filter's executive says of a failure, unless :func:`update` raises the failure."""
    if not getattr(_within, "update", False):
        vtkOutputWindow.GetInstance().DisplayErrorText(message)


show_error.CallDataType = "string0"  # type: ignore[attr-defined]


class Output:
    """The result of ``update()``: an output of an algorithm."""

    def __init__(self, algorithm: Any, port: int = 0) -> None:
        self.algorithm, self.port = algorithm, port

    @property
    def output(self) -> Any:
        """The data object."""
        return self.algorithm.GetOutputDataObject(self.port)


def update(algorithm: Any, time: float | None = None, port: int = 0) -> Output:
    """Bring an output of an algorithm, ours or VTK's, up to date; raise the original error of a failure.

    By default the time is the one that was asked for last, else the last time step.
    """
    executive, outer = algorithm.GetExecutive(), getattr(_within, "update", False)
    _within.update = True
    if (collector := vtk_collector()) is not None:
        collector.DeferredCollectionPush()
    try:
        done = executive.UpdateInformation()
        info = algorithm.GetOutputInformation(port)
        asked = time_asked(info) if time is None else float(time)
        # Nobody asked: an algorithm upstream may still stand where another branch asked for it.
        steps = times_of(info)
        request_time(info, steps[-1] if asked is None and steps else asked)
        if time is not None and steps and not steps[0] <= time <= steps[-1]:
            warnings.warn(
                f"{type(algorithm).__name__}: time {time:g} is outside of the motion, {steps[0]:g} to "
                f"{steps[-1]:g}: the pose at its end is taken; ask for a time within",
                stacklevel=3,
            )
        done = done and executive.Update(port)
        request_time(info, asked)
    finally:
        _within.update = outer
        if collector is not None:
            collector.DeferredCollectionPop()
    if not done:
        _raise_failure(algorithm)
    return Output(algorithm, port)


def _raise_failure(algorithm: Any) -> NoReturn:
    """Raise why an algorithm could not be brought up to date: the failure farthest upstream."""
    filters = [each for each in reversed(list(upstream(algorithm))) if hasattr(each, "take_failure")]
    for each in filters:
        each.check_connections()
    failures = [failure for each in filters if (failure := each.take_failure()) is not None]
    if failures:
        raise failures[0]
    raise RuntimeError(
        f"{type(algorithm).__name__}: an algorithm upstream failed; VTK's message above says which"
    )


def run_on(first: Any, last: Any, inputs: Sequence[Any], time: float | None) -> Any:
    """Connect inputs to a chain's first algorithm, and return a shallow copy of the last one's output.

    Afterwards the connections are as before. Later updates do not change the copy.
    """
    count = first.GetNumberOfInputPorts()
    if len(inputs) > count:
        raise TypeError(f"{type(first).__name__} has {count} input port(s), {len(inputs)} given")
    before = [
        first.GetInputConnection(port, 0) if first.GetNumberOfInputConnections(port) else None
        for port in range(len(inputs))
    ]
    # A vtkAlgorithmOutput does not keep its producer alive: hold on to it while it is disconnected.
    producers: list[Any] = [connection and connection.GetProducer() for connection in before]
    source_for = getattr(first, "source_for", lambda _port, value: source_of(value))  # checked by our filters
    try:
        for port, value in enumerate(inputs):
            source = source_for(port, value)
            producers.append(source)
            first.SetInputConnection(port, source and source[0].GetOutputPort(source[1]))
        return shallow_copy(update(last, time).output)
    finally:
        for port, connection in enumerate(before):
            first.SetInputConnection(port, connection)
        producers.clear()


def upstream(algorithm: Any) -> Iterator[Any]:
    """Yield an algorithm and all that it depends on, nearest first, each once."""
    seen: list[Any] = []
    waiting = [algorithm]
    while waiting:
        current = waiting.pop(0)
        if any(current is other for other in seen):
            continue
        seen.append(current)
        yield current
        for port in range(current.GetNumberOfInputPorts()):
            indices = range(current.GetNumberOfInputConnections(port))
            waiting.extend(current.GetInputAlgorithm(port, index) for index in indices)


class Runnable:
    """What can be run: a filter, or a chain of them."""

    @property
    def _ends(self) -> tuple[Any, Any]:
        """The algorithm that data go into, and the one that results come from."""
        return self, self

    @property
    def time(self) -> float | None:
        """Pipeline time that the output is asked for, until another one is; None is the last time step."""
        return time_asked(self._ends[1].GetOutputInformation(0))

    @time.setter
    def time(self, value: float | None) -> None:
        request_time(self._ends[1].GetOutputInformation(0), value)

    def update(self, time: float | None = None, port: int = 0) -> Output:
        """Bring an output up to date, and raise the original error where that fails.

        Parameters
        ----------
        time : float, optional
            Pipeline time to ask for; by default :attr:`time`.
        port : int, optional
            Number of the output.

        Returns
        -------
        Output
            With the property ``output``: the data object.

        Raises
        ------
        Exception
            The error of this filter, or of one upstream.
        """
        return update(self._ends[1], time, port)

    def apply(self, *inputs: Any, time: float | None = None) -> Any:
        """Run on data, and return the result wrapped for PyVista.

        Parameters
        ----------
        *inputs : vtkDataObject, vtkAlgorithm, chain, vtkAlgorithmOutput or None
            One per input port (of the first filter of a chain), in order; missing ones keep their connection.
        time : float, optional
            Pipeline time to ask for; by default :attr:`time`.

        Returns
        -------
        pyvista.DataObject
            A copy of the first output, which later updates do not change.

        Raises
        ------
        TypeError
            For more inputs than ports, or an input that is not of the port's kind.
        Exception
            The error of this filter, or of one upstream.
        """
        import pyvista  # noqa: PLC0415 -- filters work without PyVista

        return pyvista.wrap(run_on(*self._ends, inputs, time))

    def __call__(self, *inputs: Any, time: float | None = None) -> Any:
        """Run as :meth:`apply` does, and return the result as a bare VTK data object (a copy)."""
        return run_on(*self._ends, inputs, time)
