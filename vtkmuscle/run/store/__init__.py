"""A folder of results, read: its report, its notes of finished muscles, and the result in it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.io.parts import Part, Parts, file_digest
from vtkmuscle.io.surfaces import read_polydata
from vtkmuscle.io.temporal import TimeSeries, read_series
from vtkmuscle.run.frames import RUN_AGAIN, TIME, Frames, MuscleTrack, WrittenFile

#: The report of a run, and its page.
REPORT, PAGE = "report.json", "report.html"
#: The folder of notes, one of each finished muscle, and the name of that of the whole run.
FINISHED, SCENE = "finished", "scene"
#: What to do where a folder is another one.
_GIVE = "give the folder of a run's results, its --out"


class ResultFolder:
    """The folder of a run, finished or not, to be read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes = Parts(path / FINISHED)

    def report(self) -> dict[str, Any] | None:
        """Return the report, None where there is none or it is damaged."""
        try:
            check_is_file(self.path / REPORT)
            report = json.loads((self.path / REPORT).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return None
        good = isinstance(report, dict) and isinstance(report.get("muscles"), dict) and "complete" in report
        return report if good else None

    def series(self, name: str) -> TimeSeries | None:
        """Return a series of frames, None where there is none."""
        file = self.path / f"{name}.pvd"
        return read_series(file) if file.is_file() else None

    def frames_there(self) -> dict[str, int]:
        """Return how many frames of each muscle are listed, whatever the report says."""

        def count(name: str) -> int:
            try:
                series = self.series(name)
            except ValueError:  # damaged
                return 0
            return 0 if series is None else len(series.times)

        return {name: count(name) for name in (self.report() or {}).get("muscles", {})}

    def unfinished(self) -> str | None:
        """Return in words what a run that did not end has left; None where none is, or it ended."""
        report = self.report()
        if report is None or report["complete"]:
            return None
        frames = report.get("frames")
        total = f" of {len(frames)}" if isinstance(frames, list) else ""
        listed = ", ".join(f"{name} {count}{total}" for name, count in self.frames_there().items())
        why = report.get("stopped_by") or "it was killed"
        return f"holds a run that did not end ({why}); frames there: {listed or 'none'}"

    def result(self) -> dict[str, Any]:
        """Return the arguments of a :class:`~vtkmuscle.Result`; see :meth:`vtkmuscle.Result.load`."""
        report = self._finished_report()
        noted = self._note(SCENE).values
        notes = {name: self._note(name) for name in report["muscles"]}
        if "motion" not in noted or not all("length_errors" in note.arrays for note in notes.values()):
            raise InputError(
                self.notes.path(SCENE), "an earlier version of vtkmuscle has written it", RUN_AGAIN
            )
        bones = {name: self._at_rest(f"bones/{name}") for name in noted["bones"]}
        coordinates = {name: Coordinate(**one) for name, one in noted["motion"]["coordinates"].items()}

        tracks = {name: self._track(name, note) for name, note in notes.items()}
        for name, track in tracks.items():
            track.report = report["muscles"][name]
        return {
            "bones": multiblock_from(bones),
            "motion": RigidMotion(**noted["motion"] | {"coordinates": coordinates}),
            "tracks": tracks,
            "report": report,
            "literature": {
                name: tuple(LiteratureCurve(**curve) for curve in curves)
                for name, curves in noted["literature"].items()
            },
            "crosses": {name: tuple(one) for name, one in noted["crosses"].items()},
        }

    def finished(self, keys: Mapping[str, str]) -> dict[str, MuscleTrack]:
        """Return the muscles that are finished under these keys and whose files are whole."""
        tracks = {}
        for name, key in keys.items():
            note = self.notes.read(name, key)
            if note is not None:
                try:
                    self._check_files(note)
                    tracks[name] = self._track(name, note)
                except (ValueError, OSError):  # damaged: it is computed again
                    continue
        return tracks

    def digests(self, files: Iterable[Path]) -> dict[str, str]:
        """Return the digests of files by their paths in the folder."""
        return {file.relative_to(self.path).as_posix(): file_digest(file) for file in dict.fromkeys(files)}

    def _finished_report(self) -> dict[str, Any]:
        """Return the report of a run that has ended."""
        report, there = self.report(), (self.path / REPORT).exists()
        if not self.path.is_dir():
            what = "this is a file, not a folder" if self.path.exists() else "there is no such folder"
            raise InputError(self.path, what, _GIVE)
        if report is None:
            what = "its report.json is damaged" if there else "it holds no results of a run: no report.json"
            raise InputError(self.path, what, RUN_AGAIN if there else _GIVE)
        if not report["complete"]:
            raise InputError(self.path, f"it {self.unfinished()}", RUN_AGAIN)
        return report

    def _note(self, name: str) -> Part:
        """Return a note whose files are as they were written."""
        note = self.notes.read(name)
        if note is None:
            there = self.notes.path(name).exists()
            problem = "the file is damaged" if there else "the file is missing"
            raise InputError(self.notes.path(name), problem, RUN_AGAIN)
        self._check_files(note)
        return note

    def _check_files(self, note: Part) -> None:
        for file in self._files_of(note):
            file.check()

    def _files_of(self, note: Part, folder: str = "") -> list[WrittenFile]:
        """Return the files of a note, all of them or those in one folder."""
        files = note.facts["files"].items()
        return [
            WrittenFile((self.path / name).absolute(), digest)
            for name, digest in files
            if name.startswith(folder)
        ]

    def _track(self, name: str, note: Part) -> MuscleTrack:
        """Return a finished muscle from its note and its files."""
        return MuscleTrack(
            rest=self._at_rest(name),
            rest_fibres=self._at_rest(f"{name}_fibres") if note.facts["fibres"] else None,
            surfaces=Frames(self._files_of(note, f"{name}/")),
            fibres=Frames(self._files_of(note, f"{name}_fibres/")),
            lengths=list(note.arrays["lengths"]),
            fibre_lengths=list(note.arrays["fibre_lengths"]),
            length_errors=list(note.arrays["length_errors"]),
            fibre_length_errors=list(note.arrays["fibre_length_errors"]),
            report=dict(note.facts["report"]),
        )

    def _at_rest(self, name: str) -> vtkPolyData:
        data = read_polydata(self.path / FINISHED / f"{name}.vtp")
        data.GetFieldData().RemoveArray(TIME)
        return data
