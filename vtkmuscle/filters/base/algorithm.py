"""VTK's side of a filter: ports, times and data, errors and aborts."""

import re
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, TypeVar

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkDemandDrivenPipeline, vtkExecutive

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.shared import same_content
from vtkmuscle.data.arrays import state_of
from vtkmuscle.data.pipeline_times import announce_times, provenance_array, requested_time, times_of
from vtkmuscle.filters.base.ports import InputPort, OutputPort
from vtkmuscle.filters.base.running import show_error

T = TypeVar("T")
#: Called as ``_DATA.Get(info)``: for ``info.Get(_DATA)`` VTK first tries thirty signatures.
_DATA = vtkDataObject.DATA_OBJECT()


class AbortedError(Exception):
    """Raised in a filter after ``AbortExecute``; the output is empty."""


class Algorithm(VTKPythonAlgorithmBase):
    """A VTK algorithm with declared ports, base of :class:`~vtkmuscle.filters.base.filter.Filter`."""

    input_ports: ClassVar[tuple[InputPort, ...]] = ()
    output_ports: ClassVar[tuple[OutputPort, ...]] = ()

    #: Input port with the announced time steps, if not the first port that has any.
    times_from: ClassVar[str | None] = None
    #: Pipeline time of the request being executed; None where the pipeline has no time.
    request_time: float | None = None
    #: Read by VTKPythonAlgorithmBase.
    InputType = OutputType = "vtkDataObject"

    def __init__(self) -> None:
        self._failure: BaseException | None = None
        self._progress_reached = 0.0
        #: By port: data, state of the data, and the argument of ``execute``.
        self._arguments: dict[int, tuple[Any, Any, Any]] = {}
        #: By name: the values from which a result was made, and the result.
        self._kept: dict[str, tuple[Any, Any]] = {}
        super().__init__(nInputPorts=len(self.input_ports), nOutputPorts=len(self.output_ports))
        self.GetExecutive().AddObserver("ErrorEvent", show_error)

    def execute(self, *inputs: Any) -> Any:
        """Compute the outputs from the inputs, in port order.

        Each input is the port's argument for its data (None for an open optional port); inputs must not be
        changed. Errors name a port, or "" for the filter as a whole; the filter's name is added. The result
        is a new data object, or a tuple with an entry per output port.
        """
        raise NotImplementedError

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Return the output's time steps. Those of ``times_from``, else of the first input with steps."""
        by_port = zip(self.input_ports, inputs_information, strict=True)
        steps = {port.name: times_of(information) for port, information in by_port}
        return steps.get(self.times_from or "") or next(filter(None, steps.values()), None)

    def parameters(self) -> dict[str, Any]:
        """Return the parameters by name."""
        raise NotImplementedError

    def once(self, name: str, values: tuple[Any, ...], make: Callable[..., T]) -> T:
        """Return ``make(*values)``, kept while the values have the same content."""
        if (kept := self._kept.pop(name, None)) is None or not same_content(kept[0], values):
            kept = values, make(*values)
        self._kept[name] = kept
        result: T = kept[1]
        return result

    def report_progress(self, fraction: float) -> None:
        """Report progress to observers, and stop after a request to abort.

        Parameters
        ----------
        fraction : float
            Finished part of the work, 0 to 1; never decreases.

        Raises
        ------
        AbortedError
            If ``AbortExecute`` was set; the base class turns it into an empty output.
        """
        self._progress_reached = max(self._progress_reached, min(float(fraction), 1.0))
        self.UpdateProgress(self._progress_reached)
        if self.GetAbortExecute():
            raise AbortedError(f"{type(self).__name__} was aborted at {self._progress_reached:.0%}")

    def take_failure(self) -> BaseException | None:
        """Return the error of the last update once, None after success."""
        failure, self._failure = self._failure, None
        return failure

    def check_connections(self) -> None:
        """Check that required ports are connected to data of their kind."""
        owner = type(self).__name__
        for number, port in enumerate(self.input_ports):
            if not self.GetNumberOfInputConnections(number):
                if not port.optional:
                    where = f"{owner}: {port.name}"
                    raise InputError(where, "it is not connected", f"it must be {port.allowed}")
                continue
            connection = self.GetInputConnection(number, 0)
            data = connection.GetProducer().GetOutputDataObject(connection.GetIndex())
            if data is not None and not data.IsA(port.type_name):
                raise TypeError(f"{owner}.{port.name} takes a {port.type_name}, got a {data.GetClassName()}")

    def FillInputPortInformation(self, port: int, info: Any) -> int:
        """Tell VTK the kind of data on an input port."""
        declaration = self.input_ports[port]
        info.Set(vtkAlgorithm.INPUT_REQUIRED_DATA_TYPE(), declaration.type_name)
        if declaration.optional:
            info.Set(vtkAlgorithm.INPUT_IS_OPTIONAL(), 1)
        return 1

    def FillOutputPortInformation(self, port: int, info: Any) -> int:
        """Tell VTK the kind of data on an output port."""
        info.Set(vtkDataObject.DATA_TYPE_NAME(), self.output_ports[port].type_name)
        return 1

    def ProcessRequest(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Answer a request of the executive; errors are kept for :meth:`update`."""
        try:
            name = request.GetRequest().GetName().title().replace("_", "")  # RequestData of REQUEST_DATA
            return int(getattr(type(self), name, lambda *_: 1)(self, request, inInfo, outInfo))
        except BaseException as error:  # VTK would print and lose it; update() raises it again
            self._failure = error
            if isinstance(error, AbortedError):
                # VTK leaves the flag up, and would stop the next update too.
                self.SetAbortExecute(0)
            for port in range(outInfo.GetNumberOfInformationObjects()):
                info = outInfo.GetInformationObject(port)
                # Otherwise VTK would accept the empty output at the next update.
                info.Set(vtkDemandDrivenPipeline.DATA_NOT_GENERATED(), 1)
                if (data := _DATA.Get(info)) is not None:
                    data.ReleaseData()
            return 0

    def RequestInformation(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Announce the filter's time steps."""
        steps = self.time_steps(_first_of_each(inInfo))
        if steps is not None:
            for port in range(outInfo.GetNumberOfInformationObjects()):
                announce_times(outInfo.GetInformationObject(port), steps)
        return 1

    def RequestData(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Execute, and publish the result."""
        self._failure = None
        self._progress_reached = 0.0
        asked = max(int(vtkExecutive.FROM_OUTPUT_PORT().Get(request)), 0)
        self.request_time = requested_time(outInfo.GetInformationObject(asked))
        # Filters without progress reports stop here after a request to abort.
        self.report_progress(0.0)
        # None for an open port.
        inputs = [info and _DATA.Get(info) for info in _first_of_each(inInfo)]
        try:
            result = self.execute(*map(self._argument, range(len(inputs)), inputs))
        except InputError as error:
            self._name(error)
            raise

        def made(*_: int) -> Any:
            return provenance_array(inputs, type(self).__name__, self.parameters())

        provenance = self.once("provenance", (self.GetMTime(), self.GetExecutive().GetPipelineMTime()), made)
        for port, data in enumerate(result if isinstance(result, tuple) else (result,)):
            if data is not None:  # None for an output that was not requested
                output = _DATA.Get(outInfo.GetInformationObject(port))
                output.ShallowCopy(data)
                output.GetFieldData().AddArray(provenance)
                if self.request_time is not None:
                    vtkDataObject.DATA_TIME_STEP().Set(output.GetInformation(), self.request_time)
        return 1

    def _name(self, error: InputError) -> None:
        """Put the filter's name before an error's location."""
        port = re.split(r"\W", error.where)[0]
        if port in ("", *(declared.name for declared in self.input_ports)):
            where = ": ".join(filter(None, (type(self).__name__, error.where)))
            error.__init__(where, error.problem, error.remedy)  # type: ignore[misc]

    def _argument(self, number: int, data: Any) -> Any:
        """Return the cached argument of ``execute`` for a port's data."""
        port = self.input_ports[number]
        if data is None:
            return port.take(None)
        state = state_of(data)
        if (kept := self._arguments.get(number)) is None or kept[0] is not data or kept[1] != state:
            if not port.may_be_empty and data.GetNumberOfElements(vtkDataObject.POINT) == 0:
                raise InputError(port.name, "the input has no points")
            kept = self._arguments[number] = data, state, port.take(data)
        return kept[2]


def _first_of_each(inInfo: Any) -> list[Any]:
    """Return each port's first connection, None for an open port."""
    ports = inInfo or ()
    return [each.GetInformationObject(0) if each.GetNumberOfInformationObjects() else None for each in ports]
