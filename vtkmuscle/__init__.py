"""VTK filters for muscles: deformation, fibres and measurement.

Muscles are deformed with moving bones, filled with fibres and measured, in Python. Names are imported at
first use, to keep ``import vtkmuscle`` quick.

Examples
--------
>>> import vtkmuscle
>>> vtkmuscle.__version__
'0.1.0'
"""

from typing import Any

import lazy_loader

__version__ = "0.1.0"

#: Names are in the stub file; the first use of a name loads its module.
_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return _attribute(name)
    from vtkmuscle.core.words import remedy_for  # noqa: PLC0415 -- difflib, for unknown names alone

    remedy = remedy_for("vtkmuscle", name, __all__)
    if not name.startswith("_") and name in _attribute("filters").__all__:
        remedy = f"it is vtkmuscle.filters.{name}"
    raise AttributeError(f"module 'vtkmuscle' has no attribute {name!r}; {remedy}")
