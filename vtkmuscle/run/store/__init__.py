"""Folders of results, read. The report, a note per finished muscle, and the note of the finished run."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, PlainSerializer, PlainValidator, ValidationError
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import multiblock_from, points_of
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.io.surfaces import read_polydata, steps_in
from vtkmuscle.io.writing import file_digest, record_in
from vtkmuscle.run.frames import RUN_AGAIN, TIME, Frames, MuscleTrack, WrittenFile
from vtkmuscle.run.report_values import version_of
from vtkmuscle.scene.data import Muscle, SceneData

#: Number of the schema of notes and report. It grows by 1 with each change of a class below, or of a key of
#: the report, so that no other schema is read.
FORMAT = 7


def _array(value: Any) -> Floats:
    if value is None:
        raise ValueError("this is no array")
    return np.array(value, dtype=np.float64)


def _inside(name: str) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError("this file is outside of the folder of results")
    return name


def _arrays(values: Any) -> Any:
    if isinstance(values, dict):
        return {name: _arrays(value) for name, value in values.items()}
    return _array(values) if isinstance(values, list) else values


def _motion(fields: Any) -> RigidMotion:
    own = {name: Coordinate(**_arrays(kept)) for name, kept in fields["coordinates"].items()}
    return RigidMotion(**_arrays(fields | {"coordinates": {}}) | {"coordinates": own})


def _curve(fields: Any) -> LiteratureCurve:
    return LiteratureCurve(**_arrays(fields))


Array = Annotated[Any, PlainValidator(_array), PlainSerializer(lambda array: np.asarray(array).tolist())]
#: Sizes of files [bytes] by their paths in the folder.
Sizes = dict[Annotated[str, AfterValidator(_inside)], int]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", defer_build=True, from_attributes=True)


class MuscleNote(_Table):
    """A finished muscle's note: digest of the input, part of the report, lengths per frame, files."""

    format: int = FORMAT
    key: str
    report: dict[str, Any]
    has_fibres: bool
    lengths: list[Array]
    fibre_lengths: list[Array]
    rest_lengths: Array
    segment_errors: list[float]
    bows: list[dict[str, float]]
    files: Sizes


#: Fields that the note of a muscle has of its track, and the note of a run of its result.
TRACK_FIELDS = ("report", "lengths", "fibre_lengths", "rest_lengths", "segment_errors", "bows")
RESULT_FIELDS = ("motion", "literature", "crosses")


class RunNote(_Table):
    """The note of a finished run. The digest of the report, and the parts of a result other than muscles."""

    format: int = FORMAT
    report: str
    bones: list[str]
    motion: Annotated[Any, PlainValidator(_motion)]
    literature: dict[str, tuple[Annotated[Any, PlainValidator(_curve)], ...]]
    crosses: dict[str, tuple[str, ...]]
    files: Sizes


Note = TypeVar("Note", MuscleNote, RunNote)
#: Errors of a schema, and of values that it makes objects of.
_DAMAGED = (ValidationError, TypeError, KeyError)


def read_note(path: Path, kind: type[Note]) -> Note:
    """Return the note in a file; InputError if missing, damaged, or of a different version."""
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(values, dict):
            _check_format(path, values)
        return kind.model_validate(values)
    except FileNotFoundError:
        raise InputError(path, "the file is missing", RUN_AGAIN) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError, *_DAMAGED) as error:
        raise InputError(path, "the file is damaged", RUN_AGAIN) from error


def _check_format(path: Path, values: Mapping[str, Any]) -> None:
    """Raise an InputError for the note or report of another version."""
    if values.get("format") != FORMAT:
        problem = f"the file is of another version of vtkmuscle (format {values.get('format')}, not {FORMAT})"
        raise InputError(path, problem, "run the scene again: all muscles are computed anew")


#: The report of a run, and its page.
REPORT: str = "report.json"
PAGE: str = "report.html"
#: The folder of notes, one of each finished muscle, and the name of the note of the whole run.
FINISHED: str = "finished"
SCENE: str = "scene"
#: What to do where a folder is another one.
_GIVE = "give the folder of a run's results, its --out"


