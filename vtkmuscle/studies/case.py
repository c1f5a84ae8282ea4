"""One case of a study: a muscle of a scene with a variation, solved unless it is kept; and what comes out."""

from __future__ import annotations

import json
import threading
import time
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.accuracy import StatedErrors
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import group_fibres
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.run import RunOptions, frame_numbers, run_scene
from vtkmuscle.run.result import Result
from vtkmuscle.run.store.keys import code_digest, digest_of, muscle_keys
from vtkmuscle.run.table import total_of
from vtkmuscle.scene.data import MILLIMETRES, SceneData
from vtkmuscle.scene.reading import read_fields
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.scenes import Scene
from vtkmuscle.studies.variation import AS_IT_IS, Variation


@dataclass(frozen=True, eq=False)
class Outcome:
    """A muscle in the frames that it has finished.

    Attributes
    ----------
    facts : dict
        JSON-able: ``failure``, why there is nothing else; or ``verdict``, ``reasons``, ``remarks``,
        ``times``, ``frames`` (numbers), ``complete`` (whether these are all), ``fibres`` (of each group),
        ``coordinates`` (name, unit, positive direction), ``volume_mm3``, ``seconds``.
    arrays : dict of str to array
        ``lengths``, ``length_errors``, ``fibre_lengths`` (f, k) and ``rest`` (1, k) of the groups of fibres
        [mm], none of a muscle without; of the i-th coordinate ``armsI`` and so on.
    """

    facts: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, result: Result, name: str, groups: int | None) -> Self:
        """Return that of a muscle of a run; parameters as of :class:`~vtkmuscle.studies.case.Case`."""
        report, count = result.report["muscles"][name], result.finished(name)
        facts: dict[str, Any] = {
            "verdict": report["verdict"]["verdict"],
            "reasons": report["verdict"]["reasons"],
            "frames": list(result.frames[:count]),
            "times": list(result.times[:count]),
            "complete": count == len(result.frames),
            "volume_mm3": report["volume_mm3"],
            "seconds": report["seconds"],
            "coordinates": [],
            "fibres": [],
        }
        arrays: dict[str, NDArray[Any]] = {}
        if name in result.fibre_lengths:
            fibres, paths, errors = result.fibre_lengths[name], result.lengths.get(name), result.errors[name]
            labels = np.arange(fibres.shape[1])
            if groups is not None:
                labels = group_fibres(fibres if paths is None else paths, groups)
            facts["fibres"] = np.bincount(labels).tolist()
            rested = polylines_of(result.plain().rest_fibres(name), "fibres")
            rest = polyline_lengths(rested.points, rested.offsets) * MILLIMETRES[result.units]
            measured = {"rest": rest[None], "fibre_lengths": fibres}
            if paths is not None:
                measured |= {"lengths": paths, "length_errors": total_of(errors.get("each_length"), paths)}
            for number, one in enumerate(_arms(result, name)):
                facts["coordinates"].append([one.coordinate, one.unit, one.positive])
                off = total_of(errors.get(f"each_moment_arm_{one.coordinate}"), one.arms)
                measured |= {f"arms{number}": one.arms, f"slopes{number}": one.slopes, f"errors{number}": off}
                arrays |= {f"frames{number}": np.asarray(one.frames, np.int64), f"values{number}": one.values}
            arrays |= {key: _grouped(values, labels) for key, values in measured.items()}
        return cls(facts, arrays)

    @classmethod
    def read(cls, part: Part) -> Self:
        """Return what was kept as a part."""
        return cls(part.facts, part.arrays)

    @property
    def failure(self) -> str:
        """Why there is nothing; "" where there is something."""
        return str(self.facts.get("failure", ""))

    @property
    def message(self) -> str:
        """Why there is nothing, or what is to be looked at."""
        return self.failure or "; ".join(one["says"] for one in self.facts["reasons"])

    @property
    def arms(self) -> dict[str, JointArms]:
        """Moment arms of the groups of fibres by coordinate."""
        found = {}
        for number, (name, unit, positive) in enumerate(self.facts["coordinates"]):
            keys = ("frames", "values", "arms", "slopes")
            frames, values, arms, slopes = (self.arrays[f"{key}{number}"] for key in keys)
            found[name] = JointArms(name, unit, positive, frames, values, arms, slopes, None, None)
        return found

    def arm_errors(self, coordinate: str) -> Floats:
        """Return the errors of the moment arms by a coordinate, as its ``arms``; NaN where unknown."""
        names = [name for name, _, _ in self.facts["coordinates"]]
        return np.asarray(self.arrays[f"errors{names.index(coordinate)}"])


def _arms(result: Result, name: str) -> list[JointArms]:
    """Return the moment arms of a muscle, none where none are known."""
    try:
        return list(result.moment_arms().get(name, {}).values())
    except InputError:  # why is in no number
        return []


def _grouped(values: Floats, labels: Ints) -> Floats:
    """Return the means of the columns of each group."""
    return np.column_stack([values[:, labels == group].mean(axis=1) for group in range(labels.max() + 1)])


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
    problem : str
        Why it cannot be done at all, where that is known; "" else.
    """

    labels: Mapping[str, str]
    muscle: str
    scene: SceneData | SceneText
    variation: Variation = AS_IT_IS
    frames: str | range | None = None
    groups: int | None = None
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
    kept = case.groups, muscle.crosses  # of which muscles' keys know nothing
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
    return Outcome.of(result, case.muscle, case.groups)


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
