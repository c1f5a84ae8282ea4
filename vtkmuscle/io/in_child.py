"""Read files by VTK in a process of its own, for VTK may end the process that reads a damaged file.

One process reads all files of a run: it starts with the first one, ends with this process, and where a file
ends it the next file has a new one. Programs that are no Python, such as ParaView, read files themselves.
"""

from __future__ import annotations

import atexit
import faulthandler
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOLegacy import vtkPolyDataReader, vtkPolyDataWriter

from vtkmuscle.core.errors import InputError
from vtkmuscle.isolation import isolated_python


@contextmanager
def vtk_messages() -> Iterator[Callable[[], str]]:
    """Collect what VTK would print, and give a function that returns it."""
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    vtkOutputWindow.SetInstance(window)

    def said() -> str:
        text: str | bytes = window.GetOutput()  # bytes, where those of a damaged file are in it
        return text.decode("utf-8", "replace") if isinstance(text, bytes) else text

    try:
        yield said
    finally:
        vtkOutputWindow.SetInstance(before)
        vtkLogger.SetStderrVerbosity(verbosity)


def first_line(messages: str) -> str:
    """Return the first complaint without VTK's source lines and addresses."""
    for line in messages.splitlines():
        if line and not line.startswith(("ERROR: In", "Warning: In", "Generic Warning: In")):
            return line.partition("): ")[2].strip(" .") or line.strip(" .")
    return ""


#: Memory that a file may take in any case [bytes], and in sizes of it: text of two bytes a number becomes
#: eight bytes, which are read, held, and written.
_LEAST_MEMORY, _MEMORY_SIZES = 2 * 1024**3, 40

_TIMES = vtkStreamingDemandDrivenPipeline.TIME_STEPS()


def serve() -> None:
    """Read what the lines of the standard input ask for, until it ends.

    Each is a JSON list: the file, its reader's module and class, the longest that it may take [s], and
    whether its data are wanted, or only that all of its time steps can be read. The answer is a line of JSON,
    ``[class of what it holds, what VTK said, length]``, and as many bytes: poly data as a .vtk file.
    """
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # where VTK's readers print
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the process that asks
    for line in sys.stdin.buffer:
        path, module, name, longest, wanted = json.loads(line)
        _limit_memory(os.path.getsize(path))
        faulthandler.dump_traceback_later(longest, exit=True)
        try:
            kind, said, content = read(path, module, name, wanted=wanted)
        except MemoryError:
            kind, said, content = "", "it takes too much memory", b""
        faulthandler.cancel_dump_traceback_later()
        answers.write(json.dumps([kind, said, len(content)]).encode() + b"\n" + content)
        answers.flush()


def _limit_memory(size: int) -> None:
    """Let the process take no more than a file of a size can need, and than there is."""
    try:
        import resource  # noqa: PLC0415 -- not there in Windows
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = min(_LEAST_MEMORY + _MEMORY_SIZES * size, there)
    if hard == resource.RLIM_INFINITY or most < hard:
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))


def read(path: str, module: str, name: str, *, wanted: bool) -> tuple[str, str, bytes]:
    """Return the class of what a file holds, what VTK said, and the data where they are wanted."""
    reader: Any = getattr(import_module(module), name)()
    with vtk_messages() as messages:
        reader.SetFileName(os.fsencode(path))
        reader.UpdateInformation()
        info = reader.GetOutputInformation(0)
        for time in () if wanted or not info.Has(_TIMES) else info.Get(_TIMES):
            reader.UpdateTimeStep(time)
        reader.Update()
    data = reader.GetOutputDataObject(0)
    kind = data.GetClassName() if data is not None else ""
    said = first_line(messages()) or ("it is damaged" if reader.GetErrorCode() else "")
    if said:
        return kind, said, b""
    if not wanted or not isinstance(data, vtkPolyData):
        return kind, "", b""
    cells = (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips())
    if not all(each.IsValid() for each in cells):
        return kind, "its cells lead beyond their points", b""
    return kind, "", _written(data)


