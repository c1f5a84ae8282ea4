"""Declared ports: attributes, keywords, checks of connections, documentation."""

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkDataObjectTypes, vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkAlgorithmOutput, vtkTrivialProducer
from vtkmodules.vtkFiltersGeneral import vtkGroupDataSetsFilter

from vtkmuscle.core.words import quoted
from vtkmuscle.data.arrays import multiblock_from, polylines_of
from vtkmuscle.data.attachments import attachments_from, end_areas, is_areas
from vtkmuscle.data.moving_bones import bones_of, moving_bones_of, rest_bones_of
from vtkmuscle.data.muscle_geometry import rest_surface_of, surface_of
from vtkmuscle.data.paths import checked_superficial, path_lines_of
from vtkmuscle.filters.base.docstrings import Declaration

if TYPE_CHECKING:
    from vtkmuscle.filters.base.filter import Filter


@dataclass(eq=False)
class Port(Declaration):
    """Base of ports; the kind is a VTK class."""

    def __get__(self, instance: "Filter | None", owner: type) -> Any:
        return self if instance is None else self.read(instance)

    def read(self, instance: "Filter") -> Any:
        """Return the value of the attribute."""
        raise NotImplementedError

    @property
    def type_name(self) -> str:
        """Name of the VTK class, for the executive."""
        return self.kind.__name__


@dataclass(eq=False)
class OutputPort(Port):
    """An output of a filter, brought up to date on reading.

    Parameters
    ----------
    kind : type
        The VTK class of the data.
    doc : str, optional
        The data and its arrays, if the class's docstring has no entry.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource
    >>> FibreTemplateSource(n_fibres=3).output.GetNumberOfCells()
    3
    """

    def read(self, instance: "Filter") -> Any:
        """Return the data, brought up to date."""
        number = instance.output_ports.index(self)
        instance.update(port=number)
        return instance.GetOutputDataObject(number)

    def __set__(self, instance: "Filter", value: Any) -> None:
        raise AttributeError(f"{type(instance).__name__}.{self.name} is an output, which cannot be set")


@dataclass(eq=False)
class InputPort(Port):
    """An input of a filter: attribute and constructor keyword.

    A port takes a data set, an algorithm, a chain (``a >> b``), an algorithm's output port, or None for an
    open port. A port of a ``vtkMultiBlockDataSet`` also takes a mapping from names to sources, and a sequence
    of :class:`~vtkmuscle.data.attachments.AttachmentArea`. The attribute's value is the connected data set or
    algorithm, None for an open port.

    Parameters
    ----------
    kind : type
        The VTK class of the data.
    taken : callable, optional
        Function of the data and the port's name (for errors) that returns the checked argument of
        ``execute``. By default the argument is the data.
    optional : bool, optional
        May the port stay unconnected? The argument of ``execute`` is then ``None``.
    may_be_empty : bool, optional
        May the data have no points?
    doc : str, optional
        The data and its arrays, if the class's docstring has no entry.

    Raises
    ------
    TypeError
        On connecting another object, or data of another class.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource
    >>> smoother = FibreSmoother(fibres=FibreTemplateSource(n_fibres=3))
    >>> smoother.muscle = 3
    Traceback (most recent call last):
        ...
    TypeError: FibreSmoother.muscle is 3, but must be a vtkPolyData, an algorithm or a chain of them or None
    """

    taken: Callable[[Any, str], Any] | None = None
    _: KW_ONLY
    optional: bool = False
    may_be_empty: bool = False

    def take(self, data: Any) -> Any:
        """Return the argument of ``execute``; ValueError for unusable data."""
        return data if data is None or self.taken is None else self.taken(data, self.name)

    def read(self, instance: "Filter") -> Any:
        """Return the connected data set or algorithm, None for an open port."""
        number = instance.input_ports.index(self)
        if not instance.GetNumberOfInputConnections(number):
            return None
        connection = instance.GetInputConnection(number, 0)
        producer = connection.GetProducer()
        if isinstance(producer, vtkTrivialProducer):
            return producer.GetOutputDataObject(0)
        if isinstance(producer, _BlockSource):
            return producer.data
        return producer if producer.GetNumberOfOutputPorts() == 1 else connection

    def __set__(self, instance: "Filter", value: Any) -> None:
        instance.connect(self.name, value)

    def checked(self, value: Any, where: str) -> tuple[Any, int] | None:
        """Return algorithm and output number for a value; None for None.

        The caller must keep a reference to the algorithm: a vtkAlgorithmOutput has none. TypeError for other
        values, or data of another class; `where` names the port.
        """
        if value is None:
            return None
        source = source_of(self._as_data(value))
        if source is None:
            raise TypeError(f"{where} is {quoted(value)}, but must be {self.allowed}")
        kind = _class_of(*source)
        if not (_is_a(kind, self.type_name) or _is_a(self.type_name, kind)):
            raise TypeError(f"{where} is a {kind}, but must be {self.allowed}")
        return source

    @property
    def allowed(self) -> str:
        """Allowed sources, in words."""
        mapping = ", a dict of named ones" if self.kind is vtkMultiBlockDataSet else ""
        none = " or None" if self.optional else ""
        return f"a {self.type_name}{mapping}, an algorithm or a chain of them{none}"

    def _as_data(self, value: Any) -> Any:
        """Return a mapping or areas as the port's data set."""
        if self.kind is not vtkMultiBlockDataSet or isinstance(value, vtkDataObject):
            return value
        if is_areas(value):
            return attachments_from(value)
        if not isinstance(value, Mapping):
            return value
        if all(isinstance(block, vtkDataObject) for block in value.values()):
            return multiblock_from(dict(value))
        return _grouped(value)


