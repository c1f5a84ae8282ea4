"""The result of ``a >> b``: a chain of algorithms that can be used like the last of them."""

from __future__ import annotations

import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer

from vtkmuscle.filters.base.running import Runnable

try:
    from vtkmodules.util import execution_model
except ImportError:  # VTK has it from 9.4 on; ParaView may bring an older one
    execution_model = None

_Pipeline: Any = object if execution_model is None else execution_model.Pipeline


class Chain(Runnable, _Pipeline):
    """Algorithms connected by ``>>``: VTK's own ``Pipeline``, with the methods of our filters.

    Data go into the first algorithm, results come from the last. Connected to a filter, a chain stands for
    its last algorithm.

    Attributes
    ----------
    first, last : vtkAlgorithm
        Its ends.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource, FibreTubes
    >>> tubes = FibreTemplateSource(n_fibres=3) >> FibreSmoother() >> FibreTubes(radius=0.1)
    >>> tubes.apply().n_points == tubes.output.GetNumberOfPoints()
    True
    """

    @property
    def _ends(self) -> tuple[Any, Any]:
        return self.first, self.last

    @property
    def output(self) -> Any:
        """The last algorithm's output, brought up to date."""
        return self.update().output

    def GetOutputPort(self, port: int = 0) -> Any:
        """Return an output port of the last algorithm."""
        return self.last.GetOutputPort(port)

    def GetClassName(self) -> str:
        """Raise: PyVista asks for it in ``add_mesh``, which draws no chains."""
        raise TypeError("PyVista draws algorithms, not chains; give it the last one: add_mesh(chain.last)")

    def _determine_type(self, arg: Any) -> int:
        # VTK's own asks for exactly its class.
        return int(self.PIPELINE if isinstance(arg, _Pipeline) else super()._determine_type(arg))


def chain_everywhere() -> None:
    """Let ``>>`` give a :class:`Chain`, and take PyVista's data, whenever PyVista is imported."""
    if execution_model is None:
        return
    execution_model.Pipeline = Chain
    if "pyvista" in sys.modules:
        _extend_pyvista(sys.modules["pyvista"])
    else:
        sys.meta_path.insert(0, _AtImportOfPyVista())


def _extend_pyvista(pyvista: ModuleType) -> None:
    """Give PyVista's data sets the operator.

    VTK's own asks for the length of its left side as soon as that has ``__getitem__``, as all PyVista data
    sets do, and raises a SystemError; a PyVista MultiBlock it takes for a list of inputs.
    """

    def connect(self: Any, other: Any) -> Chain:
        producer = vtkTrivialProducer()
        producer.SetOutput(self)
        return Chain(producer, other)

    for name in ("DataSet", "MultiBlock", "DataObject"):
        getattr(pyvista, name).__rshift__ = connect


class _AtImportOfPyVista(MetaPathFinder, Loader):
    """Extends PyVista when it is imported; to import it here would make every import slow."""

    def __init__(self) -> None:
        self._loader: Any = None

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Find PyVista as Python does, and put this loader before its own."""
        spec = PathFinder.find_spec(name, path, target) if name == "pyvista" else None
        if spec is not None:
            sys.meta_path.remove(self)
            self._loader, spec.loader = spec.loader, self
        return spec

    def create_module(self, spec: ModuleSpec) -> Any:
        """Leave it to PyVista's own loader."""
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        """Execute the module by PyVista's own loader, then extend it."""
        assert module.__spec__ is not None
        module.__spec__.loader = module.__loader__ = self._loader
        self._loader.exec_module(module)
        _extend_pyvista(module)
