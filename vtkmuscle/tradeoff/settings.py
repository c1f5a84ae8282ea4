"""What is tried: settings of the solver, the meshes and the fibres, one changed at a time around a preset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vtkmuscle.filters.deformer.quality import PRESETS

#: The preset around which most settings are varied.
CENTRE = "balanced"

#: Settings of the fibres that are tried.
_FIBRES: Mapping[str, tuple[Any, ...]] = {
    "n_fibres": (25, 400),
    "resolution": (5, 45),
    "slice_tolerance": (0.1, 5.0),
}


@dataclass(frozen=True)
class Setting:
    """A choice of all that trades speed for accuracy.

    Attributes
    ----------
    name : str
        As in the table, e.g. ``"iterations=50"``.
    group : str
        What is varied, e.g. ``"iterations"``; settings of a group are joined by a line in the plots.
    solver : mapping
        Parameters of PBDDeformer; they take the place of the scene's own of the same name.
    fibres : mapping
        Keyword arguments of :func:`~vtkmuscle.pipelines.decompose`, likewise.
    weight_tolerance : float
        Of FibreTransport.
    every : int
        Only each so manieth frame of the motion is a step.
    """

    name: str
    group: str
    solver: Mapping[str, Any] = field(default_factory=dict)
    fibres: Mapping[str, Any] = field(default_factory=dict)
    weight_tolerance: float = 0.0
    every: int = 1

    def plain(self) -> dict[str, Any]:
        """Return what decides the result, JSON-able; the name does not."""
        return {
            "solver": dict(self.solver),
            "fibres": dict(self.fibres),
            "weight_tolerance": self.weight_tolerance,
            "every": self.every,
        }


def reference(iterations: int) -> Setting:
    """Return the setting whose result the others are compared with, at so many iterations per step."""
    solver = {**PRESETS["accurate"], "iterations": iterations, "tolerance": 0.0}
    return Setting("reference", "reference", solver)


def grid() -> list[Setting]:
    """Return all settings to try, the presets first.

    It is no full product, which would take years: each setting changes one thing at a preset, and a few
    products are added where two things bear on each other (iterations with the solver).
    """
    presets = [Setting(name, "presets", dict(values)) for name, values in PRESETS.items()]
    return presets + _around_centre() + _products()


def _around_centre() -> list[Setting]:
    settings = []

    def vary(name: str, *values: Any, **also: Any) -> None:
        for value in values:
            solver = {**PRESETS[CENTRE], **also, name: value}
            settings.append(Setting(_words({name: value, **also}), name, solver))

    vary("iterations", 2, 4, 6, 10, 20, 40, 100, tolerance=0.0)
    vary("tolerance", 1.0, 0.3, 0.1, 0.03, 0.01, iterations=400)
    vary("solver", "anderson", "gauss-seidel", tolerance=0.0)
    vary("substeps", 2, 4)
    vary("start", "inertial")
    vary("anisotropy", "stiffness", "off")
    vary("grid_spacing", 0.5, 1.0, 2.0, 4.0)
    vary("collision", "off")
    vary("collision", "voxel", solver="gauss-seidel")
    for name, values in _FIBRES.items():
        settings += [_at_centre(name, value, fibres={name: value}) for value in values]
    settings += [_at_centre("weight_tolerance", value, weight_tolerance=value) for value in (0.1, 1.0)]
    settings += [_at_centre("every", value, every=value) for value in (2, 5, 15)]
    return settings


def _at_centre(name: str, value: Any, **also: Any) -> Setting:
    return Setting(_words({name: value}), name, dict(PRESETS[CENTRE]), **also)


def _products() -> list[Setting]:
    """Return the products of what bears on each other."""
    settings = []
    for iterations in (10, 50, 200):
        for dtype in ("float64", "float32"):
            changes = {"solver": "gauss-seidel", "dtype": dtype, "iterations": iterations, "tolerance": 0.0}
            settings.append(
                Setting(_words(changes), f"gauss-seidel, {dtype}", {**PRESETS[CENTRE], **changes})
            )
    return settings


def _words(changes: Mapping[str, Any]) -> str:
    shown = {name: value for name, value in changes.items() if (name, value) != ("tolerance", 0.0)}
    return ", ".join(f"{name}={value}" for name, value in shown.items())
