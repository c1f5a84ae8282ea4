"""Run a study: its tasks by Dask, then its tables and its page."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from vtkmuscle.cohort.page import write_page
from vtkmuscle.cohort.solve import DONE, FAILED, KEPT, UnwritableError, solve
from vtkmuscle.cohort.statistics import write_statistics
from vtkmuscle.cohort.study import Study, Task
from vtkmuscle.cohort.tables import write_tables
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.processors import processors
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import check_no_links, left_behind, locked, write_text
from vtkmuscle.isolation import workers_leave_out_working_folder
from vtkmuscle.run.report import versions
from vtkmuscle.run.store.keys import code_digest

#: The file that says what a folder of results is of.
REPORT = "study.json"
#: What a study writes into its folder beside it.
_RESULTS = ("cohort.csv", "cohort.parquet", "cohort.html", "comparison.csv", "sensitivity.csv", "parts")
#: So long a scheduler may take to answer, or to have a worker [s].
PATIENCE = 60.0

_GOES_ON = "what is finished is kept: the same command goes on from there"


@dataclass(frozen=True)
class Progress:
    """A task that has ended.

    Attributes
    ----------
    task : Task
        Which.
    state : str
        ``"kept"`` (it was done by an earlier run), ``"done"`` or ``"failed"``.
    words : str
        The verdict, or why it failed.
    done, total : int
        Tasks that have ended, and that there are.
    subject_done, subject_total : int
        Those of this subject.
    seconds_left : float or None
        By what this run has done so far; None where it has done nothing.
    """

    task: Task
    state: str
    words: str
    done: int
    total: int
    subject_done: int
    subject_total: int
    seconds_left: float | None


def run_study(
    study: Study,
    out: str | os.PathLike[str],
    *,
    client: Any = None,
    scheduler: str | None = None,
    workers: int | None = None,
    memory: str | float | None = None,
    retries: int = 2,
    fresh: bool = False,
    progress: Callable[[Progress], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run all muscles of all subjects of a study, and write its tables and its page.

    Tasks that an earlier run into the folder has finished, with the same inputs and settings, are not run
    again. What comes out does not depend on workers, their order or interruptions.

    Parameters
    ----------
    study : Study
        What is run.
    out : path
        Folder: ``cohort.csv``, ``cohort.parquet``, ``cohort.html``, ``study.json``, ``parts/`` with what is
        finished, and ``comparison.csv``, ``sensitivity.csv`` where the study asks for them.
    client : distributed.Client, optional
        Of a cluster that is there already, as dask-jobqueue or dask-kubernetes makes it; its workers see the
        same folders, by the same names.
    scheduler : str, optional
        Or the address of its scheduler, ``"tcp://host:8786"``. Without either processes on this machine work.
    workers : int, optional
        How many of these; default: as many as there are processors. Each has one thread, for compiled kernels
        and VTK hold Python's interpreter.
    memory : str or float, optional
        What each of them may take, ``"4GB"`` or bytes; default: its share of the machine's. One that takes
        more is ended, and its task tried again.
    retries : int, optional
        How often a task may lose its worker before it counts as failed.
    fresh : bool, optional
        Run tasks again that are finished.
    progress : callable, optional
        Called with a :class:`Progress` for each task that has ended.
    announce : callable, optional
        Called with lines of text: what is about to be done, the address of Dask's dashboard.

    Returns
    -------
    dict
        What ``study.json`` says: how many tasks were kept, done and failed, verdicts, versions.

    Raises
    ------
    ValueError
        If the folder holds another study, or the extra ``cohort`` is not installed.
    OSError
        If the folder cannot be written to, another process writes to it, or the scheduler is lost.
    """
    folder = Path(out)
    distributed = _distributed()
    say = announce or (lambda words: None)
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder):
        _check_folder(folder, study)
        for left in left_behind(folder, deep=True):
            shutil.rmtree(left) if left.is_dir() else left.unlink(missing_ok=True)
        parts = Parts(folder / "parts")
        check_no_links(parts.folder)
        if fresh:
            shutil.rmtree(parts.folder, ignore_errors=True)
        report: dict[str, Any] = {"study": study.name, "study_file": str(study.file.absolute())}
        report |= {"complete": False, "subjects": len(study.subjects), "versions": versions()}
        _write_report(folder, report)
        with _connected(distributed, client, scheduler, workers, memory, retries) as connected:
            say(f"Dask's dashboard: {connected.dashboard_link}")
            states = _work(distributed, connected, study, parts, progress, retries)
        report["tasks"] = dict(sorted(states.items()))
        say("writing tables and the page")
        write_tables(study, parts, folder)
        write_statistics(study, folder)
        write_page(study, parts, folder)
        report["complete"] = True
        _write_report(folder, report)
    return report


def _write_report(folder: Path, report: dict[str, Any]) -> None:
    write_text(folder / REPORT, json.dumps(report, indent=1) + "\n")


def _distributed() -> Any:
    try:
        import cryptography  # noqa: F401, PLC0415 -- of the extra `cohort`
        import distributed  # noqa: PLC0415
        import pyarrow  # noqa: F401, PLC0415
    except ImportError as error:
        raise InputError(
            "", f"a cohort needs {error.name}", "install it: python -m pip install 'vtkmuscle[cohort]'"
        ) from error
    return distributed


