"""What is tried: settings of the solver, the grids, the fibres and the steps, one changed at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vtkmuscle.filters.deformer.quality import PRESETS, PUBLISHED

#: The preset around which most settings are varied; the published one is a group of its own.
CENTRE = "balanced"
#: Name and group of the setting that leaves the scene as it is.
AS_IT_IS = "scene"


@dataclass(frozen=True)
class Setting:
    """A choice of all that trades speed for accuracy.

    Attributes
    ----------
    name : str
        As in the table, e.g. ``"iterations=50"``.
    group : str
        What is varied, e.g. ``"iterations"``; settings of a group are joined by a line in the plots.
    solver : mapping or None
        Parameters of PBDDeformer; they take the place of the scene's own that trade speed for accuracy. None
        leaves the scene's solver as it is.
    fibres : mapping
        Settings of the fibres, which take the place of the scene's own of the same name.
    every : int
        Only each frame of this number is a step of the motion.
    """

    name: str
    group: str
    solver: Mapping[str, Any] | None = field(default_factory=dict)
    fibres: Mapping[str, Any] = field(default_factory=dict)
    every: int = 1

    def plain(self) -> dict[str, Any]:
        """Return what decides the result, JSON-able; the name does not."""
        solver = None if self.solver is None else dict(self.solver)
        return {"solver": solver, "fibres": dict(self.fibres), "every": self.every}


def reference(iterations: int) -> Setting:
    """Return the setting whose result the others are compared with, at a number of iterations per step."""
    solver = {"quality": "accurate", "iterations": iterations}
    return Setting("reference", "reference", solver)


def grid() -> list[Setting]:
    """Return all settings to try: the presets, the scene as it is, and one change at a time of ``balanced``.

    A full product would take years.
    """
    # What was published is another model, and no point on the way to this one's end.
    groups = {name: name if name == PUBLISHED else "presets" for name in PRESETS}
    settings = [Setting(name, groups[name], {"quality": name}) for name in PRESETS]
    settings.append(Setting(AS_IT_IS, AS_IT_IS, None))

    centre = {"quality": CENTRE}
    of_solver: dict[str, tuple[Any, ...]] = {
        "iterations": (1, 2, 3, 10, 20, 40),
        "taut_resolution": (8, 16, 24, 64),
        "collision": ("off",),
    }
    for name, values in of_solver.items():
        settings += [Setting(f"{name}={value}", name, {**centre, name: value}) for value in values]
    of_fibres: dict[str, tuple[Any, ...]] = {
        "n_fibres": (25, 400),
        "resolution": (5, 45),
        "slice_tolerance": (0.1, 5.0),
        "weight_tolerance": (0.0, 0.1, 1.0),
    }
    for name, values in of_fibres.items():
        settings += [Setting(f"{name}={value}", name, centre, {name: value}) for value in values]
    return settings + [Setting(f"every={n}", "every", centre, every=n) for n in (2, 5, 15)]
