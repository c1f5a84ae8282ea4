"""Chains of algorithms made by ``a >> b``."""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm

from vtkmuscle.core.words import quoted
from vtkmuscle.filters.base.ports import end_of, source_of
from vtkmuscle.filters.base.running import Runnable


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

    def __rshift__(self, right: Any) -> Chain:
        return Chain(self, right)
