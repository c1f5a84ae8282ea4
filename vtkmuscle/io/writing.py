"""Write files under temporary names and rename them when they are complete; lock a folder meanwhile."""

from __future__ import annotations

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

#: The file that is held while a folder is written to.
LOCK = ".vtkmuscle.lock"

#: Names of incomplete files and folders; the number is that of the writing process.
_PARTIAL = re.compile(r"\..+\.(?P<process>\d+)(-[0-9a-f]+)?\.partial")

#: Where the system cannot tell whether a process still runs, its files are left alone for this long [s].
_A_DAY = 86400.0


def beside(path: Path) -> Path:
    """Return an unused temporary name beside a path."""
    return path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}.partial")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a new, empty file beside a path, and move it there when it is complete.

    Readers of the path see the old content or the new one, never a part. Where writing fails the old file
    stays, and no other is left. The file is created exclusively: it is never an existing one, or a link to
    one. The folder is made. An OSError names the path.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = beside(path)
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
    """Raise a NotADirectoryError where a folder of results, or one within it at any depth, is a link.

    Files that are links do no harm: they are replaced or removed themselves, never their targets.
    """
    inside = (Path(parent, name) for parent, names, _ in os.walk(folder) for name in sorted(names))
    for path in (folder, *inside):
        if path.is_symlink():
            target = os.readlink(path)
            raise NotADirectoryError(
                f"{path} is a link to {target}; results are not written through links, move it away"
            )


def left_behind(folder: Path, *, deep: bool = False) -> list[Path]:
    """Return the incomplete files that killed processes have left in a folder.

    With ``deep`` the folders within are searched as well; links are not followed.
    """
    found = []
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path, match = Path(parent, name), _PARTIAL.fullmatch(name)
            if match and not path.is_symlink() and not _alive(int(match["process"]), path):
                found.append(path)
        folders[:] = [name for name in folders if deep and Path(parent, name) not in found]
    return found


def _alive(process: int, path: Path) -> bool:
    if process == os.getpid():
        return True
    if os.name != "posix":  # no signal tests for a process there
        return time.time() - path.stat().st_mtime < _A_DAY
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def plain_cell(value: Any) -> Any:
    """Return the value of a cell: a text that a spreadsheet would run as a formula gets an apostrophe."""
    formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if formula else value


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8), all or nothing."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def write_polydata(path: Path, data: vtkPolyData) -> None:
    """Write a .vtp file, all or nothing: binary, doubles kept exact.

    Cells name their points by 32-bit numbers and nothing is compressed, which takes as much room as 64-bit
    numbers that LZ4 compresses, and half its time.

    Raises
    ------
    OSError
        If VTK could not write the file (disk full, no permission).
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
    with replacing(path) as partial:
        writer.SetFileName(str(partial))
        with vtk_messages():
            written = writer.Write()
        if not written or writer.GetErrorCode():
            raise OSError(f"{path}: the file could not be written; is the disk full?")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder; the system releases it where the process is killed."""
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
            raise BlockingIOError(
                f"{folder}: another run is writing to it (process {holder}); wait for it to end, or give "
                "another folder with --out"
            ) from None
        except OSError as error:  # a file system without locks
            warnings.warn(f"{folder} cannot be locked ({error.strerror}); start no second run", stacklevel=6)
            break
        try:
            if os.stat(path).st_ino == os.fstat(descriptor).st_ino:
                break
        except FileNotFoundError:  # the run before has just ended and removed it
            pass
        os.close(descriptor)
    try:
        os.ftruncate(descriptor, 0)
        os.write(descriptor, f"{os.getpid()}\n".encode("ascii"))
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)
