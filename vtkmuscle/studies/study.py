"""The one way to run the cases of a study: what is kept is not done again, and what fails is a row."""

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
from pathlib import Path
from typing import Any, TypeVar

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import check_no_links, left_behind, locked, write_text
from vtkmuscle.studies.case import FAILED, KEPT, Case, Outcome, recorded, solve_here

_Key = TypeVar("_Key")
#: What is run: cases, those together that share a scene, its surfaces and distances from bones.
Cases = Sequence[Sequence[Case]]
#: Each case that has ended, with what became of it, in any order.
Ended = Generator[tuple[Case, str, str], None, None]
#: Does cases.
Workers = Callable[[Cases, Parts], Ended]
#: The file that says what a folder of results is of, and the folder of what is finished.
REPORT, PARTS = "study.json", "parts"


@dataclass(frozen=True)
class Progress:
    """A case that has ended.

    Attributes
    ----------
    case : Case
        Which.
    state : str
        ``"kept"`` (it was done by an earlier run), ``"done"`` or ``"failed"``.
    words : str
        The verdict, or why it failed.
    done, total : int
        Cases that have ended, and that there are.
    seconds_left : float or None
        By what this run has done so far; None where it has done nothing.
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

    What comes out does not depend on workers, their order or interruptions: :func:`outcome_of` gives it.

    Parameters
    ----------
    cases : sequence of sequence of Case
        Those together that share a scene.
    folder : Path
        A part for each case that is finished; such as an earlier run has finished, of the same muscle, scene,
        settings and package, are kept.
    workers : callable, optional
        From :func:`threads` or :func:`~vtkmuscle.studies.cluster.connected`; default: this thread.
    fresh : bool, optional
        Run cases again that are finished.
    progress : callable, optional
        Called with a :class:`Progress` for each case that has ended.
    """
    check_no_links(folder)
    if fresh:
        shutil.rmtree(folder, ignore_errors=True)
    states: Counter[str] = Counter()
    total, began = sum(map(len, cases)), time.monotonic()
    with closing((workers or threads(1))(cases, Parts(folder))) as running:  # ends them where this is ended
        for case, state, words in running:
            states[state] += 1
            done, worked = states.total(), states.total() - states[KEPT]
            seconds = (time.monotonic() - began) / worked * (total - done) if worked else None
            if progress is not None:
                progress(Progress(case, state, words, done, total, seconds))
    return states


def threads(count: int) -> Workers:
    """Return threads of this process as workers; it may be one."""

    def work(cases: Cases, parts: Parts) -> Ended:
        stop, run = threading.Event(), secrets.token_hex(4)
        with recorded(), ThreadPoolExecutor(count) as pool:
            tasks = {
                pool.submit(solve_here, case, parts, run, (), stop): case
                for together in cases
                for case in together
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
    """Return what came out of a case that has ended.

    Raises
    ------
    FileNotFoundError
        If it is gone.
    """
    parts = Parts(folder)
    part = parts.read(case.name)
    if part is None:
        words = "it was removed or damaged while the study ran; the same command makes it again"
        raise FileNotFoundError(f"{parts.path(case.name)}: {words}")
    return Outcome.read(part)


def outcomes_of(cases: Mapping[_Key, Sequence[Case]], folder: Path) -> dict[_Key, list[Outcome]]:
    """Return what came out of all cases, by the keys that these have."""
    return {key: [outcome_of(case, folder) for case in own] for key, own in cases.items()}


def keep_failure(case: Case, parts: Parts, words: str) -> tuple[Case, str, str]:
    """Keep that a case failed, and return what became of it."""
    parts.write(case.name, "", Part({"failure": words}))
    return case, FAILED, words


@contextmanager
def claimed(folder: Path, of: Mapping[str, Any], results: Iterable[str]) -> Iterator[dict[str, Any]]:
    """Hold a folder for a study, and give its report, which is written at the beginning and at the end.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    of : mapping of str to JSON-able
        What the study is; a folder of another study is refused by the first of them.
    results : iterable of str
        Names of the files that it writes there.

    Raises
    ------
    ValueError
        If the folder holds another study, or files of these names that no study has made.
    OSError
        If it cannot be written to, or another process writes to it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder):
        _check_folder(folder, *next(iter(of.items())), [*results, PARTS])
        for left in left_behind(folder, deep=True):
            shutil.rmtree(left) if left.is_dir() else left.unlink(missing_ok=True)
        report = {**of, "complete": False}
        for complete in (False, True):
            report["complete"] = complete
            write_text(folder / REPORT, json.dumps(report, indent=1) + "\n")
            if not complete:
                yield report


def _check_folder(folder: Path, key: str, value: str, results: Iterable[str]) -> None:
    remedy = "give another folder with --out"
    there = [name for name in results if (folder / name).exists()]
    try:
        before = json.loads((folder / REPORT).read_text(encoding="utf-8"))[key]
    except FileNotFoundError:
        if there:
            problem = "the study would be written over what no study has made"
            raise InputError(folder / there[0], problem, remedy) from None
        return
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(folder / REPORT, "the file is damaged", f"remove it, or {remedy}") from None
    if before != value:
        raise InputError(folder, f"it holds the results of another study, {before}", remedy)
