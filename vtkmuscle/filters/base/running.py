"""Running any algorithm: bring it up to date at a time, on data, and raise what a filter upstream raised.

VTK prints a failure of its own beside the exception, and loses Ctrl-C while it calls Python: both are held
back.
"""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from vtkmuscle.data.pipeline_times import times_of
from vtkmuscle.filters.base.ports import source_of


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Hold Ctrl-C back until the block has been left.

    VTK ends the process when a KeyboardInterrupt comes out of an observer. Held back until the observer has
    returned, it is raised where the filter can be left in good order. Signals are Python's main thread's
    business; elsewhere, and where Ctrl-C is not handled in Python, this does nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    caught: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _frame: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if caught:
        handler(caught[0], None)


class _State:
    """The switch is one for the whole process, so the last thread that needs it off puts it back."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.users = 0
        self.displayed = 1
        self.here = threading.local()


_state = _State()


@contextmanager
def failure_messages_off() -> Iterator[None]:
    """Keep VTK quiet about filters that fail in this block, from their failure on.

    Before it VTK's warnings are shown as ever.
    """
    with _state.lock:
        if not _state.users:
            _state.displayed = vtkObject.GetGlobalWarningDisplay()
        _state.users += 1
    outer = getattr(_state.here, "off", False)
    _state.here.off = True
    try:
        yield
    finally:
        _state.here.off = outer
        with _state.lock:
            _state.users -= 1
            vtkObject.SetGlobalWarningDisplay(_state.displayed)


def silence_after_failure() -> None:
    """Switch VTK's messages off, in a filter that has failed within :func:`failure_messages_off`."""
    if getattr(_state.here, "off", False):
        vtkObject.GlobalWarningDisplayOff()


_TIME = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()


class Output:
    """What ``update()`` returns: the outputs of an algorithm, as ``vtkAlgorithm.update()`` does."""

    def __init__(self, algorithm: Any) -> None:
        self.algorithm = algorithm

    @property
    def output(self) -> Any:
        """The data object, or a tuple of them where there are several outputs."""
        outputs = tuple(
            self.algorithm.GetOutputDataObject(port)
            for port in range(self.algorithm.GetNumberOfOutputPorts())
        )
        return outputs[0] if len(outputs) == 1 else outputs


def time_asked(algorithm: Any) -> float | None:
    """Return the time that an algorithm's output was last asked for, None where it never was."""
    info = algorithm.GetOutputInformation(0)
    return float(info.Get(_TIME)) if info.Has(_TIME) else None


def ask_for(algorithm: Any, time: float | None) -> None:
    """Ask for a time at the next update; with None for the last time step."""
    info = algorithm.GetOutputInformation(0)
    if time is None:
        info.Remove(_TIME)
    else:
        info.Set(_TIME, float(time))


def update(algorithm: Any, time: float | None = None) -> Output:
    """Bring an algorithm's output up to date, and raise the original error where that fails.

    Parameters
    ----------
    algorithm : vtkAlgorithm
        One of ours or VTK's.
    time : float, optional
        Pipeline time to ask for; by default the one that was asked for last, else the last time step.

    Raises
    ------
    Exception
        Whatever a filter of ours raised, this one or one upstream.
    """
    chain = list(upstream(algorithm))
    filters = [each for each in reversed(chain) if hasattr(each, "take_failure")]
    for each in filters:
        each.check_connections()
    with failure_messages_off():
        algorithm.UpdateInformation()
        asked = time_asked(algorithm) if time is None else float(time)
        # Nobody asked: an algorithm upstream may still stand where another branch asked for it.
        steps = times_of(algorithm.GetOutputInformation(0))
        ask_for(algorithm, steps[-1] if asked is None and steps else asked)
        if time is not None and steps and not steps[0] <= time <= steps[-1]:
            warnings.warn(
                f"{type(algorithm).__name__}: time {time:g} is outside of the motion, {steps[0]:g} to "
                f"{steps[-1]:g}: what is at its end is taken; ask for a time within",
                stacklevel=3,
            )
        done = algorithm.GetExecutive().Update()  # vtkAlgorithm.Update() says nothing before VTK 9.7
        ask_for(algorithm, asked)
    for each in filters:
        failure = each.take_failure()
        if failure is not None:
            raise failure
    if not done:
        raise RuntimeError(
            f"{type(algorithm).__name__}: an algorithm upstream failed; VTK's message above says which"
        )
    return Output(algorithm)