def _written(data: vtkPolyData) -> bytes:
    writer = vtkPolyDataWriter()  # not of .vtp: that one writes names with a "<" as they are
    writer.SetInputData(data)
    writer.SetFileTypeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    content: str | bytes = writer.GetOutputStdString()
    return content.encode() if isinstance(content, str) else content


#: The longest that the reading of a file may take, whatever its size [s], and what is read in a second of a
#: large one at least [bytes/s].
LONGEST, _SPEED = 20.0, 1e7

_REMEDY = "export it again, and check that its suffix says what it is"


def read_in_child(path: Path, module: str, reader: str) -> vtkPolyData:
    """Read poly data by one of VTK's readers.

    Parameters
    ----------
    path : Path
        The file.
    module, reader : str
        Names of the reader's module and class.

    Raises
    ------
    ValueError
        If VTK complained, ended the process or did not end, or the file holds something else.
    """
    kind, said, content = _child.ask(path, module, reader, wanted=True)
    if said:
        raise InputError(path, f"the file cannot be read as {path.suffix}: {said}", _REMEDY)
    if kind != "vtkPolyData":
        raise InputError(
            path,
            f"the file holds a {kind or 'nothing'}, not a surface",
            "extract its surface (pyvista: mesh.extract_surface()) and save that",
        )
    again = vtkPolyDataReader()
    again.ReadFromInputStringOn()
    again.SetBinaryInputString(content, len(content))  # type: ignore[arg-type]
    again.Update()
    result: vtkPolyData = again.GetOutput()
    return result


def check_in_child(path: Path, module: str, reader: str) -> None:
    """Check that one of VTK's readers can read all time steps of a file.

    Parameters
    ----------
    path, module, reader
        As of :func:`read_in_child`.

    Raises
    ------
    ValueError
        If it cannot.
    """
    _, said, _ = _child.ask(path, module, reader, wanted=False)
    if said:
        raise InputError(path, "the file is damaged", "write it again")


def _is_python() -> bool:
    """Return whether this program is a Python to be started: ParaView names itself, or no file."""
    program = Path(sys.executable or "-")
    return program.name.startswith("python") and program.is_file()


class _Child:
    """The process, where there is one."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, path: Path, module: str, reader: str, *, wanted: bool) -> tuple[str, str, bytes]:
        """Return the class of what a file holds, what VTK said, and the data."""
        if not _is_python():
            return read(os.path.abspath(path), module, reader, wanted=wanted)
        longest = LONGEST + path.stat().st_size / _SPEED
        question = json.dumps([os.path.abspath(path), module, reader, longest, wanted])
        with self._lock:
            process = self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            began = time.monotonic()
            try:
                process.stdin.write(question.encode() + b"\n")
                process.stdin.flush()
                line = process.stdout.readline()
                kind, said, length = json.loads(line) if line else ("", "", 0)
                content = process.stdout.read(length)
            except BaseException:  # the answer is not for the next one to ask
                process.kill()
                raise
            if line:
                return kind, said, content
            code = process.wait()
        if time.monotonic() - began >= longest:
            raise InputError(path, f"the file was not read within {longest:.0f} s", _REMEDY)
        name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        problem = f"the file is damaged, or takes too much memory: VTK's reader ended with {name}"
        raise InputError(path, problem, _REMEDY)

    def _running(self) -> subprocess.Popen[bytes]:
        """Return the process: a new one where there is none, it has ended, or is that of a parent."""
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self.close()
            self._owner = os.getpid()
            # The package may be where no other code is loaded from: the folder that somebody works in.
            root = str(Path(__file__).parents[2])
            self._process = subprocess.Popen(
                isolated_python(f"sys.path.append({root!r})\nfrom {read.__module__} import serve\nserve()"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self._process

    def close(self) -> None:
        """End the process of this one, which reads no further file."""
        process, self._process = self._process, None
        if process is not None and self._owner == os.getpid():
            process.communicate()


_child = _Child()
atexit.register(_child.close)
