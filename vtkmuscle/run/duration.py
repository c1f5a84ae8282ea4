"""How long a run will take: a long one is announced, and one that would not end is not begun."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

from vtkmuscle.filters.deformer.settings import PUBLISHED
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.faults import SceneError

#: Processor time that is announced, and that no run is given [h].
LONG, MOST = 1.0, 1000.0
#: Of a frame: by itself, for a fibre, and for a triangle (docs/validation/scale.rst) [s].
_FRAME, _FIBRE, _TRIANGLE = 0.02, 1e-4, 2.5e-6
#: Of a round, and of an iteration of Algorithm 2, for a triangle: on the phantom hip, 200 of them [s].
_ROUND, _ITERATION = 6e-8, 1.5e-7


def check_duration(scene: SceneData, numbers: range) -> None:
    """Say that a run of these frames takes more than an hour; raise a SceneError for more than 1000.

    Warns
    -----
    UserWarning
        If it takes more than an hour of processor time.
    """
    hours = {name: seconds / 3600.0 for name, seconds in estimated_seconds(scene, numbers)}
    total, longest = sum(hours.values()), max(hours, key=lambda name: hours[name])
    problem = f"the run takes about {total:.2g} hours of processor time, {hours[longest]:.2g} of them for "
    problem += repr(longest)
    remedy = "keep fewer frames, give fewer iterations, or simplify its surface"
    if total > MOST:
        raise SceneError(problem, f"muscles.{longest}", remedy, scene.files.get(""))
    if total > LONG:
        warnings.warn(f"{problem}; if that is too long {remedy}", stacklevel=3)


def estimated_seconds(scene: SceneData, numbers: range) -> Iterator[tuple[str, float]]:
    """Give each muscle's name, and the processor time that a run of these frames takes for it [s]."""
    for name, muscle in scene.muscles.items():
        settings = PBDDeformer(**scene.solver_of(name)).parameters()
        published = settings["quality"] == PUBLISHED
        frames = numbers[-1] + 1 if published else len(numbers)  # a frame needs those before it
        rounds = settings["iterations"] * (_ITERATION if published else _ROUND)
        default = FibreTemplateSource.parameter_declarations["n_fibres"].default
        fibres = 0 if muscle.fibres is None else muscle.fibres.get("n_fibres", default)
        triangles = 0 if scene.model == "paths" else muscle.surface.GetNumberOfCells()
        yield name, frames * (_FRAME + fibres * _FIBRE + triangles * (_TRIANGLE + rounds))
