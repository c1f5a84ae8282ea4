"""A run's folder, written: frames, tables and notes."""

import os
import re
import threading
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle import __version__
from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import add_arrays, blocks_of, shallow_copy
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.io import Series, writing
from vtkmuscle.run import store
from vtkmuscle.run.frames import STAMPS, MuscleTrack, WrittenFile
from vtkmuscle.run.store import FINISHED, PAGE, REPORT, SCENE, TRACK_FIELDS, MuscleNote, ResultFolder, RunNote
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.schema import checked_name

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result

#: Tables and pages of a run, beside those that are called after muscles; and its folders, likewise.
_LISTS = (
    *("lengths.csv", "fibre_lengths.csv", "architecture.csv", "poses.csv"),
    *("moment_arms.csv", "moment_arms_summary.csv", PAGE),
)
_FOLDERS = ("bones", "figures", FINISHED)


@contextmanager
def claimed(folder: Path, scene: SceneData, *, overwrite: bool) -> Iterator[None]:
    """Make a folder for the results of a scene, and hold it against concurrent runs.

    Half-written files of killed runs are removed; further files stay. With ``overwrite``, results of a
    different scene and files of no run may be replaced; inputs of the scene never are. OSError if the folder
    cannot be made or held, or content is in the way; ValueError if content would be lost.
    """
    if folder.is_symlink() and not folder.exists():
        raise FileNotFoundError(f"{folder} is a link to {os.readlink(folder)}, which does not exist")
    report = ResultFolder(folder).report()
    outputs = writing.Outputs(folder, inputs=scene.files, overwrite=True)  # files of no run are checked below
    for name, is_folder in _outputs([*scene.muscles, *_muscles_of(report)]).items():
        outputs.check(folder / name, is_folder=is_folder)
    folder.mkdir(parents=True, exist_ok=True)
    with writing.locked(folder):
        report = ResultFolder(folder).report()
        _tidy(folder, scene)
        if not overwrite:
            _check_results(folder, scene, report)
        try:
            yield
        finally:
            _tidy(folder, scene)


def _tidy(folder: Path, scene: SceneData) -> None:
    """Remove the half-written files of killed processes."""
    writing.remove_left_behind(folder)
    for name in (*_FOLDERS, *_series(scene.muscles)):
        writing.remove_left_behind(folder / name, deep=True)


def remove_results(folder: Path, scene: SceneData, kept: Collection[str] = ()) -> None:
    """Remove an earlier run, but for the muscles in ``kept``, from a claimed folder."""
    report = ResultFolder(folder).report() or {}
    notes, muscles = folder / FINISHED, {*scene.muscles, *_muscles_of(report)}
    gone = sorted(muscles - {*kept})
    bones = sorted({*scene.bones, *(note.stem for note in (notes / "bones").glob("*.vtp"))})
    folders = [*(folder / "bones" / name for name in bones), *map(folder.joinpath, _series(gone))]
    # Notes first: what is noted is there.
    files = [notes / f"{name}{end}" for name in (SCENE, *gone) for end in (".json", ".vtp", "_fibres.vtp")]
    files += [*(notes / "bones").glob("*.vtp"), *(folder / name for name in _LISTS)]
    files += [folder / f"{name}_fibres.csv" for name in muscles]
    # Lists before what they list: who is killed here leaves none of files that are gone.
    files += [inside.with_name(f"{inside.name}.pvd") for inside in (*folders, folder / "bones")]
    for inside in folders:
        frame = re.compile(re.escape(inside.name) + r"_\d{4,}\.vtp")
        files += [path for path in inside.glob("*.vtp") if frame.fullmatch(path.name)]
    files += [folder / "bones" / f"{name}.vtp" for name in bones]
    drawn = report.get("figures")
    names = drawn.get("written", ()) if isinstance(drawn, dict) else ()
    files += [folder / "figures" / Path(str(figure)).name for figure in names]
    for file in files:
        if file.is_symlink() or file.is_file():
            file.unlink()
    for inside in (*folders, folder / "bones"):
        if inside.is_dir() and not any(inside.iterdir()):
            inside.rmdir()


