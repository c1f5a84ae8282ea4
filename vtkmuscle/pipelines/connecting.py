"""Filters connected by the names of their ports, and several data sets as one input."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from vtkmodules.vtkFiltersGeneral import vtkGroupDataSetsFilter

from vtkmuscle.filters.base.filter import Filter

F = TypeVar("F", bound=Filter)


def connected(algorithm: F, **inputs: Any) -> F:
    """Return a filter with inputs connected to its ports of these names; None leaves a port open."""
    names = [port.name for port in algorithm.input_ports]
    for name, value in inputs.items():
        algorithm.connect(names.index(name), value)
    return algorithm


def grouped(algorithms: Mapping[str, Any]) -> vtkGroupDataSetsFilter:
    """Return an algorithm that gives the outputs of several as the named blocks of one data set."""
    group = vtkGroupDataSetsFilter()
    group.SetOutputTypeToMultiBlockDataSet()
    for number, (name, algorithm) in enumerate(algorithms.items()):
        group.AddInputConnection(algorithm.GetOutputPort())
        group.SetInputName(number, name)
    return group
