"""What was done to a data set, as a field array that travels with it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from vtkmodules.vtkCommonCore import vtkStringArray

from vtkmuscle._version import __version__

#: Name of the field array: one JSON object per filter, in the order in which they ran.
PROVENANCE = "Provenance"


def provenance_of(data: Any) -> list[dict[str, Any]]:
    """Return which filters made a data set, the first one first.

    Parameters
    ----------
    data : vtkDataObject
        What a filter gave, or what was read from a file of it.

    Returns
    -------
    list of dict
        Each with ``filter``, ``parameters`` (objects by the name of their class) and ``vtkmuscle``, the
        version; empty where nothing is known.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource, provenance_of
    >>> [step["filter"] for step in provenance_of(FibreTemplateSource(n_fibres=3).update().output)]
    ['FibreTemplateSource']
    """
    return [json.loads(entry) for entry in _entries(data)]


def provenance_entry(name: str, parameters: Mapping[str, Any]) -> str:
    """Return what a filter with these parameters adds to what it makes."""
    step = {"filter": name, "parameters": dict(parameters), "vtkmuscle": __version__}
    return json.dumps(step, default=lambda value: type(value).__name__)


def add_provenance(result: Any, inputs: Sequence[Any], entry: str) -> None:
    """Write into the field data of a result which filters made it: those of all inputs, then this one."""
    entries: dict[str, None] = {}
    for data in inputs:
        entries.update(dict.fromkeys([] if data is None else _entries(data)))
    entries[entry] = None
    array = vtkStringArray()
    array.SetName(PROVENANCE)
    for each in entries:
        array.InsertNextValue(each)
    result.GetFieldData().AddArray(array)


def _entries(data: Any) -> list[str]:
    array = data.GetFieldData().GetAbstractArray(PROVENANCE)
    if not isinstance(array, vtkStringArray):
        return []
    return [array.GetValue(i) for i in range(array.GetNumberOfValues())]
