"""VTK filters for muscles: deformation, fibres and measurement.

Muscles are deformed with moving bones, filled with fibres and measured, in Python. Names are imported at
first use, to keep ``import vtkmuscle`` quick.

Examples
--------
>>> import vtkmuscle
>>> vtkmuscle.__version__
'0.1.0'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from vtkmuscle.core.words import suggestion

if TYPE_CHECKING:
    from vtkmuscle import filters, phantoms, pipelines, plotting
    from vtkmuscle.comparison import Comparison, compare
    from vtkmuscle.core.errors import InputError
    from vtkmuscle.core.motion.rigid import RigidMotion, hinge
    from vtkmuscle.data.attachments import AttachmentArea
    from vtkmuscle.installation import selftest
    from vtkmuscle.labels.page import from_labels, init
    from vtkmuscle.opensim.checking import check_model as check
    from vtkmuscle.opensim.from_run import export
    from vtkmuscle.public_data import fetch
    from vtkmuscle.run.result import MuscleResult, Result
    from vtkmuscle.run.table import MomentArmTable, Table
    from vtkmuscle.scene.data import Muscle
    from vtkmuscle.scene.faults import SceneError
    from vtkmuscle.scenes import Scene
    from vtkmuscle.studies import cohort, vary
    from vtkmuscle.tradeoffs import Tradeoff, tradeoff

__version__ = "0.1.0"

_MODULES = ("filters", "phantoms", "pipelines", "plotting")
_SOURCES = {
    "RigidMotion": "vtkmuscle.core.motion.rigid",
    "hinge": "vtkmuscle.core.motion.rigid",
    "AttachmentArea": "vtkmuscle.data.attachments",
    "Comparison": "vtkmuscle.comparison",
    "compare": "vtkmuscle.comparison",
    "InputError": "vtkmuscle.core.errors",
    "cohort": "vtkmuscle.studies",
    "vary": "vtkmuscle.studies",
    "MomentArmTable": "vtkmuscle.run.table",
    "Muscle": "vtkmuscle.scene.data",
    "MuscleResult": "vtkmuscle.run.result",
    "Result": "vtkmuscle.run.result",
    "Scene": "vtkmuscle.scenes",
    "SceneError": "vtkmuscle.scene.faults",
    "Table": "vtkmuscle.run.table",
    "Tradeoff": "vtkmuscle.tradeoffs",
    "selftest": "vtkmuscle.installation",
    "from_labels": "vtkmuscle.labels.page",
    "init": "vtkmuscle.labels.page",
    "export": "vtkmuscle.opensim.from_run",
    "fetch": "vtkmuscle.public_data",
    "tradeoff": "vtkmuscle.tradeoffs",
}

__all__ = [
    "AttachmentArea",
    "Comparison",
    "InputError",
    "MomentArmTable",
    "Muscle",
    "MuscleResult",
    "Result",
    "RigidMotion",
    "Scene",
    "SceneError",
    "Table",
    "Tradeoff",
    "__version__",
    "check",
    "cohort",
    "compare",
    "export",
    "fetch",
    "filters",
    "from_labels",
    "hinge",
    "init",
    "phantoms",
    "pipelines",
    "plotting",
    "selftest",
    "tradeoff",
    "vary",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"vtkmuscle.{name}")
    if name in _SOURCES:
        return getattr(import_module(_SOURCES[name]), name)
    if name == "check":
        return import_module("vtkmuscle.opensim.checking").check_model
    remedy = suggestion(name, __all__)
    if not name.startswith("_") and name in import_module("vtkmuscle.filters").__all__:
        remedy = f"it is vtkmuscle.filters.{name}"
    raise AttributeError(f"module 'vtkmuscle' has no attribute {name!r}; {remedy}")


def __dir__() -> list[str]:
    return sorted(__all__)
