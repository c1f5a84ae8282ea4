"""One case of a study: a muscle of a scene with a variation, solved unless it is kept already."""

from __future__ import annotations

import json
import threading
import time
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from vtkmuscle.accuracy import StatedErrors
from vtkmuscle.core.errors import InputError
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.run import RunOptions, frame_numbers, run_scene
from vtkmuscle.run.store.keys import code_digest, digest_of, muscle_keys
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.reading import read_fields
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.scenes import Scene
from vtkmuscle.studies.outcome import Outcome
from vtkmuscle.studies.variation import AS_IT_IS, Variation

#: What becomes of a case: it was done before, it is done now, or it cannot be.
KEPT, DONE, FAILED = "kept", "done", "failed"
#: Scenes that a worker keeps: that of the muscles of a subject, which come one after the other.
_SCENES = 2


class UnwritableError(OSError):
    """What has been done cannot be kept: this ends a study, where the failure of a case does not."""


@dataclass(frozen=True)
class SceneText:
    """A scene that whoever solves the case reads: its file, and what is in it, filled in."""

    file: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One muscle of one scene with one variation.

    Attributes
    ----------
    labels : mapping of str to str
        What tells it from the others, by the columns of the table; may be "".
    muscle : str
        Which.
    scene : SceneData or SceneText
        Of which scene.
    variation : Variation
        What is changed in it.
    frames : str, range or None
        Which frames are kept; None for all.
    groups : int or None
        Groups of fibres that lengthen alike, of which means are kept; None for each fibre.
    picture : bool
        Whether it is drawn.
    problem : str
        Why it cannot be done at all, where that is known; "" else.
    """

    labels: Mapping[str, str]
    muscle: str
    scene: SceneData | SceneText
    variation: Variation = AS_IT_IS
    frames: str | range | None = None
    groups: int | None = None
    picture: bool = False
    problem: str = ""

    @property
    def name(self) -> str:
        """Name of the part that it makes; no two cases of a study have the same."""
        return "/".join(one.replace(" ", "_") or "-" for one in (*self.labels.values(), self.muscle))


def solve(case: Case, folder: str, run: str, code: str, _after: object = None) -> tuple[str, str]:
    """Do a case in a process of its own, and keep what came out as a part.

    Parameters
    ----------
    case : Case
        What is to be done.
    folder : str
        Of the parts.
    run : str
        Which run of a study; files are read anew in each.
    code : str
        Digest of the package that started the study.

    Returns
    -------
    (str, str)
        ``"kept"``, ``"done"`` or ``"failed"``; and the verdict, or why it failed.

    Raises
    ------
    UnwritableError
        If the part cannot be written, or this process's package is not the one that started the study.
    """
    if code != code_digest():
        raise UnwritableError(
            "a worker has another version of vtkmuscle, or of what it computes with, than this process; "
            "install the same in both"
        )
    with recorded() as caught:
        return solve_here(case, Parts(Path(folder)), run, caught, threading.Event())


@contextmanager
def recorded() -> Iterator[list[warnings.WarningMessage]]:
    """Give a list of what is warned of meanwhile."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        yield caught


def solve_here(
    case: Case, store: Parts, run: str, caught: Collection[warnings.WarningMessage], stop: threading.Event
) -> tuple[str, str]:
    """Do a case as :func:`solve` does; ``caught`` gathers warnings, ``stop`` ends it from outside."""
    try:
        part, state, key = _part(case, store, run, caught, stop)
    except (ImportError, UnwritableError):
        raise
    except Exception as error:  # of this case alone; it becomes a row of the table
        if stop.is_set():
            raise
        part, state, key = Part({"failure": _in_words(error)}), FAILED, ""
    if state != KEPT:
        try:
            store.write(case.name, key, part)
        except OSError as error:
            raise UnwritableError(f"{error.filename or store.path(case.name)}: {error.strerror}") from error
    return state, str(part.facts.get("failure") or part.facts["verdict"])


def _part(
    case: Case, store: Parts, run: str, caught: Collection[warnings.WarningMessage], stop: threading.Event
) -> tuple[Part, str, str]:
    """Return the part of a case, what has become of it, and its key."""
    if case.problem:
        raise InputError("", case.problem)
    scene, remarks = _scene_of(case, run)
    muscle = scene.muscles[case.muscle]
    kept = case.groups, case.picture, muscle.crosses  # of which muscles' keys know nothing
    numbers = frame_numbers(case.frames, len(scene.motion.times))
    key = digest_of([muscle_keys(scene, numbers)[case.muscle], repr(kept)])
    found = store.read(case.name, key)
    if found is not None:
        return found, KEPT, key
    outcome = _solved(case, scene, numbers, stop)
    said = sorted({*remarks, *(str(one.message) for one in caught)})
    return Part({**outcome.facts, "remarks": said}, outcome.arrays), DONE, key


def _solved(case: Case, scene: SceneData, numbers: range, stop: threading.Event) -> Outcome:
    """Run one muscle, with those before it where it may meet them."""

    def unless_stopped(*_: object) -> None:
        if stop.is_set():
            raise AbortedError("the study was stopped")

    names = list(scene.muscles)
    before = names[: names.index(case.muscle) + 1] if scene.muscle_contact != "off" else [case.muscle]
    alone = replace(scene, muscles={name: scene.muscles[name] for name in before})
    # By the processor's time: what else the machine does is in no figure.
    options = RunOptions(
        frames=numbers, workers=1, sense=False, progress=unless_stopped, clock=time.process_time
    )
    result = run_scene(alone, None, options, errors=StatedErrors(alone))
    return Outcome.of(result, case.muscle, case.groups, picture=case.picture)


def _scene_of(case: Case, run: str) -> tuple[SceneData, Collection[str]]:
    """Return the varied scene of a case, and what was warned of when it was read."""
    if isinstance(case.scene, SceneData):
        return case.variation.of(case.scene), ()
    # In order: muscles yield to those before them.
    return _read(json.dumps([asdict(case.scene), asdict(case.variation)]), run)


@lru_cache(maxsize=_SCENES)
def _read(text: str, _run: str) -> tuple[SceneData, Collection[str]]:
    """Return the scene of a text and a variation, given as JSON; read once in a run of a study."""
    scene_text, variation = json.loads(text)
    with recorded() as caught:
        scene = Scene(**read_fields(Path(scene_text["file"]), scene_text["values"]))
        change = Variation(**variation)
        if not change.cause:
            check_sense(scene)
        return change.of(scene), [str(one.message) for one in caught]


def _in_words(error: Exception) -> str:
    """Return an error in one line."""
    if isinstance(error, MemoryError):
        return "there is not enough memory for this"
    words = " ".join(str(error).split())
    known = isinstance(error, ValueError | OSError)
    return words if known and words else f"{type(error).__name__}: {words}".rstrip(": ")