def run_on(first: Any, last: Any, inputs: Sequence[Any], time: float | None) -> tuple[Any, ...]:
    """Connect inputs to the first ports of one algorithm, and return copies of what another then gives.

    Parameters
    ----------
    first, last : vtkAlgorithm
        Ends of a chain; they may be the same.
    inputs : sequence
        In the order of the ports of ``first``; the connections are as before in the end.
    time : float or None
        As of :func:`update`.

    Returns
    -------
    tuple of vtkDataObject
        Shallow copies, one per output port, that later updates do not change.
    """
    count = first.GetNumberOfInputPorts()
    if len(inputs) > count:
        raise TypeError(f"{type(first).__name__} has {count} input port(s), {len(inputs)} given")
    connected = [first.GetNumberOfInputConnections(port) > 0 for port in range(len(inputs))]
    before = [first.GetInputConnection(port, 0) if there else None for port, there in enumerate(connected)]
    # A vtkAlgorithmOutput does not keep its producer alive: hold on to it while it is disconnected.
    producers: list[Any] = [connection and connection.GetProducer() for connection in before]
    try:
        for port, value in enumerate(inputs):
            source = _checked(first, port, value)
            producers.append(source)
            first.SetInputConnection(port, source and source[0].GetOutputPort(source[1]))
        outputs = update(last, time).output
        return tuple(_shallow(data) for data in (outputs if isinstance(outputs, tuple) else (outputs,)))
    finally:
        for port, connection in enumerate(before):
            first.SetInputConnection(port, connection)
        producers.clear()


def wrapped(results: tuple[Any, ...]) -> Any:
    """Return data objects as PyVista's: one of them, or a tuple of several."""
    import pyvista  # noqa: PLC0415 -- filters work without PyVista

    return one_or_all(tuple(pyvista.wrap(data) for data in results))


def one_or_all(results: tuple[Any, ...]) -> Any:
    """Return the only item of a tuple, or the tuple where there are several."""
    return results[0] if len(results) == 1 else results


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


def _checked(algorithm: Any, port: int, value: Any) -> tuple[Any, int] | None:
    """Return what stands for a value on an input port, one of ours or of VTK's."""
    checked = getattr(algorithm, "source_for", None)
    return source_of(value) if checked is None else checked(port, value)


def _shallow(data: Any) -> Any:
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy


class Runnable:
    """What can be run: a filter, or a chain of them."""

    @property
    def _ends(self) -> tuple[Any, Any]:
        """The algorithm that data go into, and the one that results come from."""
        return self, self

    @property
    def time(self) -> float | None:
        """Pipeline time that the output is asked for, until another one is; None is the last time step."""
        return time_asked(self._ends[1])

    @time.setter
    def time(self, value: float | None) -> None:
        ask_for(self._ends[1], value)

    def update(self, time: float | None = None) -> Output:
        """Bring the output up to date, and raise the original error where that fails.

        Parameters
        ----------
        time : float, optional
            Pipeline time to ask for; by default :attr:`time`.

        Returns
        -------
        Output
            With the property ``output``: the data object (or a tuple of them).

        Raises
        ------
        Exception
            Whatever a filter raised, this one or one upstream.
        """
        return update(self._ends[1], time)

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
            A copy that later updates do not change (a tuple where there are several outputs).

        Raises
        ------
        TypeError
            For more inputs than ports, or an input that is not of the port's kind.
        Exception
            Whatever a filter raised, this one or one upstream.
        """
        return wrapped(run_on(*self._ends, inputs, time))

    def __call__(self, *inputs: Any, time: float | None = None) -> Any:
        """Run as :meth:`apply` does, and return the result as a bare VTK data object (a copy)."""
        return one_or_all(run_on(*self._ends, inputs, time))
