"""What ParaView is given: filters with the setters that it calls, and a source that reads a scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle import filters
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import OutputPort
from vtkmuscle.paraview.proxies import Property, informations_of, properties_of
from vtkmuscle.scenes import Scene


class MuscleScene(Filter):
    """Give a muscle of a scene.toml, with the scene's bones and the muscle's attachments.

    The motion of the bones is read by BoneMotion, from the same file. Settings of the scene's solver are not
    passed on: they are properties of the filters here.

    Raises
    ------
    ValueError
        If there is no scene or no such muscle.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.paraview.shells import MuscleScene
    >>> source = MuscleScene(scene=Scene.from_phantom(phantoms.spindle_over_hinge()), muscle="spindle")
    >>> source.muscle_names
    ['spindle']
    >>> source.bones.GetNumberOfBlocks(), source.attachments.GetNumberOfBlocks()
    (2, 2)
    """

    scene: Parameter[Scene | None] = Parameter(Scene, default=None, doc="The scene.")
    muscle = Parameter(
        str, default="", listed="muscle_names", doc="Name of the muscle; empty for the scene's first."
    )

    surface = OutputPort(vtkPolyData, doc="The muscle, in the rest pose.")
    bones = OutputPort(vtkMultiBlockDataSet, doc="The bones by name, in the rest pose.")
    attachments = OutputPort(vtkMultiBlockDataSet, doc="The muscle's attachment areas, a block for each.")

    @property
    def muscle_names(self) -> list[str]:
        """Names of the scene's muscles."""
        return [] if self.scene is None else list(self.scene.muscles)

    def execute(self) -> tuple[vtkPolyData, vtkMultiBlockDataSet, vtkMultiBlockDataSet]:
        """Return surface, bones and attachments."""
        if self.scene is None:
            raise ValueError("MuscleScene.scene is None; name a scene.toml")
        muscles = self.scene.muscles
        name = self.muscle or next(iter(muscles))
        if name not in muscles:
            raise ValueError(
                f"MuscleScene.muscle: there is no muscle {name!r} in the scene; {suggestion(name, muscles)}"
            )
        return (
            muscles[name].surface,
            multiblock_from(dict(self.scene.bones)),
            attachments_from(muscles[name].attachments),
        )


def all_kinds() -> list[type[Filter]]:
    """Return what is in the plugin: all public filters, in alphabetical order, and the reader of scenes."""
    return [*filters.filter_classes(), MuscleScene]


class Shell(Filter):
    """A filter in ParaView: its errors are shown there.

    ParaView drops the error of a setter, and goes on with the value before. So a refused value is remembered,
    and the filter fails with the reason until the value is replaced. ParaView also sets all properties,
    hidden ones as well, in any order: a parameter that a preset sets waits until the preset allows its own
    value.
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
    """Return a class of a filter's name, in a module, with a setter for each property in ParaView."""
    members: dict[str, Any] = {"__module__": module, "__doc__": kind.__doc__}
    for name, parameter in kind.parameter_declarations.items():
        for shown in properties_of(parameter):
            members[shown.command] = _setter(name, shown)
    for name, information in informations_of(kind).items():
        members[information.attrib["command"]] = _getter(name)
    return type(kind.__name__, (Shell, kind), members)


def _setter(name: str, shown: Property) -> Callable[..., None]:
    def set_property(self: Shell, *values: Any) -> None:
        self.take(name, shown, values)

    set_property.__name__ = shown.command
    return set_property


def _getter(name: str) -> Callable[..., Any]:
    def get_information(self: Shell) -> Any:
        return getattr(self, name)

    return get_information


def _words(failure: BaseException) -> str:
    # Errors of the package are ValueErrors that say which filter they are from; others say what they are.
    return str(failure) if isinstance(failure, ValueError) else f"{type(failure).__name__}: {failure}"
