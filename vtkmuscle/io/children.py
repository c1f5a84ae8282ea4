"""Processes of this program that work side by side."""

import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_all_start_methods, get_context
from threading import RLock
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
    pool = _Pool(size, child_context(), initializer, arguments)
    try:
        yield pool
    finally:
        pool.kill()
        pool.shutdown(cancel_futures=True)


class _Pool(ProcessPoolExecutor):
    """A pool of processes without Ctrl-C. Nor do they import the main module: it need not guard its work."""

    def submit(self, *work: Any, **options: Any) -> Future[Any]:
        """Let the next free process do a work; processes start here."""
        with _without_main(), interrupts_blocked():
            return super().submit(*work, **options)

    def kill(self) -> None:
        """End the processes of this pool, and of no other."""
        for process in list((self._processes or {}).values()):
            process.kill()


#: Held while the main module is hidden.
_hiding = RLock()


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the source of the main module. A starting process would import it, and run its work again."""
    main = sys.modules["__main__"]
    with _hiding:
        hidden = {name: vars(main)[name] for name in ("__file__", "__spec__") if vars(main).get(name)}
        vars(main).update(dict.fromkeys(hidden))
        try:
            yield
        finally:
            vars(main).update(hidden)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C in this thread, and for good in processes that start meanwhile; not on Windows."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker  # noqa: PLC0415 -- not known to Windows

    resource_tracker.ensure_running()  # its start unblocks Ctrl-C
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
