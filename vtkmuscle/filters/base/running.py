"""Runs of algorithms at a time, with errors from upstream.

Python handles Ctrl-C: pressed while a filter executes, KeyboardInterrupt leaves ``update()``. VTK itself
prints and drops the interrupt in other Python callbacks, and ends the process in an observer of an event.
"""

import math
import threading
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import quoted
from vtkmuscle.data.arrays import shallow_copy
from vtkmuscle.data.pipeline_times import request_time, time_asked, times_of, vtk_collector
from vtkmuscle.filters.base.ports import end_of, source_of

#: Whether this thread is in :func:`update`, which raises errors instead of printing them.
_within = threading.local()


def show_error(_executive: Any, _event: str, message: str) -> None:
    """Show an executive's error message outside of :func:`update`."""
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
    """Bring an output up to date, or raise the original error.

    The default time is the last requested time, or else the last time step.
    """
    if time is not None and not math.isfinite(time):
        raise InputError(type(algorithm).__name__, f"the time is {time}, but must be finite")
    executive, outer = algorithm.GetExecutive(), getattr(_within, "update", False)
    _within.update = True
    if (collector := vtk_collector()) is not None:
        collector.DeferredCollectionPush()
    try:
        done = executive.UpdateInformation()
        info = algorithm.GetOutputInformation(port)
        asked = time_asked(info) if time is None else float(time)
        # Without a request, an algorithm upstream may still have the time of another branch.
        steps = times_of(info)
        request_time(info, steps[-1] if asked is None and steps else asked)
        if time is not None and steps and not steps[0] <= time <= steps[-1]:
            words = f"time {time:g} is outside of the motion, {steps[0]:g} to {steps[-1]:g}: the nearest end"
            remedy = "of the motion is used; request a time within"
            warnings.warn(f"{type(algorithm).__name__}: {words} {remedy}", stacklevel=3)
        done = done and executive.Update(port)
        request_time(info, asked)
    finally:
        _within.update = outer
        if collector is not None:
            collector.DeferredCollectionPop()
    if done:
        return Output(algorithm, port)
    filters = [stage for stage in reversed(list(upstream(algorithm))) if hasattr(stage, "take_failure")]
    for stage in filters:
        stage.check_connections()
    for failure in [stage.take_failure() for stage in filters]:  # the farthest upstream first
        if failure is not None:
            raise failure
    raise RuntimeError(f"{type(algorithm).__name__}: an algorithm upstream failed; see VTK's message above")


def run_on(first: Any, last: Any, inputs: Sequence[Any], time: float | None) -> Any:
    """Run a chain on inputs; return a shallow copy.

    Connections are restored afterwards. Later updates do not change the copy.
    """
    count = first.GetNumberOfInputPorts()
    if len(inputs) > count:
        raise TypeError(f"{type(first).__name__} has {count} input port(s), got {len(inputs)} inputs")
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
    """Yield an algorithm and its dependencies, nearest first, without repeats."""
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
    """Base of filters and chains."""

    @property
    def _ends(self) -> tuple[Any, Any]:
        """First and last algorithm: input of data, output of results."""
        return self, self

    @property
    def time(self) -> float | None:
        """Requested pipeline time; None is the last time step."""
        return time_asked(self._ends[1].GetOutputInformation(0))

    @time.setter
    def time(self, value: float | None) -> None:
        request_time(self._ends[1].GetOutputInformation(0), value)

    def update(self, time: float | None = None, port: int = 0) -> Output:
        """Bring an output up to date, or raise the original error.

        Parameters
        ----------
        time : float, optional
            Pipeline time; by default :attr:`time`.
        port : int, optional
            Number of the output.

        Returns
        -------
        Output
            With the property ``output``: the data object.

        Raises
        ------
        Exception
            The error of this filter, or of a filter upstream.
        """
        return update(self._ends[1], time, port)

    def apply(self, *inputs: Any, time: float | None = None) -> Any:
        """Run on data, and return the result wrapped for PyVista.

        Parameters
        ----------
        *inputs : vtkDataObject, vtkAlgorithm, chain, vtkAlgorithmOutput or None
            Inputs in port order (of a chain's first filter); missing inputs keep their connection.
        time : float, optional
            Pipeline time; by default :attr:`time`.

        Returns
        -------
        pyvista.DataObject
            A copy of the first output, which later updates do not change.

        Raises
        ------
        TypeError
            For more inputs than ports, or an input that is not of the port's kind.
        Exception
            The error of this filter, or of a filter upstream.
        """
        import pyvista  # noqa: PLC0415 -- filters work without PyVista

        return pyvista.wrap(run_on(*self._ends, inputs, time))

    def __call__(self, *inputs: Any, time: float | None = None) -> Any:
        """Run as :meth:`apply`, without a PyVista wrapper."""
        return run_on(*self._ends, inputs, time)

    def __rshift__(self, right: Any) -> "Chain":
        return Chain(self, right)


class Chain(Runnable):
    """A chain of algorithms, used as its last algorithm.

    Data enter the first algorithm; the result is the output of the last algorithm. A filter's port takes a
    chain as input. ``>>`` gives a chain if a side is a filter or a chain of this package; between two VTK
    algorithms, and between VTK data and a filter, ``>>`` gives VTK's ``Pipeline``, whose ``update()`` is the
    ``update()`` of its last algorithm.

    Attributes
    ----------
    first, last : vtkAlgorithm
        Ends of the chain.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource, FibreTubes
    >>> tubes = FibreTemplateSource(n_fibres=3) >> FibreSmoother() >> FibreTubes(radius=0.1)
    >>> tubes.apply().n_points == tubes.output.GetNumberOfPoints()
    True
    """

    def __init__(self, left: Any, right: Any) -> None:
        source, target = source_of(left), end_of(right, "first")
        if source is None or not hasattr(target, "SetInputConnection"):
            raise TypeError(f"{quoted(left)} >> {quoted(right)}: a chain is made of data and algorithms")
        self.first, self.last = end_of(left, "first"), end_of(right, "last")
        several = target.GetInputPortInformation(0).Has(vtkAlgorithm.INPUT_IS_REPEATABLE())
        connect = target.AddInputConnection if several else target.SetInputConnection
        connect(source[0].GetOutputPort(source[1]))

    @property
    def _ends(self) -> tuple[Any, Any]:
        return self.first, self.last

    @property
    def output(self) -> Any:
        """The last algorithm's output, brought up to date."""
        return self.update().output

    def SetInputConnection(self, connection: Any) -> None:
        """Connect an output to the first algorithm."""
        self.first.SetInputConnection(connection)

    def GetInputPortInformation(self, port: int) -> Any:
        """Return what the first algorithm says of an input port."""
        return self.first.GetInputPortInformation(port)

    def GetOutputPort(self, port: int = 0) -> Any:
        """Return an output port of the last algorithm."""
        return self.last.GetOutputPort(port)

    def GetClassName(self) -> str:
        """Raise TypeError: PyVista's ``add_mesh`` cannot draw chains."""
        raise TypeError("PyVista draws algorithms, not chains: use add_mesh(chain.last)")
