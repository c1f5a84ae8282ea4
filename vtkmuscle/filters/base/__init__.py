"""Base of all filters: declared parameters and ports, errors, time.

:mod:`~vtkmuscle.filters.base.filter` has the base class of new filters, and
:mod:`~vtkmuscle.filters.base.history` the base class of filters whose result depends on earlier times.
"""

from vtkmuscle.data.attachments import AttachmentArea, attachments_from, attachments_of, via_rings_of
from vtkmuscle.data.pipeline_times import provenance_of
from vtkmuscle.filters.base import ports
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.history import HistoryFilter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort

__all__ = ["Filter", "HistoryFilter", "InputPort", "OutputPort", "Parameter", "ports"]
__all__ += ["AttachmentArea", "attachments_from", "attachments_of", "provenance_of", "via_rings_of"]
