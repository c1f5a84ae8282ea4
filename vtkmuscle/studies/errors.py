"""The errors of a run by further solves: the other model, a finer mesh, finer fibres, moved landmarks."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.accuracy import KINDS, SOLVED, Solution, StatedErrors
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import names, suggestion
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.run import Result, RunOptions, frame_numbers, run_scene
from vtkmuscle.run.store.writing import claimed
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.scenes import Scene
from vtkmuscle.studies.case import Case, Outcome, recorded
from vtkmuscle.studies.study import solutions
from vtkmuscle.studies.variation import FEWEST, Variation, samples_of

#: Where the further solves of a run are kept in its folder.
FOLDER = "further"


def run_with_errors(
    scene: Scene,
    out: str | PathLike[str] | None = None,
    *,
    errors: bool | str | Iterable[str] = True,
    landmark_error: float = 5.0,
    landmark_samples: int = 8,
    **options: Any,
) -> Result:
    """Run a scene, and state the parts of its numbers' errors that take further solves as well.

    Parameters
    ----------
    scene : Scene
    out : path, optional
        Folder to write to, as of :meth:`vtkmuscle.Scene.run`; further solves are kept there too.
    errors : bool, str or iterable of str, optional
        The parts of the errors of lengths, moment arms and areas: ``"model"`` (paths against the volume),
        ``"mesh"`` (edges half as long), ``"slices"`` (of the fibres at rest), ``"landmarks"`` (moved at
        random); True is all but the last.
    landmark_error : float, optional
        Distance by which ``"landmarks"`` moves each area [mm].
    landmark_samples : int, optional
        Number of such moves, 3 or more.
    **options
        As of :meth:`vtkmuscle.Scene.run`.

    Returns
    -------
    Result
        As of a run without them, with more parts in ``errors``. ``errors_not_known`` in a muscle's report
        says why a solve has failed.

    Raises
    ------
    ValueError
        If a kind is unknown, or the distance or the number of landmark moves is too small; else as of
        :meth:`vtkmuscle.Scene.run`.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.studies.errors import run_with_errors
    >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8, resolution=5)
    >>> result = run_with_errors(scene, errors=["model"], frames="0:2")
    >>> sorted(result.errors["spindle"]["length"].parts)
    ['fibres', 'model', 'segments']
    """
    wanted = {*(() if errors is False else SOLVED if errors is True else names(errors))}
    for kind in sorted(wanted.difference(KINDS)):
        raise InputError("errors", f"there is no kind {kind!r}", suggestion(kind, KINDS))
    if not (np.isfinite(landmark_error) and landmark_error > 0.0):
        problem = f"it is {landmark_error!r}, but must be a positive number of millimetres"
        raise InputError("landmark_error", problem)
    if landmark_samples < FEWEST:
        raise InputError("landmark_samples", f"it is {landmark_samples!r}, but must be {FEWEST} or more")
    kinds = tuple(kind for kind in KINDS if kind in wanted)
    asked = RunOptions.of(options)
    target = None if out is None else Path(out)
    frames = frame_numbers(asked.frames, len(scene.motion.times))
    alone = replace(scene, muscle_contact="off", files={})
    cases = {
        (name, kind): [
            Case({"kind": kind, "sample": one.name}, name, alone, one, frames)
            for one in _variations(scene, name, kind, landmark_error, landmark_samples)
        ]
        for name, muscle in scene.muscles.items()
        for kind in kinds
        if muscle.fibres is not None
    }
    tell = asked.progress or (lambda *_: None)
    claim = nullcontext() if target is None else claimed(target, scene, overwrite=asked.overwrite)
    with recorded():
        check_sense(scene)
        with claim:
            found = solutions(
                cases,
                None if target is None else target / FOLDER,
                workers=asked.workers,
                fresh=asked.fresh,
                progress=lambda one: tell(one.case.muscle, f"errors: {one.case.labels['kind']}", 0.0),
            )
    failed = {key: words for key, own in found.items() if (words := _failure(own))}
    solved = {key: [_solution(one) for one in own] for key, own in found.items() if key not in failed}
    return run_scene(scene, target, asked, errors=StatedErrors(scene, kinds, solved, failed))


def _variations(scene: Scene, name: str, kind: str, distance: float, samples: int) -> list[Variation]:
    """Return the further solves of a kind."""
    if kind == "model":
        return [Variation(kind, model="paths" if scene.model == "volume" else "volume")]
    if kind == "mesh":
        return [Variation(kind, halved=True)]
    if kind == "slices":
        default = FibreTemplateSource.parameter_declarations["resolution"].default
        segments = int((scene.muscles[name].fibres or {}).get("resolution", default))
        return [Variation(kind, fibres={"slice_tolerance": 0.0, "resolution": 2 * segments})]
    return samples_of(kind, distance, samples, model="paths")


def _failure(outcomes: Iterable[Outcome]) -> str:
    """Return the reason why one of the solves of a kind failed, or ""."""
    return next((one.message for one in outcomes if one.failure or not one.values["complete"]), "")


def _solution(one: Outcome) -> Solution:
    lengths = one.values.get("lengths", np.empty((0, 0)))
    return Solution(lengths, one.values["fibre_lengths"], one.values["rest"], one.arms)
