"""One case of a study: a muscle of a varied scene, solved unless its outcome is kept already."""

from __future__ import annotations

import json
import threading
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from vtkmuscle.accuracy import StatedErrors
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import group_fibres
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats
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

#: State of a case that has ended: finished by an earlier run, finished by this one, or failed.
KEPT, DONE, FAILED = "kept", "done", "failed"
#: Scenes that a process remembers; the muscles of a scene are solved one after the other.
_SCENES = 2


_Scene = TypeVar("_Scene", bound=SceneData)


class UnwritableError(OSError):
    """An outcome cannot be kept. This ends a study; the failure of a single case does not."""


@dataclass(frozen=True)
class SceneText:
    """A scene that is read where its case is solved: the scene's file, and its tables, filled in."""

    file: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One muscle of one scene with one variation.

    Attributes
    ----------
    labels : mapping of str to str
        Texts, or "", by the names of columns; with the muscle they name the case.
    muscle : str
    scene : SceneData or SceneText
    variation : Variation
    frames : str, range or None
        The frames that are kept; None for all.
    groups : int or None
        Number of groups of fibres that lengthen alike, of which means are kept; None to keep each fibre.
    problem : str
        The reason why the case cannot be solved, or "".
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
        """Name of the case's part, unique in a study."""
        return "/".join(one.replace(" ", "_") or "-" for one in (*self.labels.values(), self.muscle))


@dataclass(frozen=True, eq=False)
class Outcome:
    """The values that are kept of a case.

    Attributes
    ----------
    values : mapping
        ``failure`` alone, the reason; or ``verdict``, ``reasons``, ``remarks``, ``frames`` (numbers),
        ``times`` and ``complete`` (whether these are all frames). Of a muscle with fibres also ``fibres``
        (number in each of k groups), ``rest`` (k,), ``fibre_lengths`` (f, k) [mm], ``arms`` (fields of
        JointArms by coordinate) and ``arm_errors`` (by coordinate); of one with paths ``lengths`` and
        ``length_errors`` (f, k) [mm].
    """

    values: Mapping[str, Any]

    @property
    def failure(self) -> str:
        """The reason why the case failed, or ""."""
        return str(self.values.get("failure", ""))

    @property
    def message(self) -> str:
        """The reason of a failure, or of the verdict."""
        return self.failure or "; ".join(one["says"] for one in self.values["reasons"])

    @property
    def arms(self) -> dict[str, JointArms]:
        """Moment arms of the groups of fibres by coordinate."""
        return {name: JointArms(**fields) for name, fields in self.values.get("arms", {}).items()}


def solve(case: Case, folder: str, run: str, code: str, _after: object = None) -> tuple[str, str]:
    """Solve a case in a process of its own, and keep its outcome in a folder of parts.

    ``run`` names the run of the study: files are read anew in each. ``code`` is the digest of the package
    that started it. Returns the state, and the verdict or the reason of a failure.

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
    """Collect warnings in a list instead of showing them."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        yield caught


def solve_here(
    case: Case, store: Parts, run: str, caught: Collection[warnings.WarningMessage], stop: threading.Event
) -> tuple[str, str]:
    """Solve a case as :func:`solve` does; ``caught`` gathers warnings, ``stop`` ends it from outside."""
    key, state = "", FAILED
    try:
        if case.problem:
            raise InputError("", case.problem)
        scene, remarks = _scene_of(case, run)
        muscle = scene.muscles[case.muscle]
        numbers = frame_numbers(case.frames, len(scene.motion.times))
        unknown_to_keys = repr((case.groups, muscle.crosses))
        digest = digest_of([muscle_keys(scene, numbers)[case.muscle], unknown_to_keys])
        kept = store.read(case.name, digest)
        if kept is not None:
            return KEPT, kept.facts["verdict"]
        values = _solved(case, scene, numbers, stop)
        values["remarks"] = sorted({*remarks, *(str(one.message) for one in caught)})
        key, state = digest, DONE
    except ImportError:  # of an extra that the worker lacks: the same for all cases
        raise
    except Exception as error:  # of this case alone; it becomes a row of the table
        if stop.is_set():
            raise
        values = {"failure": _in_words(error)}
    try:
        store.write(case.name, key, Part.of(values))
    except OSError as error:
        raise UnwritableError(f"{error.filename or store.path(case.name)}: {error.strerror}") from error
    return state, values.get("failure") or values["verdict"]


