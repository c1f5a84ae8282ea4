"""Deform muscles with moving bones, fill them with fibres, and measure them: VTK filters in Python.

Names are imported when they are first used, so that ``import vtkmuscle`` stays quick.

Examples
--------
>>> import vtkmuscle
>>> vtkmuscle.__version__
'0.1.0'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vtkmuscle import filters, phantoms, pipelines, plotting
    from vtkmuscle.core.motion.rigid import RigidMotion, hinge
    from vtkmuscle.scene import Scene, SceneError

__version__ = "0.1.0"

_MODULES = ("filters", "phantoms", "pipelines", "plotting")
_SOURCES = {
    "RigidMotion": "vtkmuscle.core.motion.rigid",
    "hinge": "vtkmuscle.core.motion.rigid",
    "Scene": "vtkmuscle.scene",
    "SceneError": "vtkmuscle.scene",
}

__all__ = [
    "RigidMotion",
    "Scene",
    "SceneError",
    "__version__",
    "filters",
    "hinge",
    "phantoms",
    "pipelines",
    "plotting",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"vtkmuscle.{name}")
    if name in _SOURCES:
        return getattr(import_module(_SOURCES[name]), name)
    raise AttributeError(f"module 'vtkmuscle' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
