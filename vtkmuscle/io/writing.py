"""Write files atomically; lock a folder during a run."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

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
    OSError names the path.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = partial_path(path)
    try:
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield partial
        partial.replace(path)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(partial)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        partial.unlink(missing_ok=True)


def check_no_links(folder: Path) -> None:
    """Raise a NotADirectoryError for a link among result folders.

    Links to files are harmless: they are replaced or removed, not their targets.
    """
    inside = (Path(parent, name) for parent, names, _ in os.walk(folder) for name in sorted(names))
    for path in filter(Path.is_symlink, (folder, *inside)):
        words = f"{path} is a link to {os.readlink(path)}; results are not written through links"
        raise NotADirectoryError(f"{words}, remove the link")


def left_behind(folder: Path, *, deep: bool = False) -> list[Path]:
    """Return the incomplete files of killed processes in a folder.

    With ``deep``, subfolders are searched as well; links are not followed.
    """
    left = []
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path, match = Path(parent, name), _PARTIAL.fullmatch(name)
            if match and not path.is_symlink() and not _alive(int(match["process"]), path):
                left.append(path)
        folders[:] = [name for name in folders if deep and Path(parent, name) not in left]
    return left


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
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(narrow)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetHeaderTypeToUInt64()
    writer.SetCompressorTypeToNone()
    write_with(writer, path)


def write_with(writer: Any, path: Path) -> None:
    """Write a file by a writer of VTK, all or nothing; OSError if it fails."""
    with replacing(path) as partial:
        writer.SetFileName(str(partial))
        with vtk_messages():
            written = writer.Write()
        if not written or writer.GetErrorCode():
            raise OSError(f"{path}: the file could not be written; is the disk full?")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder; the system releases the lock of a killed process."""
    path = folder / LOCK
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
            words = f"{folder}: another run is writing here (process {holder})"
            raise BlockingIOError(f"{words}; wait for its end, or give another folder with --out") from None
        except OSError as error:  # a file system without locks
            warnings.warn(f"{folder} cannot be locked ({error.strerror}); start no second run", stacklevel=6)
            break
        try:
            if os.stat(path).st_ino == os.fstat(descriptor).st_ino:
                break
        except FileNotFoundError:  # the previous run has just removed the file
            pass
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
