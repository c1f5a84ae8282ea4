"""The base of all filters: declared parameters and ports on top of VTK's pipeline.

A filter declares its parameters and ports as class attributes and does its work in :meth:`Filter.execute`.
Everything else (validation, change guards, error propagation, progress, abort, pickling, documentation)
is here, once.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import (
    vtkAlgorithm,
    vtkDemandDrivenPipeline,
    vtkStreamingDemandDrivenPipeline,
    vtkTrivialProducer,
)

from vtkmuscle.data.pipeline_times import announce_times
from vtkmuscle.data.provenance import add_provenance, provenance_entry
from vtkmuscle.filters.base.docstrings import documented
from vtkmuscle.filters.base.failure_messages import failure_messages_off, silence_after_failure
from vtkmuscle.filters.base.interrupts import interrupts_deferred
from vtkmuscle.filters.base.parameters import InputPort, OutputPort, Parameter
from vtkmuscle.filters.base.pyvista_operator import mend_pyvista_operator

_RESERVED = frozenset(dir(vtkAlgorithm)) | {"update", "apply", "execute", "parameters"}


class AbortedError(Exception):
    """The filter was asked to stop (``AbortExecute``) and did, leaving its output empty."""


class Output:
    """What ``update()`` returns: the outputs of an algorithm, as ``vtkAlgorithm.update()`` does."""

    def __init__(self, algorithm: Filter) -> None:
        self.algorithm = algorithm

    @property
    def output(self) -> Any:
        """The data object, or a tuple of them where there are several outputs."""
        count = self.algorithm.GetNumberOfOutputPorts()
        outputs = tuple(self.algorithm.GetOutputDataObject(port) for port in range(count))
        return outputs[0] if count == 1 else outputs


class Filter(VTKPythonAlgorithmBase):
    """A VTK algorithm with declared parameters and ports.

    A subclass declares :class:`~vtkmuscle.filters.base.parameters.Parameter`,
    :class:`~vtkmuscle.filters.base.parameters.InputPort` and
    :class:`~vtkmuscle.filters.base.parameters.OutputPort` attributes and defines :meth:`execute`. Constructor
    arguments are keyword-only and equal to the parameters.

    Errors raised in :meth:`execute` are re-raised by :meth:`update` and :meth:`apply`, also where the
    failing filter is further upstream; VTK's own ``Update()`` returns ``False`` for them, every time.

    Raises
    ------
    TypeError
        For a keyword that is no parameter.
    ValueError
        For a value that is not allowed; the message says what is.
    """

    parameter_declarations: ClassVar[dict[str, Parameter[Any]]] = {}
    input_ports: ClassVar[tuple[InputPort, ...]] = ()
    output_ports: ClassVar[tuple[OutputPort, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        declared: dict[str, Any] = {}
        for base in reversed(cls.__mro__):
            declared.update(vars(base))
        cls.parameter_declarations = {n: d for n, d in declared.items() if isinstance(d, Parameter)}
        cls.input_ports = tuple(d for d in declared.values() if isinstance(d, InputPort))
        cls.output_ports = tuple(d for d in declared.values() if isinstance(d, OutputPort))
        taken = sorted(set(cls.parameter_declarations) & _RESERVED)
        if taken:
            raise TypeError(f"{cls.__name__}: VTK owns the name(s) {', '.join(taken)}")
        keywords = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=parameter.default)
            for name, parameter in cls.parameter_declarations.items()
        ]
        cls.__signature__ = inspect.Signature(keywords)
        own = cls.__dict__.get("__doc__") or ""
        cls.__doc__ = documented(own, cls.parameter_declarations, cls.input_ports, cls.output_ports)

    def __init__(self, **parameters: Any) -> None:
        self._parameter_values: dict[str, Any] = {}
        self._failure: BaseException | None = None
        self._provenance: tuple[int, str] | None = None
        self._progress_reached = 0.0
        self._producers: list[Any] = []
        #: Pipeline time of the request being executed; None where the pipeline has no time.
        self.request_time: float | None = None
        super().__init__(
            nInputPorts=len(self.input_ports),
            inputType="vtkDataObject",
            nOutputPorts=len(self.output_ports),
            outputType="vtkDataObject",
        )
        mend_pyvista_operator()
        unknown = sorted(set(parameters) - set(self.parameter_declarations))
        if unknown:
            known = ", ".join(self.parameter_declarations) or "none"
            raise TypeError(
                f"{type(self).__name__} has no parameter {', '.join(unknown)}; its parameters are: {known}"
            )
        for name, declaration in self.parameter_declarations.items():
            setattr(self, name, parameters.get(name, declaration.default))

    # ---------------------------------------------------------------- to be defined by subclasses

    def execute(self, *inputs: Any) -> Any:
        """Compute the output(s) from the inputs, given in port order (None for an open optional port).

        Inputs must not be changed. The result is a new data object (or a tuple, one per output port).
        """
        raise NotImplementedError

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Time steps that the output announces; None passes on what the first input announces."""
        return None

    # ---------------------------------------------------------------- parameters

    def parameters(self) -> dict[str, Any]:
        """Return the parameters as a dict, from which ``type(self)(**parameters)`` rebuilds the filter."""
        return dict(self._parameter_values)

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), self.parameters())

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self._parameter_values.items())
        return f"{type(self).__name__}({values})"

    __str__ = __repr__

    # ---------------------------------------------------------------- running

    def update(self, time: float | None = None) -> Output:
        """Bring the output up to date, and raise the original error where that fails.

        Parameters
        ----------
        time : float, optional
            Pipeline time to ask for.

        Returns
        -------
        Output
            With the property ``output``: the data object (or a tuple of them).

        Raises
        ------
        Exception
            Whatever this filter or a filter upstream of it raised.
        """
        chain = list(_upstream(self))
        for algorithm in reversed(chain):
            if isinstance(algorithm, Filter):
                algorithm._check_connections()
        with failure_messages_off():
            if time is not None:
                self.UpdateInformation()
                key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
                self.GetOutputInformation(0).Set(key, float(time))
            done = self.GetExecutive().Update()  # vtkAlgorithm.Update() says nothing before VTK 9.7
        for algorithm in reversed(chain):
            failure = algorithm._failure if isinstance(algorithm, Filter) else None
            if failure is not None:
                algorithm._failure = None
                raise failure
        if not done:
            raise RuntimeError(
                f"{type(self).__name__}: an algorithm upstream failed; VTK's message above says which"
            )
        return Output(self)

    def apply(self, *inputs: Any, time: float | None = None) -> Any:
        """Run the filter on data, and return the result wrapped for PyVista.

        Parameters
        ----------
        *inputs : vtkDataObject, vtkAlgorithm, vtkAlgorithmOutput or None
            One per input port, in order; missing ones keep their connection.
        time : float, optional
            Pipeline time to ask for.

        Returns
        -------
        pyvista.DataObject
            A copy that later updates do not change (a tuple where there are several outputs).

        Raises
        ------
        TypeError
            For more inputs than ports, or an input that is neither data nor an algorithm.
        Exception
            Whatever this filter or a filter upstream of it raised.
        """
        import pyvista  # noqa: PLC0415 -- filters work without PyVista

        results = tuple(pyvista.wrap(data) for data in self._run_on(inputs, time))
        return results[0] if len(results) == 1 else results

    def __call__(self, *inputs: Any) -> Any:
        """Run the filter on data, and return the result as a bare VTK data object (a copy).

        VTK's own call operator fails on PyVista data sets; otherwise this is the same.
        """
        results = self._run_on(inputs, None)
        return results[0] if len(results) == 1 else results

    def _run_on(self, inputs: Sequence[Any], time: float | None) -> tuple[Any, ...]:
        if len(inputs) > len(self.input_ports):
            raise TypeError(
                f"{type(self).__name__} has {len(self.input_ports)} input port(s), {len(inputs)} given"
            )
        before = [self.GetInputConnection(p, 0) if self._connected(p) else None for p in range(len(inputs))]
        # A vtkAlgorithmOutput does not keep its producer alive: hold on to it while it is disconnected.
        producers = [connection.GetProducer() for connection in before if connection is not None]
        try:
            for port, value in enumerate(inputs):
                self.connect(port, value)
            outputs = self.update(time).output
            return tuple(_shallow(data) for data in (outputs if isinstance(outputs, tuple) else (outputs,)))
        finally:
            for port, connection in enumerate(before):
                self.SetInputConnection(port, connection)
            producers.clear()

    def connect(self, port: int, value: Any) -> None:
        """Connect a data object, an algorithm, an algorithm's output port or None to an input port.

        Parameters
        ----------
        port : int
            Number of the input port.
        value : vtkDataObject, vtkAlgorithm, vtkAlgorithmOutput or None
            What to connect; None leaves the port open.

        Raises
        ------
        TypeError
            For anything else.
        """
        if value is None:
            self.SetInputConnection(port, None)
        elif isinstance(value, vtkDataObject):
            producer = vtkTrivialProducer()
            producer.SetOutput(value)
            self.SetInputConnection(port, producer.GetOutputPort())
        elif hasattr(value, "GetOutputPort"):
            self.SetInputConnection(port, value.GetOutputPort())
        elif hasattr(value, "GetProducer"):
            self.SetInputConnection(port, value)
        else:
            name = self.input_ports[port].name
            raise TypeError(
                f"{type(self).__name__}: port {port} ({name}) takes a data object or an algorithm, "
                f"got {type(value).__name__}"
            )

    def SetInputConnection(self, *arguments: Any) -> None:
        """Connect an input, as VTK does, and hold on to the Python side of its producer."""
        super().SetInputConnection(*arguments)
        self._hold_producers()

    def AddInputConnection(self, *arguments: Any) -> None:
        """Add a connection, as VTK does, and hold on to the Python side of its producer."""
        super().AddInputConnection(*arguments)
        self._hold_producers()

    def RemoveAllInputConnections(self, port: int) -> None:
        """Disconnect a port, as VTK does, and let go of its producers."""
        super().RemoveAllInputConnections(port)
        self._hold_producers()

    def _hold_producers(self) -> None:
        # VTK keeps the C++ side of a producer only. The Python side of a filter comes and goes with its
        # references, and loses its attributes when the garbage collector takes it as part of a cycle.
        self._producers = [
            self.GetInputAlgorithm(port, index)
            for port in range(self.GetNumberOfInputPorts())
            for index in range(self.GetNumberOfInputConnections(port))
        ]

    def report_progress(self, fraction: float) -> None:
        """Tell observers how far the filter is, and stop here if it was asked to abort.

        Parameters
        ----------
        fraction : float
            Part of the work that is done, 0 to 1; never goes back.

        Raises
        ------
        AbortedError
            If ``AbortExecute`` was set; the base class turns it into an empty output.
        """
        self._progress_reached = max(self._progress_reached, min(float(fraction), 1.0))
        if self.HasObserver("ProgressEvent"):
            with interrupts_deferred():
                self.UpdateProgress(self._progress_reached)
        else:
            self.UpdateProgress(self._progress_reached)
        if self.GetAbortExecute():
            raise AbortedError(f"{type(self).__name__} was aborted at {self._progress_reached:.0%}")

    # ---------------------------------------------------------------- VTK's side

    def FillInputPortInformation(self, port: int, info: Any) -> int:
        """Tell VTK what the port takes."""
        declaration = self.input_ports[port]
        info.Set(vtkAlgorithm.INPUT_REQUIRED_DATA_TYPE(), declaration.type_name)
        if declaration.optional:
            info.Set(vtkAlgorithm.INPUT_IS_OPTIONAL(), 1)
        return 1

    def FillOutputPortInformation(self, port: int, info: Any) -> int:
        """Tell VTK what the port gives."""
        info.Set(vtkDataObject.DATA_TYPE_NAME(), self.output_ports[port].type_name)
        return 1

    def ProcessRequest(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Answer a request of the executive; an exception is kept for :meth:`update`."""
        try:
            return int(super().ProcessRequest(request, inInfo, outInfo))
        except BaseException as error:  # VTK would print and lose it; update() raises it again
            self._failure = error
            if isinstance(error, AbortedError):
                # VTK leaves the flag up, and would stop the next update too.
                self.SetAbortExecute(0)
            for port in range(outInfo.GetNumberOfInformationObjects()):
                info = outInfo.GetInformationObject(port)
                # Without these two, VTK takes the empty output for good at the next update.
                info.Set(vtkDemandDrivenPipeline.DATA_NOT_GENERATED(), 1)
                data = info.Get(vtkDataObject.DATA_OBJECT())
                if data is not None:
                    data.ReleaseData()
            silence_after_failure()
            return 0

    def RequestInformation(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Announce time steps, if the filter makes its own."""
        first = [
            port.GetInformationObject(0) if port.GetNumberOfInformationObjects() else None
            for port in _items(inInfo)
        ]
        steps = self.time_steps(first)
        if steps is not None:
            announce_times(outInfo.GetInformationObject(0), steps)
        return 1

    def RequestData(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Execute, and publish the result."""
        self._begin(outInfo)
        # Who asks a filter to stop before it has begun is heard by every filter, also by those that are too
        # quick to report progress themselves.
        self.report_progress(0.0)
        inputs = self._inputs(inInfo)
        self._publish(self.execute(*inputs), inputs, outInfo)
        return 1

    def _begin(self, outInfo: Any) -> None:
        self._failure = None
        self._progress_reached = 0.0
        info = outInfo.GetInformationObject(0)
        key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        self.request_time = info.Get(key) if info.Has(key) else None

    def _inputs(self, inInfo: Any) -> list[Any]:
        inputs: list[Any] = []
        for number, (port, infos) in enumerate(zip(self.input_ports, _items(inInfo), strict=True)):
            connected = infos.GetNumberOfInformationObjects() > 0
            data = infos.GetInformationObject(0).Get(vtkDataObject.DATA_OBJECT()) if connected else None
            if data is not None and data.GetNumberOfElements(vtkDataObject.POINT) == 0:
                raise ValueError(
                    f"{type(self).__name__}: the input on port {number} ({port.name}) has no points"
                )
            inputs.append(data)
        return inputs

    def _publish(self, results: Any, inputs: Sequence[Any], outInfo: Any) -> None:
        for port, result in enumerate(results if isinstance(results, tuple) else (results,)):
            output = outInfo.GetInformationObject(port).Get(vtkDataObject.DATA_OBJECT())
            output.ShallowCopy(result)
            add_provenance(output, inputs, self._entry_of_provenance())
            if self.request_time is not None:
                output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), self.request_time)

    def _entry_of_provenance(self) -> str:
        """Return what the filter is; it is put into words again only where a parameter has changed."""
        modified = self.GetMTime()
        if self._provenance is None or self._provenance[0] != modified:
            self._provenance = modified, provenance_entry(type(self).__name__, self._parameter_values)
        return self._provenance[1]

    def _connected(self, port: int) -> bool:
        return bool(self.GetNumberOfInputConnections(port))

    def _check_connections(self) -> None:
        for number, port in enumerate(self.input_ports):
            if not self._connected(number):
                if not port.optional:
                    raise ValueError(
                        f"{type(self).__name__}: nothing is connected to port {number} ({port.name}), "
                        f"which takes a {port.type_name}"
                    )
                continue
            connection = self.GetInputConnection(number, 0)
            producer, index = connection.GetProducer(), connection.GetIndex()
            data = producer.GetOutputDataObject(index)
            if data is not None and not data.IsA(port.type_name):
                raise TypeError(
                    f"{type(self).__name__}: port {number} ({port.name}) takes a {port.type_name}, "
                    f"got a {data.GetClassName()}"
                )


def _rebuild(kind: type[Filter], parameters: dict[str, Any]) -> Filter:
    return kind(**parameters)


def _items(vector: Any) -> list[Any]:
    # Sources are given an empty tuple (or None), filters a tuple of information vectors.
    return list(vector or ())


def _shallow(data: Any) -> Any:
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy


def _upstream(algorithm: Any) -> Iterator[Any]:
    """Yield the algorithm and all that it depends on, nearest first, each once."""
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