class ResultFolder:
    """The folder of a run to read, finished or not."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def note_file(self, name: str) -> Path:
        """Return the note file of a muscle or run."""
        return self.path / FINISHED / f"{name}.json"

    def report(self) -> dict[str, Any] | None:
        """Return the report, None if missing or damaged."""
        report = record_in(self.path / REPORT)
        return report if isinstance(report.get("muscles"), dict) and "complete" in report else None

    def frames_there(self) -> dict[str, int]:
        """Return the number of listed frames per muscle. The lists of frames count, not the report."""
        counts = dict.fromkeys((self.report() or {}).get("muscles", {}), 0)
        for name in counts:
            with suppress(ValueError, FileNotFoundError):  # damaged, or not begun
                counts[name] = steps_in(self.path / f"{name}.pvd")
        return counts

    def unfinished(self) -> str | None:
        """Return the remains of an unfinished run in words. None for a finished run or without a run."""
        report = self.report()
        if report is None or report["complete"]:
            return None
        frames = report.get("frames")
        total = f" of {len(frames)}" if isinstance(frames, list) else ""
        listed = ", ".join(f"{name} {count}{total}" for name, count in self.frames_there().items())
        why = report.get("stopped_by") or "it was killed"
        return f"contains an unfinished run ({why}); finished frames: {listed or 'none'}"

    def result(self) -> dict[str, Any]:
        """Return the arguments of a :class:`~vtkmuscle.Result`. See :meth:`vtkmuscle.Result.load`."""
        report = self._finished_report()
        noted = read_note(self.note_file(SCENE), RunNote)
        self._check_sizes(noted.files)
        if file_digest(self.path / REPORT) != noted.report:
            raise InputError(self.path / REPORT, "the file is not what the run has written", RUN_AGAIN)
        tracks = {}
        for name in report["muscles"]:
            tracks[name] = self._track(name, read_note(self.note_file(name), MuscleNote))
            tracks[name].report = report["muscles"][name]
        bones = multiblock_from({name: self._at_rest(f"bones/{name}") for name in noted.bones})
        own = {field: getattr(noted, field) for field in RESULT_FIELDS}
        return {"bones": bones, "tracks": tracks, "report": report, **own}

    def finished(self, keys: Mapping[str, str]) -> dict[str, MuscleTrack]:
        """Return the finished muscles with these keys. All files of the muscles are present."""
        tracks = {}
        for name, key in keys.items():
            with suppress(ValueError, OSError):  # it is computed again
                note = read_note(self.note_file(name), MuscleNote)
                if note.key == key:
                    tracks[name] = self._track(name, note)
        return tracks

    def _finished_report(self) -> dict[str, Any]:
        """Return the report of a finished run."""
        report, there = self.report(), (self.path / REPORT).exists()
        if not self.path.is_dir():
            what = "this is a file, not a folder" if self.path.exists() else "there is no such folder"
            raise InputError(self.path, what, _GIVE)
        if report is None:
            what = "report.json is damaged" if there else "the folder has no results of a run (report.json)"
            raise InputError(self.path, what, RUN_AGAIN if there else _GIVE)
        _check_format(self.path / REPORT, report)
        if not report["complete"]:
            raise InputError(self.path, f"the folder {self.unfinished()}", RUN_AGAIN)
        return report

    def _check_sizes(self, files: Sizes) -> None:
        """Raise an InputError for missing or resized files. The files and sizes are from a note."""
        for name, size in files.items():
            if not (self.path / name).is_file():
                raise InputError(self.path / name, "the file is missing", RUN_AGAIN)
            if (self.path / name).stat().st_size != size:
                raise InputError(self.path / name, "the file is not what the run has written", RUN_AGAIN)

    def _track(self, name: str, note: MuscleNote) -> MuscleTrack:
        """Return a finished muscle from note and files."""
        self._check_sizes(note.files)

        def frames(folder: str) -> Frames:
            inside = (file for file in note.files if file.startswith(f"{folder}/"))
            return Frames(WrittenFile.of(self.path / file, own=False) for file in inside)

        rest, lines = self._at_rest(name), f"{name}_fibres"
        rest_fibres = self._at_rest(lines) if note.has_fibres else None
        own: dict[str, Any] = {field: getattr(note, field) for field in TRACK_FIELDS}
        return MuscleTrack(rest, rest_fibres, frames(name), frames(lines), **own)

    def _at_rest(self, name: str) -> vtkPolyData:
        data = read_polydata(self.path / FINISHED / f"{name}.vtp")
        data.GetFieldData().RemoveArray(TIME)
        return data


#: Parts of the package that only start runs or show results.
_SHOWING = ("cli", "paraview", "plotting", "report/")
#: Fields that no frame of a muscle depends on: the content of files counts, guesses are judged anew in every
#: run, and published curves are drawn beside a finished run's. All other fields count.
IRRELEVANT = ("SceneData.files", "SceneData.guessed", "Muscle.literature")
#: Packages that have a part in the numbers.
_PACKAGES = ("numpy", "scipy", "numba", "vtk")


def muscle_keys(scene: SceneData, numbers: range) -> dict[str, str]:
    """Return the key of each muscle of a scene."""
    shared = _relevant(scene, SceneData)
    del shared["muscles"]  # each has a key of its own
    shared["bones"] = list(scene.bones.items())  # in order: points are fixed to bones by number
    common = digest_of([code_digest(), list(numbers), shared])
    keys: dict[str, str] = {}
    for name, muscle in scene.muscles.items():
        before = list(keys.values()) if scene.muscle_contact != "off" else []
        template = (muscle.fibres or {}).get("template_file")
        content = None if template is None else Path(template).read_text(encoding="utf-8")
        keys[name] = digest_of([common, before, name, content, _relevant(muscle, Muscle)])
    return keys


def _relevant(value: Any, kind: type) -> dict[str, Any]:
    names = {field.name for field in fields(kind) if f"{kind.__name__}.{field.name}" not in IRRELEVANT}
    return {name: getattr(value, name) for name in names}


def digest_of(value: Any) -> str:
    """Return a digest of all parts of a value; the order of mappings does not count."""
    return hashlib.sha256(json.dumps(value, default=_parts, sort_keys=True).encode()).hexdigest()


def _parts(value: Any) -> Any:
    """Return the parts of a value that JSON does not know."""
    if isinstance(value, vtkPolyData):
        cells = (value.GetVerts(), value.GetLines(), value.GetPolys(), value.GetStrips())
        ids = [array for kind in cells for array in (kind.GetOffsetsArray(), kind.GetConnectivityArray())]
        kinds = (value.GetPointData(), value.GetCellData(), value.GetFieldData())
        named = [kind.GetAbstractArray(i) for kind in kinds for i in range(kind.GetNumberOfArrays())]
        # VTK chooses how it keeps ids.
        return [points_of(value), *(np.asarray(array, np.int64) for array in ids), *map(_named, named)]
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return [str(value.dtype), value.shape, digest]
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    return dict(value) if isinstance(value, Mapping) else repr(value)


def _named(array: Any) -> Any:
    if isinstance(array, vtkDataArray):
        return array.GetName(), np.asarray(array)
    return array.GetName(), [array.GetValue(i) for i in range(array.GetNumberOfValues())]


@cache
def code_digest() -> str:
    """Return a digest of the computing code: source without :data:`_SHOWING`, and further packages."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256("".join(f"{package} {version_of(package)}\n" for package in _PACKAGES).encode())
    for file in sorted(file for kind in ("py", "toml", "csv") for file in root.rglob(f"*.{kind}")):
        name = file.relative_to(root).as_posix()
        if not name.startswith(_SHOWING):
            digest.update(name.encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
