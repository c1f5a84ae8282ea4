"""The data sets that can be fetched, by name."""

from __future__ import annotations

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion
from vtkmuscle.fetch.datasets import DataSet
from vtkmuscle.fetch.lhdl_hip import LHDL_HIP

DATA_SETS: dict[str, DataSet] = {"lhdl-hip": LHDL_HIP}


def data_set(name: str) -> DataSet:
    """Return a data set by its name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in DATA_SETS:
        raise InputError("", f"there is no data set {name!r}; {suggestion(name, DATA_SETS)}")
    return DATA_SETS[name]
