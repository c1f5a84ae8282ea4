"""What a run writes to its folder: frames, tables and notes, each moved into place complete."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData

from vtkmuscle._version import __version__
from vtkmuscle.data.arrays import blocks_of, set_cell_array, set_field_array
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.io.parts import Part, plain
from vtkmuscle.io.temporal import Collection as Pvd
from vtkmuscle.io.temporal import Series, read_series, write_vtkhdf
from vtkmuscle.io.writing import write_polydata, write_text
from vtkmuscle.run.store import FINISHED, REPORT, SCENE, STAMPS, ResultFolder
from vtkmuscle.run.store.claim import remove_if_empty, remove_results
from vtkmuscle.run.store.keys import muscle_keys
from vtkmuscle.run.table import Table
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.scene.data import SceneData

#: Digits of the numbers in tables; the lengths have all of theirs.
_DIGITS = 10


class ResultWriter(ResultFolder):
    """The results of a run that is under way.

    ``NAME.pvd`` and ``NAME_fibres.pvd`` per muscle with their frames in folders of these names,
    ``bones.pvd`` with ``bones/``, tables, ``report.json`` and ``figures/``; and ``finished/`` with what
    :meth:`vtkmuscle.Result.load` and a later run need: a note of each finished muscle with its key and the
    digests of its files, the muscles and bones at rest, and a note of the whole run.

    Parameters
    ----------
    path : Path
        A claimed folder. Results of an earlier run are replaced, but for muscles that are finished and of the
        same key; other files are left alone.
    scene : SceneData
        What is run.
    numbers : range
        Of the frames that are kept.
    series : str
        ``"pvd"``, or ``"vtkhdf"``: each series is gathered in one file when it is finished; one that is
        not finished stays a .pvd.
    """

    def __init__(self, path: Path, scene: SceneData, numbers: range, series: str) -> None:
        super().__init__(path)
        self._scene, self._numbers = scene, numbers
        self._gather = series == "vtkhdf"
        self._keys = {name: f"{key} {series}" for name, key in muscle_keys(scene, numbers).items()}
        self._series: dict[str, Series] = {}

    def kept(self) -> dict[str, MuscleTrack]:
        """Return the muscles that an earlier run has finished, and that are the same now."""
        kept = self.finished(self._keys, self._scene.millimetres)
        if self._scene.muscle_contact != "off" and len(kept) < len(self._scene.muscles):
            return {}  # the others are kept out of these, and ask their filters for it
        return kept

    def begin(self, report: Mapping[str, Any], kept: Collection[str]) -> None:
        """Remove the results of an earlier run but for muscles that are ``kept``; write the report."""
        remove_results(self.path, self._scene, kept)
        self.write_report(report)

    def write_frame(
        self, muscle: str, number: int, surface: vtkPolyData | None, fibres: vtkPolyData | None
    ) -> None:
        """Write a frame of a muscle and of its fibres."""
        time = float(self._scene.motion.times[number])
        for name, data in ((f"{muscle}_fibres", fibres), (muscle, surface)):
            if data is not None:
                series = self._series.setdefault(name, Series(self.path, name))
                series.add(number, time, self._stamped(data))

    def finish(self, name: str, track: MuscleTrack) -> None:
        """Note that a muscle is finished: all its frames are written."""
        inside, files = self.path / FINISHED, list[Path]()
        for series in (name, f"{name}_fibres"):
            if series in self._series:
                files += self._gathered(series) if self._gather else self._series[series].files
        for ending, rest in (("", track.rest), ("_fibres", track.rest_fibres)):
            if rest is not None:
                files.append(inside / f"{name}{ending}.vtp")
                write_polydata(files[-1], rest)
        facts = {
            "report": track.report,
            "fibres": track.rest_fibres is not None,
            "files": self.digests(files),
        }
        self.notes.write(name, self._keys[name], Part(facts))

    def write_bones(self, stopped: Callable[[], bool]) -> None:
        """Write the bones over time, until it is stopped; those that stay where they are only once."""
        scene, folder = self._scene, self.path / "bones"
        mover = BoneMotion(motion=scene.motion)
        mover.connect(0, scene.bones_data())
        collection = Pvd(self.path / "bones.pvd")
        still = {name: folder / f"{name}.vtp" for name in scene.bones if name not in scene.motion.transforms}
        for name, bone in scene.bones.items():
            write_polydata(self.path / FINISHED / "bones" / f"{name}.vtp", bone)
            if name in still:
                write_polydata(still[name], self._stamped(bone))
        for number in self._numbers:
            if stopped():
                return
            time = float(scene.motion.times[number])
            parts = {}
            for name, bone in blocks_of(mover.update(time=time).output):
                parts[name] = still.get(name) or folder / name / f"{name}_{number:04d}.vtp"
                if name not in still:
                    write_polydata(parts[name], self._stamped(bone))
            collection.add(time, parts)
        if self._gather:
            self._gathered("bones")

    def write_table(self, name: str, table: Table, *, digits: int | None = _DIGITS) -> None:
        """Write a table by the name of its file; without ``digits`` as many as keep every bit."""
        table.to_csv(self.path / name, digits=digits)

    def write_report(self, report: Mapping[str, Any]) -> None:
        """Write report.json."""
        text = json.dumps(report, indent=1, allow_nan=False, default=plain)
        write_text(self.path / REPORT, text + "\n")

    def complete(self, report: Mapping[str, Any], tracks: Mapping[str, MuscleTrack]) -> None:
        """Write the last report, and note what a result needs beside its muscles.

        These are the motion, published curves, the errors of the muscles, and the digests of the report and
        of the bones at rest.
        """
        self.write_report(report)
        scene = self._scene
        bones = [self.path / FINISHED / "bones" / f"{name}.vtp" for name in scene.bones]
        muscles = scene.muscles.items()
        noted = {
            "bones": list(scene.bones),
            "motion": scene.motion,
            "literature": {name: muscle.literature for name, muscle in muscles},
            "crosses": {name: muscle.crosses for name, muscle in muscles if muscle.crosses is not None},
            "errors": {name: track.errors for name, track in tracks.items()},
            "files": self.digests([*bones, self.path / REPORT]),
        }
        self.notes.write(SCENE, "", Part.of(noted))

    def _gathered(self, name: str) -> list[Path]:
        """Turn a collection of files into one file, and return that."""
        collection = self.path / f"{name}.pvd"
        series, whole = read_series(collection), collection.with_suffix(".vtkhdf")
        write_vtkhdf(whole, series.times, lambda i: merged(series.frame(i)))
        for file in (collection, *series.files):
            file.unlink()
        for folder in sorted({file.parent for file in series.files} | {self.path / name}, reverse=True):
            remove_if_empty(folder)
        return [whole]

    def _stamped(self, data: vtkPolyData) -> vtkPolyData:
        """Return a shallow copy whose field data say what it is part of."""
        copy = vtkPolyData()
        copy.ShallowCopy(data)
        values = (self._scene.name, self._scene.units, __version__)
        for name, value in zip(STAMPS, values, strict=True):
            set_field_array(copy, name, value)
        return copy


def merged(data: Any) -> vtkPolyData:
    """Return the blocks of a data set as one, with the cell array ``Bone``: the number of the block."""
    if isinstance(data, vtkPolyData):
        return data
    append = vtkAppendPolyData()
    blocks = blocks_of(data)
    for number, (_, block) in enumerate(blocks):
        numbered = vtkPolyData()
        numbered.ShallowCopy(block)
        set_cell_array(numbered, "Bone", np.full(block.GetNumberOfCells(), number, dtype=np.int32))
        append.AddInputData(numbered)
    append.SetOutputPointsPrecision(vtkAppendPolyData.DOUBLE_PRECISION)
    append.Update()
    merged: vtkPolyData = append.GetOutput()
    for name in STAMPS:
        merged.GetFieldData().AddArray(blocks[0][1].GetFieldData().GetAbstractArray(name))
    set_field_array(merged, "BoneNames", ", ".join(name for name, _ in blocks))
    return merged
