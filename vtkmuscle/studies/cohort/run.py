"""Run a cohort: its cases by Dask, then its tables and its page."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vtkmuscle.run.report_values import versions
from vtkmuscle.studies.cluster import connected, dask
from vtkmuscle.studies.cohort.page import write_cohort
from vtkmuscle.studies.cohort.subjects import Study
from vtkmuscle.studies.cohort.table import curves, spreads, tables_of, write_csv
from vtkmuscle.studies.study import PARTS, Progress, claimed, study

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
        What is run.
    out : path
        Folder: ``cohort.csv``, ``cohort.html``, ``study.json``, ``parts/`` with what is
        finished, and ``sensitivity.csv`` where the study asks for it.
    fresh : bool, optional
        Run cases again that are finished.
    progress : callable, optional
        Called with a :class:`~vtkmuscle.studies.study.Progress` for each case that has ended.
    announce : callable, optional
        Called with lines of text: what is about to be done, the address of Dask's dashboard.
    **workers
        ``client``, a distributed.Client of a cluster that is there already, as dask-jobqueue or
        dask-kubernetes makes it; its workers see the same folders, by the same names. Or ``scheduler``, the
        address of its scheduler, ``"tcp://host:8786"``. Without either processes on this machine work:
        ``workers`` of them (default: as many as there are processors), each of one thread, for compiled
        kernels and VTK hold Python's interpreter; ``memory``, ``"4GB"`` or bytes, is what each may take
        (default: its share of the machine's): one that takes more is ended, and its case tried again.
        ``retries`` (2) says how often a case may lose its worker before it counts as failed.

    Returns
    -------
    dict
        What ``study.json`` says: how many cases were kept, done and failed, versions.

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
    of: dict[str, Any] = {
        "study_file": str(cohort.file.absolute()),
        "study": cohort.name,
        "versions": versions(),
    }
    of["subjects"] = len(cohort.subjects)
    with claimed(folder, of, _RESULTS) as report:
        parts = folder / PARTS
        with connected(**workers) as (found, dashboard):
            say(f"Dask's dashboard: {dashboard}")
            states = study(cohort.cases(), parts, workers=found, fresh=fresh, progress=progress)
        report["tasks"] = dict(sorted(states.items()))
        say("writing tables and the page")
        write_csv(folder / "cohort.csv", tables_of(cohort, parts))
        measured = curves(tables_of(cohort, parts))
        (folder / "sensitivity.csv").unlink(missing_ok=True)
        spread = None
        if cohort.table.sensitivity is not None:
            spread = spreads(measured)
            spread.to_csv(folder / "sensitivity.csv")
        write_cohort(cohort, parts, folder, measured, spread)
    return report
