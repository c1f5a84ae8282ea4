"""The folder that a run writes: series of frames, tables and figures, each moved into place complete."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from collections.abc import Collection as Collection_
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle._version import __version__
from vtkmuscle.data.arrays import blocks_of, set_field_array
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.io.parts import plain
from vtkmuscle.io.series import Collection, Series
from vtkmuscle.io.temporal import read_series, write_vtkhdf
from vtkmuscle.io.writing import write_polydata, write_text
from vtkmuscle.run.architecture import architecture_table
from vtkmuscle.run.claim import remove_results
from vtkmuscle.run.finished import STAMPS, finished_muscles, note_errors, note_finished
from vtkmuscle.run.lengths import length_table
from vtkmuscle.run.loading import note_scene
from vtkmuscle.run.poses import merged
from vtkmuscle.run.report import fibre_table

if TYPE_CHECKING:
    from vtkmuscle.run.moment_arms import MomentArmTable
    from vtkmuscle.run.track import MuscleTrack
    from vtkmuscle.scene.data import SceneData


#: Digits of the numbers in tables; the lengths have all of theirs.
DIGITS = 10


class RunFolder:
    """What a run writes, and where.

    ``NAME.pvd`` and ``NAME_fibres.pvd`` per muscle with their frames in folders of these names,
    ``bones.pvd`` with ``bones/``, ``lengths.csv`` of the paths, ``fibre_lengths.csv``, ``architecture.csv``,
    ``NAME_fibres.csv`` with all measures, ``moment_arms.csv`` with ``moment_arms_summary.csv`` where the
    motion has a coordinate, ``report.json`` and ``figures/``; and ``finished/`` with what
    :meth:`vtkmuscle.Result.load` and a later run need: a note of each finished muscle with its key, the
    muscles and bones at rest, and the motion.

    Parameters
    ----------
    path : Path
        Made where it does not exist. Results of an earlier run are replaced, but for muscles that
        are finished and of the same key; other files are left alone.
    series : str, optional
        ``"pvd"``, or ``"vtkhdf"``: each series is gathered in one file when it is finished; one that is
        not finished stays a .pvd.

    Raises
    ------
    OSError
        If it cannot be made, or is a file.
    """

    def __init__(self, path: Path, *, series: str = "pvd") -> None:
        if path.exists() and not path.is_dir():
            raise NotADirectoryError(f"{path} is a file; give another folder for the results")
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._gather = series == "vtkhdf"
        self._series: dict[str, Series] = {}
        self._keys: dict[str, str] = {}

    def finished(self, keys: Mapping[str, str], millimetres: float) -> dict[str, MuscleTrack]:
        """Return the muscles that an earlier run has finished, by their keys."""
        return finished_muscles(self.path, self._with_format(keys), millimetres)

    def begin(
        self, report: dict[str, Any], scene: SceneData, keys: Mapping[str, str], kept: Collection_[str] = ()
    ) -> None:
        """Write a report that says that the run is not finished, and remove the results of an earlier run.

        Muscles are finished under these keys; files of those that are ``kept`` stay.
        """
        self._keys = self._with_format(keys)
        remove_results(self.path, scene, kept)
        self.write_report(report)
        note_scene(self.path, scene)

    def _with_format(self, keys: Mapping[str, str]) -> dict[str, str]:
        return {name: f"{key} {'vtkhdf' if self._gather else 'pvd'}" for name, key in keys.items()}

    def write_frame(
        self,
        scene: SceneData,
        muscle: str,
        number: int,
        time: float,
        surface: vtkPolyData | None,
        fibres: vtkPolyData | None,
    ) -> None:
        """Write a frame of a muscle and of its fibres."""
        parts = {f"{muscle}_fibres": fibres, muscle: surface}
        for name, data in parts.items():
            if data is not None:
                self._series.setdefault(name, Series(self.path, name)).add(
                    number, time, _stamped(data, scene)
                )

    def finish(self, muscle: str, track: MuscleTrack) -> None:
        """Note that a muscle is finished: all its frames are written."""
        for name in (muscle, f"{muscle}_fibres"):
            if self._gather and name in self._series:
                self._gathered(name)
        note_finished(self.path, muscle, self._keys[muscle], track)

    def _gathered(self, name: str) -> None:
        """Turn a collection of files into one file."""
        collection = self.path / f"{name}.pvd"
        series = read_series(collection)
        write_vtkhdf(collection.with_suffix(".vtkhdf"), series.times, lambda i: merged(series.frame(i)))
        collection.unlink()
        for file in series.files:
            file.unlink()
        for folder in sorted({file.parent for file in series.files} | {self.path / name}, reverse=True):
            if not any(folder.iterdir()):
                folder.rmdir()

    def write_bones(self, scene: SceneData, numbers: range, stopped: Callable[[], bool]) -> None:
        """Write the bones over time, until it is stopped; those that stay where they are only once."""
        mover = BoneMotion(motion=scene.motion)
        mover.connect(0, scene.bones_data())
        collection = Collection(self.path / "bones.pvd")
        folder = self.path / "bones"
        still = {}
        for name, bone in scene.bones.items():
            if name not in scene.motion.transforms:
                still[name] = folder / f"{name}.vtp"
                write_polydata(still[name], _stamped(bone, scene))
        for number in numbers:
            if stopped():
                return
            time = float(scene.motion.times[number])
            parts = {}
            for name, bone in blocks_of(mover.update(time=time).output):
                parts[name] = still.get(name) or folder / name / f"{name}_{number:04d}.vtp"
                if name not in still:
                    write_polydata(parts[name], _stamped(bone, scene))
            collection.add(time, parts)
        if self._gather:
            self._gathered("bones")

    def write_tables(
        self, report: dict[str, Any], scene: SceneData, numbers: range, tracks: dict[str, MuscleTrack]
    ) -> None:
        """Write report.json, tables of lengths, architecture and fibres, as far as there are frames."""
        times = [float(scene.motion.times[number]) for number in numbers]
        errors = {name: track.errors for name, track in tracks.items()}
        paths = {name: np.array(track.lengths) for name, track in tracks.items() if track.lengths}
        fibres = {name: np.array(one.fibre_lengths) for name, one in tracks.items() if one.fibre_lengths}
        for file, lengths, quantity in (
            ("lengths.csv", paths, "each_length"),
            ("fibre_lengths.csv", fibres, "each_fibre_length"),
        ):
            length_table(lengths, errors, quantity, numbers, times).write(self.path / file)
        if any("architecture" in muscle for muscle in report["muscles"].values()):
            architecture_table(report["muscles"]).write(self.path / "architecture.csv", digits=DIGITS)
        for name, track in tracks.items():
            if track.fibres:
                table = fibre_table(track.fibres, times[: len(track.fibres)], scene.millimetres)
                table.write(self.path / f"{name}_fibres.csv", digits=DIGITS)
        self.write_report(report)

    def write_moment_arms(self, arms: MomentArmTable, tracks: Mapping[str, MuscleTrack]) -> None:
        """Write moment_arms.csv and moment_arms_summary.csv, where there are any; note their errors."""
        note_errors(self.path, tracks)
        if arms:
            arms.table().write(self.path / "moment_arms.csv", digits=DIGITS)
            arms.summary().write(self.path / "moment_arms_summary.csv", digits=DIGITS)

    def write_report(self, report: dict[str, Any]) -> None:
        """Write report.json."""
        text = json.dumps(report, indent=1, allow_nan=False, default=plain)
        write_text(self.path / "report.json", text + "\n")


def _stamped(data: vtkPolyData, scene: SceneData) -> vtkPolyData:
    """Return a shallow copy whose field data say what it is part of."""
    copy = vtkPolyData()
    copy.ShallowCopy(data)
    for name, value in zip(STAMPS, (scene.name, scene.units, __version__), strict=True):
        set_field_array(copy, name, value)
    return copy
