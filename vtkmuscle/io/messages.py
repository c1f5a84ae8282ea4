"""What VTK would print, collected instead."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow


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
