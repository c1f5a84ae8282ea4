"""VTK filters over :mod:`vtkmuscle.core`, imported on first use.

Examples
--------
>>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource
>>> fibres = FibreTemplateSource(template="curved", n_fibres=10) >> FibreSmoother()
>>> fibres.output.GetNumberOfCells()
10
"""

from typing import Any

import lazy_loader

#: Names are in the stub file; the first use of a name loads its module.
_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    try:
        return _attribute(name)
    except AttributeError as error:
        from vtkmuscle.core.words import suggestion  # noqa: PLC0415 -- difflib, for unknown names alone

        raise AttributeError(f"{error}; {suggestion(name, __all__)}") from None


def filter_classes() -> list[Any]:
    """Return all filters in alphabetical order, importing each."""
    values, base = map(_attribute, __all__), _attribute("Filter")
    return [each for each in values if isinstance(each, type) and issubclass(each, base) and each is not base]
