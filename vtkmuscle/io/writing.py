"""Write files atomically; lock a folder during a run."""

import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Self

from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import with_settings
from vtkmuscle.io.in_child import vtk_messages

#: Lock file of a folder.
LOCK = ".vtkmuscle.lock"

#: Names of incomplete files and folders, with the number of the writing process.
_PARTIAL = re.compile(r"\..+\.(?P<process>\d+)(-[0-9a-f]+)?\.partial")


def partial_path(path: Path) -> Path:
    """Return an unused temporary path in a path's folder."""
    return path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}.partial")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a new file, moved to a path once complete.

    Readers of the path see the old or the new content, never a part. After a failure the old file stays, and
    the new file is removed. The new file is created exclusively, never through a link. The folder is made. An
    OSError names the path. Inside of :class:`Outputs`, files are moved together at the end.
    """
    outputs = _active.get()
    partial = partial_path(path) if outputs is None else outputs.staged(path)
    try:
        partial.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield partial
        if outputs is None:
            partial.replace(path)
    except BaseException as error:
        if partial.exists():
            partial.unlink()
        if isinstance(error, OSError) and error.errno and ".partial" in str(error.filename or partial):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


#: Record of a folder: the digests of files that commands have written there.
RECORD = ".vtkmuscle.json"


class Outputs:
    """The files of a command in a folder, written all or none, and nothing of the user's replaced.

    Inputs are never replaced, and nothing is written through links. Files are replaced if their content is
    that of an earlier command, by the folder's record; other files, or edited files, are refused unless
    ``overwrite``. As a context manager, all files written inside appear at the end, and after a failure none.
    ``inputs`` may be by key; ``ours`` are files that a run has written.
    """

    def __init__(
        self, folder: Path, *, inputs: Mapping[str, Path] | Iterable[Path] = (), overwrite: bool = False,
        ours: Iterable[Path] = (),
    ) -> None:  # fmt: skip
        if folder.parts[:1] == ("~",):
            raise InputError(folder, "~ is not expanded", "give the full path, or Path(...).expanduser()")
        self.folder = Path(os.path.abspath(folder))
        keyed = inputs.items() if isinstance(inputs, Mapping) else (("", path) for path in inputs)
        self._inputs = [(key, file, _reals(file)) for key, file in keyed]
        self._overwrite, self._ours = overwrite, {Path(os.path.abspath(path)) for path in ours}
        self._staged: dict[Path, Path] = {}
        self.whole: set[Path] = set()  # folders that lose the other files of an earlier command
        self._stage = partial_path(self.folder / "outputs")

    @classmethod
    def for_file(cls, file: Path, inputs: Iterable[Path | None], **options: Any) -> Self:
        """Return the outputs in the folder of a file, after a check of the file."""
        outputs = cls(file.parent, inputs=filter(None, inputs), **options)
        outputs.check(file)
        return outputs

    def check(self, path: Path, *, is_folder: bool = False) -> None:
        """Raise an InputError or OSError if a file, or a whole folder, must not be written."""
        path = Path(os.path.abspath(path))
        for key, file, lost in self._inputs:
            if {path, path.resolve()} & lost:
                problem = f"the output {path} would replace an input{f' ({key})' if key else ''}"
                raise InputError(file, problem, "give another --out")
        if (file := next(filter(Path.is_file, path.parents), None)) is not None:
            raise NotADirectoryError(f"{file} is a file; give another folder for the results")
        inside = (Path(parent, name) for parent, names, _ in os.walk(path) for name in sorted(names))
        above = [each for each in path.parents if self.folder in each.parents]
        for each in filter(Path.is_symlink, (*above, path, *inside)):
            words = f"{each} is a link to {os.readlink(each)}; results are not written through links"
            raise NotADirectoryError(f"{words}, remove the link")
        if path.exists() and path.is_dir() != is_folder:
            kind, other = ("file", "folder") if is_folder else ("folder", "file")
            error = NotADirectoryError if is_folder else IsADirectoryError
            raise error(f"{path} is a {kind}, not a {other} for results; move the {kind}")
        if path.is_file() and not self._overwrite and path not in self._ours and not self._is_recorded(path):
            problem = "the file exists, and is not, or no longer, as a command of vtkmuscle has written it"
            raise InputError(path, problem, "give another --out, or add --overwrite")

    def staged(self, path: Path) -> Path:
        """Return the temporary path of an output, after a check."""
        path = Path(os.path.abspath(path))
        self.check(path)
        partial = self._staged[path] = self._stage / path.relative_to(self.folder)
        partial.unlink(missing_ok=True)
        return partial

    def written(self, path: Path) -> Path:
        """Return where a file is that was written inside of the context."""
        return self._staged[Path(os.path.abspath(path))]

    def __enter__(self) -> Self:
        remove_left_behind(self.folder)
        self._missing = [each for each in (self.folder, *self.folder.parents) if not each.exists()]
        self._token = _active.set(self)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        _active.reset(self._token)
        try:
            if kind is None and self._staged:
                with locked(self.folder, patience=_PATIENCE):
                    self._move()
        finally:
            shutil.rmtree(self._stage, ignore_errors=True)
            for each in self._missing if kind is not None else ():
                with suppress(OSError):  # the folder is not empty, or was not made
                    each.rmdir()

    def _move(self) -> None:
        """Record the files, then move the files to their paths."""
        record = self._record()
        for path, partial in self._staged.items():
            self.check(path)
            kept = path.is_file() and self._is_recorded(path)  # a kill leaves some old files
            old = [file_digest(path)] if kept else []
            record[path.relative_to(self.folder).as_posix()] = [file_digest(partial), *old]
        paths = {name: self.folder / name for name in sorted(record)}
        there = [name for name, path in paths.items() if path in self._staged or path.exists()]
        write_json(self.folder / RECORD, {name: record[name] for name in there}, indent=1)
        for path, partial in self._staged.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.replace(path)
        for path in (paths[name] for name in there):
            if path.parent in self.whole and path not in self._staged and self._is_recorded(path):
                path.unlink()

    def _record(self) -> dict[str, list[str]]:
        record = record_in(self.folder / RECORD)
        return record if all(isinstance(each, list) for each in record.values()) else {}

    def _is_recorded(self, path: Path) -> bool:
        inside = self.folder in path.parents
        digests = self._record().get(path.relative_to(self.folder).as_posix(), []) if inside else []
        return bool(digests) and file_digest(path) in digests


#: The outputs of the command in whose context files are written.
_active: ContextVar[Outputs | None] = ContextVar("_active", default=None)


def _reals(file: Path) -> set[Path]:
    """Return a file, the link to it if any, and their folders, without links on the way."""
    both = file.resolve(), file.parent.resolve() / file.name
    return {each for real in both for each in (real, *real.parents)}


def remove_left_behind(folder: Path, *, deep: bool = False) -> None:
    """Remove the incomplete files and folders of killed processes."""
    for path in list(folder.glob("**/.*" if deep else ".*")):
        match = _PARTIAL.fullmatch(path.name)
        if match and not path.is_symlink() and not _alive(int(match["process"]), path):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _alive(process: int, path: Path) -> bool:
    if os.name != "posix":  # no signal tests for a process
        return process == os.getpid() or time.time() - path.stat().st_mtime < 86400.0  # a day
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


def plain_cell(value: Any) -> Any:
    """Return a cell, with an apostrophe before spreadsheet formulas."""
    formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if formula else value


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8), all or nothing."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def insert_before(path: Path, text: str, end: str) -> None:
    """Insert text before the end of a text file of this command, in place; a full disk changes nothing."""
    outputs, added, tail = _active.get(), text.encode(), end.encode()
    with (path if outputs is None else outputs.written(path)).open("r+b", buffering=0) as file:
        start = file.seek(-len(tail), os.SEEK_END)
        try:
            if file.write(added + tail) < len(added + tail):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        except BaseException:
            file.seek(start)
            file.write(tail)  # in its old place
            file.truncate()
            raise


def write_json(path: Path, value: Any, **options: Any) -> None:
    """Write a JSON file, all or nothing; numbers and arrays of NumPy are written as Python's."""
    write_text(path, json.dumps(value, default=plain, **options) + "\n")


