"""Ctrl-C while VTK calls Python."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Hold Ctrl-C back until the block has been left.

    VTK ends the process when a KeyboardInterrupt comes out of an observer. Held back until the observer has
    returned, it is raised where the filter can be left in good order. Signals are Python's main thread's
    business; elsewhere, and where Ctrl-C is not handled in Python, this does nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    caught: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _frame: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if caught:
        handler(caught[0], None)