def scene_file(scene: SceneData) -> str | None:
    """Return the full path of a scene's file, None for a scene made in Python."""
    return str(scene.files[""].resolve()) if "" in scene.files else None


def digests(scene: SceneData) -> dict[str, str]:
    """Return the digests of a scene's source files by key."""
    return {key or "scene": writing.file_digest(path) for key, path in scene.files.items() if path.is_file()}


def _series(muscles: Iterable[str]) -> list[str]:
    """Return the names of the surfaces and fibres of muscles."""
    return [part for name in muscles for part in (name, f"{name}_fibres")]


def _outputs(muscles: Collection[str]) -> dict[str, bool]:
    """Return whether an output of a run is a folder, by the output's name."""
    series, tables = _series(muscles), [f"{name}_fibres.csv" for name in muscles]
    files = [REPORT, *_LISTS, *(f"{name}.pvd" for name in ("bones", *series)), *tables]
    return dict.fromkeys(files, False) | dict.fromkeys((*_FOLDERS, *series), True)


def _muscles_of(report: Mapping[str, Any] | None) -> Iterator[str]:
    """Give the muscles of an earlier run, without names that no run has."""
    for name in (report or {}).get("muscles", ()):
        with suppress(ValueError):
            yield checked_name(name)


def _check_results(folder: Path, scene: SceneData, report: Mapping[str, Any] | None) -> None:
    """Raise a ValueError where results of a different scene, or files of no run, would be lost."""
    if report is None:
        for path in map(folder.joinpath, _outputs(scene.muscles)):
            for file in filter(Path.is_file, (path, *path.rglob("*"))):
                writing.Outputs(folder).check(file)  # files of a command stay replaceable, as of run --only
        return
    before, now = report.get("scene_file"), scene_file(scene)
    if report.get("scene") != scene.name or (before and now and before != now):
        of = f" of {before}" if before else ""
        raise InputError(folder, f"the folder has results of the scene {report.get('scene')!r}{of}", _INSIST)
    left = [name for name in _muscles_of(report) if name not in scene.muscles]
    check_lost(folder, [name for name in left if ResultFolder(folder).note_file(name).is_file()])


#: What to do where results would be lost.
_INSIST = "give another folder with --out, or --overwrite (overwrite=True)"


def check_lost(file: Path, muscles: Sequence[str]) -> None:
    """Raise an InputError if a run would remove muscles."""
    if muscles:
        raise InputError(file, f"the run would remove the finished results of {', '.join(muscles)}", _INSIST)


#: Digits of the numbers in tables, and the tables that have all digits.
DIGITS, _EXACT = 10, ("lengths", "fibre_lengths", "poses")


