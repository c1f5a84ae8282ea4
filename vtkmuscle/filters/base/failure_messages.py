"""VTK's "returned failure for request": not shown where the exception itself is about to be raised."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from vtkmodules.vtkCommonCore import vtkObject


class _State:
    """The switch is one for the whole process, so the last thread that needs it off puts it back."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.users = 0
        self.displayed = 1
        self.here = threading.local()


_state = _State()


@contextmanager
def failure_messages_off() -> Iterator[None]:
    """Keep VTK quiet about filters that fail in this block, from their failure on.

    Before it VTK's warnings are shown as ever.
    """
    with _state.lock:
        if not _state.users:
            _state.displayed = vtkObject.GetGlobalWarningDisplay()
        _state.users += 1
    outer = getattr(_state.here, "off", False)
    _state.here.off = True
    try:
        yield
    finally:
        _state.here.off = outer
        with _state.lock:
            _state.users -= 1
            vtkObject.SetGlobalWarningDisplay(_state.displayed)


def silence_after_failure() -> None:
    """Switch VTK's messages off, in a filter that has failed within :func:`failure_messages_off`."""
    if getattr(_state.here, "off", False):
        vtkObject.GlobalWarningDisplayOff()
