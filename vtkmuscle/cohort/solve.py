"""What a worker does: one muscle of one subject in one motion, unless it is done already."""

from __future__ import annotations

import json
import warnings
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.cohort.pictures import strip
from vtkmuscle.cohort.study import Task
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.groups import group_fibres
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.io.parts import Part, Parts, file_digest
from vtkmuscle.run.options import RunOptions, frame_numbers
from vtkmuscle.run.result import Result
from vtkmuscle.run.scenes import run_scene
from vtkmuscle.run.store.keys import code_digest, digest_of, muscle_keys
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.reading import read_fields
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.scenes import Scene
from vtkmuscle.sensitivity import varied

#: What becomes of a task: it was done before, it is done now, or it cannot be.
KEPT, DONE, FAILED = "kept", "done", "failed"
#: Scenes that a worker keeps: that of the muscles of a subject, which come one after the other.
_SCENES = 2


class UnwritableError(OSError):
    """What a worker has done cannot be kept: this ends a study, where a subject's failure does not."""


def solve(task: Task, parts: str, code: str, after: object = None) -> tuple[str, str]:
    """Do a task, and keep what came out as a part.

    Parameters
    ----------
    task : Task
        What is to be done.
    parts : str
        Folder of the parts.
    code : str
        Digest of the package that started the study.
    after : object, optional
        Not looked at: Dask runs this task after the one that gives it, where that one ran.

    Returns
    -------
    (str, str)
        ``"kept"``, ``"done"`` or ``"failed"``; and the verdict, or why it failed.

    Raises
    ------
    UnwritableError
        If the part cannot be written, or this worker's package is not the one that started the study.
    """
    if code != code_digest():
        raise UnwritableError(
            "a worker has another version of vtkmuscle, or of what it computes with, than this process; "
            "install the same in both"
        )
    store = Parts(Path(parts))
    try:
        part, state, key = _part(task, store)
    except (ImportError, UnwritableError):
        raise
    except Exception as error:  # of this subject alone; it becomes a row of the table
        part, state, key = Part({"failure": _in_words(error)}), FAILED, ""
    if state != KEPT:
        _write(store, task.name, key, part)
    return state, str(part.facts.get("failure") or part.facts["verdict"])


def _part(task: Task, store: Parts) -> tuple[Part, str, str]:
    """Return the part of a task, what has become of it, and its key."""
    if task.problem:
        raise InputError("", task.problem)
    found = store.read(task.name)
    if found is not None and "inputs" in found.facts and found.facts["inputs"] == _inputs(task, found.facts):
        return found, KEPT, ""
    loaded = _scene_of(task)
    crosses = loaded.scene.muscles[task.muscle].crosses  # a part has moment arms as well
    key = f"{loaded.keys[task.muscle]} {task.groups} {task.pictures} {crosses}"
    found = store.read(task.name, key)
    state = KEPT if found is not None else DONE
    if found is None:
        found = _solved(task, loaded)
    inputs = {"files": loaded.files, "inputs": _inputs(task, {"files": loaded.files})}
    part = Part({**found.facts, **inputs}, found.arrays)
    if state == KEPT:  # other files, the same content: next time nothing is read
        _write(store, task.name, key, part)
    return part, state, key


def _write(store: Parts, name: str, key: str, part: Part) -> None:
    try:
        store.write(name, key, part)
    except OSError as error:
        raise UnwritableError(f"{error.filename or store.path(name)}: {error.strerror}") from error


@dataclass(frozen=True, eq=False)
class _TaskScene:
    """A scene, what was warned of, the keys of its muscles, and the digests of its files."""

    scene: Scene
    remarks: list[str]
    keys: dict[str, str]
    files: dict[str, str]


def _scene_of(task: Task) -> _TaskScene:
    """Return the scene of a task: the one in memory, unless a file of it has changed since."""
    text = json.dumps(asdict(task) | {"muscle": ""})  # in order: muscles yield to those before
    found = _scene(text)
    if any(_digest(Path(name)) != digest for name, digest in found.files.items()):
        _scene.cache_clear()
        found = _scene(text)
    return found


