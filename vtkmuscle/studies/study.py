"""The one way to run the cases of a study: finished cases are kept, and a case that fails is a row."""

from __future__ import annotations

import json
import secrets
import shutil
import threading
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.machine import processors
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import check_no_links, left_behind, locked, write_text
from vtkmuscle.studies.case import FAILED, KEPT, Case, Outcome, recorded, solve_here

_Key = TypeVar("_Key")
#: Cases in groups that share a scene and its surfaces.
Cases = Sequence[Sequence[Case]]
#: Each case that has ended, its state, and the verdict or the reason of a failure; in any order.
Ended = Generator[tuple[Case, str, str], None, None]
#: Solves cases.
Workers = Callable[[Cases, Parts], Ended]
#: The file that describes a folder of results, and the folder of finished cases.
REPORT, PARTS = "study.json", "parts"


@dataclass(frozen=True)
class Progress:
    """A case that has ended.

    Attributes
    ----------
    case : Case
    state : str
        ``"kept"`` (an earlier run finished it), ``"done"`` or ``"failed"``.
    words : str
        The verdict, or the reason of a failure.
    done, total : int
        Number of cases that have ended, and of all.
    seconds_left : float or None
        Estimated from the cases that this run has solved; None before the first.
    """

    case: Case
    state: str
    words: str
    done: int
    total: int
    seconds_left: float | None


def study(
    cases: Cases,
    folder: Path,
    *,
    workers: Workers | None = None,
    fresh: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Counter[str]:
    """Run the cases of a study, and return how many were kept, done and failed.

    The outcomes, which :func:`outcome_of` reads, do not depend on workers, their order or interruptions.

    Parameters
    ----------
    cases : sequence of sequence of Case
        In groups that share a scene.
    folder : Path
        Of the finished cases. A case that an earlier run has finished, with the same muscle, scene, settings
        and package, is kept.
    workers : callable, optional
        From :func:`threads` or :func:`~vtkmuscle.studies.cluster.connected`; default: this thread.
    fresh : bool, optional
        Run finished cases again.
    progress : callable, optional
        Called with a :class:`Progress` for each case that has ended.
    """
    check_no_links(folder)
    if fresh:
        shutil.rmtree(folder, ignore_errors=True)
    states: Counter[str] = Counter()
    total, began = sum(map(len, cases)), time.monotonic()
    with closing((workers or threads(1))(cases, Parts(folder))) as running:
        for case, state, words in running:
            states[state] += 1
            done, worked = states.total(), states.total() - states[KEPT]
            seconds = (time.monotonic() - began) / worked * (total - done) if worked else None
            if progress is not None:
                progress(Progress(case, state, words, done, total, seconds))
    return states


def solutions(
    cases: Mapping[_Key, Sequence[Case]],
    folder: Path | None = None,
    *,
    workers: int | None = None,
    **more: Any,
) -> dict[_Key, list[Outcome]]:
    """Run cases by threads, by default one per processor, and return their outcomes by the same keys.

    They are kept in the folder, if there is one; further arguments as of :func:`study`.
    """
    with TemporaryDirectory() as passing:
        kept = folder or Path(passing)
        study(list(cases.values()), kept, workers=threads(workers or processors()), **more)
        return {key: [outcome_of(case, kept) for case in own] for key, own in cases.items()}


def threads(count: int) -> Workers:
    """Return ``count`` threads of this process as workers."""

    def work(cases: Cases, parts: Parts) -> Ended:
        stop, run = threading.Event(), secrets.token_hex(4)
        with recorded(), ThreadPoolExecutor(count) as pool:
            tasks = {
                pool.submit(solve_here, case, parts, run, (), stop): case
                for case in chain.from_iterable(cases)
            }
            try:
                for task in as_completed(tasks):
                    yield tasks[task], *task.result()
            except BaseException:
                stop.set()
                pool.shutdown(cancel_futures=True)
                raise

    return work


def outcome_of(case: Case, folder: Path) -> Outcome:
    """Return the outcome of a case that has ended."""
    parts = Parts(folder)
    part = parts.read(case.name)
    if part is None:
        words = "it was removed or damaged while the study ran; the same command makes it again"
        raise FileNotFoundError(f"{parts.path(case.name)}: {words}")
    return Outcome(part.values)


def outcomes_of(cases: Cases, folder: Path) -> list[tuple[Case, Outcome]]:
    """Return all cases with their outcomes."""
    return [(case, outcome_of(case, folder)) for case in chain.from_iterable(cases)]


def keep_failure(case: Case, parts: Parts, words: str) -> tuple[Case, str, str]:
    """Keep the reason why a case failed, and return the case as one that has ended."""
    parts.write(case.name, "", Part({"failure": words}))
    return case, FAILED, words


@contextmanager
def claimed(folder: Path, about: Mapping[str, Any], results: Iterable[str]) -> Iterator[dict[str, Any]]:
    """Hold a folder for a study, and give its report, which is written at the beginning and at the end.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    about : mapping of str to JSON-able
        Describes the study; its first entry tells it from others.
    results : iterable of str
        Names of the files that the study writes there.

    Raises
    ------
    ValueError
        If the folder holds another study, or files of these names that no study has made.
    OSError
        If the folder cannot be written to, or another process writes to it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder):
        _check_folder(folder, *next(iter(about.items())), [*results, PARTS])
        for left in left_behind(folder, deep=True):
            shutil.rmtree(left) if left.is_dir() else left.unlink(missing_ok=True)
        report = {**about, "complete": False}
        write_text(folder / REPORT, json.dumps(report, indent=1) + "\n")
        yield report
        report["complete"] = True
        write_text(folder / REPORT, json.dumps(report, indent=1) + "\n")


def _check_folder(folder: Path, key: str, value: str, results: Iterable[str]) -> None:
    remedy = "give another folder with --out"
    there = [name for name in results if (folder / name).exists()]
    try:
        before = json.loads((folder / REPORT).read_text(encoding="utf-8"))[key]
    except FileNotFoundError:
        if there:
            problem = "the study would be written over a file that no study has made"
            raise InputError(folder / there[0], problem, remedy) from None
        return
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(folder / REPORT, "the file is damaged", f"remove it, or {remedy}") from None
    if before != value:
        raise InputError(folder, f"it holds the results of another study, {before}", remedy)