def _solved(case: Case, scene: SceneData, numbers: range, stop: threading.Event) -> dict[str, Any]:
    """Run a scene, and return the values of the outcome of its muscle."""

    def check_stop(*_: object) -> None:
        if stop.is_set():
            raise AbortedError("the study was stopped")

    if case.variation.cause:  # a motion that was moved too far would be followed for hours
        with recorded():
            check_sense(scene)
    options = RunOptions(frames=numbers, workers=1, sense=False, progress=check_stop)
    return _values_of(run_scene(scene, None, options, errors=StatedErrors(scene)), case.muscle, case.groups)


def _values_of(result: Result, name: str, groups: int | None) -> dict[str, Any]:
    """Return the values that are kept of a muscle of a run; see :class:`Outcome`."""
    report, count = result.report["muscles"][name], result.finished(name)
    values: dict[str, Any] = {
        "verdict": report["verdict"]["verdict"],
        "reasons": report["verdict"]["reasons"],
        "frames": list(result.frames[:count]),
        "times": list(result.times[:count]),
        "complete": count == len(result.frames),
    }
    if name not in result.fibre_lengths:
        return values
    fibres, paths, errors = result.fibre_lengths[name], result.lengths.get(name), result.errors[name]
    labels = np.arange(fibres.shape[1])
    if groups is not None:
        labels = group_fibres(fibres if paths is None else paths, groups)

    def grouped(each: Floats) -> Floats:
        means = [each[..., labels == group].mean(axis=-1) for group in range(labels.max() + 1)]
        return np.stack(means, axis=-1)

    lines = polylines_of(result.plain().rest_fibres(name), "fibres")
    rest = polyline_lengths(lines.points, lines.offsets) * MILLIMETRES[result.units]
    values |= {
        "fibres": np.bincount(labels).tolist(),
        "rest": grouped(rest),
        "fibre_lengths": grouped(fibres),
    }
    values |= {"arms": {}, "arm_errors": {}}
    if paths is not None:
        values["lengths"] = grouped(paths)
        values["length_errors"] = grouped(total_of(errors.get("each_length"), paths))
    for one in _arms(result, name):
        arms, slopes = grouped(one.arms), grouped(one.slopes)
        off = total_of(errors.get(f"each_moment_arm_{one.coordinate}"), one.arms)
        values["arms"][one.coordinate] = replace(
            one, arms=arms, slopes=slopes, quartic=None, quartic_residuals=None
        )
        values["arm_errors"][one.coordinate] = grouped(off)
    return values


def _arms(result: Result, name: str) -> list[JointArms]:
    try:
        return list(result.moment_arms().get(name, {}).values())
    except InputError:  # the motion gives none
        return []


def _scene_of(case: Case, run: str) -> tuple[SceneData, Collection[str]]:
    """Return the varied scene of a case, with no muscles that the case does not need; warnings of reading."""
    if isinstance(case.scene, SceneData):
        return case.variation.of(_reduced(case.scene, case.muscle)), ()
    # The text keeps the order of muscles, which yield to those before them.
    scene, remarks = _read(json.dumps([asdict(case.scene), asdict(case.variation)]), run)
    return _reduced(scene, case.muscle), remarks


def _reduced(scene: _Scene, muscle: str) -> _Scene:
    """Return a scene of one muscle, after those before it if they may meet."""
    names = list(scene.muscles)
    before = names[: names.index(muscle) + 1] if scene.muscle_contact != "off" else [muscle]
    return replace(scene, muscles={name: scene.muscles[name] for name in before})


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