def record_in(path: Path) -> dict[str, Any]:
    """Return the mapping in a JSON file, empty if missing or damaged."""
    try:
        record = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}


def write_polydata(path: Path, data: vtkPolyData) -> None:
    """Write a .vtp file, all or nothing: binary, with exact doubles; OSError if VTK cannot.

    Point numbers have 32 bits, without compression: as small as 64 bits with LZ4, in half the time.
    """
    narrow = vtkPolyData()
    narrow.ShallowCopy(data)
    for kind in ("Verts", "Lines", "Polys", "Strips"):
        cells = vtkCellArray()
        cells.DeepCopy(getattr(data, f"Get{kind}")())
        if cells.ConvertTo32BitStorage():
            getattr(narrow, f"Set{kind}")(cells)
    form = {"DataMode": vtkXMLPolyDataWriter.Appended, "EncodeAppendedData": False, "HeaderType": 64}
    write_with(with_settings(vtkXMLPolyDataWriter(), InputData=narrow, Compressor=None, **form), path)


def write_with(writer: Any, path: Path) -> None:
    """Write a file by a writer of VTK, all or nothing; OSError if it fails."""
    with replacing(path) as partial:
        writer.SetFileName(str(partial))
        with vtk_messages():
            written = writer.Write()
        if not written or writer.GetErrorCode():
            raise OSError(f"{path}: the file could not be written; is the disk full?")


#: Longest wait for the lock of a folder at the end of a command [s].
_PATIENCE = 10.0


@contextmanager
def locked(folder: Path, *, patience: float = 0.0) -> Iterator[None]:
    """Hold the lock of a folder; the system releases the lock of a killed process."""
    path, until = folder / LOCK, time.monotonic() + patience
    if os.name != "posix":
        yield
        return
    import fcntl  # noqa: PLC0415 -- Windows has none

    while True:
        descriptor = os.open(path, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, 20).decode("ascii", "replace").strip() or "unknown"
            os.close(descriptor)
            if time.monotonic() < until:
                time.sleep(0.05)
                continue
            words = f"{folder}: another run is writing here (process {holder})"
            raise BlockingIOError(f"{words}; wait for its end, or give another folder with --out") from None
        except OSError as error:  # a file system without locks
            warnings.warn(f"{folder} cannot be locked ({error.strerror}); start no second run", stacklevel=6)
            break
        with suppress(FileNotFoundError):  # the previous run may have just removed the file
            if os.stat(path).st_ino == os.fstat(descriptor).st_ino:
                break
        os.close(descriptor)
    try:
        os.ftruncate(descriptor, 0)
        os.write(descriptor, f"{os.getpid()}\n".encode("ascii"))
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def plain(value: Any) -> Any:
    """Return a value for JSON in place of one that JSON does not know."""
    if isinstance(value, Path):
        return str(value)
    return value.tolist() if hasattr(value, "tolist") else repr(value)
