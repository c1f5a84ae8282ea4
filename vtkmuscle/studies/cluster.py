"""Workers of Dask: processes of this machine, or of a cluster that is there already."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.machine import processors
from vtkmuscle.io.parts import Parts
from vtkmuscle.run.store.keys import code_digest
from vtkmuscle.studies.case import Case, UnwritableError, solve
from vtkmuscle.studies.study import Cases, Ended, Workers, keep_failure

#: Longest wait for a scheduler's answer, and for its first worker [s].
ANSWER, PATIENCE = 5.0, 60.0

_GOES_ON = "what is finished is kept: the same command goes on from there"


def dask() -> Any:
    """Return the package ``distributed``; raise an InputError if the extra ``cohort`` is not installed."""
    try:
        import cryptography  # noqa: F401, PLC0415 -- of the extra `cohort`
        import distributed  # noqa: PLC0415
    except ImportError as error:
        remedy = "install it: python -m pip install '.[cohort]'"
        raise InputError("", f"a cohort needs {error.name}", remedy) from error
    return distributed


@contextmanager
def connected(
    *,
    client: Any = None,
    scheduler: str | None = None,
    workers: int | None = None,
    memory: str | float | None = None,
    retries: int = 2,
) -> Iterator[tuple[Workers, str]]:
    """Give workers, and the address of their dashboard; parameters as of ``run_study``."""
    distributed = dask()
    with ExitStack() as stack:
        if client is None and scheduler is not None:
            client = stack.enter_context(_client(distributed, scheduler))
        if client is None:
            client = stack.enter_context(_local_client(distributed, workers or processors(), memory, retries))
        yield _workers(distributed, client, retries), client.dashboard_link


@contextmanager
def _local_client(distributed: Any, workers: int, memory: str | float | None, retries: int) -> Iterator[Any]:
    """Give a client of processes of this machine."""
    import dask as settings  # noqa: PLC0415 -- of the extra `cohort`

    limits = {
        "distributed.scheduler.allowed-failures": retries,
        "distributed.worker.memory.terminate": 0.95,
        "distributed.worker.profile.enabled": False,  # it grows by 0.3 MB for each subject of a worker
    }
    with settings.config.set(limits):
        try:
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                memory_limit="auto" if memory is None else memory,
                dashboard_address="127.0.0.1:0",
                security=True,  # whoever can connect can have code executed: other users of this machine
                silence_logs="CRITICAL",
            )
        except RuntimeError as error:
            raise ConnectionError(f"a worker was lost before it began ({error}); {_GOES_ON}") from error
        with cluster, distributed.Client(cluster) as client:
            yield client


@contextmanager
def _client(distributed: Any, scheduler: str) -> Iterator[Any]:
    """Give a client of a scheduler that has a worker."""
    try:
        found = distributed.Client(scheduler, timeout=ANSWER)
    except (OSError, ValueError, TimeoutError) as error:
        raise ConnectionError(f"{scheduler}: no scheduler answers ({error})") from error
    with found:
        try:
            found.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, TimeoutError) as error:
            raise ConnectionError(f"{scheduler}: the scheduler has no worker ({error})") from error
        yield found


def _workers(distributed: Any, client: Any, retries: int) -> Workers:
    def work(cases: Cases, parts: Parts) -> Ended:
        try:
            client.run(import_module, "vtkmuscle.studies.case")  # by name: nothing of the package is sent
        except ImportError as error:
            remedy = "install '.[cohort]' there too"
            raise InputError("", f"a worker cannot import vtkmuscle ({error})", remedy) from error
        code, folder, run = code_digest(), str(parts.folder.absolute()), secrets.token_hex(4)
        submitted: dict[str, Case] = {}

        def submit(case: Case, number: int, after: Any = None) -> Any:
            key = f"vtkmuscle-{run}-{len(submitted)}"
            submitted[key] = case
            return client.submit(solve, case, folder, run, code, after, key=key, pure=False, priority=-number)

        futures = []
        for number, together in enumerate(cases):
            # A worker that has solved the first muscle of a scene has read and checked the scene, which takes
            # 2 s of a real hip; most of the other muscles then run there.
            first = submit(together[0], number)
            futures += [first, *(submit(case, number, first) for case in together[1:])]
        left = len(futures)
        running = distributed.as_completed(futures)
        del futures, first
        for future in running:
            case = submitted[future.key]
            try:
                ended = (case, *future.result())
            except distributed.KilledWorker as error:
                if getattr(error, "task", future.key) != future.key:  # the first muscle of the scene was lost
                    running.add(submit(case, 0))
                    continue
                lost = f"its worker was lost {retries + 1} times: it ran out of memory, or was killed"
                ended = keep_failure(case, parts, lost)
            except (Exception, distributed.CancelledError) as error:
                lost_it = isinstance(error, OSError) or future.status != "error"
                if lost_it and not isinstance(error, UnwritableError):
                    raise ConnectionError(f"the scheduler was lost ({error}); {_GOES_ON}") from error
                raise
            left -= 1
            yield ended
        if left:
            raise ConnectionError(f"the scheduler was lost; {_GOES_ON}")

    return work
