"""PyVista data sets on the left side of VTK's pipeline operator."""

from __future__ import annotations

import sys
from typing import Any

from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer


def mend_pyvista_operator() -> None:
    """Let ``pyvista_mesh >> filter`` work.

    VTK's own operator asks for the length of its left side as soon as that has ``__getitem__``, as all
    PyVista data sets do, and raises a SystemError; a PyVista MultiBlock it takes for a list of inputs.
    PyVista is not imported for this: where it is not loaded there is nothing to mend.
    """
    pyvista = sys.modules.get("pyvista")
    data_object = getattr(pyvista, "DataObject", None)
    if data_object is None or "__rshift__" in vars(data_object):
        return
    from vtkmodules.util import execution_model  # noqa: PLC0415 -- VTK has it from 9.4 on

    def connect(self: Any, other: Any) -> Any:
        producer = vtkTrivialProducer()
        producer.SetOutput(self)
        return execution_model.Pipeline(producer, other)

    for name in ("DataSet", "MultiBlock", "DataObject"):
        getattr(pyvista, name).__rshift__ = connect
