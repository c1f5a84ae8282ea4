"""Processes of this program that work side by side."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_all_start_methods, get_context
from typing import Any

from vtkmuscle.core.machine import processors


def child_context() -> Any:
    """Return the context of child processes, as of :func:`multiprocessing.get_context`.

    Children are forked from a server that has loaded the package once. A fork of this process itself would
    hang in libraries with threads. Windows has no server: each child loads the package.
    """
    if "forkserver" not in get_all_start_methods():
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(["vtkmuscle.run.pool", "vtkmuscle.cli"])
    return context


def start_early(workers: int | None) -> None:
    """Start the server of child processes, to load the package while this process does."""
    if workers != 1 and processors() > 1 and child_context().get_start_method() == "forkserver":
        from multiprocessing import forkserver  # noqa: PLC0415 -- not known to Windows

        with interrupts_blocked():
            forkserver.ensure_running()


@contextmanager
def processes(
    size: int, initializer: Callable[..., None] | None = None, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of child processes, which are ended with the context."""
    before = active_children()
    pool = ProcessPoolExecutor(size, child_context(), initializer, arguments)
    try:
        yield pool
    finally:
        for process in set(active_children()).difference(before):
            process.kill()
        pool.shutdown(cancel_futures=True)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C in this thread, and for good in processes that start meanwhile; not on Windows."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
