"""What is tried: settings of the solver, the grids, the fibres and the steps, one changed at a time."""

from __future__ import annotations

from typing import Any

from vtkmuscle.filters.deformer.settings import PRESETS, PUBLISHED
from vtkmuscle.studies.variation import Variation

#: The preset around which most settings are varied; the published one is a group of its own.
CENTRE = "balanced"
#: Name and group of the setting that leaves the scene as it is.
AS_IT_IS = "scene"
#: Values of the parameters of the solver, and of the fibres, that are tried.
_SOLVER: dict[str, tuple[Any, ...]] = {
    "iterations": (1, 2, 3, 10, 20, 40),
    "taut_resolution": (8, 16, 24, 64),
    "collision": ("off",),
}
_FIBRES: dict[str, tuple[Any, ...]] = {
    "n_fibres": (25, 400),
    "resolution": (5, 45),
    "slice_tolerance": (0.1, 5.0),
    "weight_tolerance": (0.0, 0.1, 1.0),
}
_EVERY = (2, 5, 15)


def reference(iterations: int) -> Variation:
    """Return the setting whose result the others are compared with, at a number of iterations per step."""
    solver = {"quality": "accurate", "iterations": iterations}
    return Variation(f"reference={iterations}", "reference", solver)


def grid() -> list[Variation]:
    """Return all settings to try: the presets, the scene as it is, and one change at a time of ``balanced``.

    A full product would take years.
    """
    # What was published is another model, and no point on the way to this one's end.
    groups = {name: name if name == PUBLISHED else "presets" for name in PRESETS}
    settings = [Variation(name, groups[name], {"quality": name}) for name in PRESETS]
    settings.append(Variation(AS_IT_IS, AS_IT_IS))
    centre = {"quality": CENTRE}
    for name, values in _SOLVER.items():
        settings += [Variation(f"{name}={value}", name, {**centre, name: value}) for value in values]
    for name, values in _FIBRES.items():
        settings += [Variation(f"{name}={value}", name, centre, {name: value}) for value in values]
    return settings + [Variation(f"every={n}", "every", centre, every=n) for n in _EVERY]


def chosen(settings: list[Variation], only: tuple[str, ...]) -> list[Variation]:
    """Return the settings whose group or beginning of the name is wanted, all where nothing is.

    Raises
    ------
    ValueError
        If there is none of a name; the message lists the groups.
    """
    for word in only:
        if not any(_wanted(setting, word) for setting in settings):
            groups = ", ".join(dict.fromkeys(setting.group for setting in settings))
            raise ValueError(f"no setting is called {word!r}; there are groups {groups}")
    return [setting for setting in settings if not only or any(_wanted(setting, word) for word in only)]


def _wanted(setting: Variation, word: str) -> bool:
    return setting.group == word or setting.name.startswith(word)
