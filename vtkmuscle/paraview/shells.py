"""Filters with the setters that ParaView calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtkmodules.vtkCommonCore import vtkOutputWindow

from vtkmuscle import filters
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.paraview.muscle_scene import MuscleScene
from vtkmuscle.paraview.properties import Property, properties_of


def all_kinds() -> list[type[Filter]]:
    """Return what is in the plugin: all public filters, in alphabetical order, and the reader of scenes."""
    return [*filters.filter_classes(), MuscleScene]


class Shell(Filter):
    """What ParaView's filters have beside their setters: errors that reach the one who looks at ParaView.

    ParaView drops what a setter raises and goes on with the value before. Here a value that is refused is
    kept in mind, and makes the filter fail with the reason until it is replaced. ParaView also sets all
    properties, hidden ones as well, in whatever order: one that another parameter sets waits until that has
    no say in it.
    """

    def __init__(self, **parameters: Any) -> None:
        self._shown: dict[str, Any] = {}
        self._refused: dict[str, str] = {}
        #: Values from ParaView, by parameter.
        self._given: dict[str, Any] = {}
        super().__init__(**parameters)

    def take(self, name: str, shown: Property, values: tuple[Any, ...]) -> None:
        """Set a parameter from what ParaView sets."""
        refused = self._refused.pop(name, None)
        try:
            declared = self.parameter_declarations[name]
            value = declared.check(shown.take(self._shown, *values), type(self).__name__)
            self._given[name] = value
            if declared.sets:
                setattr(self, name, value)
            for each in self._given if declared.sets else (name,):
                if each not in self._set_by_others():
                    setattr(self, each, self._given[each])
        except (ValueError, OSError) as error:
            self._refused[name] = str(error)
        if self._refused.get(name) != refused:
            self.Modified()

    def _set_by_others(self) -> set[str]:
        """Return the parameters that another one sets."""
        declared = self.parameter_declarations.items()
        return {other for name, each in declared for other in each.group(getattr(self, name))}

    def ProcessRequest(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Answer a request, and show why where that fails."""
        done = super().ProcessRequest(request, inInfo, outInfo)
        if self._failure is not None:
            if not isinstance(self._failure, AbortedError):
                vtkOutputWindow.GetInstance().DisplayErrorText(f"{_words(self._failure)}\n")
            # The exception's traceback holds this filter. ParaView holds the VTK side only, and the garbage
            # collector would take the cycle, and with it the Python side's attributes.
            self._failure = None
        return done

    def RequestData(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Execute, unless a value was refused."""
        for message in self._refused.values():
            raise ValueError(message)
        return super().RequestData(request, inInfo, outInfo)


def shell_of(kind: type[Filter], module: str) -> type[Shell]:
    """Return a filter with a setter for each of its properties in ParaView.

    Parameters
    ----------
    kind : type
        A filter class.
    module : str
        Name of the module that ParaView will look for the class in.

    Returns
    -------
    type
        A class of the same name.
    """
    members: dict[str, Any] = {"__module__": module, "__doc__": kind.__doc__}
    for name, parameter in kind.parameter_declarations.items():
        for shown in properties_of(parameter):
            members[shown.command] = _setter(name, shown)
    return type(kind.__name__, (Shell, kind), members)


def _setter(name: str, shown: Property) -> Callable[..., None]:
    def set_property(self: Shell, *values: Any) -> None:
        self.take(name, shown, values)

    set_property.__name__ = shown.command
    return set_property


def _words(failure: BaseException) -> str:
    # Errors of the package are ValueErrors that say which filter they are from; others say what they are.
    return str(failure) if isinstance(failure, ValueError) else f"{type(failure).__name__}: {failure}"
