"""The finished muscles of a run's folder: noted with their keys and files, and read back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import points_of
from vtkmuscle.io.parts import Part, Parts, file_digest
from vtkmuscle.io.surfaces import read_polydata
from vtkmuscle.io.writing import write_polydata
from vtkmuscle.run.poses import series_of
from vtkmuscle.run.track import MuscleTrack

#: The folder of notes in that of a run.
FINISHED = "finished"
#: The one in it of what is known of errors.
ERRORS = "errors"
#: Field arrays that say what a file is part of.
STAMPS = ("Scene", "Units", "Version")
#: Field array that VTK's writer adds to data that a pipeline made for a time.
_TIME = "TimeValue"

#: What to do where files are missing or damaged.
AGAIN = "run the scene again: what is whole is kept"


def note_finished(folder: Path, name: str, key: str, track: MuscleTrack) -> None:
    """Note that all files of a muscle are written, with the digest of each, and what it is at rest."""
    inside = folder / FINISHED
    files = []
    for series in (name, f"{name}_fibres"):
        found = series_of(folder, series)
        if found is not None:
            files += [*found.files, folder / f"{series}.pvd"]
    for ending, rest in (("", track.rest), ("_fibres", track.rest_fibres)):
        if rest is not None:
            files.append(inside / f"{name}{ending}.vtp")
            write_polydata(files[-1], rest)
    facts = {
        "report": track.report,
        "fibres": track.rest_fibres is not None,
        "files": digests_of(folder, files),
    }
    Parts(inside).write(name, key, Part(facts))


def note_errors(folder: Path, tracks: Mapping[str, MuscleTrack]) -> None:
    """Note what is known of the errors of all muscles, once all are finished."""
    parts = Parts(folder / FINISHED / ERRORS)
    for name, track in tracks.items():
        arrays: dict[str, Any] = {}
        for number, one in enumerate(track.errors.values()):
            arrays |= {f"{number}": one.value}
            arrays |= {f"{number}.{i}": part for i, part in enumerate(one.parts.values())}
        known = {what: [one.unit, list(one.parts)] for what, one in track.errors.items()}
        parts.write(name, "", Part({"errors": known}, arrays))


def read_errors(folder: Path, name: str) -> dict[str, Estimate]:
    """Return what is known of the errors of a muscle.

    Raises
    ------
    ValueError
        If the note is missing or damaged.
    """
    parts = Parts(folder / FINISHED / ERRORS)
    noted = read_note(parts, name)
    return {
        what: Estimate(
            noted.arrays[f"{number}"],
            unit,
            {cause: noted.arrays[f"{number}.{i}"] for i, cause in enumerate(causes)},
        )
        for number, (what, (unit, causes)) in enumerate(noted.facts["errors"].items())
    }


def read_note(parts: Parts, name: str) -> Part:
    """Return a note; raise an InputError where it is missing or damaged."""
    part = parts.read(name)
    if part is None:
        there = parts.path(name).exists()
        raise InputError(parts.path(name), "the file is damaged" if there else "the file is missing", AGAIN)
    return part


def digests_of(folder: Path, files: list[Path]) -> dict[str, str]:
    """Return the digests of files by their paths in a folder; those that are not there are left out."""
    there = dict.fromkeys(file for file in files if file.is_file())
    return {file.relative_to(folder).as_posix(): file_digest(file) for file in there}


def finished_muscles(folder: Path, keys: Mapping[str, str], millimetres: float) -> dict[str, MuscleTrack]:
    """Return the muscles that are finished in a folder, of these keys, and as they were written."""
    tracks = {}
    for name, key in keys.items():
        part = Parts(folder / FINISHED).read(name, key)
        if part is not None:
            try:
                tracks[name] = read_track(folder, name, part, millimetres)
            except (ValueError, OSError):  # damaged: it is computed again
                continue
    return tracks


def read_track(folder: Path, name: str, part: Part, millimetres: float) -> MuscleTrack:
    """Return a finished muscle from its files.

    Raises
    ------
    ValueError
        If a file is not what the run has written.
    OSError
        If one is missing, or cannot be read.
    """
    check_files(folder, part.facts)
    inside = folder / FINISHED
    track = MuscleTrack(rest=_rest(inside / f"{name}.vtp"), report=dict(part.facts["report"]))
    count = len(track.report["frames"])
    track.points = [points_of(frame) for frame in _frames(folder, name)]
    if part.facts["fibres"]:
        track.rest_fibres = _rest(inside / f"{name}_fibres.vtp")
        for fibres in _frames(folder, f"{name}_fibres"):
            track.keep(fibres, millimetres)
    if any(len(one) not in (0, count) for one in (track.points, track.fibres)):
        raise InputError(folder, f"it has not all frames of {name!r}", AGAIN)
    return track


def check_files(folder: Path, facts: Mapping[str, Any]) -> None:
    """Raise an error where a file of finished work is missing, or is not what was written."""
    for name, digest in facts["files"].items():
        if not (folder / name).is_file():
            raise InputError(folder / name, "the file is missing", AGAIN)
        if file_digest(folder / name) != digest:
            raise InputError(folder / name, "the file is not what the run has written", AGAIN)


def _rest(path: Path) -> vtkPolyData:
    data = read_polydata(path)
    data.GetFieldData().RemoveArray(_TIME)
    return data


def _frames(folder: Path, name: str) -> list[vtkPolyData]:
    series = series_of(folder, name)
    frames = [] if series is None else [series.frame(number) for number in range(len(series.times))]
    for frame in frames:
        for stamp in (*STAMPS, _TIME):
            frame.GetFieldData().RemoveArray(stamp)
    return frames
