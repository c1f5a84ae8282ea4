"""Running any algorithm: bring it up to date at a time, on data, and raise what a filter upstream raised.

VTK prints a message of its own beside the exception, and loses Ctrl-C while it calls Python. Both are held
back.
"""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from vtkmodules.vtkCommonCore import vtkObject

from vtkmuscle.data.arrays import shallow_copy
from vtkmuscle.data.pipeline_times import request_time, time_asked, times_of
from vtkmuscle.filters.base.ports import source_of

#: Handlers of Ctrl-C that blocks of :func:`interrupts_deferred` have put aside, outermost first.
_deferred: list[Callable[[int, FrameType | None], Any]] = []


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Hold Ctrl-C back until the block has been left.

    VTK loses a KeyboardInterrupt that comes out of Python that it calls, and ends the process when it comes
    out of an observer. Elsewhere than in Python's main thread, and where Ctrl-C is not handled in Python,
    this does nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    caught: list[int] = []
    _deferred.append(handler)
    signal.signal(signal.SIGINT, lambda number, _frame: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, _deferred.pop())
        if caught:
            handler(caught[0], None)


@contextmanager
def interrupts_let_through() -> Iterator[None]:
    """Let Ctrl-C through at once, in a part of a block of :func:`interrupts_deferred` that keeps errors."""
    if threading.current_thread() is not threading.main_thread() or not _deferred:
        yield
        return
    before = signal.signal(signal.SIGINT, _deferred[-1])
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _Messages:
    """VTK's switch for messages is one for the whole process: the last thread that needs it restores it."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.users = 0
        self.displayed = 1
        self.thread = threading.local()


_messages = _Messages()


@contextmanager
def failure_messages_off() -> Iterator[None]:
    """Silence VTK from the moment at which a filter fails in this block; before, its warnings are shown."""
    with _messages.lock:
        if not _messages.users:
            _messages.displayed = vtkObject.GetGlobalWarningDisplay()
        _messages.users += 1
    outer = getattr(_messages.thread, "off", False)
    _messages.thread.off = True
    try:
        yield
    finally:
        _messages.thread.off = outer
        with _messages.lock:
            _messages.users -= 1
            vtkObject.SetGlobalWarningDisplay(_messages.displayed)


def silence_after_failure() -> None:
    """Switch VTK's messages off, in a filter that has failed within :func:`failure_messages_off`."""
    if getattr(_messages.thread, "off", False):
        vtkObject.GlobalWarningDisplayOff()


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
    filters = [each for each in reversed(list(upstream(algorithm))) if hasattr(each, "take_failure")]
    for each in filters:
        each.check_connections()
    with failure_messages_off(), interrupts_deferred():
        algorithm.UpdateInformation()
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
        done = algorithm.GetExecutive().Update(port)  # vtkAlgorithm.Update() returns None before VTK 9.7
        request_time(info, asked)
    for each in filters:
        failure = each.take_failure()
        if failure is not None:
            raise failure
    if not done:
        raise RuntimeError(
            f"{type(algorithm).__name__}: an algorithm upstream failed; VTK's message above says which"
        )
    return Output(algorithm, port)


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