def _check_folder(folder: Path, study: Study) -> None:
    """Raise an error where results would be written over those of another study, or what is unknown."""
    remedy = "give another folder with --out"
    there = [name for name in _RESULTS if (folder / name).exists()]
    try:
        before = json.loads((folder / REPORT).read_text(encoding="utf-8"))["study_file"]
    except FileNotFoundError:
        if there:
            raise InputError(
                folder / there[0], "the study would be written over what no study has made", remedy
            ) from None
        return
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(folder / REPORT, "the file is damaged", f"remove it, or {remedy}") from None
    if before != str(study.file.absolute()):
        raise InputError(folder, f"it holds the results of another study, {before}", remedy)


@contextmanager
def _connected(
    distributed: Any,
    client: Any,
    scheduler: str | None,
    workers: int | None,
    memory: str | float | None,
    retries: int,
) -> Iterator[Any]:
    """Give a client of the cluster that is there, or of one of this machine's own processes."""
    if client is not None:
        yield client
        return
    if scheduler is not None:
        try:
            with distributed.Client(scheduler, timeout=PATIENCE) as connected:
                connected.wait_for_workers(1, timeout=PATIENCE)
                yield connected
        except (OSError, ValueError, TimeoutError) as error:
            if isinstance(error, UnwritableError | InputError | ConnectionError):
                raise
            raise ConnectionError(f"{scheduler}: no scheduler with a worker answers ({error})") from error
        return
    import dask  # noqa: PLC0415 -- of the extra `cohort`

    root = str(Path(__file__).parents[2])
    if root not in sys.path:  # it may be the working folder, which is left out; workers need the package too
        sys.path.append(root)
    with (
        workers_leave_out_working_folder(),
        dask.config.set(
            {"distributed.scheduler.allowed-failures": retries, "distributed.worker.memory.terminate": 0.95}
        ),
        distributed.LocalCluster(
            n_workers=workers or processors(),
            threads_per_worker=1,
            processes=True,
            memory_limit="auto" if memory is None else memory,
            dashboard_address="127.0.0.1:0",
            security=True,  # whoever can connect has code executed: other users of this machine
            silence_logs="CRITICAL",
        ) as cluster,
        distributed.Client(cluster) as connected,
    ):
        yield connected


def _work(
    distributed: Any,
    client: Any,
    study: Study,
    parts: Parts,
    progress: Callable[[Progress], None] | None,
    retries: int,
) -> Counter[str]:
    """Have all tasks done, and return how many were kept, done and failed."""
    try:
        client.run(import_module, "vtkmuscle.cohort.solve")  # by name: nothing of the package is sent
    except ImportError as error:
        raise InputError(
            "", f"a worker cannot import vtkmuscle ({error})", "install 'vtkmuscle[cohort]' there too"
        ) from error
    code, folder, run = code_digest(), str(parts.folder.absolute()), secrets.token_hex(4)
    tasks: dict[str, Task] = {}
    futures = []

    def submit(task: Task, number: int, after: Any = None, again: str = "") -> Any:
        key = f"vtkmuscle-{run}-{len(tasks)}{again}"
        tasks[key] = task
        return client.submit(solve, task, folder, code, after, key=key, pure=False, priority=-number)

    for number, together in enumerate(study.tasks()):
        # The first muscle of a scene measures distances from the bones; the others, wherever they run, find
        # them on disk, and most of them run where the scene is in memory.
        first = submit(together[0], number)
        futures += [first, *(submit(task, number, first) for task in together[1:])]
    total, count = len(tasks), _Count(tasks)
    states: Counter[str] = Counter()
    running = distributed.as_completed(futures)
    del futures, first
    for future in running:
        task = tasks[future.key]
        try:
            state, words = future.result()
        except distributed.KilledWorker as error:
            if getattr(error, "task", future.key) != future.key:  # the task before it was lost
                running.add(submit(task, 0, again="-alone"))
                continue
            words = f"its worker was lost {retries + 1} times: it ran out of memory, or was killed"
            state = FAILED
            parts.write(task.name, "", Part({"failure": words}))
        except UnwritableError:
            raise
        except (Exception, distributed.CancelledError) as error:
            if isinstance(error, OSError) or future.status != "error":
                raise ConnectionError(f"the scheduler was lost ({error}); {_GOES_ON}") from error
            raise
        states[state] += 1
        if progress is not None:
            progress(count.ended(task, state, words, total))
    if sum(states.values()) < total:
        raise ConnectionError(f"the scheduler was lost; {_GOES_ON}")
    return states


class _Count:
    """Counts tasks that have ended, and foretells how long the others take."""

    def __init__(self, tasks: dict[str, Task]) -> None:
        self._total = Counter(task.subject for task in tasks.values())
        self._ended: Counter[str] = Counter()
        self._began, self._worked = time.monotonic(), 0

    def ended(self, task: Task, state: str, words: str, total: int) -> Progress:
        """Count a task."""
        self._ended[task.subject] += 1
        self._worked += state != KEPT
        done = sum(self._ended.values())
        each = (time.monotonic() - self._began) / self._worked if self._worked else None
        left = None if each is None else each * (total - done)
        of_subject = self._ended[task.subject], self._total[task.subject]
        return Progress(task, state, words, done, total, *of_subject, left)


__all__ = ["DONE", "FAILED", "KEPT", "Progress", "run_study"]
