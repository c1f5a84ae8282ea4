"""A finished run read back from its folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.surfaces import read_polydata
from vtkmuscle.io.writing import write_polydata
from vtkmuscle.run.claim import read_report
from vtkmuscle.run.finished import (
    AGAIN,
    FINISHED,
    check_files,
    digests_of,
    read_errors,
    read_note,
    read_track,
)
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.run.unfinished import unfinished
from vtkmuscle.scene.data import MILLIMETRES, SceneData

#: The part that says what was run; no muscle is called so.
SCENE = "scene"


def note_scene(folder: Path, scene: SceneData) -> None:
    """Note in a run's folder what its result needs of the scene: bones at rest, motion, published curves."""
    inside = folder / FINISHED
    bones = {name: inside / "bones" / f"{name}.vtp" for name in scene.bones}
    for name, file in bones.items():
        write_polydata(file, scene.bones[name])
    motion = scene.motion
    arrays: dict[str, NDArray[Any]] = {"times": motion.times}
    arrays |= {f"transforms{i}": table for i, table in enumerate(motion.transforms.values())}
    for i, one in enumerate(motion.coordinates.values()):
        arrays[f"coordinate{i}"] = one.values
        arrays |= {f"twists{i}.{k}": found for k, found in enumerate((one.twists or {}).values())}
    muscles = scene.muscles.items()
    facts = {
        "name": scene.name,
        "bones": list(scene.bones),
        "moving": list(motion.transforms),
        "centre": _plain_centre(motion.centre),
        "coordinates": {
            name: [one.unit, one.positive, None if one.twists is None else list(one.twists)]
            for name, one in motion.coordinates.items()
        },
        "literature": {name: [_curve(one) for one in muscle.literature] for name, muscle in muscles},
        "crosses": {name: list(one.crosses) for name, one in muscles if one.crosses is not None},
        "files": digests_of(folder, list(bones.values())),
    }
    Parts(inside).write(SCENE, "", Part(facts, arrays))


def read_result(folder: Path) -> dict[str, Any]:
    """Read what a :class:`~vtkmuscle.run.result.Result` is made of; see :meth:`vtkmuscle.Result.load`."""
    if not folder.is_dir():
        what = "this is a file, not a folder" if folder.exists() else "there is no such folder"
        raise InputError(folder, what, "give the folder of a run's results, its --out")
    report = read_report(folder)
    if report is None:
        there = (folder / "report.json").exists()
        what = "its report.json is damaged" if there else "it holds no results of a run: no report.json"
        raise InputError(folder, what, AGAIN if there else "give the folder of a run's results, its --out")
    if not report["complete"]:
        raise InputError(
            folder, (unfinished(folder) or "").removeprefix(f"{folder} ") or "the run did not end", AGAIN
        )
    parts = Parts(folder / FINISHED)
    noted = read_note(parts, SCENE)
    check_files(folder, noted.facts)
    inside = folder / FINISHED / "bones"
    bones = {name: read_polydata(inside / f"{name}.vtp") for name in noted.facts["bones"]}
    return {
        "name": noted.facts["name"],
        "units": report["units"],
        "bones": multiblock_from(bones),
        "motion": _motion(noted),
        "frames": report["frames"],
        "tracks": _Tracks({name: _reader(folder, parts, name, report) for name in report["muscles"]}),
        "report": report,
        "literature": {
            name: tuple(map(_curve_from, curves)) for name, curves in noted.facts["literature"].items()
        },
        "crosses": {name: tuple(one) for name, one in noted.facts["crosses"].items()},
    }


def _reader(folder: Path, parts: Parts, name: str, report: Mapping[str, Any]) -> Callable[[], MuscleTrack]:
    """Return what reads a muscle, once, from files that are there and whole."""
    note, errors = read_note(parts, name), read_errors(folder, name)
    check_files(folder, note.facts)

    @cache
    def read() -> MuscleTrack:
        track = read_track(folder, name, note, MILLIMETRES[report["units"]])
        track.report, track.errors = report["muscles"][name], errors
        return track

    return read


class _Tracks(Mapping[str, MuscleTrack]):
    """The muscles of a result, each read when it is first asked for."""

    def __init__(self, readers: Mapping[str, Callable[[], MuscleTrack]]) -> None:
        self._readers = readers

    def __getitem__(self, name: str) -> MuscleTrack:
        return self._readers[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)


def _motion(noted: Part) -> RigidMotion:
    facts, arrays = noted.facts, noted.arrays
    centre = facts["centre"]
    return RigidMotion(
        arrays["times"],
        {bone: arrays[f"transforms{i}"] for i, bone in enumerate(facts["moving"])},
        {bone: np.array(one) for bone, one in centre.items()} if isinstance(centre, dict) else centre,
        {
            name: Coordinate(
                arrays[f"coordinate{i}"],
                unit,
                positive,
                None if bones is None else {bone: arrays[f"twists{i}.{k}"] for k, bone in enumerate(bones)},
            )
            for i, (name, (unit, positive, bones)) in enumerate(facts["coordinates"].items())
        },
    )


def _plain_centre(centre: Any) -> Any:
    if isinstance(centre, Mapping):
        return {bone: np.asarray(one).tolist() for bone, one in centre.items()}
    return None if centre is None else np.asarray(centre).tolist()


def _curve(curve: LiteratureCurve) -> dict[str, Any]:
    return {name: np.asarray(value).tolist() for name, value in vars(curve).items()}


def _curve_from(facts: Mapping[str, Any]) -> LiteratureCurve:
    source, muscle, dof, part = (str(facts[name]) for name in ("source", "muscle", "dof", "part"))
    return LiteratureCurve(source, muscle, dof, part, np.array(facts["angles"]), np.array(facts["arms"]))