@lru_cache(maxsize=_SCENES)
def _scene(text: str) -> _TaskScene:
    """Return the scene of a task, which is given as JSON without its muscle's name."""
    task = Task(**json.loads(text))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        scene = Scene(**read_fields(Path(task.scene_file), task.values))
        files = {str(file.absolute()): _digest(file.absolute()) for file in scene.files.values()}
        if task.sample:
            cause = task.sample.partition(" ")[0]
            scene = varied(scene, cause, task.amount, sample=task.sample, seed=task.seed)
        else:
            check_sense(scene)
    numbers = frame_numbers(task.frames, len(scene.motion.times))
    keys = muscle_keys(scene, numbers)
    return _TaskScene(scene, sorted({str(one.message) for one in caught}), keys, files)


def _inputs(task: Task, facts: Any) -> str:
    """Return a digest of what a task is made from: its texts and numbers, and the files that it read."""
    files = {name: _digest(Path(name)) for name in facts["files"]}
    return digest_of([code_digest(), json.dumps(asdict(task), sort_keys=True), files])


def _digest(path: Path) -> str:
    try:
        stamp = path.stat()
        return _digest_of(str(path), stamp.st_mtime_ns, stamp.st_size, stamp.st_ino)
    except OSError:
        return ""


@lru_cache(maxsize=4096)
def _digest_of(path: str, *_stamp: int) -> str:
    return file_digest(Path(path))


def _solved(task: Task, loaded: _TaskScene) -> Part:
    """Run one muscle, and return its lengths and moment arms."""
    scene = loaded.scene
    # Where muscles may meet, this one needs those before it.
    names = list(scene.muscles)
    before = names[: names.index(task.muscle) + 1] if scene.muscle_contact != "off" else [task.muscle]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        options = RunOptions(frames=task.frames, workers=1, sense=False)
        result = run_scene(scene.with_muscles(*before), None, options)
    report = result.report["muscles"][task.muscle]
    arrays, facts = _measured(result, task.muscle, task.groups)
    if task.pictures:
        arrays["picture"] = np.frombuffer(strip(result, task.muscle), dtype=np.uint8)
    facts |= {
        "verdict": report["verdict"]["verdict"],
        "reasons": report["verdict"]["reasons"],
        "remarks": sorted({*loaded.remarks, *(str(one.message) for one in caught)}),
        "volume_mm3": report["volume_mm3"],
        "seconds": sum(report["seconds"].values()),
    }
    return Part(facts, arrays)


def _measured(result: Result, name: str, groups: int) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return lengths and moment arms of a muscle's groups of fibres, as arrays and facts of a part."""
    count = result.finished(name)
    arrays: dict[str, NDArray[Any]] = {
        "frames": np.array(result.frames[:count], dtype=np.int64),
        "times": np.array(result.times[:count], dtype=np.float64),
    }
    lengths = result.lengths.get(name)
    if lengths is None:
        return arrays, {"fibres": [], "coordinates": []}
    labels = group_fibres(lengths, groups)
    present = range(int(labels.max()) + 1)
    grouped, of_fibres = (
        np.column_stack([one[:, labels == group].mean(axis=1) for group in present])
        for one in (lengths, result.fibre_lengths[name])
    )
    arrays["lengths"], arrays["fibre_lengths"] = grouped, of_fibres
    wrenches = {
        bone: np.stack([one[:, labels == group].mean(axis=1) for group in present], axis=1)
        for bone, one in result.wrenches(name).items()
    }
    facts: dict[str, Any] = {"fibres": [int((labels == group).sum()) for group in present]}
    arms: dict[str, Any] = {}
    if result.motion.coordinates and count == len(result.frames):
        try:
            arms, refused = joint_arms(
                grouped,
                wrenches,
                result.motion.part(result.frames),
                crossed=result.crosses.get(name),
                millimetres=MILLIMETRES[result.units],
            )
            facts["refused"] = dict(refused)
        except InputError as error:
            facts["refused"] = {"": str(error)}
    facts["coordinates"] = [[one.coordinate, one.unit, one.positive] for one in arms.values()]
    for number, one in enumerate(arms.values()):
        arrays |= {
            f"rows{number}": np.asarray(one.frames, dtype=np.int64),
            f"values{number}": one.values,
            f"arms{number}": one.arms,
            f"slopes{number}": one.slopes,
        }
    return arrays, facts


def _in_words(error: Exception) -> str:
    """Return an error in one line."""
    if isinstance(error, MemoryError):
        return "there is not enough memory for this"
    words = " ".join(str(error).split())
    known = isinstance(error, ValueError | OSError)
    return words if known and words else f"{type(error).__name__}: {words}".rstrip(": ")