class ResultWriter(ResultFolder):
    """The writer of results to a claimed folder.

    ``NAME.pvd`` and ``NAME_fibres.pvd`` per muscle with frames in folders of these names, ``bones.pvd`` with
    ``bones/``, tables, ``report.json`` and ``figures/``; and ``finished/`` with a note of each finished
    muscle and of the run, and the muscles and bones at rest.
    """

    def __init__(self, path: Path, scene: SceneData, numbers: range) -> None:
        super().__init__(path.absolute())
        self._times, self._numbers = scene.motion.times, numbers
        self._stamp = scene.name, scene.units, __version__
        self.keys = store.muscle_keys(scene, numbers)
        self._series: dict[str, Series] = {}

    def write_frame(
        self, muscle: str, number: int, surface: vtkPolyData | None, fibres: vtkPolyData | None
    ) -> tuple[WrittenFile | None, WrittenFile | None]:
        """Write the surface and the fibres of a frame of a muscle; return the files."""

        def written(name: str, data: vtkPolyData | None) -> WrittenFile | None:
            if data is None:
                return None
            series = self._series.setdefault(name, Series(self.path, name))
            path = series.add(number, float(self._times[number]), self._stamped(data))
            return WrittenFile.of(path, own=True)

        lines = written(f"{muscle}_fibres", fibres)
        return written(muscle, surface), lines

    def finish(self, name: str, track: MuscleTrack) -> None:
        """Note a finished muscle, with all frames written."""
        files = [frame.path for frames in (track.surfaces, track.fibres) for frame in frames.files]
        for series, rest in ((name, track.rest), (f"{name}_fibres", track.rest_fibres)):
            if rest is not None:
                files.append(self.path / FINISHED / f"{series}.vtp")
                writing.write_polydata(files[-1], rest)
            if series in self._series:
                files.append(self._series[series].path)
        own: dict[str, Any] = {"key": self.keys[name], "has_fibres": track.rest_fibres is not None}
        own |= {field: getattr(track, field) for field in TRACK_FIELDS}
        writing.write_json(self.note_file(name), MuscleNote(**own, files=self._sizes(files)).model_dump())

    def write_bones(self, scene: SceneData, stop: threading.Event) -> None:
        """Write the bones over time until ``stop``; a bone at rest throughout is written once."""
        folder, mover = self.path / "bones", BoneMotion(motion=scene.motion)
        mover.connect(0, scene.bones_data())
        collection = Series(self.path, "bones")
        still = {name: folder / f"{name}.vtp" for name in scene.bones if name not in scene.motion.transforms}
        for name, bone in scene.bones.items():
            writing.write_polydata(self.path / FINISHED / "bones" / f"{name}.vtp", bone)
            if name in still:
                writing.write_polydata(still[name], self._stamped(bone))
        for number in self._numbers:
            if stop.is_set():
                return
            time = float(scene.motion.times[number])
            parts = {}
            for name, bone in blocks_of(mover.update(time=time).output):
                parts[name] = still.get(name) or folder / name / f"{name}_{number:04d}.vtp"
                if name not in still:
                    writing.write_polydata(parts[name], self._stamped(bone))
            collection.add_parts(time, parts)

    def write_tables(self, result: "Result") -> None:
        """Write the tables of a result and of fibre measures. Tables of lengths have all digits."""
        tables = {name: table for name, table in result.tables().items() if len(next(iter(table.values())))}
        for name, table in {"fibre_lengths": result.fibre_length_table(), **tables}.items():
            table.to_csv(self.path / f"{name}.csv", digits=None if name in _EXACT else DIGITS)
        for name, table in result.fibre_tables():
            table.to_csv(self.path / f"{name}_fibres.csv", digits=DIGITS)

    def write_report(self, report: Mapping[str, Any]) -> None:
        """Write report.json."""
        writing.write_json(self.path / REPORT, report, indent=1, allow_nan=False)

    def complete(self, result: "Result", bones: Iterable[str]) -> None:
        """Write the last report, and the note of the run."""
        self.write_report(result.report)
        files = [self.path / REPORT, *(self.path / FINISHED / "bones" / f"{name}.vtp" for name in bones)]
        parts = {field: getattr(result, field) for field in store.RESULT_FIELDS}
        digest = writing.file_digest(files[0])
        note = RunNote.model_construct(report=digest, bones=list(bones), files=self._sizes(files), **parts)
        writing.write_json(self.note_file(SCENE), note.model_dump())

    def _sizes(self, files: Iterable[Path]) -> dict[str, int]:
        """Return the sizes of files by their paths in the folder."""
        return {file.relative_to(self.path).as_posix(): file.stat().st_size for file in files}

    def _stamped(self, data: vtkPolyData) -> vtkPolyData:
        """Return a shallow copy whose field data name the run."""
        return add_arrays(shallow_copy(data), fields=dict(zip(STAMPS, self._stamp, strict=True)))
