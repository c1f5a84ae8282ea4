"""The base of all filters: declared parameters and ports."""

import inspect
import re
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm

from vtkmuscle.core.words import suggestion
from vtkmuscle.filters.base.algorithm import Algorithm
from vtkmuscle.filters.base.docstrings import documented
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort
from vtkmuscle.filters.base.running import Runnable

#: Reserved names, not allowed for parameters and ports.
_RESERVED = {
    *dir(vtkAlgorithm), "apply", "connect", "execute", "parameters", "request_time", "time", "time_steps",
}  # fmt: skip


class Filter(Runnable, Algorithm):
    """A VTK algorithm with declared parameters and ports.

    A subclass declares :class:`~vtkmuscle.filters.base.parameters.Parameter`,
    :class:`~vtkmuscle.filters.base.ports.InputPort` and :class:`~vtkmuscle.filters.base.ports.OutputPort`
    attributes and defines :meth:`execute`. Parameters and input ports are keywords of the constructor and
    attributes of the filter.

    :meth:`update` and :meth:`apply` raise the errors of :meth:`execute`, also of filters upstream; VTK's own
    ``Update()`` returns ``False`` after an error.

    Raises
    ------
    TypeError
        For a keyword that is neither a parameter nor an input port, or an input of another kind.
    ValueError
        For a value that is not allowed; the message lists the allowed values. On update, if an
        input has no points, or points that are not finite; if an input has no polylines, or other cells;
        if a surface has no triangles, or other faces; if attachments or bones lack their field arrays.
    AttributeError
        On assignment to an undeclared name.
    """

    parameter_declarations: ClassVar[dict[str, Parameter[Any]]] = {}

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        declared: dict[str, Any] = {}
        for base in reversed(cls.__mro__):
            declared.update(vars(base))
        cls.parameter_declarations = {n: d for n, d in declared.items() if isinstance(d, Parameter)}
        cls.input_ports = tuple(d for d in declared.values() if isinstance(d, InputPort))
        cls.output_ports = tuple(d for d in declared.values() if isinstance(d, OutputPort))
        names = [*cls.parameter_declarations, *(port.name for port in (*cls.input_ports, *cls.output_ports))]
        taken = sorted(set(names) & _RESERVED)
        if taken:
            raise TypeError(f"{cls.__name__}: VTK or Filter owns the name(s) {', '.join(taken)}")
        for parameter in cls.parameter_declarations.values():
            parameter.check_references(cls.parameter_declarations, cls.__name__)
        keyword = inspect.Parameter.KEYWORD_ONLY
        defaults = {port.name: None for port in cls.input_ports}
        defaults |= {name: parameter.default for name, parameter in cls.parameter_declarations.items()}
        keywords = [inspect.Parameter(name, keyword, default=value) for name, value in defaults.items()]
        cls.__signature__ = inspect.Signature(keywords)
        own = cls.__dict__.get("__doc__") or ""
        cls.__doc__ = documented(own, cls.parameter_declarations, cls.input_ports, cls.output_ports)

    def __init__(self, *data: Any, **settings: Any) -> None:
        if data:
            name = type(self).__name__
            raise TypeError(f"{name} takes parameters by name; {name}()(data) runs it on data")
        super().__init__()
        self._check_names(settings, TypeError)
        declared, owner = self.parameter_declarations, type(self).__name__
        values = {name: parameter.default for name, parameter in declared.items()}
        values |= {name: declared[name].check(settings[name], owner) for name in declared if name in settings}
        for name, parameter in declared.items():
            group = parameter.group(values[name])
            values |= {other: value for other, value in group.items() if other not in settings}
        self._parameter_values: dict[str, Any] = values
        for port in self.input_ports:
            if settings.get(port.name) is not None:
                self.connect(port.name, settings[port.name])

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_") and not hasattr(type(self), name):
            self._check_names([name], AttributeError)
        super().__setattr__(name, value)

    def _check_names(self, names: Iterable[str], error: type[Exception]) -> None:
        """Check that names are those of parameters or input ports."""
        declared = [*(port.name for port in self.input_ports), *self.parameter_declarations]
        for name in names:
            if name not in declared:
                problem = f"{type(self).__name__} has no parameter or input port {name!r}"
                raise error(f"{problem}; {suggestion(name, declared)}")

    def parameters(self) -> dict[str, Any]:
        """Return the parameters; ``type(self)(**parameters)`` rebuilds the filter."""
        return dict(self._parameter_values)

    def parameters_that_count(self) -> dict[str, Any]:
        """Return the parameters that affect the result."""
        own, declared = self._parameter_values, self.parameter_declarations.items()
        state = (self.GetMTime(),)
        return self.once("used", state, lambda _: {n: own[n] for n, d in declared if d.counts_with(own)})

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self.parameters()), ()

    def __copy__(self, _memo: object = None) -> Self:
        """Return a filter with the same parameters and connections. Also as a deep copy."""
        return type(self)(**self.parameters(), **{port.name: port.read(self) for port in self.input_ports})

    __deepcopy__ = __copy__

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            words = re.sub(r"(?<!^)(?=[A-Z])", "_", name.removeprefix("Set").removeprefix("Get")).lower()
            hint = f"parameters are attributes: {suggestion(words, self.parameter_declarations)}"
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}; {hint}")

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self._parameter_values.items())
        return f"{type(self).__name__}({values})"

    __str__ = __repr__

    def connect(self, port: str | int, value: Any) -> None:
        """Connect an input port; ``connect("muscle", mesh)`` is ``muscle = mesh``.

        Parameters
        ----------
        port : str or int
            Name or number of the input port.
        value : vtkDataObject, vtkAlgorithm, chain, vtkAlgorithmOutput or None
            Source; None leaves the port open.

        Raises
        ------
        AttributeError, IndexError
            If there is no such port.
        TypeError
            If the value cannot be connected, or gives data of another class.
        """
        number, source = self._number_of(port), self.source_for(port, value)
        self.SetInputConnection(number, None if source is None else source[0].GetOutputPort(source[1]))

    def source_for(self, port: str | int, value: Any) -> tuple[Any, int] | None:
        """Return algorithm and output number for a value; raises as `connect`."""
        declared = self.input_ports[self._number_of(port)]
        return declared.checked(value, f"{type(self).__name__}.{declared.name}")

    def _number_of(self, port: str | int) -> int:
        names = [declared.name for declared in self.input_ports]
        missing = f"{type(self).__name__} has no input port {port!r}"
        if isinstance(port, str):
            if port not in names:
                raise AttributeError(f"{missing}; {suggestion(port, names)}")
            return names.index(port)
        if not 0 <= port < len(names):
            numbered = ", ".join(f"{number} ({name})" for number, name in enumerate(names)) or "none"
            raise IndexError(f"{missing}; its input ports are {numbered}")
        return port

    def SetInputData(self, *arguments: Any) -> None:
        """Connect data to a port, as VTK: ``(mesh)`` or ``(1, mesh)``."""
        self.connect(*(arguments if len(arguments) == 2 else (0, *arguments)))

    SetInputDataObject = SetInputData

    def GetOutput(self, port: int = 0) -> Any:
        """Return an output's data object without an update, as VTK."""
        return self.GetOutputDataObject(port)

    def SetInputConnection(self, *arguments: Any) -> None:
        """Connect an output to a port, as VTK, with checks."""
        port, value = arguments if len(arguments) == 2 else (0, *arguments)
        self.source_for(port, value)
        super().SetInputConnection(port, value)
        self._hold_producers()

    def AddInputConnection(self, *arguments: Any) -> None:
        """Add a connection, as VTK, and keep its Python producer alive."""
        super().AddInputConnection(*arguments)
        self._hold_producers()

    def RemoveAllInputConnections(self, port: int) -> None:
        """Disconnect a port, as VTK, and release its producers."""
        super().RemoveAllInputConnections(port)
        self._hold_producers()

    def _hold_producers(self) -> None:
        # VTK keeps only the C++ side of a producer. The Python side lives as long as Python references,
        # and loses its attributes when the garbage collector breaks a cycle.
        self._producers = [
            self.GetInputAlgorithm(port, index)
            for port in range(self.GetNumberOfInputPorts())
            for index in range(self.GetNumberOfInputConnections(port))
        ]
        kept = self._arguments.items()
        self._arguments = {port: of for port, of in kept if of[0] is self.GetInputDataObject(port, 0)}
