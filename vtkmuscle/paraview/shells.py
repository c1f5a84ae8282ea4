"""Filters with ParaView's setters, and a source of scenes."""

from functools import partialmethod
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
    """Give a muscle of a scene with attachments and bones.

    BoneMotion reads the bones' motion from the same file. Settings of the scene's solver are not passed on:
    set the filters' properties.

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
    muscle = Parameter(str, default="", listed="muscle_names", doc="Name; empty for the scene's first.")

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
            problem = f"there is no muscle {name!r} in the scene"
            raise ValueError(f"MuscleScene.muscle: {problem}; {suggestion(name, muscles)}")
        areas = attachments_from(muscles[name].attachments)
        return muscles[name].surface, multiblock_from(dict(self.scene.bones)), areas


def all_kinds() -> list[type[Filter]]:
    """Return the filters and the source in the plugin."""
    return [*filters.filter_classes(), MuscleScene]


class Shell(Filter):
    """A filter in ParaView that shows errors there.

    ParaView drops the error of a setter and keeps the previous value. A refused value is therefore stored,
    and the filter fails with the reason until the value is replaced. ParaView sets all properties, also
    hidden properties, in any order: a parameter controlled by a preset waits until the preset allows the
    value.
    """

    def __init__(self, **parameters: Any) -> None:
        self._shown: dict[str, Any] = {}
        self._refused: dict[str, str] = {}
        #: Values from ParaView, by parameter.
        self._given: dict[str, Any] = {}
        super().__init__(**parameters)

    def take(self, name: str, shown: Property, *values: Any) -> None:
        """Set a parameter from a value of ParaView."""
        refused = self._refused.pop(name, None)
        try:
            declared = self.parameter_declarations[name]
            value = declared.check(shown.take(self._shown, *values), type(self).__name__)
            self._given[name] = value
            if declared.sets:
                setattr(self, name, value)
            for each in self._given if declared.sets else (name,):
                if each not in self._set_by_presets():
                    setattr(self, each, self._given[each])
        except (ValueError, OSError) as error:
            self._refused[name] = str(error)
        if self._refused.get(name) != refused:
            self.Modified()

    def _set_by_presets(self) -> set[str]:
        """Return the parameters controlled by a preset."""
        declared = self.parameter_declarations.items()
        return {controlled for name, each in declared for controlled in each.group(getattr(self, name))}

    def ProcessRequest(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Answer a request, and show the reason of a failure."""
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
    """Return a class of a filter's name with ParaView's setters."""
    members: dict[str, Any] = {"__module__": module, "__doc__": kind.__doc__}
    for name, parameter in kind.parameter_declarations.items():
        for shown in properties_of(parameter):
            members[shown.command] = partialmethod(Shell.take, name, shown)
    for name, information in informations_of(kind).items():
        members[information.attrib["command"]] = lambda self, name=name: getattr(self, name)
    return type(kind.__name__, (Shell, kind), members)


def _words(failure: BaseException) -> str:
    # Errors of the package are ValueErrors that say which filter they are from; others say what they are.
    return str(failure) if isinstance(failure, ValueError) else f"{type(failure).__name__}: {failure}"
