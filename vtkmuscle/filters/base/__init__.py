"""What all filters share: declared parameters and ports, failures, time.

Open :mod:`~vtkmuscle.filters.base.filter` for the class that a new filter derives from, and
:mod:`~vtkmuscle.filters.base.history` for filters whose result at a time depends on those before.
"""

from vtkmuscle.filters.base import ports
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.history import HistoryFilter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort

__all__ = ["Filter", "HistoryFilter", "InputPort", "OutputPort", "Parameter", "ports"]
