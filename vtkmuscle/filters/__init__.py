"""VTK filters over :mod:`vtkmuscle.core`, imported on first use.

The module ``fibre_smoother.py`` defines ``FibreSmoother``; :data:`_MODULES` has the exception.

Examples
--------
>>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource
>>> fibres = FibreTemplateSource(template="curved", n_fibres=10) >> FibreSmoother()
>>> fibres.output.GetNumberOfCells()
10
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from vtkmuscle.data.attachments import AttachmentArea, attachments_from, attachments_of, via_rings_of
from vtkmuscle.data.pipeline_times import provenance_of
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter

#: Public names besides the filters.
_HELPERS = (
    AttachmentArea, Filter, InputPort, OutputPort, Parameter, attachments_from, attachments_of, provenance_of,
    via_rings_of,
)  # fmt: skip
#: Module of each filter by the filter's name in lower case.
_MODULES = {
    module.name.replace("_", ""): module.name for module in iter_modules(__path__) if not module.ispkg
} | {"stifftendons": "fibre_transport"}


def filter_classes() -> list[type[Filter]]:
    """Return all filters in alphabetical order, importing each."""
    classes = []
    for name, file in _MODULES.items():
        module = import_module(f"{__name__}.{file}")
        (own,) = (value for key, value in vars(module).items() if key.lower() == name)
        classes.append(own)
    return sorted(classes, key=lambda kind: kind.__name__)


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return __dir__()
    if name.lower() in _MODULES and not name.islower():
        module = import_module(f"{__name__}.{_MODULES[name.lower()]}")
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*(kind.__name__ for kind in filter_classes()), *(value.__name__ for value in _HELPERS)])