# Ports by the argument of ``execute``.
Lines = partial(InputPort, vtkPolyData, polylines_of)
Surface = partial(InputPort, vtkPolyData, surface_of)
RestSurface = partial(InputPort, vtkPolyData, rest_surface_of)
SeenLines = partial(InputPort, vtkPolyData, checked_superficial)
Areas = partial(InputPort, vtkMultiBlockDataSet, end_areas)
Paths = partial(InputPort, vtkPolyData, path_lines_of, may_be_empty=True)
Bones = partial(InputPort, vtkMultiBlockDataSet, bones_of)
RestBones = partial(InputPort, vtkMultiBlockDataSet, rest_bones_of)
MovingBones = partial(InputPort, vtkMultiBlockDataSet, moving_bones_of)


def source_of(value: Any) -> tuple[Any, int] | None:
    """Return algorithm and output number for a value, None for other objects.

    The value is a data object, an algorithm, a chain, a vtkAlgorithmOutput or VTK's ``select_ports``.
    """
    if isinstance(value, vtkMultiBlockDataSet):
        return _BlockSource(value), 0
    if isinstance(value, vtkDataObject):
        producer = vtkTrivialProducer()
        producer.SetOutput(value)
        return producer, 0
    if isinstance(value, vtkAlgorithmOutput):
        return value.GetProducer(), value.GetIndex()
    last = end_of(value, "last")
    if isinstance(last, type) or not hasattr(last, "GetOutputPort"):
        return None
    port = last.GetOutputPort()
    return port.GetProducer(), port.GetIndex()


def end_of(value: Any, name: str) -> Any:
    """Return a chain's ``first`` or ``last`` algorithm, else the value."""
    return value if isinstance(value, vtkObject) else getattr(value, name, value)


class _BlockSource(VTKPythonAlgorithmBase):
    """Source of a data set, executed after changes of blocks. VTK's producer ignores such changes."""

    def __init__(self, data: vtkMultiBlockDataSet) -> None:
        self.data, self._parts = data, list[vtkDataObject]()
        super().__init__(inputType="vtkDataObject", outputType="vtkMultiBlockDataSet")
        self.GetInputPortInformation(0).Set(vtkAlgorithm.INPUT_IS_REPEATABLE(), 1)
        self._connect_parts()

    def _connect_parts(self) -> None:
        blocks = map(self.data.GetBlock, range(self.data.GetNumberOfBlocks()))
        parts = [self.data, *(block for block in blocks if block is not None)]
        if list(map(id, parts)) != list(map(id, self._parts)):
            self._parts = parts
            self.RemoveAllInputConnections(0)
            for part in parts:
                producer = vtkTrivialProducer()
                producer.SetOutput(part)
                self.AddInputConnection(producer.GetOutputPort())

    def RequestData(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Pass on the data set."""
        self._connect_parts()
        vtkDataObject.GetData(outInfo).ShallowCopy(self.data)
        return 1


def _grouped(blocks: Mapping[str, Any]) -> vtkGroupDataSetsFilter | None:
    """Return an algorithm that groups outputs as named blocks, None on failure."""
    group = vtkGroupDataSetsFilter()
    group.SetOutputTypeToMultiBlockDataSet()
    group.inputs = list(blocks.values())  # VTK keeps only the C++ side
    for number, (name, block) in enumerate(blocks.items()):
        source = source_of(block)
        if source is None:
            return None
        group.AddInputConnection(source[0].GetOutputPort(source[1]))
        group.SetInputName(number, name)
    return group


def _class_of(producer: Any, index: int) -> str:
    """Return the class name of an output's data, or its declaration."""
    if isinstance(producer, vtkTrivialProducer):
        return str(producer.GetOutputDataObject(index).GetClassName())
    return str(producer.GetOutputPortInformation(index).Get(vtkDataObject.DATA_TYPE_NAME()))


def _is_a(kind: str, other: str) -> bool:
    number = vtkDataObjectTypes.GetTypeIdFromClassName
    return kind == other or vtkDataObjectTypes.TypeIdIsA(number(kind), number(other))
