"""Cohorts: many subjects, motions and muscles, run by Dask, into one table and a page.

``vtkmuscle cohort STUDY.toml --out DIR`` on the command line; needs ``pip install '.[cohort]'``.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vtkmuscle.run.report_values import versions
from vtkmuscle.studies.cluster import connected, dask
from vtkmuscle.studies.cohort.page import write_cohort
from vtkmuscle.studies.cohort.subjects import Study
from vtkmuscle.studies.cohort.table import COLUMNS, curves, rows_of, spreads, write_csv
from vtkmuscle.studies.study import PARTS, Progress, claimed, outcomes_of, study

__all__ = ["COLUMNS", "Progress", "Study", "run_study"]

_RESULTS = ("cohort.csv", "cohort.html", "sensitivity.csv")


def run_study(
    cohort: Study,
    out: str | os.PathLike[str],
    *,
    fresh: bool = False,
    progress: Callable[[Progress], None] | None = None,
    announce: Callable[[str], None] | None = None,
    **workers: Any,
) -> dict[str, Any]:
    """Run all muscles of all subjects of a study, and write its tables and its page.

    Cases that an earlier run into the folder has finished, with the same inputs and settings, are not run
    again. What comes out does not depend on workers, their order or interruptions.

    Parameters
    ----------
    cohort : Study
    out : path
        Folder of the results: ``cohort.csv``, ``cohort.html``, ``study.json``, ``parts/`` with finished
        cases, and ``sensitivity.csv`` if the study asks for it.
    fresh : bool, optional
        Run finished cases again.
    progress : callable, optional
        Called with a :class:`~vtkmuscle.studies.study.Progress` for each case that has ended.
    announce : callable, optional
        Called with lines of text: the address of Dask's dashboard, and the next step.
    **workers
        ``client``, a distributed.Client of a running cluster, as dask-jobqueue or dask-kubernetes makes it,
        whose workers see the same folders by the same names; or ``scheduler``, the address of its scheduler,
        ``"tcp://host:8786"``. Without either, processes of this machine work: ``workers`` of them (default:
        one per processor), of one thread each, for compiled kernels and VTK hold Python's interpreter.
        ``memory``, ``"4GB"`` or bytes, is the limit of each (default: its share of the machine's); a process
        over it is ended, and its case tried again. ``retries`` (2) is how often a case may lose its worker
        before it counts as failed.

    Returns
    -------
    dict
        The content of ``study.json``: the number of cases kept, done and failed, and versions.

    Raises
    ------
    ValueError
        If the folder holds another study, or the extra ``cohort`` is not installed.
    OSError
        If the folder cannot be written to, another process writes to it, or the scheduler is lost.
    """
    dask()
    folder = Path(out)
    say = announce or (lambda words: None)
    about = {
        "study_file": str(cohort.file.absolute()),
        "study": cohort.name,
        "versions": versions(),
        "subjects": len(cohort.subjects),
    }
    with claimed(folder, about, _RESULTS) as report:
        cases, parts = cohort.cases(), folder / PARTS
        with connected(**workers) as (found, dashboard):
            say(f"Dask's dashboard: {dashboard}")
            states = study(cases, parts, workers=found, fresh=fresh, progress=progress)
        report["tasks"] = dict(sorted(states.items()))
        say("writing tables and the page")
        outcomes = outcomes_of(cases, parts)
        write_csv(folder / "cohort.csv", rows_of(cohort, outcomes))
        measured = curves(rows_of(cohort, outcomes))
        (folder / "sensitivity.csv").unlink(missing_ok=True)
        spread = None
        if cohort.table.sensitivity is not None:
            spread = spreads(measured)
            spread.to_csv(folder / "sensitivity.csv")
        write_cohort(cohort, outcomes, measured, spread, folder / "cohort.html")
    return report
