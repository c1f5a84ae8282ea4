"""What the process does that reads files by VTK: a line of answer per file, and what VTK would print."""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter


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
