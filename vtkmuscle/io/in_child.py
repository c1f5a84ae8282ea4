"""Read files by VTK in a child process, because damaged files can crash VTK's readers.

The process starts with the first file and reads all files of a run; after a crash the next file gets a new
process. In programs other than Python, such as ParaView, files are read directly.
"""

import atexit
import faulthandler
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOLegacy import vtkPolyDataReader, vtkPolyDataWriter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.machine import is_python, python_command


@contextmanager
def log_level(verbosity: Any) -> Iterator[None]:
    """Print VTK's log from a verbosity on."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(verbosity)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)


@contextmanager
def vtk_messages() -> Iterator[Callable[[], str]]:
    """Collect VTK's messages, and yield a function that returns the text."""
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)

    def messages() -> str:
        text: str | bytes = window.GetOutput()  # bytes for text of a damaged file
        return text.decode("utf-8", "replace") if isinstance(text, bytes) else text

    try:
        with log_level(vtkLogger.VERBOSITY_OFF):
            yield messages
    finally:
        vtkOutputWindow.SetInstance(before)


def first_line(messages: str) -> str:
    """Return the first complaint without VTK's source lines and addresses."""
    for line in messages.splitlines():
        if line and not line.startswith(("ERROR: In", "Warning: In", "Generic Warning: In")):
            return line.partition("): ")[2].strip(" .") or line.strip(" .")
    return ""


#: Memory limit of the child [bytes]: a constant, plus a multiple of the file's size. A number of 2 bytes in
#: text becomes 8 bytes, which are read, kept and written.
_LEAST_MEMORY, _MEMORY_SIZES = 2 * 1024**3, 40


def serve() -> None:
    """Answer the requests on standard input, until the end of input.

    A request is a line with a JSON list: file, module and class of the reader, time limit [s], and size of
    the file [bytes]. The answer is a line of JSON, ``[class of the data, VTK's complaint, length]``, followed
    by poly data as a .vtk file of that length.
    """
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # VTK's readers print to standard output
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles an interrupt
    for line in sys.stdin.buffer:
        path, module, name, longest, size = json.loads(line)
        _limit_memory(size)
        faulthandler.dump_traceback_later(longest, exit=True)
        try:
            kind, complaint, content = read(path, module, name)
        except MemoryError:
            kind, complaint, content = "", "it takes too much memory", b""
        faulthandler.cancel_dump_traceback_later()
        answers.write(json.dumps([kind, complaint, len(content)]).encode() + b"\n" + content)
        answers.flush()


def _limit_memory(size: int) -> None:
    """Limit the process's memory by the file's size."""
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 -- not there in Windows

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = min(_LEAST_MEMORY + _MEMORY_SIZES * size, there)
    if hard == resource.RLIM_INFINITY or most < hard:
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))


#: Filters of the outer surface, by class of the data.
_SURFACES = {
    "vtkUnstructuredGrid": "vtkGeometryFilter",
    "vtkMultiBlockDataSet": "vtkCompositeDataGeometryFilter",
}


def read(path: str, module: str, name: str) -> tuple[str, str, bytes]:
    """Return class, VTK's complaint and data of a file."""
    reader: Any = getattr(import_module(module), name)()
    with vtk_messages() as messages:
        reader.SetFileName(os.fsencode(path))
        reader.Update()
    data = reader.GetOutputDataObject(0)
    kind = data.GetClassName() if data is not None else ""
    complaint = first_line(messages()) or ("it is damaged" if reader.GetErrorCode() else "")
    if not complaint and kind in _SURFACES:
        outer: Any = getattr(import_module("vtkmodules.vtkFiltersGeometry"), _SURFACES[kind])()
        outer.SetInputData(data)
        outer.Update()
        data, kind = outer.GetOutput(), "vtkPolyData"
    if complaint or not isinstance(data, vtkPolyData):
        return kind, complaint, b""
    cells = (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips())
    if not all(each.IsValid() for each in cells):
        return kind, "its cells refer to points that do not exist", b""
    writer = vtkPolyDataWriter()  # VTK's .vtp writer does not escape a "<" in names
    writer.SetInputData(data)
    writer.SetFileTypeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    content: str | bytes = writer.GetOutputStdString()
    return kind, "", content.encode() if isinstance(content, str) else content


#: Time limit for a file [s], and the least speed for large files [bytes/s]: on a busy machine a process
#: starts in 0.8 s and reads 3 MB in half a second.
LONGEST, _SPEED = 20.0, 1e7

_REMEDY = "export it again, and check that its suffix is that of its format"


def read_in_child(path: Path, module: str, reader: str) -> vtkPolyData:
    """Read poly data by the module and class of a reader."""
    kind, complaint, content = _child.ask(path, module, reader)
    if complaint:
        raise InputError(path, f"the file cannot be read as {path.suffix}: {complaint}", _REMEDY)
    if kind != "vtkPolyData":
        raise InputError(path, f"the file contains {kind or 'no data'}, not a surface", "save a surface mesh")
    again = vtkPolyDataReader()
    again.ReadFromInputStringOn()
    again.SetBinaryInputString(content, len(content))  # type: ignore[arg-type]
    again.Update()
    result: vtkPolyData = again.GetOutput()
    return result


class _Child:
    """The reading process, started on demand."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: Any = None
        self._owner = 0

    def ask(self, path: Path, module: str, reader: str) -> tuple[str, str, bytes]:
        """Return class, VTK's complaint and data of a file."""
        if not is_python():
            return read(str(path.absolute()), module, reader)
        longest = LONGEST + (size := path.stat().st_size) / _SPEED
        question = json.dumps([str(path.absolute()), module, reader, longest, size])
        with self._lock:
            process, began = self._running(), time.monotonic()
            try:
                with suppress(BrokenPipeError):  # the exit status of a dead process tells more
                    process.stdin.write(question.encode() + b"\n")
                    process.stdin.flush()
                if line := process.stdout.readline():
                    kind, complaint, length = json.loads(line)
                    return kind, complaint, process.stdout.read(length)
            except BaseException:  # the next question must not get this answer
                process.kill()
                raise
            code = process.wait()
        if time.monotonic() - began >= longest:
            raise InputError(path, f"the file was not read within {longest:.0f} s", _REMEDY)
        name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        problem = f"the file is damaged, or takes too much memory: VTK's reader ended with {name}"
        raise InputError(path, problem, _REMEDY)

    def _running(self) -> Any:
        """Return a running process of this process; start one if necessary."""
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self.close()
            self._owner = os.getpid()
            # The package may be in the working folder, which this Python leaves out.
            root = str(Path(__file__).parents[2])
            code = f"sys.path.append({root!r})\nfrom {read.__module__} import serve\nserve()"
            pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
            self._process = subprocess.Popen(python_command(code), stdin=pipe, stdout=pipe, stderr=nothing)
        return self._process

    def close(self) -> None:
        """End the process, if started by this process."""
        if self._process is not None and self._owner == os.getpid():
            try:
                self._process.communicate()
            except KeyboardInterrupt:  # at the end of the program
                self._process.kill()
        self._process = None


_child = _Child()
atexit.register(_child.close)
